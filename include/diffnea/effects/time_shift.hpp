#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>

namespace diffnea {

/// time_shift: clocks of motion and torque differ. What is logged of the motion at t is what
/// happened at t − d; beside the torque of t belongs the motion logged at t + d. Bind it at `all`
/// if one clock serves all joints.
struct TimeShift {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "time_shift",
        .formula = "q_logged(t) = q(t - d)",
        .summary = "motion that is logged later than the torque beside it",
        .port = Port::kMeasurement,
        .parameters = {{.name = "shift", .unit = "s", .unit_prismatic = "s", .linear = false}},
        .traits = {Trait::kOfDrive, Trait::kShared},
        .shown_over = {ShownOver::kTorqueRate, ShownOver::kCorrelation}};
    return kInfo;
  }

  static double clock_shift(const double* p) { return p[0]; }

  void add_to_motion(const JointSeries& x, int joint, const double* p, JointSeries& truth) const {
    for (RowMatX<double>* m : {&truth.q, &truth.qd, &truth.qdd})
      m->col(joint) = shifted(m->col(joint), x.dt, p[0]);
  }
};

}  // namespace diffnea
