#pragma once
/// One case of the study: a robot, a motion, sensors, and what is hidden. Everything follows from
/// family and seed.

#include <cstdint>
#include <string>
#include <vector>

#include "mechanisms.hpp"
#include "physics.hpp"

namespace hidden {

/// What the sensors add.
struct Sensors {
  double torque_noise = 0.01;      ///< standard deviation, share of each joint's torque RMS
  double corner = 0.0;             ///< of first-order coloured torque noise [Hz]; 0: white
  double torque_step = 0.0;        ///< quantisation, share of that noise's deviation; 0: none
  Eigen::VectorXd position_noise;  ///< standard deviation per joint [rad] or [m]
  Eigen::VectorXd position_step;   ///< quantisation per joint [rad] or [m]; 0: none
  bool velocities = false;         ///< qd_ columns
};

struct Case {
  std::uint64_t seed = 0;
  std::uint64_t stream = 0;  ///< of its family
  std::string family;
  World world;
  double period = 10.0;  ///< of the motion [s]
  bool repeats = true;   ///< the motion, after that; else it goes on as it likes
  double rate = 500.0, duration = 40.0;
  Sensors sensors;
  /// What the right answer is: "none", "named", "unknown", "absorbed", "audit".
  std::string kind;
  std::string base = "refit";  ///< option of diagnose that the case is made for
};

struct CaseOptions {
  double noise = 0.01, duration = 40.0, rate = 500.0;
  double position_noise = 1.0;  ///< times what is drawn
  bool repeats = true;          ///< the motion
  /// Share of its joint's torque RMS that an effect is scaled to, drawn between these (logarithm).
  double smallest = 0.003, largest = 0.1;
};

/// Names of all families: "none", the catalogue's effects, "absorbed", "outside", "two", "three".
std::vector<std::string> families();

/// @param family  one of families(); empty: drawn
/// @throws std::invalid_argument for a family that there is not
Case draw_case(std::uint64_t seed, const std::string& family, const CaseOptions& options);

/// The commanded torque that the hidden effects make up, tau − needed, where needed belongs to the
/// positions as they are reported. Rows as in `series`. [N·m]
Eigen::MatrixXd effect_torque(const World& world, const Series& series);

/// Means over a fiftieth of a second, without the padding.
Eigen::MatrixXd decimate(const Eigen::MatrixXd& padded, double rate);

/// Per joint: root mean square of the effect at 50 Hz over that of the torque.
Eigen::VectorXd effect_share(const World& world, const Series& series, double rate);

/// Root mean square of each column without the padding.
Eigen::VectorXd rms(const Eigen::MatrixXd& padded);

/// Seeds of the independent streams of a case.
enum Stream : std::uint64_t { kFamily, kDraw, kTrainMotion, kTestMotion, kTrainNoise, kTestNoise };

}  // namespace hidden
