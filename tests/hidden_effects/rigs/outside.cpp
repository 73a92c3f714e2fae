#include <algorithm>
#include <cmath>
#include <functional>

#include "effects_detail.hpp"

namespace rigs {

const std::vector<std::string>& outside_effects() {
  static const std::vector<std::string> kAll{"outside/speed_ripple", "outside/hose_drag",
                                             "outside/magnet",       "outside/hose_twist",
                                             "outside/soft_stops",   "outside/drift",
                                             "outside/mains_ripple", "outside/eccentric_encoder"};
  return kAll;
}

void outside_effect(Effect& e, int j, Scene& s) {
  const std::string kind = e.name.substr(e.name.find('/') + 1);
  const Joint& joint = joint_of(s, j);
  const double torque = s.usual.torque[j], speed = s.usual.speed[j];
  const double centre = s.usual.centre[j], spread = s.usual.spread[j];
  const int n = s.arm.size(), other = (j + 1 + s.draw.index(n - 1)) % n;
  const std::string its_name = joint_of(s, other).name;
  const double its_centre = s.usual.centre[other], its_spread = s.usual.spread[other],
               its_speed = s.usual.speed[other];
  e.start = 0.03 * torque;
  using Law = std::function<double(double, const Eigen::VectorXd&, const Eigen::VectorXd&)>;
  const auto opposes = [&](const Law& law) {
    e.act = [=](double x, Rig& rig) {
      rig.physics.outside_joint = j;
      rig.physics.outside = [=](double time, const Eigen::VectorXd& q, const Eigen::VectorXd& qd) {
        return x * law(time, q, qd);
      };
    };
    e.parameters = [](double x) { return Json{{"torque", x}}; };
  };
  if (kind == "eccentric_encoder") {
    const double phase = s.draw.uniform(0.0, kTurn);
    e.joints = every(n);
    e.start = 0.03;
    e.limit = 0.2;
    e.act = [=](double x, Rig& rig) {
      rig.physics.wobble[j] = x;
      rig.physics.wobble_phase[j] = phase;
    };
    e.parameters = [=](double x) { return Json{{"wobble", x}, {"phase", phase}}; };
    e.variables = {"q_" + joint.name};
  } else if (kind == "speed_ripple") {
    const double cycles = s.draw.uniform(2.0, 4.0) / spread, phase = s.draw.uniform(0.0, kTurn);
    opposes([=](double, const auto& q, const auto& qd) {
      return qd[j] / speed * std::sin(cycles * q[j] + phase);
    });
    e.variables = {"q_" + joint.name, "qd_" + joint.name};
  } else if (kind == "hose_drag") {
    opposes([=](double, const auto&, const auto& qd) { return qd[other] / its_speed; });
    e.variables = {"qd_" + its_name};
  } else if (kind == "magnet") {
    const double at = centre + s.draw.uniform(-1.0, 1.0) * spread,
                 width = s.draw.uniform(0.15, 0.4) * spread;
    opposes([=](double, const auto& q, const auto&) {
      const double r = (q[j] - at) / width;
      return 2.0 * r / ((1.0 + r * r) * (1.0 + r * r));
    });
    e.variables = {"q_" + joint.name};
  } else if (kind == "hose_twist") {
    opposes([=](double, const auto& q, const auto&) {
      const double mine = (q[j] - centre) / spread, its = (q[other] - its_centre) / its_spread;
      return std::tanh(mine * its);
    });
    e.variables = {"q_" + joint.name, "q_" + its_name};
  } else if (kind == "soft_stops") {
    const double room = s.draw.uniform(0.5, 0.9) * spread;
    opposes([=](double, const auto& q, const auto&) {
      const double r = q[j] - centre, in = std::max(0.0, std::abs(r) - room) / spread;
      return std::copysign(in * in, r);
    });
    e.variables = {"q_" + joint.name};
  } else if (kind == "drift") {
    const double seconds = s.seconds, bend = s.draw.uniform(0.5, 3.0);
    opposes([=](double time, const auto&, const auto&) {
      return std::pow(std::clamp(time / seconds, 0.0, 1.0), bend);
    });
    e.variables = {"time"};
  } else {
    const double turn = kTurn * s.draw.ratio(1.5, 8.0), phase = s.draw.uniform(0.0, kTurn);
    opposes([=](double time, const auto&, const auto&) { return std::sin(turn * time + phase); });
    e.variables = {"time"};
  }
}

}  // namespace rigs
