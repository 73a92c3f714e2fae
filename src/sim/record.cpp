#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/integrators.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/sim/record.hpp>

#include "sim/control_loop.hpp"

namespace diffnea {
namespace {

/// The effort limit of an arm's joint to which friction of about 1 N·m belongs.
constexpr double kArmEffort = 40.0;  // [N·m]

class ModelPlant : public sim::Plant {
 public:
  ModelPlant(const Model& model, const RecordOptions& options)
      : dynamics_(extend(model)),
        n_(dynamics_.num_dofs()),
        substeps_(sim::substeps(options)),
        step_(1.0 / (options.control_rate * substeps_)),
        z_(VecX<double>::Zero(2 * n_)) {}

  void reset(const VecX<double>& q) override { z_ << q, VecX<double>::Zero(n_); }
  VecX<double> q() const override { return z_.head(n_); }
  VecX<double> qd() const override { return z_.tail(n_); }
  std::string step(const VecX<double>& torque) override {
    const auto slope = [&](double, const VecX<double>& z, VecX<double>& dz) {
      dz.resize(2 * n_);
      dz.head(n_) = z.tail(n_);
      dynamics_.acceleration(z.data(), z.data() + n_, torque.data(), 0, dz.data() + n_);
    };
    for (int i = 0; i < substeps_; ++i) integrator_.step(slope, step_, z_);
    return z_.allFinite() ? "" : "the integration is unstable";
  }

 private:
  ForwardDynamics dynamics_;
  int n_;
  int substeps_;
  double step_;
  VecX<double> z_;  ///< q, q̇
  RungeKutta4<VecX<double>> integrator_;
};

}  // namespace

double torque_scale(const ModelLink& link) {
  return std::min(1.0, link.limits.effort / kArmEffort);
}

SimulatedRecording record_model(const Model& robot, const Model& controller,
                                const Trajectory& trajectory, const RecordOptions& options) {
  ModelPlant plant(robot, options);
  SimulatedRecording out = sim::run_control_loop(plant, robot, controller, trajectory, options);
  out.recording.source = robot.source;
  return out;
}

}  // namespace diffnea
