#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// encoder_scale: the encoder counts wrongly (gear ratio, lines, pulley). What is logged is (1 + ε)
/// q_true, and so with its derivatives.
struct EncoderScale {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{.name = "encoder_scale",
                                  .formula = "q_logged = (1 + eps) q",
                                  .summary = "scale of the encoder",
                                  .port = Port::kMeasurement,
                                  .parameters = {{.name = "scale_error",
                                                  .unit = "1",
                                                  .unit_prismatic = "1",
                                                  .linear = false}},
                                  .shown_over = {ShownOver::kPosition}};
    return kInfo;
  }

  static void add_to_encoder(const double* p, Encoder& encoder) { encoder.scale += p[0]; }

  void add_to_motion(const JointSeries&, int joint, const double* p, JointSeries& truth) const {
    for (RowMatX<double>* m : {&truth.q, &truth.qd, &truth.qdd}) m->col(joint) /= 1.0 + p[0];
  }
};

}  // namespace diffnea
