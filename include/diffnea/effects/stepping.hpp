#pragma once
/// Effects of time and of measurement in a simulation that goes on step by step: what those of
/// effects/memory.hpp have, by BoundEffect.

#include <optional>

#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// Joints whose motion the torque of one instant depends on: those that it acts on, unless its
/// formula names others.
std::vector<int> joints_read(const BoundEffect& e);

/// Tells whether its formula names joints by their numbers in the robot.
bool names_joints(const BoundEffect& e);

/// Tells whether it has a state at each of its joints (JointStateEffect).
bool has_state(const BoundEffect& e);
/// The state after a move at constant velocity; e has one.
double advanced_state(const BoundEffect& e, double z, const Move& move);
/// Torque at a state and a velocity; e has a state.
double state_torque(const BoundEffect& e, double z, double qd);
/// Spring and damper at rest; e has a state.
AtRest<double> at_rest(const BoundEffect& e);

/// Tells whether it hides a motor (EffectInfo::motor).
bool hides_motor(const BoundEffect& e);
/// Tells whether positions are logged at the motor, so that the link's angle is what is hidden.
bool encoder_at_motor(const BoundEffect& e);
/// Spring of the hidden motor.
MotorSpring<double> motor_spring(const BoundEffect& e);
/// Torque that a hidden motor transmits, by its angle and velocity beyond the link's.
double transmitted(const BoundEffect& e, double deflection, double velocity);
/// Angle of the hidden motor beyond the link's that transmits `load` at rest.
double deflection_at(const BoundEffect& e, double load);
/// The same with derivatives. @param p  parameters in the order of e.parameter_info
JetD deflection_at(const BoundEffect& e, const JetD& load, const JetD* p);

/// Adds what the effect does between command and torque.
/// @return whether it does anything there
bool add_to_drive(const BoundEffect& e, DrivePath<double>& path);
/// Tells whether it acts between command and torque.
bool is_of_drive_path(const BoundEffect& e);

/// Adds what the effect does to an encoder's reading.
/// @return whether it does anything there
bool add_to_encoder(const BoundEffect& e, Encoder& encoder);
/// How much later the motion is logged than the torque beside it [s]; 0 if the effect is another.
double clock_shift(const BoundEffect& e);
/// Velocities as the log has them: filtered, where the effect is such a filter.
/// @param qd  (N), @param dt [s]
VecX<double> logged_velocity(const BoundEffect& e, const VecX<double>& qd, double dt);
/// Tells whether it is of the log alone: a clock, a filter, a camera. The motion does not know of
/// it.
bool is_of_log(const BoundEffect& e);

/// Tells whether a simulation of one robot has its state or channel: every effect of
/// ExtendedTree::series that brings one of effects/memory.hpp.
bool is_simulated(const BoundEffect& e);

/// How late the camera's picture is [s]; none if the effect does not say.
std::optional<double> view_delay(const BoundEffect& e);
/// Moves the place where the string is tied, in its link's frame; others leave it.
void add_to_anchor(const BoundEffect& e, Vec3<double>& p_LS);

}  // namespace diffnea
