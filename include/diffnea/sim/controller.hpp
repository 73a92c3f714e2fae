#pragma once
/// The controller that every simulated robot has: it knows a nominal model, reads positions and
/// velocities once a period, and holds its torque until the next.

#include <diffnea/model/model.hpp>

namespace diffnea {

/// How torques follow from the desired motion.
enum class ControlLaw {
  kPd,              ///< u = g(q) + kp (q* − q) + kd (q̇* − q̇)
  kComputedTorque,  ///< u = RNEA(q, q̇, q̈* + kp' (q* − q) + kd' (q̇* − q̇)), kp' and kd' in 1/s², 1/s
};

/// The joint controller of a simulated robot.
struct ControllerOptions {
  ControlLaw law = ControlLaw::kPd;  ///< with the nominal model in g and RNEA
  double control_rate = 500.0;       ///< [Hz]; torques are held between two samples
  /// Gains per degree of freedom [N·m/rad, N·m·s/rad] or [N/m, N·s/m]. Empty: kp = m_j ω², kd = 2 ζ
  /// m_j ω with m_j = 1/(M⁻¹)_jj, the inertia that the joint feels at the start in the nominal
  /// model; with computed torque ω² and 2 ζ ω.
  ///@{
  VecX<double> kp{}, kd{};
  ///@}
  double bandwidth = 16.0;           ///< ω of the gains that are derived [rad/s]
  double damping = 0.7;              ///< ζ
  bool gravity_compensation = true;  ///< of the nominal model, at the measured position
};

/// Gains of all joints.
struct JointGains {
  VecX<double> kp;  ///< (n) [N·m/rad] or [N/m]; of computed torque [1/s²]
  VecX<double> kd;  ///< (n) [N·m·s/rad] or [N·s/m]; of computed torque [1/s]
};
/// The gains that options ask for.
/// @param q0  (n) where the robot starts
/// @throws ShapeError if gains are given and not one a degree of freedom
JointGains joint_gains(const Model& nominal, const ControllerOptions& options,
                       const VecX<double>& q0);

}  // namespace diffnea
