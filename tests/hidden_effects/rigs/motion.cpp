#include "motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace rigs {
namespace {

using Eigen::VectorXd;

constexpr double kTurn = 2.0 * std::numbers::pi;
/// A slide's way in m beside a hinge's in rad.
constexpr double kSlide = 0.3;

double unit(const Joint& joint) { return joint.passive ? 0.0 : joint.slide ? kSlide : 1.0; }

}  // namespace

Motion::Motion(const Arm& arm, const MotionPlan& plan, double seconds, Draw draw)
    : centre_(plan.centre), seconds_(seconds), smooth_(plan.smooth) {
  const int n = arm.size();
  for (int j = 0; j < n; ++j)
    centre_[j] += 0.3 * plan.reach * unit(arm.joints[static_cast<std::size_t>(j)]) * draw.normal();
  if (plan.kind == "multisine") {
    for (int j = 0; j < n; ++j) {
      std::vector<Wave> mine;
      double speed = 0.0, push = 0.0, way = 0.0;
      const int most = plan.period > 0.0
                           ? std::max(plan.waves, static_cast<int>(plan.fastest * plan.period))
                           : 0;
      for (int i = 0; i < plan.waves; ++i) {
        const double hertz = plan.period > 0.0 ? (1 + draw.index(most)) / plan.period
                                               : draw.ratio(0.08, plan.fastest);
        const Wave wave{std::pow(hertz, -draw.uniform(0.7, 1.6)), kTurn * hertz,
                        draw.uniform(-std::numbers::pi, std::numbers::pi)};
        mine.push_back(wave);
        way += wave.size * wave.size;
        speed += std::pow(wave.size * wave.turn, 2);
        push += std::pow(wave.size * wave.turn * wave.turn, 2);
      }
      // Peaks of sums with random phases: about twice their root mean square.
      const double peak = std::sqrt(2.0);
      const double size =
          unit(arm.joints[static_cast<std::size_t>(j)]) * draw.uniform(0.6, 1.0) *
          std::min({plan.reach / (peak * std::sqrt(way)), plan.speed / (peak * std::sqrt(speed)),
                    plan.push / (peak * std::sqrt(push))});
      for (Wave& wave : mine) wave.size *= size;
      waves_.push_back(mine);
    }
  } else if (plan.kind == "chirp") {
    for (int j = 0; j < n; ++j) {
      const double u = unit(arm.joints[static_cast<std::size_t>(j)]) * draw.uniform(0.6, 1.0);
      const double spread = draw.uniform(0.7, 1.0);
      sweeps_.push_back({plan.reach * u, plan.speed * u, plan.push * u,
                         0.1 * draw.uniform(0.7, 1.5), spread * plan.fastest,
                         draw.uniform(-std::numbers::pi, std::numbers::pi)});
    }
  } else {
    double time = -2.0;
    VectorXd here = centre_;
    while (time < seconds + 2.0) {
      Leg leg;
      leg.from = here;
      leg.to = here;
      leg.start = time;
      leg.whole = leg.ramp = 0.0;
      for (int j = 0; j < n; ++j) {
        const double u = unit(arm.joints[static_cast<std::size_t>(j)]);
        if (u == 0.0) continue;
        leg.to[j] = centre_[j] + u * plan.reach * draw.uniform(-1.0, 1.0);
        const double way = std::abs(leg.to[j] - here[j]) / u;
        const double ramp = std::min(plan.speed / plan.push, std::sqrt(way / plan.push));
        leg.ramp = std::max(leg.ramp, ramp);
        leg.whole = std::max(leg.whole, ramp + way / (plan.push * std::max(ramp, 1e-3)));
      }
      leg.whole = std::max(leg.whole, 2.0 * leg.ramp);
      here = leg.to;
      time += leg.whole + draw.uniform(0.05, 0.7);
      legs_.push_back(leg);
    }
  }
}

double Motion::swept(int j, double time) const {
  const Sweep& s = sweeps_[static_cast<std::size_t>(j)];
  // Frequency grows by one factor in equal times, before the start as well.
  const double rate = std::log(s.to / s.from) / seconds_;
  const double turn = kTurn * s.from * std::exp(rate * time);
  const double size = 1.0 / (1.0 / s.size + turn / s.speed + turn * turn / s.push);
  return size * std::sin(turn / rate + s.phase);
}

Desired Motion::at(double time) const {
  const Eigen::Index n = centre_.size();
  Desired out{centre_, VectorXd::Zero(n), VectorXd::Zero(n)};
  for (Eigen::Index j = 0; j < n && !waves_.empty(); ++j) {
    for (const Wave& w : waves_[static_cast<std::size_t>(j)]) {
      const double x = w.turn * time + w.phase;
      out.q[j] += w.size * std::sin(x);
      out.qd[j] += w.size * w.turn * std::cos(x);
      out.qdd[j] -= w.size * w.turn * w.turn * std::sin(x);
    }
  }
  for (Eigen::Index j = 0; j < n && !sweeps_.empty(); ++j) {
    // Central differences: (2π 5 Hz · 1 ms)²/6 = 2e-4 of a velocity that is only asked for.
    constexpr double kStep = 1e-3;
    const int at = static_cast<int>(j);
    const double here = swept(at, time), after = swept(at, time + kStep),
                 before = swept(at, time - kStep);
    out.q[j] += here;
    out.qd[j] = (after - before) / (2.0 * kStep);
    out.qdd[j] = (after - 2.0 * here + before) / (kStep * kStep);
  }
  if (legs_.empty()) return out;
  const auto after =
      std::ranges::upper_bound(legs_, time, {}, [](const Leg& leg) { return leg.start; });
  const Leg& leg = after == legs_.begin() ? legs_.front() : *(after - 1);
  const double t = std::clamp(time - leg.start, 0.0, leg.whole), back = leg.whole - t;
  const double push = 1.0 / (leg.ramp * (leg.whole - leg.ramp));  // acceleration over a way of 1
  double s = 0.0, sd = 0.0, sdd = 0.0;
  // Way, speed, acceleration of a ramp after a time: constant, or as sin² with the same end.
  const auto ramp = [&](double x, double& way, double& speed, double& acceleration) {
    if (smooth_) {
      const double turn = kTurn / leg.ramp;
      acceleration = push * (1.0 - std::cos(turn * x));
      speed = push * (x - std::sin(turn * x) / turn);
      way = push * (0.5 * x * x - (1.0 - std::cos(turn * x)) / (turn * turn));
    } else {
      acceleration = push;
      speed = push * x;
      way = 0.5 * push * x * x;
    }
  };
  if (t < leg.ramp) {
    ramp(t, s, sd, sdd);
  } else if (back < leg.ramp) {
    ramp(back, s, sd, sdd);
    s = 1.0 - s;
    sdd = -sdd;
  } else {
    s = push * leg.ramp * (t - 0.5 * leg.ramp), sd = push * leg.ramp;
  }
  if (t == 0.0 || back == 0.0) sdd = 0.0;
  out.q = leg.from + s * (leg.to - leg.from);
  out.qd = sd * (leg.to - leg.from);
  out.qdd = sdd * (leg.to - leg.from);
  return out;
}

}  // namespace rigs
