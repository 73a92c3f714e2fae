#pragma once
/// The loop that every recording runs: measure, compute the torque, hold it while the plant moves.

#include <optional>

#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/effects/command.hpp>
#include <diffnea/sim/record.hpp>

namespace diffnea::sim {

/// How a robot that floats is thrown.
struct Launch {
  Pose<double> X_WB;     ///< pose of its base
  Twist<double> V_WB_B;  ///< twist of its base, in the base's axes [rad/s, m/s]
};

/// A robot that can be stepped. Vectors are (n), in the order of the degrees of freedom.
class Plant {
 public:
  virtual ~Plant() = default;
  virtual void reset(const VecX<double>& q) = 0;  ///< at rest
  /// A robot that floats, in the midst of its joints' motion.
  /// @throws ModelError if the plant has no such base
  virtual void launch(const VecX<double>& q, const VecX<double>& qd, const Launch& thrown);
  /// Pose X_WB of a base that floats, x y z [m] and qx qy qz qw; empty: the base is fixed.
  virtual VecX<double> base() const { return {}; }
  virtual VecX<double> q() const = 0;
  virtual VecX<double> qd() const = 0;
  /// Position of the ball, W [m], if there is one.
  virtual std::optional<Vec3<double>> ball() const { return {}; }
  /// Commands of the run, for drives that have a loop of their own.
  /// @throws ModelError if the plant has no such drives
  virtual void follow(CommandPath commands);
  /// Moves by one control period under constant torque.
  /// @return empty, or what went wrong
  virtual std::string step(const VecX<double>& torque) = 0;
};

/// @param thrown  how a robot that floats begins; null: at rest
/// @throws as record_model
SimulatedRecording run_control_loop(Plant& plant, const Model& robot, const Model& controller,
                                    const Trajectory& trajectory, const RecordOptions& options,
                                    const Launch* thrown = nullptr);

}  // namespace diffnea::sim
