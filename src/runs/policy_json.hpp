#pragma once
/// What files of policies, of searches and of their runs share. Every number is exact.

#include <optional>

#include <diffnea/experiment/ball_in_cup.hpp>

#include "runs/fields_json.hpp"

namespace diffnea {

/// Key `simulator` of a task.
struct SimulatorFile {
  ControllerOptions controller;
  double arm_step = 0.0;
  double ball_step = 0.0;
  double settle_time = 0.0;
  double least_upright = 0.0;
  std::string instruction_set;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Simulator", "How the model is simulated.", {.exact = true});
    list.field("controller", &SimulatorFile::controller, "The robot has the same.");
    list.field("arm_step", &SimulatorFile::arm_step, "At most.", {.unit = "s"});
    list.field("ball_step", &SimulatorFile::ball_step, "At most.", {.unit = "s"});
    list.field("settle_time", &SimulatorFile::settle_time,
               "Time that the arm holds its start before time 0.", {.unit = "s"});
    list.field("least_upright", &SimulatorFile::least_upright,
               "The cup is upside down where its axis' z is less.");
    list.field("instruction_set", &SimulatorFile::instruction_set,
               "Of the processor; empty: the best.");
  }
};

/// Key `task` of a run: all that is not a model.
struct TaskFile {
  VecX<double> start;
  PrompSpec primitive;
  ErepsOptions search;
  double weight_std = 0.0;
  double nominal_string = 0.0;
  BallInCupOptions reward;
  SimulatorFile simulator;
  std::optional<RobustOptions> robust;
  std::optional<NetworkSource> ball_network;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Task", "What was learned, and where.", {.exact = true});
    list.field("start", &TaskFile::start, "Posture q_0 of all joints [rad] or [m].");
    list.field("primitive", &TaskFile::primitive, "The movement primitive.");
    list.field("search", &TaskFile::search, "How the search went.");
    list.field("weight_std", &TaskFile::weight_std, "Of the first Gaussian's weights.",
               {.unit = "rad"});
    list.field("nominal_string", &TaskFile::nominal_string,
               "The string that is on the robot; 0: not said.", {.unit = "m"});
    list.field("reward", &TaskFile::reward, "Its weights and lengths.");
    list.field("simulator", &TaskFile::simulator, "How the model is simulated.");
    // Where they are not asked for, files and fingerprints are those of a search that knows none.
    list.field("robust", &TaskFile::robust, "Draws that samples are executed in, where asked for.",
               {.absent = true});
    list.field("ball_network", &TaskFile::ball_network,
               "Network that moved the ball, where one did.", {.absent = true});
  }
};

namespace io {

TaskFile task_file(const BallInCup& task);
/// @param joints  of the model
/// @throws ModelError if no primitive, controller or simulator can be so
LearnOptions read_task(JsonObject& root, long joints);
/// Which network the task has; empty: none.
NetworkSource read_task_network(JsonObject& root);

/// @param where  of the key, for messages  @throws ModelError if no primitive can be so
void check_primitive(const PrompSpec& spec, const std::string& where);
/// @throws ModelError if gains are not those of the joints, or the rate is none
void check_controller(const ControllerOptions& options, long joints, const std::string& where);
/// @param where  of the object that holds mean and covariance
/// @throws ModelError if it is not positive definite, or has another size
void check_gaussian(const Gaussian& g, long size, const std::string& where);
/// Iterations are numbered from 1.
void number_iterations(std::vector<ErepsIteration>& history);

}  // namespace io
}  // namespace diffnea
