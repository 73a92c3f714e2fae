#pragma once

#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// encoder_offset: the encoder's zero is not the model's. What is logged is q_true + δ.
struct EncoderOffset {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "encoder_offset",
        .formula = "q_logged = q + delta",
        .summary = "zero of the encoder",
        .port = Port::kMeasurement,
        .parameters = {{.name = "offset", .unit = "rad", .unit_prismatic = "m", .linear = false}},
        .shown_over = {ShownOver::kPosition}};
    return kInfo;
  }

  static void add_to_encoder(const double* p, Encoder& encoder) { encoder.offset += p[0]; }

  void add_to_motion(const JointSeries&, int joint, const double* p, JointSeries& truth) const {
    truth.q.col(joint).array() -= p[0];
  }
};

}  // namespace diffnea
