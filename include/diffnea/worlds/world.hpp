#pragma once
/// Worlds by name, as the command line writes them: `mujoco:wam4,perturb=A,seed=3,noise=0`, and the
/// recordings that they give.

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <diffnea/sim/mujoco_simulator.hpp>
#include <diffnea/sim/mujoco_world.hpp>
#include <diffnea/worlds/surrogate.hpp>

namespace diffnea {

/// A string with mass: a chain of capsules, two hinges with damping between every two.
struct Rope {
  double mass = 1.2e-3;   ///< of the whole string [kg]
  double damping = 5e-5;  ///< of a hinge [N·m·s/rad]
  int links = 24;         ///< capsules, all of one length
};

/// A robot in MuJoCo that may differ from its description.
struct WorldSpec {
  std::filesystem::path mjcf;  ///< the description
  Perturbation perturbation;   ///< that the robot is drawn from
  /// Of the perturbation and the noise; not given: the command's.
  std::optional<std::uint64_t> seed;
  std::vector<EffectSpec> effects;  ///< that the robot has; in place of a drawn one at that place
  double noise = 1.0;               ///< factor on the sensors' noise
  std::optional<Rope> rope;         ///< chain that the ball hangs on; none: the document's tendon
  std::optional<double> string;     ///< length of the world's string [m]; none: as it was drawn
  std::optional<double> nominal_string;  ///< that the drawn one differs from; none: the document's
  bool has_ball = true;                  ///< false: the ball is left out
  int repetitions = 1;  ///< of the motion, each from rest, that a recording averages
};

/// Parses `mujoco:NAME[,key=value…]`. NAME is a path to an MJCF, or the name of a model that
/// find_model_file knows. Keys: `perturb` = none, A (default), B, C or
/// PATH.json (worlds/surrogate.hpp); `seed`; `noise` (factor,
/// default 1); `repetitions`; `effect` = `NAME@WHERE:PARAMETER=VALUE+…`, once each; of a ball
/// `ball` = tendon (default), chain, none, `rope` = heavy, mid (default), light, none, `string`,
/// `nominal_string` [m], `tilt` (largest, of a cup [rad]).
/// @throws Error listing what there is
WorldSpec parse_world(const std::string& text);

/// Where policies are tried unless another world is named: a WAM drawn from surrogate A, its ball
/// on a rope with mass. The seed is part of the name: every command draws the same robot.
inline constexpr const char* kBallInCupWorld = "mujoco:wam4_ball_in_cup,perturb=A,rope=mid,seed=3";

/// Clauses on how the world's robot may differ from its description, e.g. "masses −8…+20 %": ranges
/// of the perturbation, effects, rope. Empty: the world is its description.
std::vector<std::string> differences(const WorldSpec& world);

/// The document with a rotor for every elastic joint of `truth` and a tendon between the two, as
/// record_in_mujoco and MujocoSimulator ask for; the document itself where there is none.
/// @throws ModelError if such a joint has no name in the document
std::string with_rotors(const std::string& mjcf, const Model& truth);

/// What a world gave, and the robot that it was.
struct WorldRecording {
  SimulatedRecording result;  ///< mean of the repetitions
  Model truth;                ///< the robot as it was drawn
};
/// Draws the world's robot and records it: record_in_mujoco with the ball that the world asks for,
/// a base that floats held where the document has it and without contacts, repetitions averaged
/// (each with noise of its own). The noise of `options` is taken as it is.
/// @param seed     of robot and noise; where the world has one of its own, that is the robot's
/// @param threads  that repetitions are divided among; the result does not depend on it
/// @param number   of several recordings of one robot: every number has noise of its own. By
///   default 0, or `seed` where that is not the robot's
/// @throws as record_in_mujoco; ModelError if the world asks for a ball that the document has not
WorldRecording record_in_world(const WorldSpec& world, const Model& controller,
                               const Trajectory& trajectory, RecordOptions options,
                               std::uint64_t seed, int threads = 1,
                               std::optional<std::uint64_t> number = {});

/// Flights that a world gave, and the robot that flew them.
struct WorldFlights {
  std::vector<SimulatedRecording> flights;  ///< one a run
  Model truth;  ///< the robot as it was drawn
};
/// Draws the world's robot and throws it: record_flights, without contacts. The noise of `options`
/// is taken as it is.
/// @param controller  a model that floats
/// @param seed  of robot and noise; where the world has one of its own, that is the robot's
/// @throws as record_flights; Error if the world asks for repetitions
WorldFlights record_flights_in_world(const WorldSpec& world, const Model& controller,
                                     const Trajectory& trajectory, RecordOptions options,
                                     std::uint64_t seed);

/// Draws the world's robot as record_in_world does, for policies to act in. `repetitions` and
/// `noise` are the caller's: the noise of `options` is taken as it is.
/// @param seed   of the robot, where the world has none of its own; noises are seeded by Starts
/// @param truth  gets the robot that was drawn
/// @throws as MujocoSimulator; ModelError if the world asks for a ball that the document has not
std::unique_ptr<Simulator> make_simulator(const WorldSpec& world, const Model& controller,
                                          MujocoSimulatorOptions options, std::uint64_t seed,
                                          Model* truth = nullptr);

/// Folders with the models that come with the program, in the order they are searched:
/// $DIFFNEA_MODELS, the folder share/diffnea/models beside the command or of the installation, the
/// source tree it was built from.
std::vector<std::filesystem::path> model_folders();

/// Models in those folders by name; the first folder that has a name wins.
std::map<std::string, std::filesystem::path> list_models(
    const std::vector<std::string>& extensions);

/// What `diffnea worlds` says: the worlds there are, and their keys. As JSON: schema
/// "diffnea/worlds/1".
std::string worlds_text();
/// The worlds there are, as `diffnea worlds --json` prints them.
std::string worlds_json();

/// `wam4` → …/wam4.xml; a path that exists is returned as it is.
/// @param extensions  those that will do, e.g. {".xml"}
/// @throws FileError listing the models there are
std::filesystem::path find_model_file(const std::string& name,
                                      const std::vector<std::string>& extensions);

}  // namespace diffnea
