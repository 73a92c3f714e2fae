#pragma once
/// The torque of any effect of any port over a stretch of a recording: what the log has in addition
/// because of the effect, given the motion (inverse direction), and its derivatives. What fits and
/// tests of effects build on.
///
///     JointSeries x{.dt = 0.002, .q = q, .qd = qd, .qdd = qdd};
///     predict(base, x);
///     const BoundEffect lag = bind({"actuator_lag", "elbow", {}}, model);
///     const std::vector<RowMatX<double>> columns = series_columns(lag, base, x,
///     lag.parameters.data(), {0});
///
/// Where constraints close loops (ExtendedTree::loops), predicted torques are those of the leading
/// joints, and so are torques of measurement channels. Others are the joints' own.
///
/// Torques of different effects add up, except those of order two in small quantities (a lag of the
/// torque that a backlash adds). What is linear in its parameters is exactly so; order of accuracy
/// four in dt elsewhere.

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

/// Fills x.tau, x.total and x.inertia from x.q, x.qd, x.qdd.
/// @param base  the model without the effect in question; its effects count in x.total
void predict(const ExtendedTree& base, JointSeries& x);

/// Torque that the log has in addition because of `effect`, (N, n) [N·m] or [N].
///  - kJointTorque, kLinkForce: the effect's torque at every instant, at x.tau
///  - kModelParameter: RNEA of the changed tree minus that of the tree
///  - kMeasurement: the sign equation at the true motion minus the same at the logged one, all
///  joints
///  - kMemory: torque of the series; a hidden motor angle θ also moves the friction of `base` on
///  the motor's side from q̇ to θ̇, and that on the link's side winds its spring up; where θ is
///  logged, RNEA at the links' motion, which starts without swinging, minus that at θ, all joints
/// @param base  the model it is added to; a Tree is one without effects
/// @param x     x.tau may be empty: it is then computed; x.total, where it is there, is that of
/// `base`
/// @param p     parameters in the order of effect.parameter_info; shapes must be positive
/// @throws ShapeError if the matrices differ in shape, DataError for a saturation or a
/// backlash without x.logged
RowMatX<double> series_torque(const BoundEffect& effect, const ExtendedTree& base,
                              const JointSeries& x, const double* p);
/// Torque of an effect along a series, (rows, joints) [N·m] or [N]. @param p  its parameters
RowMatX<double> series_torque(const BoundEffect& effect, const Tree<double>& tree,
                              const JointSeries& x, const double* p);

/// Derivatives of it by the parameters `which` at p, one (N, n) matrix each, on the scale of the
/// parameter: Scale::kLinear and kPlain ∂/∂p, kLog ∂/∂ln p. For a linear one that is the torque of
/// one unit of it. Exact for linear parameters and for the port kJointTorque (Jets), else
/// differences good to six digits (five at 0, below which there is none).
/// @param torque  if not null: the torque itself, which the columns of memory effects need anyway
std::vector<RowMatX<double>> series_columns(const BoundEffect& effect, const ExtendedTree& base,
                                            const JointSeries& x, const double* p,
                                            const std::vector<int>& which,
                                            RowMatX<double>* torque = nullptr);
/// Derivatives of that torque by the parameters asked for, (rows, joints) each.
std::vector<RowMatX<double>> series_columns(const BoundEffect& effect, const Tree<double>& tree,
                                            const JointSeries& x, const double* p,
                                            const std::vector<int>& which);

}  // namespace diffnea
