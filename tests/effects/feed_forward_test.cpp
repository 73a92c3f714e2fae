/// Velocities and torques that a drive is told beside positions.

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/effects/feed_forward.hpp>
#include <diffnea/effects/position_servo.hpp>

namespace diffnea::feed_forward_test {
namespace {

using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

constexpr double kDamping = 0.7, kShare = 0.9;

RowMatX<double> column(const std::vector<double>& values) {
  return Eigen::Map<const VecX<double>>(values.data(), std::ssize(values));
}

/// Commands of 10 Hz, led by a drive with this delay and what it is told besides.
CommandPath commands(double delay, double damping = kDamping, double share = kShare) {
  const double off = std::numeric_limits<double>::quiet_NaN();
  CommandPath path({0.0, 0.1, 0.2, 0.3, 0.4}, column({0.0, 0.1, 0.3, 0.4, off}),
                   VecX<double>::Ones(1));
  path.set_feed_forward(column({0.0, 1.0, 2.0, off, 5.0}), column({3.0, -1.0, 0.0, 2.0, 5.0}));
  const std::vector<double> servo{10.0, 0.5, delay, 1e3, 0.0, 1e3, 0.0}, fed{damping, share};
  PositionServo::lead(0, servo.data(), path);
  FeedForward::lead(0, fed.data(), path);
  return path;
}

/// Torque that an effect adds to the right-hand side; at an instant, if the step is empty.
template <class E, class T>
T added(const CommandPath& path, double time, SimulationStep step, const std::vector<T>& p) {
  T q(0.2), qd(0.3);
  JointSample<T> x;
  x.time = time;
  x.q = &q;
  x.qd = &qd;
  x.command = &path;
  x.step = step;
  const int joint = 0;
  T tau(0.0);
  E{}.add_torque(x, &joint, p.data(), &tau);
  return tau;
}

double fed(const CommandPath& path, double time, SimulationStep step = {}) {
  return -added<FeedForward>(path, time, step, std::vector{kDamping, kShare});
}

}  // namespace

TEST_CASE("feed_forward: velocity and torque are held, late, and none while the drive is off",
          "[effects]") {
  const CommandPath path = commands(0.0), late = commands(0.08);
  CHECK_THAT(fed(path, 0.05), WithinAbs(kShare * 3.0, 1e-15));
  CHECK_THAT(fed(path, 0.15), WithinAbs(kDamping * 1.0 - kShare * 1.0, 1e-15));
  CHECK_THAT(fed(path, 0.35), WithinAbs(kShare * 2.0, 1e-15));  // a gap is none
  CHECK(fed(path, 0.45) == 0.0);
  CHECK_THAT(fed(late, 0.15), WithinAbs(kShare * 3.0, 1e-15));
  CHECK_THAT(fed(late, 0.19), WithinAbs(kDamping * 1.0 - kShare * 1.0, 1e-15));
  CHECK(path.has_velocity(0));
  CHECK(path.has_torque(0));
  CHECK_FALSE(CommandPath({0.0}, column({0.0}), VecX<double>::Ones(1)).has_torque(0));
}

TEST_CASE("feed_forward: its mean over a step is that of what was told", "[effects]") {
  const CommandPath late = commands(0.08);
  const SimulationStep step{0.15, 0.19};
  double mean = 0.0;
  constexpr int kParts = 4000;
  for (int k = 0; k < kParts; ++k)
    mean += fed(late, step.from + (step.to - step.from) * (k + 0.5) / kParts) / kParts;
  // The straight line that stands for it has its mean in the middle.
  CHECK_THAT(fed(late, 0.17, step), WithinAbs(mean, 1e-3));
}

TEST_CASE("feed_forward: derivatives by its gains, and by the delay of its drive", "[effects]") {
  const SimulationStep step{0.30, 0.36};
  const double time = 0.34, delay = 0.03;
  const std::vector<double> servo{10.0, 0.5, delay, 1e3, 0.0, 1e3, 0.0};
  const auto both = [&](double late, double damping, double share) {
    std::vector<double> p = servo;
    p[2] = late;
    const CommandPath path = commands(late, damping, share);
    return added<PositionServo>(path, time, step, p) +
           added<FeedForward>(path, time, step, std::vector{damping, share});
  };
  const CommandPath path = commands(delay);
  std::vector<JetD> of_servo(servo.begin(), servo.end()), of_rest{JetD(kDamping), JetD(kShare)};
  of_servo[2].v[0] = of_rest[0].v[1] = of_rest[1].v[2] = 1.0;
  const JetD tau = added<PositionServo>(path, time, step, of_servo) +
                   added<FeedForward>(path, time, step, of_rest);
  CHECK_THAT(tau.a, WithinRel(both(delay, kDamping, kShare), 1e-12));
  constexpr double h = 1e-6;
  const double by_delay =
      (both(delay + h, kDamping, kShare) - both(delay - h, kDamping, kShare)) / (2.0 * h);
  CHECK(std::abs(by_delay) > 10.0);
  CHECK_THAT(tau.v[0], WithinRel(by_delay, 1e-5));
  CHECK_THAT(
      tau.v[1],
      WithinAbs((both(delay, kDamping + h, kShare) - both(delay, kDamping - h, kShare)) / (2.0 * h),
                1e-6));
  CHECK_THAT(
      tau.v[2],
      WithinAbs((both(delay, kDamping, kShare + h) - both(delay, kDamping, kShare - h)) / (2.0 * h),
                1e-6));
}

}  // namespace diffnea::feed_forward_test
