#pragma once
/// Held-out motion as measured and as both models simulate it.

#include <limits>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>

namespace diffnea {

/// One joint's motion over held-out windows, as measured and as simulated by both models, and for
/// how long the simulations follow it. The models' last row of each window is NaN: there the next
/// one starts.
struct SimulatedSeries {
  std::string joint;
  std::string unit;
  double noise = std::numeric_limits<double>::quiet_NaN();
  double tolerance = std::numeric_limits<double>::quiet_NaN();
  double base_follows = std::numeric_limits<double>::quiet_NaN();
  double extended_follows = std::numeric_limits<double>::quiet_NaN();
  double base_rmse = std::numeric_limits<double>::quiet_NaN();
  double extended_rmse = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> time;
  std::vector<double> measured;
  std::vector<double> base;
  std::vector<double> extended;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("SimulatedSeries",
              "One joint's held-out motion, measured and simulated, and for how long a simulation "
              "follows it.",
              {.files = kInSeries, .columns = true});
    list.field("joint", &SimulatedSeries::joint, "Its name in the model.", {.files = kInBoth});
    list.field("unit", &SimulatedSeries::unit, "Of the position: ``rad``, ``m``.",
               {.files = kInBoth});
    list.field("noise", &SimulatedSeries::noise,
               "Standard deviation of its sensor's noise, quantisation included.",
               {.unit = "unit", .files = kInResult});
    list.field(
        "tolerance", &SimulatedSeries::tolerance,
        "Error within which a simulation follows: three times the noise, or 1 % of the range "
        "of the held-out motion, whichever is more.",
        {.unit = "unit", .files = kInResult});
    list.field("base_follows", &SimulatedSeries::base_follows,
               "How long the base model follows this joint; 0: not even for the shortest horizon.",
               {.unit = "s", .key = "follows.base", .files = kInResult});
    list.field("extended_follows", &SimulatedSeries::extended_follows,
               "The same of the extended model.",
               {.unit = "s", .key = "follows.extended", .files = kInResult});
    list.field("base_rmse", &SimulatedSeries::base_rmse,
               "Root mean square error over the windows that are drawn [unit]; NaN: none.",
               {.key = "rmse_base", .files = kInResult});
    list.field("extended_rmse", &SimulatedSeries::extended_rmse, "The same of the extended model.",
               {.key = "rmse_extended", .files = kInResult});
    list.field("time", &SimulatedSeries::time, "(M,) [s]; windows follow each other.");
    list.field("measured", &SimulatedSeries::measured, "Position.", {.unit = "unit"});
    list.field("base", &SimulatedSeries::base, "(M,) of the base model; NaN where a window ends.");
    list.field("extended", &SimulatedSeries::extended, "(M,) of the extended model; NaN likewise.");
  }
};

/// Errors of both models over windows of one length. Where a window falls apart, its error is no
/// more than that of a joint at rest in the middle of its motion.
struct SimulatedHorizon {
  double horizon = 0.0;
  int windows = 0;
  int base_apart = 0;
  int extended_apart = 0;
  double base = std::numeric_limits<double>::quiet_NaN();
  double extended = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> base_rmse;
  std::vector<double> extended_rmse;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("SimulatedHorizon",
              "Errors of simulated positions over held-out windows of one length.",
              {.files = kInResult});
    list.field("horizon", &SimulatedHorizon::horizon, "Length of the windows.", {.unit = "s"});
    list.field("windows", &SimulatedHorizon::windows, "Number of windows.");
    list.field(
        "base_apart", &SimulatedHorizon::base_apart,
        "Windows in which the base model's simulation falls apart: it blows up, or its error "
        "exceeds the joint's motion about its mean.",
        {.key = "apart.base"});
    list.field("extended_apart", &SimulatedHorizon::extended_apart,
               "The same of the extended model.", {.key = "apart.extended"});
    list.field(
        "base", &SimulatedHorizon::base,
        "Largest of all joints' errors over their tolerance, base model; NaN: not simulated.");
    list.field("extended", &SimulatedHorizon::extended, "The same of the extended model.");
    list.field("base_rmse", &SimulatedHorizon::base_rmse,
               "Root mean square error of each of ``joints``, base model.");
    list.field("extended_rmse", &SimulatedHorizon::extended_rmse, "The same, extended model.");
  }
};

/// A window in which a simulation falls apart.
struct ApartWindow {
  std::string model;
  std::string joint;
  int run = 0;
  double time = 0.0;
  double horizon = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ApartWindow", "A held-out window in which a simulation falls apart.",
              {.files = kInResult});
    list.field("model", &ApartWindow::model, "``base`` or ``extended``.");
    list.field("joint", &ApartWindow::joint, "The first that leaves the measured motion.");
    list.field("run", &ApartWindow::run, "Number of the held-out recording, from 0.");
    list.field("time", &ApartWindow::time, "When it leaves, of the recording.", {.unit = "s"});
    list.field("horizon", &ApartWindow::horizon, "Length of the window.", {.unit = "s"});
  }
};

/// Held-out motion simulated by both models over windows of growing length, each from an estimated
/// first state on, driven by the measured torque.
struct SimulatedMotion {
  double base_follows = std::numeric_limits<double>::quiet_NaN();
  double extended_follows = std::numeric_limits<double>::quiet_NaN();
  double window = 0.0;
  std::vector<SimulatedHorizon> horizons;
  std::vector<ApartWindow> apart;
  std::string reason;
  std::vector<SimulatedSeries> joints;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("SimulatedMotion",
              "Held-out motion simulated over windows of growing length: for how long a simulation "
              "follows the robot.");
    list.field("base_follows", &SimulatedMotion::base_follows,
               "How long the base model follows every joint within its tolerance; 0: not even for "
               "the shortest horizon; the longest horizon: at least so long.",
               {.unit = "s", .key = "follows.base"});
    list.field("extended_follows", &SimulatedMotion::extended_follows,
               "The same of the extended model.", {.unit = "s", .key = "follows.extended"});
    list.field("horizons", &SimulatedMotion::horizons,
               "By growing length, a list of :class:`SimulatedHorizon`.");
    list.field("apart", &SimulatedMotion::apart,
               "Windows that fall apart at the shortest horizon at which a model's do, a list of "
               ":class:`ApartWindow`.");
    list.field("window", &SimulatedMotion::window,
               "Length of the windows that are drawn: beyond what the base model follows.",
               {.unit = "s"});
    list.field("reason", &SimulatedMotion::reason, "Why there is none; empty if there is.",
               {.empty_is_null = true});
    list.field("joints", &SimulatedMotion::joints, "A list of :class:`SimulatedSeries`.");
  }
};

}  // namespace diffnea
