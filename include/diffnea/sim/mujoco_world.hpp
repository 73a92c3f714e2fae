#pragma once
/// MuJoCo as the real robot: a world whose inertias and friction differ from what the model says.
/// The truth is drawn as a Model of its own, which tests and demonstrations compare with, and which
/// nothing else sees.
///
///     const Model nominal = read_model("wam4.xml");
///     const Model truth = perturbed(nominal, surrogate_a(), /*seed=*/1);
///     const SimulatedRecording r = record_in_mujoco(read_mjcf("wam4.xml"), truth, nominal,
///     trajectory);

#include <diffnea/sim/record.hpp>

namespace diffnea {

/// Ranges that every number is drawn from, uniformly. A joint's friction and rotor take its
/// torque_scale times that, a slide's in [N], [N·s/m] and [kg].
struct Perturbation {
  double mass_low = 0.0;       ///< least relative change of every mass
  double mass_high = 0.0;      ///< largest relative change of every mass
  double inertia_low = 0.0;    ///< least relative change of inertias about the centre of mass
  double inertia_high = 0.0;   ///< largest relative change of inertias about the centre of mass
  double com = 0.0;            ///< largest shift of a centre of mass [m]
  double coulomb_low = 0.0;    ///< least added Coulomb friction [N·m]
  double coulomb_high = 0.0;   ///< largest added Coulomb friction [N·m]
  double viscous_low = 0.0;    ///< least added viscous friction [N·m·s/rad]
  double viscous_high = 0.0;   ///< largest added viscous friction [N·m·s/rad]
  double armature_low = 0.0;   ///< least added rotor inertia [kg·m²]
  double armature_high = 0.0;  ///< largest added rotor inertia [kg·m²]
  double attachment = 0.0;     ///< largest shift of where a ball's string is tied [m]
  double string = 0.0;         ///< largest change of its length [m]
  double cup_tilt = 0.0;  ///< largest tilt of the cup's axis [rad], about where the string is tied
  // Drives and camera. Springs are at joints that turn, with a rotor and an effort limit.
  double wind_up_low = 0.0;        ///< least wind-up of the spring at the effort limit [rad]
  double wind_up_high = 0.0;       ///< largest wind-up of the spring at the effort limit [rad]
  double relaxation_low = 0.0;     ///< least damping of the spring over its stiffness [s]
  double relaxation_high = 0.0;    ///< largest damping of the spring over its stiffness [s]
  double stiction_low = 0.0;       ///< least stiction beyond Coulomb friction, as a share of that
  double stiction_high = 0.0;      ///< largest stiction beyond Coulomb friction, as a share of that
  double stribeck_low = 0.0;       ///< least speed where it has faded to 1/e [rad/s] or [m/s]
  double stribeck_high = 0.0;      ///< largest speed where it has faded to 1/e [rad/s] or [m/s]
  double delay_low = 0.0;          ///< least delay of all drives [s]
  double delay_high = 0.0;         ///< largest delay of all drives [s]
  double actuation_noise = 0.0;    ///< of the torque that acts [N·m], times torque_scale; not drawn
  double camera_delay_low = 0.0;   ///< least delay with which the ball is seen [s]
  double camera_delay_high = 0.0;  ///< largest delay with which the ball is seen [s]
};
/// A robot like `model` whose parameters were drawn anew: every link with mass that moves, every
/// joint with a motor (friction and rotors times torque_scale). Physically consistent if the model
/// is. Of one seed, ranges that are alike draw alike, whatever drives and camera have.
Model perturbed(const Model& model, const Perturbation& perturbation, std::uint64_t seed);

/// Means over several recordings of one motion, each from rest, row by row: positions, torques,
/// desired positions, the ball. The shortest tells how many rows; a failure is that of the first
/// that failed.
/// @throws DataError if there is none, or their channels differ
SimulatedRecording averaged(const std::vector<SimulatedRecording>& repetitions);

/// Runs MuJoCo with the inertias, friction, rotors and springs of `truth`, and the pose of a cup
/// (frame `cup`) that is fixed to its link, written over those of the document; other effects of
/// joint torque that `truth` has act as additional torques. A joint with elasticity has its rotor,
/// and the friction of that, as a joint of its own that a tendon holds; stribeck_friction raises
/// the bound of its dry friction. Drives act late, the camera sees the ball late. A ball of the
/// document (on a tendon, or on a chain) is recorded, too: mass, attachment and length are those of
/// the truth, and it hangs at rest in the beginning. Deterministic.
/// @param mjcf        one self-contained document (read_mjcf), with_rotors where the truth has
///                    elastic joints
/// @param truth       a model with the document's links and joints, e.g. perturbed(read_model(…))
/// @param controller  as record_model
/// @throws ModelError if MuJoCo cannot compile the document, or its names are not those of the
/// model, or an effect of
///         `truth` cannot act in MuJoCo
SimulatedRecording record_in_mujoco(const std::string& mjcf, const Model& truth,
                                    const Model& controller, const Trajectory& trajectory,
                                    const RecordOptions& options = {});

/// Flights of a robot that floats: the motion is cut into pieces of options.flight, whole ones
/// alone, and at the beginning of each the robot is thrown up from where the file has it, turning,
/// its joints in the midst of their motion. Nothing else touches it (contacts are the document's).
/// The controller compensates no gravity, which no joint feels in the air. Recordings have the pose
/// of the base, and are numbered as runs.
/// @param mjcf, truth, controller, trajectory  as record_in_mujoco, of robots that float
/// @throws ModelError as record_in_mujoco, or if a base is fixed or the model has constraints;
///         Error if options.flight is not positive; DataError of a motion shorter than a flight
std::vector<SimulatedRecording> record_flights(const std::string& mjcf, const Model& truth,
                                               const Model& controller,
                                               const Trajectory& trajectory,
                                               const RecordOptions& options = {});

}  // namespace diffnea
