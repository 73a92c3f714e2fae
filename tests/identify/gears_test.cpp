/// Springs and gaps in the gears of drives, fitted by the motion of a rotor and a link that are
/// integrated here.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/random.hpp>

#include "support/servo_bench.hpp"

namespace diffnea::gears_test {

using Catch::Matchers::ContainsSubstring;
using test::estimate;

namespace {

/// A pendulum behind the gear of a servo, or of a motor whose torque is logged.
struct Drive {
  double link = 0.012, weight = 0.7;  // [kg·m²], [N·m]
  double rotor = 0.02, gain = 14.0, damping = 0.4, coulomb = 0.05;
  double spring = 0.0, spring_damping = 0.02;  // 0: a gap
  double gap = 0.0;
  bool at_motor = false;  // the encoder
  bool servo = true;

  Model model() const {
    const double mass = 0.5, length = weight / (mass * 9.81);
    return test::servo_bench(mass, length, link - mass * length * length);
  }

  /// Torque of the gear; teeth are stiff, push only, and hardly bounce.
  double gear(double wound, double rate) const {
    if (spring > 0.0) return spring * wound + spring_damping * rate;
    const double depth = std::abs(wound) - 0.5 * gap, side = wound > 0.0 ? 1.0 : -1.0;
    if (depth <= 0.0) return 0.0;
    return side * std::max(0.0, 3e4 * depth + 20.0 * side * rate);
  }

  /// 100 Hz, commands or torques that are held, an encoder of 14 bits with noise.
  Recording record(double seconds, unsigned seed, int run) const {
    constexpr int kFine = 1000;  // steps a row
    const double row = 0.01, h = row / kFine, step = 2.0 * M_PI / 16384.0;
    const long rows = std::lround(seconds / row);
    Rng rng(seed);
    Recording r;
    r.source = "drive, run " + std::to_string(run);
    r.run = run;
    r.joint_names = {"servo"};
    r.has_tau = {!servo};
    r.time.resize(rows);
    r.q.resize(rows, 1);
    r.tau = RowMatX<double>::Constant(rows, 1, std::nan(""));
    if (servo) r.qcmd.resize(rows, 1);
    double phase[3];
    for (double& p : phase) p = 6.28 * rng.uniform();
    const auto wave = [&](double t) {
      const double wanted = 0.5 * std::sin(1.7 * t + phase[0]) +
                            0.3 * std::sin(4.1 * t + phase[1]) +
                            0.15 * std::sin(9.3 * t + phase[2]);
      return wanted * std::min(1.0, t);
    };
    double q = 0.0, v = 0.0, theta = 0.0, w = 0.0;
    for (long k = 0; k < rows; ++k) {
      const double t = row * static_cast<double>(k), told = wave(t);
      r.time[k] = t;
      r.q(k, 0) = step * std::round(((at_motor ? theta : q) + 0.3 * step * rng.normal()) / step);
      if (servo)
        r.qcmd(k, 0) = told;
      else
        r.tau(k, 0) = told;
      for (int i = 0; i < kFine; ++i) {
        const double between = gear(theta - q, w - v);
        double tau = servo ? gain * (told - (at_motor ? theta : q)) - damping * w : told;
        tau -= between;
        v += h * (between - weight * std::sin(q)) / link;
        const double free = w + h * tau / rotor, stop = h * coulomb / rotor;
        w = std::abs(free) <= stop ? 0.0 : free - std::copysign(stop, free);
        q += h * v;
        theta += h * w;
      }
    }
    return r;
  }
};

IdentifyResult fitted(const Drive& drive, const std::string& effect) {
  IdentifyOptions options;
  options.loss = Loss::kMotion;
  options.choice.effects = {effect, "armature", "coulomb_friction"};
  if (drive.servo) options.choice.effects->push_back("position_servo");
  options.choice.fit = {"armature", "effects"};
  options.choice.fix = {"servo." + effect + ".encoder_side=" + (drive.at_motor ? "1" : "0")};
  return identify(drive.model(), {drive.record(8.0, 1, 0)}, {drive.record(4.0, 2, 0)}, options);
}

/// Standard errors within which a size is found, and what smoothed friction and yielding flanks
/// move it by beside.
constexpr double kErrors = 3.0;

void check_near(const IdentifyResult& result, const std::string& end, double truth, double share) {
  const ParameterEstimate& p = estimate(result, end);
  CAPTURE(end, truth, p.value, p.std);
  CHECK(std::abs(p.value - truth) < kErrors * p.std + share * truth);
}

}  // namespace

TEST_CASE(
    "identify: the spring in a drive's gear, from commands or torques, encoder on either side",
    "[identify]") {
  Drive drive;
  drive.spring = 60.0;
  drive.at_motor = GENERATE(false, true);
  drive.servo = GENERATE(false, true);
  if (!drive.servo) drive.coulomb = 0.02;  // nothing else than it damps the swing
  CAPTURE(drive.at_motor, drive.servo);
  const IdentifyResult result = fitted(drive, "joint_elasticity");
  check_near(result, "joint_elasticity.stiffness", drive.spring, 0.02);
  check_near(result, "armature.armature", drive.rotor, 0.02);
  // Simulators read the rotor behind the spring from the gear.
  CHECK(estimate(result, ".motor_inertia").value == estimate(result, "armature.armature").value);
  // In an open loop, friction that truly holds leads away from one that is smoothed.
  for (const HorizonError& e : result.horizons) CHECK(e.test < (drive.servo ? 5e-4 : 2e-3));
}

TEST_CASE("identify: the gap in a servo's gear, encoder on either side", "[identify]") {
  Drive drive;
  drive.gap = 0.03;
  drive.at_motor = GENERATE(false, true);
  CAPTURE(drive.at_motor);
  const IdentifyResult result = fitted(drive, "backlash");
  check_near(result, "backlash.gap", drive.gap, 0.05);
  check_near(result, "position_servo.stiffness", drive.gain, 0.02);
  CHECK(estimate(result, "backlash.stiffness").value > 10.0 * drive.gain);
}

TEST_CASE("identify: other losses have no hidden motor, and say where there is one", "[identify]") {
  Drive drive;
  drive.servo = false;
  drive.spring = 60.0;
  IdentifyOptions options;
  options.choice.effects = {"joint_elasticity"};
  CHECK_THROWS_WITH(identify(drive.model(), {drive.record(2.0, 1, 0)}, {}, options),
                    ContainsSubstring("--loss motion"));
}

}  // namespace diffnea::gears_test
