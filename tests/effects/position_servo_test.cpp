/// A drive that follows commanded positions by itself: its law, and what it makes of its commands.

#include <diffnea/effects/position_servo.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/effects/bound_effect.hpp>

namespace diffnea::position_servo_test {
namespace {

using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

const double kOff = std::numeric_limits<double>::quiet_NaN();

CommandPath commands(std::vector<double> time, std::vector<double> q, double gain = 1.0) {
  RowMatX<double> column(static_cast<long>(q.size()), 1);
  std::ranges::copy(q, column.data());
  return CommandPath(std::move(time), std::move(column), VecX<double>::Constant(1, gain));
}

/// Command as a drive without bounds takes it over a step, and its derivatives.
struct Taken {
  double q, by_delay, by_speed;
};

Taken taken(const CommandPath& path, double time, double delay, const SimulationStep& step) {
  JetD late(delay), speed(0.0);
  late.v[0] = speed.v[1] = 1.0;
  const JetD q = path.made_of(0, time, late, speed, step, [](const JetD& c, long) { return c; });
  return {q.a, q.v[0], q.v[1]};
}

/// Torque that the drive adds to the right-hand side at a time.
template <class T>
T added(const CommandPath& path, double time, T q, T qd, const std::vector<T>& p) {
  JointSample<T> x;
  x.time = time;
  x.q = &q;
  x.qd = &qd;
  x.command = &path;
  x.step = {time - 0.03, time + 0.04};
  const int joint = 0;
  T tau(0.0);
  PositionServo{}.add_torque(x, &joint, p.data(), &tau);
  return tau;
}

}  // namespace

TEST_CASE("CommandPath: commands that are held, ends, gaps, and a switch that no delay holds back",
          "[effects]") {
  const CommandPath path = commands({0.0, 1.0, 2.0, 3.0}, {0.0, 2.0, kOff, 4.0});
  CHECK(path.at(0, -1.0, 0.0) == 0.0);
  CHECK(path.at(0, 0.99, 0.0) == 0.0);
  CHECK(path.at(0, 1.0, 0.0) == 2.0);
  CHECK(path.at(0, 1.99, 1.0) == 0.0);
  CHECK(std::isnan(path.at(0, 2.5, 0.0)));
  CHECK(std::isnan(path.at(0, 2.5, 1.0)));  // off is off, whatever was told before
  CHECK(path.at(0, 3.2, 1.0) == 2.0);
  CHECK(path.at(0, 9.0, 0.0) == 4.0);
}

TEST_CASE("CommandPath: over a step, a mass goes where the jumps within it would bring it",
          "[effects]") {
  const CommandPath path = commands({0.0, 1.0, 2.0}, {0.0, 2.0, -1.0});
  for (const SimulationStep step :
       {SimulationStep{0.2, 0.9}, {0.7, 1.5}, {0.5, 2.5}, {-1.0, 0.4}}) {
    const double delay = 0.25, h = step.to - step.from;
    // ∫ c dt and ∫ (to − t) c dt: of what is held by a fine sum, of the line at Gauss's points.
    double speed = 0.0, way = 0.0;
    const int parts = 70000;
    for (int i = 0; i < parts; ++i) {
      const double t = step.from + h * (i + 0.5) / parts, q = path.at(0, t, delay);
      speed += q * h / parts;
      way += (step.to - t) * q * h / parts;
    }
    double line_speed = 0.0, line_way = 0.0;
    for (const double side : {-1.0, 1.0}) {
      const double t = step.from + h * (0.5 + side * 0.5 / std::sqrt(3.0));
      const Taken c = taken(path, t, delay, step);
      line_speed += 0.5 * h * c.q;
      line_way += 0.5 * h * (step.to - t) * c.q;
      CHECK_THAT(
          c.by_delay,
          WithinAbs(
              (taken(path, t, delay + 1e-6, step).q - taken(path, t, delay - 1e-6, step).q) / 2e-6,
              1e-5));
    }
    CHECK_THAT(line_speed, WithinAbs(speed, 1e-4));
    CHECK_THAT(line_way, WithinAbs(way, 1e-4));
  }
}

TEST_CASE("CommandPath: a jump where a step begins has the derivative of one that is later",
          "[effects]") {
  const CommandPath path = commands({0.0, 1.0, 2.0}, {0.0, 2.0, -1.0});
  const SimulationStep step{1.0, 1.5};
  for (const double t : {1.1, 1.25, 1.5}) {
    const double later = (taken(path, t, 1e-7, step).q - taken(path, t, 0.0, step).q) / 1e-7;
    CHECK_THAT(taken(path, t, 0.0, step).by_delay, WithinAbs(later, 1e-4));
  }
}

TEST_CASE("CommandPath: a setpoint that moves no faster than its speed", "[effects]") {
  const std::vector<double> time{0.0, 0.1, 0.2, 0.3, 0.4, 0.5}, step{0.0, 1.0, 1.0, 1.0, 1.0, 1.0};
  const auto led = [&](double speed) {
    CommandPath path = commands(time, step);
    path.limit_speed(0, speed);
    return path;
  };
  CHECK_THAT(led(3.0).at(0, 0.2, 0.0), WithinAbs(0.3, 1e-12));  // told at 0.1 s
  CHECK_THAT(led(3.0).at(0, 0.35, 0.0), WithinAbs(0.75, 1e-12));
  CHECK_THAT(led(3.0).at(0, 0.43, 0.0), WithinAbs(0.99, 1e-12));  // there at 0.433 s
  CHECK_THAT(led(3.0).at(0, 0.44, 0.0), WithinAbs(1.0, 1e-12));
  const SimulationStep across{0.35, 0.47};
  // Mean, in the middle: from 0.75 on for 0.0833 s, then 1.
  CHECK_THAT(taken(led(3.0), 0.41, 0.0, across).q,
             WithinAbs(1.0 - 0.125 * (0.25 / 3.0) / 0.12, 1e-12));
  for (const double t : {0.12, 0.25, 0.42, 0.5})
    for (const SimulationStep& over : {SimulationStep{}, {t - 0.03, t + 0.06}})
      CHECK_THAT(taken(led(3.0), t, 0.0, over).by_speed,
                 WithinAbs((taken(led(3.0 + 1e-6), t, 0.0, over).q -
                            taken(led(3.0 - 1e-6), t, 0.0, over).q) /
                               2e-6,
                           1e-6));
  CHECK_THAT(led(1e6).at(0, 0.15, 0.0), WithinAbs(1.0, 1e-5));
  // Nothing leads a setpoint before the first command, which holds there.
  for (const double t : {0.05, 0.07, 0.1})
    for (const SimulationStep& over : {SimulationStep{0.04, 0.1}, {0.04, 0.13}})
      CHECK_THAT(taken(led(3.0), t, 0.1, over).q, WithinAbs(0.0, 1e-12));
}

TEST_CASE("position_servo: dead band, reach, gain, and a drive that is off", "[effects]") {
  const CommandPath path = commands({0.0, 1.0}, {1.0, 1.0}), twice = commands({0.0, 1.0}, {1.0, 1.0}, 2.0);
  const std::vector<double> p{10.0, 0.5, 0.0, 0.3, 0.1, 1e3, 0.0};
  CHECK_THAT(added(path, 0.5, 0.8, 0.0, p), WithinAbs(-10.0 * (0.2 - 0.1), 1e-12));
  CHECK_THAT(added(path, 0.5, 0.95, 0.4, p), WithinAbs(0.5 * 0.4, 1e-12));  // within the dead band
  CHECK_THAT(added(path, 0.5, -1.0, 0.0, p), WithinAbs(-10.0 * 0.3, 1e-12));
  CHECK_THAT(added(path, 0.5, 3.0, 0.0, p), WithinAbs(10.0 * 0.3, 1e-12));
  CHECK_THAT(added(twice, 0.5, 0.9, 0.0, p), WithinAbs(-10.0 * (2.0 * 0.1 - 0.1), 1e-12));
  CHECK(added(commands({0.0, 1.0}, {kOff, kOff}), 0.5, 0.0, 1.0, p) == 0.0);
}

TEST_CASE("position_servo: braking within the reach ends there, the motor's goes on", "[effects]") {
  const CommandPath path = commands({0.0, 1.0}, {1.0, 1.0});
  const std::vector<double> p{10.0, 0.8, 0.0, 0.3, 0.0, 1e3, 0.05};  // 0.5 of 0.8 N·m·s/rad within
  CHECK_THAT(added(path, 0.5, 0.9, 0.4, p), WithinAbs(-10.0 * 0.1 + 0.8 * 0.4, 1e-12));
  CHECK_THAT(added(path, 0.5, 0.0, 2.0, p), WithinAbs(-10.0 * 0.3 + 0.3 * 2.0, 1e-12));
  // At −5 rad/s it would ask for more than it can give, and at 20 rad/s brakes with all it has.
  CHECK_THAT(added(path, 0.5, 0.9, -5.0, p), WithinAbs(-10.0 * 0.3 - 0.3 * 5.0, 1e-12));
  CHECK_THAT(added(path, 0.5, 0.9, 20.0, p), WithinAbs(10.0 * 0.3 + 0.3 * 20.0, 1e-12));
}

TEST_CASE("position_servo: over a step, a jump between two commands that saturate it",
          "[effects]") {
  const CommandPath jump = commands({0.0, 1.0}, {-5.0, 5.0});
  const double reach = 0.2, delay = 0.015;  // s: the jump is in the middle of the step
  const auto at = [&](double later) {
    return added(jump, 1.005, 0.0, 0.0, {10.0, 0.0, delay + later, reach, 0.0, 1e6, 0.0});
  };
  // From 0.975 to 1.045 s: −2 N·m before 1.015 s, then +2. Its mean at Gauss's points:
  const double h = 0.07, before = 0.04, mean = 2.0 * (h - 2.0 * before) / h;
  double line = 0.0;
  for (const double side : {-1.0, 1.0}) {
    JointSample<double> x;
    double q = 0.0, qd = 0.0, tau = 0.0;
    x.time = 1.01 + side * 0.5 * h / std::sqrt(3.0);
    x.q = &q;
    x.qd = &qd;
    x.command = &jump;
    x.step = {0.975, 1.045};
    const int joint = 0;
    const std::vector<double> p{10.0, 0.0, delay, reach, 0.0, 1e6, 0.0};
    PositionServo{}.add_torque(x, &joint, p.data(), &tau);
    line -= 0.5 * tau;
  }
  CHECK_THAT(line, WithinAbs(mean, 1e-5));
  CHECK(std::abs((at(1e-6) - at(-1e-6)) / 2e-6) > 1.0);  // a later jump shows
}

TEST_CASE("position_servo: derivatives by its delay, its speed and its bounds", "[effects]") {
  const std::vector<double> time{0.0, 0.1, 0.2, 0.3, 0.4}, ramp{0.0, 0.1, 0.9, 1.0, 1.1};
  const auto at = [&](const std::vector<double>& p) {
    CommandPath path = commands(time, ramp);
    path.limit_speed(0, p[5]);
    return added(path, 0.33, 0.2, 0.3, p);
  };
  for (const double reach : {0.25, 5.0}) {
    const std::vector<double> p{10.0, 0.5, 0.02, reach, 0.05, 2.5, 0.03};
    CommandPath path = commands(time, ramp);
    path.limit_speed(0, p[5]);
    std::vector<JetD> jets(p.begin(), p.end());
    for (std::size_t k = 0; k < p.size(); ++k) jets[k].v[static_cast<long>(k)] = 1.0;
    const JetD tau = added<JetD>(path, 0.33, JetD(0.2), JetD(0.3), jets);
    CHECK_THAT(tau.a, WithinRel(at(p), 1e-12));
    for (std::size_t k = 0; k < p.size(); ++k) {
      std::vector<double> more = p, less = p;
      more[k] += 1e-6;
      less[k] -= 1e-6;
      CAPTURE(reach, k);
      CHECK_THAT(tau.v[static_cast<long>(k)], WithinAbs((at(more) - at(less)) / 2e-6, 1e-5));
    }
  }
}

}  // namespace diffnea::position_servo_test
