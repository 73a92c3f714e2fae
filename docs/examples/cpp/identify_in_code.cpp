/// A pendulum that is described and recorded in code, and identified: the component
/// diffnea::identify, without MuJoCo and without files.
///
///     identify_in_code

#include <cmath>
#include <cstdio>
#include <exception>

#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/identify/identify.hpp>

using namespace diffnea;

namespace {

/// A rod on a hinge. @param mass  [kg]
Model pendulum(double mass) {
  Model model;
  model.name = "pendulum";
  ModelLink link;
  link.name = "rod";
  link.joint = "hinge";
  link.type = ModelJoint::kRevolute;
  link.axis = {0, 1, 0};
  link.inertia = inertia_from_com<double>(mass, {0, 0, -0.5}, {0.02, 0, 0, 0.02, 0, 0.001});
  model.links = {link};
  return model;
}

/// Motion and torque of a pendulum with 0.4 N·m·s/rad of viscous friction under sines.
Recording recorded(const Model& truth, double phase) {
  constexpr long kRows = 2000;
  constexpr double kFriction = 0.4;  // [N·m·s/rad]
  Recording out;
  out.source = "pendulum";
  out.joint_names = joint_names(truth);
  out.time = VecX<double>::LinSpaced(kRows, 0.0, 0.005 * (kRows - 1));
  out.q.resize(kRows, 1);
  out.tau.resize(kRows, 1);
  out.has_tau = {true};
  out.info.torque_sampling = TorqueSampling::kInstant;
  const Tree<double> tree = make_tree(truth);
  RneaWorkspace<double, double> ws;
  for (long k = 0; k < kRows; ++k) {
    VecX<double> q(1), qd(1), qdd(1);
    q.setZero(), qd.setZero(), qdd.setZero();
    for (const double w : {1.3, 2.9, 4.7}) {  // [rad/s]
      const double angle = w * out.time[k] + phase * w;
      q[0] += 0.5 * std::sin(angle);
      qd[0] += 0.5 * w * std::cos(angle);
      qdd[0] -= 0.5 * w * w * std::sin(angle);
    }
    out.q(k, 0) = q[0];
    out.tau(k, 0) = rnea(tree, q, qd, qdd, ws)[0] + kFriction * qd[0];
  }
  return out;
}

}  // namespace

int main() try {
  const Model truth = pendulum(1.5);
  const IdentifyResult result =
      identify(pendulum(1.0), {recorded(truth, 0.0)}, {recorded(truth, 1.0)});
  for (const ParameterEstimate& p : result.parameters)
    if (p.identifiable && !p.fixed)
      std::printf("%-32s %10.4f %s\n", p.name.c_str(), p.value, p.unit.c_str());
  const JointError& error = result.errors.front();
  std::printf("%s: rms error %.2g %s before, %.2g after (held out)\n", error.joint.c_str(),
              error.nominal_test, error.unit.c_str(), error.test);
  return error.test < 1e-4 * error.nominal_test ? 0 : 3;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
