/// An arm in the horizontal plane with so little friction that its torques' signs are told by
/// inertia alone. Its equations of motion are written out here.

#include <cmath>
#include <numbers>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/recording/audit.hpp>

namespace diffnea::audit_torque_test {
namespace {

struct Friction {
  double coulomb = 0.0, viscous = 0.0;
};

/// Two links of 0.4 m, 3 kg and 2 kg [kg·m²]: m₁l₁²/3 + m₂l₁² + m₂l₂²/3, m₂l₂²/3, m₂l₁l₂/2.
constexpr double kFirst = 0.16 + 0.32 + 0.107, kSecond = 0.107, kCoupling = 0.16;

/// 30 s at 250 Hz, two joints in independent sums of sines; noise of q 2e-5 rad, of τ 0.02 N·m.
Recording planar_arm(unsigned seed, const Friction& friction, double late = 0.0) {
  Rng rng(seed + 5100);
  double amplitude[2][5], phase[2][5];
  for (int j = 0; j < 2; ++j)
    for (int k = 0; k < 5; ++k) {
      amplitude[j][k] = rng.uniform(0.3, 0.6) / (k + 1);
      phase[j][k] = rng.uniform(0.0, 2.0 * std::numbers::pi);
    }
  const auto motion = [&](int j, double t, int order) {
    double sum = 0.0;
    for (int k = 0; k < 5; ++k) {
      const double w = 2.0 * std::numbers::pi * (0.2 * (k + 1) + 0.03 * j);
      sum += amplitude[j][k] * std::pow(w, order) *
             std::sin(w * t + phase[j][k] + 0.5 * std::numbers::pi * order);
    }
    return sum;
  };
  Recording r;
  const long rows = 7500;
  r.source = "scara.csv";
  r.joint_names = {"first", "second"};
  r.has_tau.assign(2, true);
  r.info.torque_sampling = TorqueSampling::kInstant;
  r.time.resize(rows);
  r.q.resize(rows, 2);
  r.tau.resize(rows, 2);
  for (long i = 0; i < rows; ++i) {
    r.time[i] = 0.004 * static_cast<double>(i);
    for (int j = 0; j < 2; ++j) r.q(i, j) = motion(j, r.time[i], 0) + 2e-5 * rng.normal();
    const double t = r.time[i] - late;
    const double v1 = motion(0, t, 1), v2 = motion(1, t, 1);
    const double a1 = motion(0, t, 2), a2 = motion(1, t, 2);
    const double c = kCoupling * std::cos(motion(1, t, 0));
    const double s = kCoupling * std::sin(motion(1, t, 0));
    const double tau[] = {
        (kFirst + 2.0 * c) * a1 + (kSecond + c) * a2 - s * (2.0 * v1 + v2) * v2,
        (kSecond + c) * a1 + kSecond * a2 + s * v1 * v1,
    };
    for (int j = 0; j < 2; ++j) {
      const double v = j == 0 ? v1 : v2;
      r.tau(i, j) = tau[j] + friction.coulomb * std::tanh(v / 0.01) + friction.viscous * v +
                    0.02 * rng.normal();
    }
  }
  return r;
}

}  // namespace

TEST_CASE("audit: without friction and gravity, inertia tells the sign of a torque", "[audit]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  const Friction friction =
      GENERATE(Friction{}, Friction{.coulomb = 0.01}, Friction{.coulomb = 0.01, .viscous = 0.02});
  CAPTURE(seed, friction.coulomb, friction.viscous);
  Recording r = planar_arm(seed, friction);

  CHECK(audit({r}).faults.empty());

  SECTION("torque") {
    const int j = GENERATE(0, 1);
    r.tau.col(j) *= -1.0;
    const std::vector<ChannelFault> faults = audit({r}).faults;
    REQUIRE(faults.size() == 1);
    CHECK(faults[0].fault == "torque_sign");
    CHECK(faults[0].where == r.joint_names[j]);
    CHECK(faults[0].unit == "N*m/(rad/s^2)");
    // The mean of its own inertia over the motion; the other joint's varies with the angle.
    const double least = j == 0 ? kFirst - 2.0 * kCoupling : 0.5 * kSecond;
    const double most = j == 0 ? kFirst + 2.0 * kCoupling : 1.5 * kSecond;
    CHECK(-faults[0].value > least);
    CHECK(-faults[0].value < most);
  }
  SECTION("position: the joint's torque and, through the coupling, no other") {
    r.q.col(0) *= -1.0;
    const std::vector<ChannelFault> faults = audit({r}).faults;
    REQUIRE(faults.size() == 1);
    CHECK(faults[0].fault == "torque_sign");
    CHECK(faults[0].where == "first");
  }
}

TEST_CASE("audit: a few moves from point to point do not tell that a sign is flipped", "[audit]") {
  // Torques without friction hold a load, of each move, that no black box of angles knows.
  int flipped = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Rng rng(seed + 7300);
    Recording r;
    r.source = "moves.csv";
    r.joint_names = {"first", "second"};
    r.has_tau.assign(2, true);
    r.info.torque_sampling = TorqueSampling::kInstant;
    constexpr long kRows = 10'000, kMove = 1250;
    r.time = VecX<double>::LinSpaced(kRows, 0.0, 0.004 * (kRows - 1));
    r.q.resize(kRows, 2);
    r.tau.resize(kRows, 2);
    double from[2] = {0.0, 0.0}, to[2] = {0.0, 0.0}, load = 0.0;
    for (long i = 0; i < kRows; ++i) {
      if (i % kMove == 0) {
        load = rng.uniform(-1.0, 1.0);
        for (int j = 0; j < 2; ++j) from[j] = to[j], to[j] = rng.uniform(-1.0, 1.0);
      }
      const double s = static_cast<double>(i % kMove) / kMove;
      const double share = s * s * s * (10.0 + s * (6.0 * s - 15.0));
      for (int j = 0; j < 2; ++j) {
        r.q(i, j) = from[j] + (to[j] - from[j]) * share + 2e-5 * rng.normal();
        r.tau(i, j) = load + std::cos(r.q(i, j)) + 0.02 * rng.normal();
      }
    }
    for (const ChannelFault& f : audit({r}).faults)
      flipped += f.fault == "torque_sign" || f.fault == "torque_swapped";
  }
  CHECK(flipped == 0);
}

TEST_CASE("audit: false alarms where inertia is what tells the sign", "[.][audit-study]") {
  int alarms = 0;
  for (unsigned seed = 100; seed < 500; ++seed) {
    Rng rng(seed);
    const Friction friction{.coulomb = rng.uniform(0.0, 0.05), .viscous = rng.uniform(0.0, 0.1)};
    alarms += audit({planar_arm(seed, friction, rng.uniform(0.0, 0.02))}).faults.empty() ? 0 : 1;
  }
  CHECK(alarms == 0);
}

TEST_CASE("audit: a late torque is not one of the wrong sign", "[audit]") {
  // 1.2 N·m·s/rad late by 0.2 s outweigh the second joint's inertia: −0.24 against 0.107 kg·m².
  const unsigned seed = GENERATE(range(0u, 4u));
  CHECK(audit({planar_arm(seed, {.viscous = 1.2}, 0.2)}).faults.empty());
}

}  // namespace diffnea::audit_torque_test
