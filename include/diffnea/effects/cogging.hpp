#pragma once

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// cogging: torque ripple over the angle, a sin(nq) + b cos(nq), of magnets and slots or of a
/// gear's teeth. n counts the periods in one turn of the joint (2π rad; 2π m at a prismatic joint),
/// hence its unit 1/rad.
struct Cogging {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "cogging",
        .formula = "a sin(n q) + b cos(n q)",
        .summary = "torque ripple over the angle",
        .place = Place::kJoint,
        .parameters = {{.name = "sine", .unit = "N*m", .unit_prismatic = "N"},
                       {.name = "cosine", .unit = "N*m", .unit_prismatic = "N"},
                       {.name = "cycles",
                        .unit = "1/rad",
                        .unit_prismatic = "1/m",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 8.0,
                        .initial_prismatic = 80.0,
                        .search = log_grid(0.5, 200.0, 121),
                        .search_prismatic = log_grid(5.0, 2000.0, 121),
                        .bound = SearchBound::kRipple}},
        .motor_side = true,
        .traits = {Trait::kAtMotor},
        .shown_over = {ShownOver::kPosition, ShownOver::kSpectrum}};
    return kInfo;
  }

  template <Scalar T>
  void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const {
    using std::cos;
    using std::sin;
    const T angle = p[2] * x.q[*joint];
    tau[*joint] += p[0] * sin(angle) + p[1] * cos(angle);
  }
};

/// The same as one wave, A sin(nq + φ).
struct CoggingWave {
  double amplitude;  ///< A [N·m] or [N], ≥ 0
  double phase;      ///< φ [rad], in (−π, π]
};
/// The wave of a sine and a cosine part, a and b [N·m] or [N].
inline CoggingWave cogging_wave(double sine, double cosine) {
  return {std::hypot(sine, cosine), std::atan2(cosine, sine)};
}

}  // namespace diffnea
