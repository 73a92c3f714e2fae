#pragma once
/// One case: a rig, its motions, its sensors, and what is hidden. Everything follows from family
/// and seed.

#include <cstdint>
#include <string>
#include <vector>

#include "effects.hpp"

namespace rigs {

struct Sensors {
  Eigen::VectorXd position_step, position_noise;  ///< [rad] or [m]
  double torque_noise = 0.01;                     ///< deviation, share of each joint's torque RMS
  double corner = 0.0;                            ///< corner of its colour [Hz]; 0: white
  int slow_positions = 1, slow_torques = 1;       ///< rows between refreshes
  double jitter = 0.0;                            ///< deviation of the instants, share of a period
  bool middle = false, centred = false;           ///< instants of the torque, see Sampling
  Eigen::VectorXd constant;                       ///< N·m/A where currents are logged; else empty
  bool velocities = false, commands = false;      ///< columns qd_, qcmd_
};

struct Case {
  std::uint64_t seed = 0, stream = 0;
  std::string family, kind, base = "refit";
  Rig rig;
  Arm nominal;
  bool urdf = false;
  MotionPlan plan;
  std::string layout;        ///< "one", "several", "heap" of runs
  std::vector<double> runs;  ///< length of each [s]
  double rate = 500.0;       ///< rows of the log [Hz]
  Sensors sensors;
  Usual usual;
  std::vector<Effect> effects;
  std::vector<double> targets;  ///< sizes that the effects were scaled to
};

struct CaseOptions {
  double noise = 0.0;                      ///< torque noise, share; 0: drawn
  double duration = 0.0;                   ///< length of a recording in one run [s]; 0: drawn
  bool repeats = true;                     ///< motions may be periodic
  double smallest = 0.003, largest = 0.1;  ///< RMS of an effect over that of its joint's torque
};

struct Recording {
  std::vector<Sampling> samplings;
  std::vector<Track> tracks;  ///< one a run
};

/// Random streams of a case; each run of a recording has its own kStreams after them.
enum Stream : std::uint64_t { kWhat = 1, kTrain = 2, kTest = 3, kInstants = 4, kStreams = 16 };

/// "none", the catalogue's joint effects, "absorbed", "outside", "two", "three".
std::vector<std::string> families();

/// @param attempt  another draw of the same family and seed
/// @throws std::invalid_argument for a family that there is not
Case draw_case(std::uint64_t seed, int attempt, const std::string& family,
               const CaseOptions& options);

/// Strength of one effect, so that it has that size by itself along a part of the motion.
void scale_effect(Case& c, std::size_t which, double target);

/// @throws std::runtime_error where the machine leaves its motion or its drives chatter
Recording record(const Case& c, bool is_test);

/// Lets the hidden effects act at their strengths.
Rig with_effects(const Case& c);

/// Means over 20 ms of one of a track's series, all runs below each other.
Eigen::MatrixXd at_50_hz(const Recording& recording, Eigen::MatrixXd Track::* series);
Eigen::VectorXd root_mean_square(const Eigen::MatrixXd& x);
/// RMS of the hidden torque over that of the logged one, per joint; of a joint without a drive over
/// what gravity asks of it.
Eigen::VectorXd effect_share(const Case& c, const Recording& recording);

}  // namespace rigs
