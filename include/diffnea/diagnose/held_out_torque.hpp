#pragma once
/// Held-out errors of each joint, in numbers and to draw.

#include <limits>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>

namespace diffnea {

/// Held-out error of one joint through the steps [N·m] or [N], RMS over the rows in which it moves;
/// of joint `ball`: of its position along one axis [m].
struct JointGain {
  std::string joint;
  std::string unit;
  double torque_rms = 0.0;
  double base = 0.0;
  double extended = 0.0;
  double noise_floor = 0.0;
  double described = std::numeric_limits<double>::quiet_NaN();

  template <class List>
  static constexpr void fields(List& list) {
    list.type("JointGain",
              "Root mean square of one joint's held-out error: of its torque [N·m] or [N]; where "
              "commands "
              "lead it and no torque was recorded, of its position [rad] or [m].");
    list.field("joint", &JointGain::joint, "Its name, or ``ball``.");
    list.field("unit", &JointGain::unit, "Of all: ``N*m``, ``N``; of positions ``rad``, ``m``.");
    list.field("torque_rms", &JointGain::torque_rms,
               "Of the measured torque; of a position, about its mean.");
    list.field("base", &JointGain::base, "Of the base model, refitted as ``base`` allows.");
    list.field("extended", &JointGain::extended, "With all causes.");
    list.field("noise_floor", &JointGain::noise_floor,
               "Of the torque's or the encoder's noise; ``ball``: what nothing removes.");
    list.field("described", &JointGain::described,
               "Of the model as it came, its drives not fitted; null: they always are, or it has "
               "none.",
               {.optional = true});
  }
};

/// Residuals of one joint over the held-out rows, for plots; rows of several recordings one after
/// the other.
struct ResidualSeries {
  std::string joint;
  std::string unit;
  std::vector<double> time;
  std::vector<double> measured;
  std::vector<double> base;
  std::vector<double> extended;
  std::vector<double> q;
  std::vector<double> qd;
  std::vector<double> qdd;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ResidualSeries",
              "Torque of one joint over the held-out rows, filtered and decimated.",
              {.columns = true, .most_rows = 4000});
    list.field("joint", &ResidualSeries::joint, "Its name in the model.");
    list.field("unit", &ResidualSeries::unit, "Of the torques: ``N*m``, ``N``.");
    list.field("time", &ResidualSeries::time, "Of the recording.", {.unit = "s"});
    list.field("measured", &ResidualSeries::measured, "Torque, filtered and decimated.",
               {.unit = "unit"});
    list.field("base", &ResidualSeries::base, "The base model's prediction of it.");
    list.field("extended", &ResidualSeries::extended, "(M,) of the model with all causes.");
    list.field("q", &ResidualSeries::q, "Filtered position [rad] or [m].");
    list.field("qd", &ResidualSeries::qd, "Its velocity [rad/s] or [m/s].");
    list.field("qdd", &ResidualSeries::qdd, "Its acceleration [rad/s²] or [m/s²].");
  }
};

}  // namespace diffnea
