#pragma once
/// The data of the paper's experiment, four minutes of it, and what is identified from it: a fast
/// motion of the arm, and a slow one under which the ball swings, repeated and averaged.

#include <functional>

#include <diffnea/excite/design.hpp>
#include <diffnea/identify/identify.hpp>

namespace diffnea {

/// What a robot is identified from: recordings of the arm, and of the ball.
struct RobotData {
  double arm_seconds = 40.0;   ///< of the arm's motion [s]
  double ball_seconds = 40.0;  ///< of the ball's motion, one period [s]
  int ball_repetitions = 5;    ///< of the ball's motion, of which the mean is taken
};

/// Options of `design_excitation` for the arm: all of its limits.
DesignOptions arm_excitation(const RobotData& data, std::uint64_t seed);
/// For the ball: slow, about the posture `home` (n), and with the turns of the last joints that
/// tell the string's length from where it is tied.
DesignOptions ball_excitation(const Model& model, const VecX<double>& home, const RobotData& data,
                              std::uint64_t seed);

/// Arm and ball as fitted to the data of one robot.
struct IdentifiedRobot {
  IdentifyResult arm;  ///< of the arm without a ball
  /// Of ball and string on that arm, its joints prescribed; with the nominal ball and no estimates
  /// where the arm's fit was interrupted.
  IdentifyResult ball;
  Model model;  ///< both
};
/// @param arm   without a ball  @param ball  with it; its torques are not used: joints are
/// prescribed
/// @throws as identify
IdentifiedRobot identify_robot(const Model& nominal, const Recording& arm, const Recording& ball,
                               const std::function<bool(const FitProgress&)>& progress = {});

}  // namespace diffnea
