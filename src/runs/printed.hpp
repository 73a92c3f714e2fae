#pragma once
/// Output of commands that leave no run (--json), as described values.

#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>

namespace diffnea {

/// `diffnea simulate`.
struct SimulatedFile {
  std::string recording;
  long runs = 1;
  long rows = 0;
  double seconds = 0.0;
  std::vector<std::string> joints;
  std::vector<std::string> passive;
  long saturated_rows = 0;
  std::string failure;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Simulate", "A recording that was simulated.");
    list.field("recording", &SimulatedFile::recording, "File that it was written to.");
    list.field("runs", &SimulatedFile::runs, "Flights of a robot that floats; else 1.",
               {.optional = true});
    list.field("rows", &SimulatedFile::rows, "Of the recording, all runs.");
    list.field("seconds", &SimulatedFile::seconds, "Time of a run's last row.", {.unit = "s"});
    list.field("joints", &SimulatedFile::joints, "In the order of the columns.");
    list.field("passive", &SimulatedFile::passive, "Joints without a motor.");
    list.field("saturated_rows", &SimulatedFile::saturated_rows,
               "Rows where a torque met its limit.");
    list.field("failure", &SimulatedFile::failure,
               "Why the simulation ended early, after the last row; null: it did not.",
               {.empty_is_null = true});
  }
};

/// Motion of one joint in an excitation.
struct ExcitedJoint {
  std::string joint;
  double lowest = 0.0;
  double highest = 0.0;
  double fastest = 0.0;
  double position = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;
  double torque = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ExcitedJoint", "Motion of one joint, and what it uses of its limits.");
    list.field("joint", &ExcitedJoint::joint, "Its name.");
    list.field("lowest", &ExcitedJoint::lowest, "Smallest position [rad] or [m].");
    list.field("highest", &ExcitedJoint::highest, "Largest position [rad] or [m].");
    list.field("fastest", &ExcitedJoint::fastest, "Largest speed [rad/s] or [m/s].");
    list.field("position", &ExcitedJoint::position, "Share of the allowed range.",
               {.key = "limits_used.position"});
    list.field("velocity", &ExcitedJoint::velocity, "Share of the velocity limit.",
               {.key = "limits_used.velocity"});
    list.field("acceleration", &ExcitedJoint::acceleration, "Share of the acceleration limit.",
               {.key = "limits_used.acceleration"});
    list.field("torque", &ExcitedJoint::torque,
               "Share of the torque limit, by the model with its effects; null: none is known.",
               {.key = "limits_used.torque", .empty_is_null = true});
  }
};

/// `diffnea excite`.
struct ExcitedFile {
  std::string trajectory;
  long rows = 0;
  double seconds = 0.0;
  double period = 0.0;
  std::vector<ExcitedJoint> joints;
  int base_parameters = 0;
  double log_det = 0.0;
  double random_log_det = 0.0;
  double condition = 0.0;
  double random_condition = 0.0;
  double std_ratio = 0.0;
  double best_std_ratio = 0.0;
  double worst_std_ratio = 0.0;
  int iterations = 0;
  bool interrupted = false;
  std::vector<std::string> notes;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Excite", "An informative motion, and what it gains.");
    list.field("trajectory", &ExcitedFile::trajectory, "File that it was written to.");
    list.field("rows", &ExcitedFile::rows, "Of the file.");
    list.field("seconds", &ExcitedFile::seconds, "Time of its last row.", {.unit = "s"});
    list.field("period", &ExcitedFile::period, "After which the motion repeats.", {.unit = "s"});
    list.field("joints", &ExcitedFile::joints, "Joints with a motor.");
    list.field("base_parameters", &ExcitedFile::base_parameters,
               "Combinations of parameters that torques depend on.",
               {.key = "information.base_parameters"});
    list.field("log_det", &ExcitedFile::log_det,
               "Of the information about them, columns scaled to one over random states.",
               {.key = "information.log_det"});
    list.field("random_log_det", &ExcitedFile::random_log_det, "Of the median random motion.",
               {.key = "information.random_log_det"});
    list.field("condition", &ExcitedFile::condition, "Of the scaled regressor.",
               {.key = "information.condition"});
    list.field("random_condition", &ExcitedFile::random_condition,
               "The same of the median random motion.", {.key = "information.random_condition"});
    list.field("std_ratio", &ExcitedFile::std_ratio,
               "Expected standard errors over those of the median random motion, geometric mean.",
               {.key = "information.std_ratio"});
    list.field("best_std_ratio", &ExcitedFile::best_std_ratio, "Smallest ratio of one parameter.",
               {.key = "information.std_ratio_range[0]"});
    list.field("worst_std_ratio", &ExcitedFile::worst_std_ratio, "Largest ratio of one parameter.",
               {.key = "information.std_ratio_range[1]"});
    list.field("iterations", &ExcitedFile::iterations, "Generations of the search.");
    list.field("interrupted", &ExcitedFile::interrupted, "It was stopped; the best so far.");
    list.field("notes", &ExcitedFile::notes, "What stands in for limits that are not known.");
  }
};

/// `diffnea export`.
struct ExportedFile {
  std::string from;
  std::string to;
  std::string format;
  std::vector<std::string> left_out;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Export", "A model in another format.");
    list.field("from", &ExportedFile::from, "The model or run, as it was named.");
    list.field("to", &ExportedFile::to, "File that was written.");
    list.field("format", &ExportedFile::format, "By the file's ending.",
               {.choices = "json|urdf|mjcf"});
    list.field("left_out", &ExportedFile::left_out,
               "What the format cannot hold, one phrase each: ``stribeck_friction at elbow``.");
  }
};

/// `diffnea report`.
struct ReportedFile {
  std::string page;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Report", "A page that was built again.");
    list.field("page", &ReportedFile::page, "The file.");
  }
};

}  // namespace diffnea
