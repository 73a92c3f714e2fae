#pragma once
/// Residuals of the constrained loss at one sample, each over its noise. Internal to identify/.

#include <vector>

#include <diffnea/core/softplus.hpp>
#include <diffnea/identify/constrained_loss.hpp>

namespace diffnea {

/// Numbers of a body's motion: place and turn, three each, and their two derivatives.
inline constexpr int kPerBody = 18;

/// How a sample enters the cost, taken at one point and then kept.
struct Weighing {
  bool counts = true;      ///< smoothed within one motion
  std::vector<bool> acts;  ///< per row
};

/// Standard deviation of a row's derivative of order d, of those of its bodies. Parameters move it:
/// a distance over its noise is one in the space of what was measured, as of total least squares.
template <class T>
T row_noise(const ConstraintRow<T>& row, const std::vector<BodyNoise>& noise, std::size_t d) {
  using std::sqrt;
  T square(0.0);
  for (std::size_t s = 0; s < kMostBodies; ++s) {
    if (row.bodies[s] == kWorld) continue;
    const BodyNoise& of = noise[static_cast<std::size_t>(row.bodies[s])];
    square = square + dot(row.J[s].torque, row.J[s].torque) * T(of.angle[d] * of.angle[d]) +
             dot(row.J[s].force, row.J[s].force) * T(of.position[d] * of.position[d]);
  }
  return sqrt(square);
}

/// Accelerations under the rows that act, and their forces.
template <class T>
ConstrainedAcceleration<T> predicted(const ConstrainedSystem<T>& s,
                                     const std::vector<ConstraintRow<T>>& rows) {
  return held_acceleration<T>(s.bodies, s.states, s.applied, s.accelerations, rows, s.gravity);
}

/// Residuals of a sample over their noise.
template <class T>
std::vector<T> residuals(const ConstrainedSystem<T>& system, const std::vector<BodyNoise>& noise,
                         const Weighing& weighing, const std::array<double, 3>& lambda) {
  std::vector<T> out;
  const auto put = [&out](const T& x, double weight) { out.push_back(x * T(weight)); };
  const auto put_three = [&put](const Vec3<T>& x, double weight) {
    put(x.x, weight), put(x.y, weight), put(x.z, weight);
  };
  std::vector<ConstraintRow<T>> acting;
  for (std::size_t i = 0; i < system.rows.size(); ++i)
    if (weighing.acts[i]) acting.push_back(system.rows[i]);
  const std::vector<Twist<T>> model = predicted(system, acting).Vd;
  for (std::size_t b = 0; b < model.size(); ++b) {
    const BodyKind kind = system.bodies[b].kind;
    if (kind == BodyKind::kPrescribed) continue;
    put_three(system.accelerations[b].linear - model[b].linear, 1.0 / noise[b].position[2]);
    if (kind == BodyKind::kRigid)
      put_three(system.accelerations[b].angular - model[b].angular, 1.0 / noise[b].angle[2]);
  }
  for (std::size_t i = 0; i < system.rows.size(); ++i) {
    const ConstraintRow<T>& row = system.rows[i];
    const auto over_noise = [&](const T& x, std::size_t order) {
      put(x / row_noise(row, noise, order), std::sqrt(lambda[order]));
    };
    if (!weighing.acts[i]) {  // softplus leaves half of the noise at g = 0
      const double sharp = 2.0 * std::log(2.0);
      put(softplus((row.g / row_noise(row, noise, 0)) * T(sharp)), std::sqrt(lambda[0]) / sharp);
      continue;
    }
    over_noise(row.g, row.of_velocity ? 1 : 0);
    if (!row.of_velocity) over_noise(row.gd, 1);
    over_noise(detail::along(row, system.accelerations) + row.bias, 2);
  }
  return out;
}

/// Jets by a share of the parameters. @param first  the first of them
inline VecX<JetD> seeded(const VecX<double>& p, Eigen::Index first) {
  VecX<JetD> out(p.size());
  for (Eigen::Index k = 0; k < p.size(); ++k)
    out[k] =
        k >= first && k < first + kJetWidth ? JetD(p[k], static_cast<int>(k - first)) : JetD(p[k]);
  return out;
}

}  // namespace diffnea
