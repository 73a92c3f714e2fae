#include "effects/swing.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/joint_series.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"

namespace diffnea {

VecX<double> swung(const VecX<double>& f, const VecX<double>& inertia, double dt,
                   const MotorSpring<double>& spring, const Swing& start) {
  constexpr int kSubsteps = 4;
  const double K = spring.stiffness, D = spring.damping, h = dt / kSubsteps, c = 1.5 / h;
  VecX<double> out(f.size());
  double at = start.at, v = start.speed;
  const double a = (f[0] - D * v - K * at) / inertia[0];
  double v_before = v - h * a, before = at - h * (v - 0.5 * h * a);
  out[0] = at;
  for (long k = 1; k < f.size(); ++k) {
    for (int i = 1; i <= kSubsteps; ++i) {
      const double share = static_cast<double>(i) / kSubsteps;
      const double M = (1.0 - share) * inertia[k - 1] + share * inertia[k];
      const double push = (1.0 - share) * f[k - 1] + share * f[k];
      // δ̇ = c δ + r, δ̈ = c δ̇ + s at the end of the step.
      const double r = (before - 4.0 * at) / (2.0 * h), s = (v_before - 4.0 * v) / (2.0 * h);
      const double next = (push - M * (c * r + s) - D * r) / ((M * c + D) * c + K);
      before = at, at = next;
      v_before = v, v = c * at + r;
    }
    out[k] = at;
  }
  return out;
}

Swing led(const VecX<double>& f, const VecX<double>& inertia, double dt,
          const MotorSpring<double>& spring) {
  const VecX<double> rate = derivative(f, dt), bend = derivative(rate, dt);
  const double v = rate[0] / spring.stiffness;
  return {(f[0] - inertia[0] * bend[0] / spring.stiffness - spring.damping * v) / spring.stiffness,
          v};
}

Swing started(const VecX<double>& f, const VecX<double>& torque, const VecX<double>& inertia,
              double dt, const MotorSpring<double>& spring) {
  constexpr double kLeastRows = 8.0, kDecays = 3.0;
  const double period = 2.0 * kPi * std::sqrt(inertia[0] / spring.stiffness);
  // Over one period, what else the model lacks looks like a start.
  const double lasts = 2.0 * kDecays * inertia[0] / spring.damping;
  const double rows = std::max(std::max(period, lasts) / dt, kLeastRows);
  const long n = rows < static_cast<double>(f.size()) ? std::lround(rows) : f.size();
  const VecX<double> M = inertia.head(n), none = VecX<double>::Zero(n);
  const auto transmitted = [&](const VecX<double>& push, const Swing& start) {
    const VecX<double> wound = swung(push, M, dt, spring, start);
    return VecX<double>(spring.stiffness * wound + spring.damping * derivative(wound, dt));
  };
  const double speed = std::sqrt(spring.stiffness / inertia[0]);  // both columns of like size
  MatX<double> free(n, 2);
  free << transmitted(none, {1.0, 0.0}), transmitted(none, {0.0, speed});
  const VecX<double> x =
      free.colPivHouseholderQr().solve(torque.head(n) - transmitted(f.head(n), {}));
  return {x[0], speed * x[1]};
}

}  // namespace diffnea
