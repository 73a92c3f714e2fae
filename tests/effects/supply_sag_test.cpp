/// A drive whose torque follows its supply: what was logged of the supply, the law, and derivatives
/// by its share and by the drive's own parameters.

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/effects/supply_sag.hpp>

namespace diffnea::supply_sag_test {
namespace {

using Catch::Matchers::WithinAbs;

const double kGap = std::numeric_limits<double>::quiet_NaN();

RowMatX<double> column(const std::vector<double>& values) {
  return Eigen::Map<const RowMatX<double>>(values.data(), static_cast<long>(values.size()), 1);
}

CommandPath commands(const std::vector<double>& volts) {
  CommandPath path({0.0, 0.1, 0.2, 0.3, 0.4}, column({0.0, 0.1, 0.9, 1.0, 1.1}),
                   VecX<double>::Ones(1));
  if (!volts.empty()) path.set_supply(column(volts));
  return path;
}

/// Torque that a drive and its supply add to the right-hand side.
/// @param p  seven parameters of the servo, then share and nominal supply
template <class T>
T added(CommandPath path, const std::vector<T>& p, double time = 0.33) {
  std::vector<double> plain;
  for (const T& x : p) plain.push_back(value_part(x));
  PositionServo::lead(0, plain.data(), path);
  SupplySag::lead(0, plain.data() + 7, path);
  const T q(0.2), qd(0.3);
  JointSample<T> x;
  x.time = time;
  x.q = &q;
  x.qd = &qd;
  x.command = &path;
  x.step = {time - 0.03, time + 0.04};
  const int joint = 0;
  T tau(0.0);
  PositionServo{}.add_torque(x, &joint, p.data(), &tau);
  SupplySag{}.add_torque(x, &joint, p.data() + 7, &tau);
  return tau;
}

const std::vector<double> kSagging{8.0, 7.0, 6.0, 7.5, 7.0};

}  // namespace

TEST_CASE("CommandPath: a supply goes along straight lines, over gaps and ends", "[effects]") {
  const CommandPath path = commands({kGap, 8.0, kGap, 6.0, kGap});
  CHECK_THAT(path.supply(0, 0.0), WithinAbs(8.0, 1e-12));
  CHECK_THAT(path.supply(0, 0.15), WithinAbs(7.5, 1e-12));
  CHECK_THAT(path.supply(0, 0.25), WithinAbs(6.5, 1e-12));
  CHECK_THAT(path.supply(0, 0.9), WithinAbs(6.0, 1e-12));
  CHECK(std::isnan(commands({}).supply(0, 0.1)));
}

TEST_CASE("supply_sag: the pull is in proportion to the supply, the braking is not", "[effects]") {
  // 1 rad is told, 0.2 read: the bound of 0.25 holds. Over the step the command is one.
  std::vector<double> p{10.0, 0.5, 0.0, 0.25, 0.0, 1e3, 0.0, 1.0, 7.4};
  const double braking = 0.5 * 0.3, pull = 10.0 * 0.25, volts = 7.5 - 0.5 * 0.3;  // at 0.33 s
  CHECK_THAT(added(commands(kSagging), p), WithinAbs(braking - pull * volts / 7.4, 1e-12));
  p[7] = 0.4;
  CHECK_THAT(added(commands(kSagging), p),
             WithinAbs(braking - pull * (1.0 + 0.4 * (volts / 7.4 - 1.0)), 1e-12));
  CHECK_THAT(added(commands({}), p), WithinAbs(braking - pull, 1e-12));  // not logged
}

TEST_CASE("supply_sag: derivatives by the share and by all that the drive has", "[effects]") {
  for (const double reach : {0.25, 5.0}) {
    const std::vector<double> p{10.0, 0.5, 0.02, reach, 0.05, 2.5, 0.03, 0.7, 7.4};
    std::vector<JetD> jets(p.begin(), p.end());
    for (std::size_t k = 0; k < 8; ++k) jets[k].v[static_cast<long>(k)] = 1.0;
    const JetD tau = added(commands(kSagging), jets);
    CHECK_THAT(tau.a, WithinAbs(added(commands(kSagging), p), 1e-12));
    for (std::size_t k = 0; k < 8; ++k) {
      std::vector<double> more = p, less = p;
      more[k] += 1e-6;
      less[k] -= 1e-6;
      CAPTURE(reach, k);
      const double difference =
          (added(commands(kSagging), more) - added(commands(kSagging), less)) / 2e-6;
      CHECK_THAT(tau.v[static_cast<long>(k)], WithinAbs(difference, 1e-5));
    }
  }
}

}  // namespace diffnea::supply_sag_test
