#pragma once
/// The controller that every simulated robot has: it knows a nominal model, reads positions and
/// velocities once a period, and holds its torque until the next.

#include <diffnea/core/fields.hpp>
#include <diffnea/model/model.hpp>

namespace diffnea {

/// How torques follow from the desired motion.
enum class ControlLaw {
  kPd,              ///< u = g(q) + kp (q* − q) + kd (q̇* − q̇)
  kComputedTorque,  ///< u = RNEA(q, q̇, q̈* + kp' (q* − q) + kd' (q̇* − q̇)), kp' and kd' in 1/s², 1/s
};

/// Names in files and options.
template <>
struct EnumNames<ControlLaw> {
  /// Both laws.
  static constexpr NamedValue<ControlLaw> list[] = {
      {ControlLaw::kPd, "pd"}, {ControlLaw::kComputedTorque, "computed_torque"}};
};

/// The joint controller of a simulated robot.
struct ControllerOptions {
  ControlLaw law = ControlLaw::kPd;
  double control_rate = 500.0;
  VecX<double> kp{};
  VecX<double> kd{};
  double bandwidth = 16.0;
  double damping = 0.7;
  bool gravity_compensation = true;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ControllerOptions", "The joint controller of a simulated robot.", {.exact = true});
    list.field("law", &ControllerOptions::law,
               "How torques follow from the desired motion, with the nominal model in g and RNEA.");
    list.field("rate", &ControllerOptions::control_rate, "Torques are held between two samples.",
               {.unit = "Hz", .key = "control_rate"});
    list.field(
        "kp", &ControllerOptions::kp,
        "Gains per degree of freedom [N·m/rad] or [N/m]. Empty: m_j ω² with m_j = 1/(M⁻¹)_jj, the "
        "inertia that the joint feels at the start in the nominal model; with computed torque ω².");
    list.field("kd", &ControllerOptions::kd,
               "Gains per degree of freedom [N·m·s/rad] or [N·s/m]. Empty: 2 ζ m_j ω; with "
               "computed torque 2 ζ ω.");
    list.field("bandwidth", &ControllerOptions::bandwidth,
               "Frequency ω of the gains that are derived.", {.unit = "rad/s"});
    list.field("damping", &ControllerOptions::damping, "Damping ratio ζ of these.");
    list.field("gravity_compensation", &ControllerOptions::gravity_compensation,
               "Of the nominal model, at the measured position.");
  }
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
