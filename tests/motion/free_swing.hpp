#pragma once
/// A pendulum that swings freely, integrated here, without the library's dynamics: the model of
/// models/pendulum.json with known friction.

#include <cmath>
#include <string>
#include <vector>

#include <diffnea/core/random.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/recording/recording.hpp>

namespace diffnea::test {

struct FreeSwing {
  double coulomb = 4e-4;    ///< [N·m]
  double quadratic = 3e-5;  ///< [N·m·s²/rad²]
  double viscous = 0.0;     ///< [N·m·s/rad]
  double smoothing = 0.01;  ///< v₀ of dry friction [rad/s], the effects' default
  double q0 = 0.6;          ///< [rad]
  double qd0 = 0.0;         ///< [rad/s]
  double noise = 2e-4;      ///< of the positions [rad]
  unsigned seed = 1;
};

/// Inertia about the joint [kg·m²] and torque of gravity at 90° [N·m] of models/pendulum.json.
inline constexpr double kSwingInertia = 0.00159 + 0.107 * 0.23 * 0.23;
inline constexpr double kSwingGravity = 0.107 * 9.81 * 0.23;

/// Positions at these times, steps of 0.1 ms: exact to 1e-9 rad.
inline Recording free_swing(const FreeSwing& swing, const std::vector<double>& times) {
  const auto rate = [&](double q, double v) {
    return -(kSwingGravity * std::sin(q) + swing.viscous * v +
             swing.coulomb * std::tanh(v / swing.smoothing) + swing.quadratic * v * std::abs(v)) /
           kSwingInertia;
  };
  Rng rng(swing.seed);
  double q = swing.q0, v = swing.qd0, t = times.front();
  Recording out;
  out.source = "free swing";
  out.joint_names = {"pendulum"};
  out.info.passive = {"pendulum"};
  const long n = static_cast<long>(times.size());
  out.time = Eigen::Map<const VecX<double>>(times.data(), n);
  out.q.resize(n, 1);
  out.tau = RowMatX<double>::Zero(n, 1);
  out.has_tau = {false};
  for (long k = 0; k < n; ++k) {
    const double to = times[static_cast<std::size_t>(k)];
    const int steps = static_cast<int>(std::ceil((to - t) / 1e-4));
    const double h = steps > 0 ? (to - t) / steps : 0.0;
    for (int s = 0; s < steps; ++s) {
      const double a1 = rate(q, v), v2 = v + 0.5 * h * a1;
      const double a2 = rate(q + 0.5 * h * v, v2), v3 = v + 0.5 * h * a2;
      const double a3 = rate(q + 0.5 * h * v2, v3), v4 = v + h * a3;
      const double a4 = rate(q + h * v3, v4);
      q += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
      v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    }
    t = to;
    out.q(k, 0) = q + swing.noise * rng.normal();
  }
  return out;
}

/// Times from `from` on at an even rate.
inline std::vector<double> even_times(double from, double seconds, double rate) {
  std::vector<double> out;
  for (long k = 0; static_cast<double>(k) / rate <= seconds; ++k)
    out.push_back(from + static_cast<double>(k) / rate);
  return out;
}

inline Model swing_model() {
  return read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/pendulum.json");
}

}  // namespace diffnea::test
