#pragma once
/// Recordings of simulated robots as a real one would give them: a controller that knows the
/// nominal model follows a desired motion, and sensors with noise write down positions and
/// commanded torques.

#include <cstdint>
#include <string>

#include <diffnea/recording/recording.hpp>
#include <diffnea/recording/trajectory.hpp>
#include <diffnea/sim/controller.hpp>

namespace diffnea {

/// One row a sample of the controller.
struct RecordOptions : ControllerOptions {
  double physics_step = 5e-4;  ///< largest step of the integration [s]
  // Standard deviations of the noise on what is recorded (and on the position the controller sees).
  double position_noise = 1e-4;  ///< revolute [rad]
  double slide_noise = 1e-5;     ///< prismatic [m]
  double torque_noise = 0.05;    ///< [N·m] or [N], times torque_scale of the joint
  double actuation_noise = 0.0;  ///< of the torque that acts [N·m] or [N], times torque_scale
  double camera_noise = 1.5e-3;  ///< of a ball's position along one axis [m]
  // Motion capture of a base that floats, by a cluster of markers 0.5 m wide.
  double place_noise = 1e-4;     ///< deviation of its position along one axis [m]
  double turn_noise = 2e-4;      ///< deviation of its orientation about one axis [rad]
  double camera_rate = 100.0;    ///< rows at which the ball is seen [Hz]; every row if higher
  double period =
      0.0;  ///< of the desired motion [s], for the recording's information; 0: not periodic
  /// Duration of a flight of a robot that floats [s]. It is thrown so that it comes back to where
  /// it began, which is g (flight)²/8 high: 4.9 m. Of flights of 1 s `identify` gives biased
  /// parameters.
  double flight = 2.0;
  double spin = 0.5;       ///< deviation of its speed of turning about each axis [rad/s]
  std::uint64_t seed = 0;  ///< noise and throws are drawn from it
  /// Gains that are not given are raised until every joint follows its motion to 10 %, as far as
  /// the rate of control lets them: for light joints, and those with much friction.
  bool follow = false;

  /// Standard deviations of what is recorded times `factor`; actuation_noise is the robot's own.
  void scale_noise(double factor);
};

/// Size of a joint's torques against an arm's: effort limit / 40 N·m, at most 1. Noise and
/// perturbations of small rigs shrink with it.
double torque_scale(const ModelLink& link);

/// A recording of a simulated robot, and the robot as it was.
struct SimulatedRecording {
  Recording recording;  ///< q, qcmd, tau; a passive joint has no tau; the ball of a world with one
  long saturated = 0;   ///< rows where a torque met its limit
  /// Empty if the simulation reached the end; otherwise what went wrong, the recording ends before
  /// it.
  std::string failure;
};

/// The model itself as the robot: ABA with all its effects, RK4; steps are shortened for stiff
/// springs and bristles. Lag, delay and limit stand between the torque that is recorded and the one
/// that acts; motors behind a spring or a gap have their own angle; encoders show the controller,
/// too, what they read. A filter in the logged velocity (then `qd` is recorded) and a late clock
/// change the log alone.
/// @param controller  the model that the controller compensates gravity with; same joints
/// Constraints of the robot act, and what follows in its loops is logged without a torque. Without
/// gains, loops are controlled by computed torque: no gains of single joints hold them.
/// @param trajectory  of all joints that have a motor, and possibly others; its first row is the
/// start, at rest
/// @throws DataError naming the time where a loop does not close or is not held; ModelError if
/// joints differ, or effects cannot act at one joint together; ShapeError for the gains
SimulatedRecording record_model(const Model& robot, const Model& controller,
                                const Trajectory& trajectory, const RecordOptions& options = {});

}  // namespace diffnea
