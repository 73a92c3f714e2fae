#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// session_offset: a constant in the measured torque, another one in every recording (strain gauges
/// and current sensors drift between sessions). Its parameters are named after the runs: offset_0,
/// offset_3.
struct SessionOffset {
  std::vector<int> runs;  ///< parameter k belongs to run runs[k]

  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "session_offset",
        .formula = "c_run",
        .summary = "offset of the torque that changes from run to run",
        .place = Place::kJoint,
        .parameters = {{.name = "offset", .unit = "N*m", .unit_prismatic = "N", .per_run = true}},
        .traits = {Trait::kOfDrive, Trait::kAtMotor},
        .reads = Reads::kNothing,
        .shown_over = {ShownOver::kTime}};
    return kInfo;
  }

  /// One parameter for each run.
  void complete(const BoundSetting& setting) { runs = setting.runs; }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    for (std::size_t k = 0; k < runs.size(); ++k)
      if (runs[k] == x.run) tau[*joint] += p[k];
  }
};

}  // namespace diffnea
