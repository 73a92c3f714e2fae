#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/promp.hpp>

namespace diffnea {
namespace {

constexpr double kLongest = 3600.0;  ///< [s]: beyond, a slip of the pen
constexpr int kMost = 1000;          ///< joints, and bases of each: likewise

void require_promp(bool ok, const std::string& what) {
  if (!ok) throw Error("ProMP: " + what);
}

/// Normalised radial bases n_b and dn_b/ds at phase s. Centres b/(B − 1): both ends are centres.
void radial_bases(const PrompSpec& spec, double s, VecX<double>& n, VecX<double>& n_d) {
  const long B = spec.bases;
  const double spacing = 1.0 / static_cast<double>(B - 1), sigma = spec.width * spacing;
  const VecX<double> from_centre =
      (s - VecX<double>::LinSpaced(B, 0.0, 1.0).array()) / sigma;  // in σ
  // Less the largest exponent: narrow bases all vanish between two centres.
  const VecX<double> exponent = -0.5 * from_centre.array().square();
  n = (exponent.array() - exponent.maxCoeff()).exp();
  n /= n.sum();
  // n' = n (e' − Σ n e'), e' = −(s − c)/σ²
  n_d = n.array() * (n.dot(from_centre) - from_centre.array()) / sigma;
}

/// Cubic Hermite polynomial: each has one of p(0), p'(0), p(1), p'(1) equal to 1, the others 0.
struct Hermite {
  double start, start_slope, end, end_slope;
};
Hermite hermite(double s) {
  const double r = 1.0 - s;
  return {(1.0 + 2.0 * s) * r * r, s * r * r, s * s * (3.0 - 2.0 * s), -s * s * r};
}
Hermite hermite_slope(double s) {
  const double r = 1.0 - s;
  return {-6.0 * s * r, r * (1.0 - 3.0 * s), 6.0 * s * r, s * (3.0 * s - 2.0)};
}

}  // namespace

Promp::Promp(PrompSpec spec) : spec_(std::move(spec)) {
  require_promp(!spec_.joints.empty(), "no joint moves");
  require_promp(spec_.joints.size() <= kMost && spec_.bases <= kMost,
                std::to_string(spec_.joints.size()) + " joints and " + std::to_string(spec_.bases) +
                    " bases, expected at most " + std::to_string(kMost) + " of either");
  for (std::size_t j = 0; j < spec_.joints.size(); ++j)
    require_promp(std::count(spec_.joints.begin(), spec_.joints.end(), spec_.joints[j]) == 1,
                  "joint '" + spec_.joints[j] + "' is named twice");
  require_promp(spec_.bases >= 2, std::to_string(spec_.bases) + " bases, expected at least 2");
  require_promp(spec_.held_first >= 0 && spec_.held_last >= 0, "fewer than 0 weights are held");
  require_promp(spec_.held_first < spec_.bases - std::min(spec_.held_last, spec_.bases),
                "all of " + std::to_string(spec_.bases) + " weights are held (" +
                    std::to_string(spec_.held_first) + " first, " +
                    std::to_string(spec_.held_last) + " last)");
  require_promp(std::isfinite(spec_.width) && spec_.width > 0.0, "the width must be positive");
  require_promp(std::isfinite(spec_.duration) && spec_.duration > 0.0,
                "the duration must be positive");
  require_promp(std::isfinite(spec_.hold) && spec_.hold >= 0.0, "the hold must not be negative");
  require_promp(spec_.duration + spec_.hold <= kLongest,
                "duration and hold are longer than an hour together");
}

int Promp::parameters_per_joint() const { return spec_.bases - spec_.held_first - spec_.held_last; }

int Promp::size() const { return static_cast<int>(spec_.joints.size()) * parameters_per_joint(); }

void Promp::features(double time, VecX<double>& phi, VecX<double>& phi_d) const {
  require_promp(time >= 0.0, "time " + std::to_string(time) + " s, expected 0 or later");
  const double s = std::min(time / spec_.duration, 1.0);
  const Hermite h = hermite(s), h_d = hermite_slope(s);
  VecX<double> n, n_d, at_end, slope_at_end, at_start, slope_at_start;
  radial_bases(spec_, s, n, n_d);
  radial_bases(spec_, 0.0, at_start, slope_at_start);
  radial_bases(spec_, 1.0, at_end, slope_at_end);
  if (!spec_.returns) at_end.setZero();  // the posture of T is free

  // φ(s) = n(s) − n(0) h₀₀ − n'(0) h₁₀ − n(1) h₀₁ − n'(1) h₁₁
  n -= at_start * h.start + slope_at_start * h.start_slope + at_end * h.end +
       slope_at_end * h.end_slope;
  n_d -= at_start * h_d.start + slope_at_start * h_d.start_slope + at_end * h_d.end +
         slope_at_end * h_d.end_slope;
  phi = n.segment(spec_.held_first, parameters_per_joint());
  phi_d = n_d.segment(spec_.held_first, parameters_per_joint()) / spec_.duration;
  if (s >= 1.0) phi_d.setZero();
}

void Promp::motion(const VecX<double>& theta, const VecX<double>& times, RowMatX<double>& q,
                   RowMatX<double>& qd) const {
  require_size("Promp::motion", theta.size(), size(), "parameter");
  const long joints = static_cast<long>(spec_.joints.size());
  // (parameters per joint × joints)
  const Eigen::Map<const MatX<double>> weights(theta.data(), parameters_per_joint(), joints);
  q.resize(times.size(), joints);
  qd.resize(times.size(), joints);
  VecX<double> phi, phi_d;
  for (long i = 0; i < times.size(); ++i) {
    features(times[i], phi, phi_d);
    q.row(i) = phi.transpose() * weights;
    qd.row(i) = phi_d.transpose() * weights;
  }
}

}  // namespace diffnea
