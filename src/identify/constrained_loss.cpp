#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/identify/constrained_loss.hpp>

#include "core/decompositions.hpp"
#include "core/statistics.hpp"
#include "identify/constrained_checks.hpp"
#include "identify/constrained_residuals.hpp"
#include "identify/descent.hpp"

namespace diffnea {
namespace {

/// Root mean square of a sample's residuals, over the usual one, from which Huber's loss is linear.
constexpr double kHuber = 3.0;
/// Multiplier over its standard error from which the motion shows a force: noise alone does once in
/// 3e4 samples.
constexpr double kShown = 4.0;
/// Change of the cost by weights of the present point, relative, below which they have settled: a
/// tenth of what one of a hundred samples counts.
constexpr double kSettled = 1e-3;
/// Eigenvalue of the curvature, columns of length 1, over the largest, that counts as 0: the square
/// of what rounding leaves of derivatives through ill-conditioned forces.
constexpr double kUnseen = 1e-12;
/// Change of the cost, residuals over their noise, by all of a positive parameter, below which it
/// moves none: rounding makes 1e-20 of it.
constexpr double kNothing = 1e-12;
/// Square of a parameter's share in what is not seen, from which it is not known itself.
constexpr double kPartOfUnseen = 1e-6;
constexpr std::size_t kSamplesPerParameter = 10;  ///< at least

using Weighings = std::vector<Weighing>;

/// The descent, and what it is fitted to.
class ConstrainedDescent {
 public:
  ConstrainedDescent(const ConstrainedModel& model,
                     const std::vector<ConstrainedParameter>& parameters, const BodyMotion& motion,
                     const ConstrainedFitOptions& options)
      : model_(model), parameters_(parameters), motion_(motion), options_(options) {
    p_.resize(static_cast<Eigen::Index>(parameters.size()));
    for (Eigen::Index k = 0; k < p_.size(); ++k) p_[k] = parameters[k].value;
    weighings_ = weighings_at(p_);
    require_agreement(model, parameters, motion);
    set_usual();
    now_ = cost_at(p_, weighings_);
  }

  /// Steps, for descend().
  ///@{
  double cost() const { return now_; }
  void linearise();
  double attempt(double damping);
  void accept() {
    p_ = tried_;
    now_ = then_;
  }
  void refuse() {}
  bool stopped() const { return false; }
  bool settled() {
    there_ = weighings_at(p_);
    return std::abs(cost_at(p_, there_) - now_) <= kSettled * now_;
  }
  void reweigh() {
    weighings_ = there_;
    set_usual();
    now_ = cost_at(p_, weighings_);
  }
  ///@}

  const VecX<double>& p() const { return p_; }
  long counting() const {
    return std::ranges::count_if(weighings_, [](const Weighing& w) { return w.counts; });
  }
  MatX<double> covariance() const;  ///< at the last linearisation
  std::vector<ConstraintError> errors() const;

 private:
  Weighings weighings_at(const VecX<double>& p) const;
  std::vector<bool> shown_at(const ConstrainedSystem<double>& system) const;
  void leave_out_changes(Weighings& weighings) const;
  void set_usual();
  MatX<double> score_by_motion(std::size_t k, std::size_t body) const;
  std::vector<double> residuals_at(const VecX<double>& p, std::size_t k,
                                   const Weighing& weighing) const {
    return residuals(model_.at(motion_.samples[k], p), motion_.noise, weighing, options_.lambda);
  }
  double cost_at(const VecX<double>& p, const Weighings& weighings) const;
  /// Huber's weight of a sample.
  double weight(double squared, std::size_t count) const {
    const double u = std::sqrt(squared / static_cast<double>(count)), most = kHuber * usual_;
    return !options_.robust || u <= most ? 1.0 : most / u;
  }

  const ConstrainedModel& model_;
  const std::vector<ConstrainedParameter>& parameters_;
  const BodyMotion& motion_;
  const ConstrainedFitOptions& options_;
  Weighings weighings_, there_;  ///< in use, and of the present point
  double usual_ = 1.0;           ///< root mean square of the median sample's residuals
  VecX<double> p_, tried_, g_;
  MatX<double> H_;                      ///< (P, P) Jᵀ W J
  std::vector<MatX<double>> weighted_;  ///< W J of each sample
  double now_ = 0.0, then_ = 0.0;
};

/// Rows whose force the measured accelerations show: least squares of V̇₀ − V̇ = M̄⁻¹ Jᵀ λ.
std::vector<bool> ConstrainedDescent::shown_at(const ConstrainedSystem<double>& system) const {
  const auto m = static_cast<Eigen::Index>(system.rows.size());
  const std::vector<Twist<double>> without = predicted(system, {}).Vd;
  const auto n = static_cast<Eigen::Index>(6 * without.size());
  MatX<double> B = MatX<double>::Zero(n, m);
  VecX<double> r = VecX<double>::Zero(n);
  for (std::size_t b = 0; b < without.size(); ++b) {
    if (system.bodies[b].kind == BodyKind::kPrescribed) continue;
    const bool turns = system.bodies[b].kind == BodyKind::kRigid;
    const double per_angle = turns ? 1.0 / motion_.noise[b].angle[2] : 0.0,
                 per_length = 1.0 / motion_.noise[b].position[2];
    const Mobility<double> mobility(system.bodies[b]);
    const auto six = [&](const Twist<double>& V) {
      Eigen::Matrix<double, 6, 1> out;
      out << to_eigen(V.angular) * per_angle, to_eigen(V.linear) * per_length;
      return out;
    };
    const auto at = static_cast<Eigen::Index>(6 * b);
    r.segment<6>(at) = six(without[b] + system.accelerations[b] * -1.0);
    for (Eigen::Index i = 0; i < m; ++i)
      for (std::size_t s = 0; s < kMostBodies; ++s)
        if (system.rows[i].bodies[s] == static_cast<int>(b))
          B.block<6, 1>(at, i) += six(mobility * system.rows[i].J[s]);
  }
  const Eigen::CompleteOrthogonalDecomposition<MatX<double>> qr(B);
  const MatX<double> inverse = pseudo_inverse(qr);
  std::vector<bool> out(static_cast<std::size_t>(m));
  for (Eigen::Index i = 0; i < m; ++i)
    out[static_cast<std::size_t>(i)] = inverse.row(i).dot(r) > kShown * inverse.row(i).norm();
  return out;
}

Weighings ConstrainedDescent::weighings_at(const VecX<double>& p) const {
  Weighings out;
  bool changes = false;
  for (const BodySample& sample : motion_.samples) {
    const ConstrainedSystem<double> system = model_.at(sample, p);
    if (!out.empty() && system.rows.size() != out.front().acts.size())
      throw ShapeError("constrained loss: the system at " + detail::number_text(sample.time) +
                       " s has " + std::to_string(system.rows.size()) +
                       " rows of constraints, expected " + std::to_string(out.front().acts.size()) +
                       " as at the first sample");
    Weighing w;
    const bool one_sided = std::ranges::any_of(
        system.rows, [](const auto& row) { return row.relation == Relation::kAtMost; });
    const std::vector<bool> shown = one_sided ? shown_at(system) : std::vector<bool>();
    for (std::size_t i = 0; i < system.rows.size(); ++i) {
      const ConstraintRow<double>& row = system.rows[i];
      w.acts.push_back(row.relation == Relation::kEqual || shown[i]);
      changes = changes || row.relation == Relation::kAtMost;
      if (!std::isfinite(row.g + row.gd + row.bias + row_noise(row, motion_.noise, 0)))
        throw DataError("constrained loss: constraint '" + row.name + "' has no " +
                        (std::isfinite(row.g) ? "derivative" : "value") + " at " +
                        detail::number_text(sample.time) +
                        " s; begin with parameters that its formula allows at every sample");
      if (!(row_noise(row, motion_.noise, 0) > 0.0 && row_noise(row, motion_.noise, 1) > 0.0 &&
            row_noise(row, motion_.noise, 2) > 0.0))
        throw DataError("constrained loss: constraint '" + row.name + "' at " +
                        detail::number_text(sample.time) +
                        " s: the noise of its bodies leaves it none; give BodyMotion::noise of a "
                        "body that it moves");
    }
    out.push_back(std::move(w));
  }
  if (changes) leave_out_changes(out);
  return out;
}

/// Leaves out samples with another choice of acting rows within their smoothing.
void ConstrainedDescent::leave_out_changes(Weighings& weighings) const {
  const auto n = static_cast<long>(weighings.size());
  std::vector<long> since(weighings.size(), 0);  // first sample of the same choice
  for (long k = 1; k < n; ++k)
    since[k] = motion_.samples[k].stretch == motion_.samples[k - 1].stretch &&
                       weighings[k].acts == weighings[k - 1].acts
                   ? since[k - 1]
                   : k;
  for (long k = 0; k < n; ++k) {
    const int stretch = motion_.samples[k].stretch;
    long first = k, last = k;
    while (first > 0 && k - first < motion_.half_width &&
           motion_.samples[first - 1].stretch == stretch)
      --first;
    while (last + 1 < n && last - k < motion_.half_width &&
           motion_.samples[last + 1].stretch == stretch)
      ++last;
    weighings[k].counts = since[last] <= first;
  }
}

void ConstrainedDescent::set_usual() {
  std::vector<double> each;
  for (std::size_t k = 0; k < weighings_.size(); ++k) {
    if (!weighings_[k].counts) continue;
    const std::vector<double> e = residuals_at(p_, k, weighings_[k]);
    each.push_back(Eigen::Map<const VecX<double>>(e.data(), static_cast<long>(e.size())).norm() /
                   std::sqrt(static_cast<double>(e.size())));
  }
  if (each.size() < kSamplesPerParameter * parameters_.size())
    throw DataError("constrained loss: " + std::to_string(each.size()) +
                    " samples are left that are smoothed within one motion, expected at least " +
                    std::to_string(kSamplesPerParameter * parameters_.size()) + " for " +
                    std::to_string(parameters_.size()) + " parameters; record for longer");
  usual_ = std::max(1.0, median(each));
}

double ConstrainedDescent::cost_at(const VecX<double>& p, const Weighings& weighings) const {
  double sum = 0.0;
  for (std::size_t k = 0; k < weighings.size(); ++k) {
    if (!weighings[k].counts) continue;
    const std::vector<double> e = residuals_at(p, k, weighings[k]);
    double squared = 0.0;
    for (const double x : e) squared += x * x;
    const double w = weight(squared, e.size());
    sum += w * (2.0 - w) * squared;
  }
  return sum;
}

void ConstrainedDescent::linearise() {
  const Eigen::Index P = p_.size();
  H_ = MatX<double>::Zero(P, P);
  g_ = VecX<double>::Zero(P);
  weighted_.assign(weighings_.size(), {});
  for (std::size_t k = 0; k < weighings_.size(); ++k) {
    if (!weighings_[k].counts) continue;
    MatX<double> J;
    VecX<double> e;
    for (Eigen::Index begin = 0; begin < P; begin += kJetWidth) {
      const std::vector<JetD> r = residuals(model_.at(motion_.samples[k], seeded(p_, begin)),
                                            motion_.noise, weighings_[k], options_.lambda);
      const auto rows = static_cast<Eigen::Index>(r.size());
      const Eigen::Index width = std::min<Eigen::Index>(kJetWidth, P - begin);
      J.conservativeResize(rows, P);
      e.resize(rows);
      for (Eigen::Index i = 0; i < rows; ++i) {
        e[i] = r[static_cast<std::size_t>(i)].a;
        J.row(i).segment(begin, width) = r[static_cast<std::size_t>(i)].v.head(width).transpose();
      }
    }
    const double w = weight(e.squaredNorm(), static_cast<std::size_t>(e.size()));
    H_ += w * J.transpose() * J;
    g_ += w * J.transpose() * e;
    weighted_[k] = w * J;
  }
  for (Eigen::Index k = 0; k < P; ++k) {
    if (parameters_[static_cast<std::size_t>(k)].sign != Sign::kPositive ||
        H_(k, k) * p_[k] * p_[k] > kNothing)
      continue;
    H_.row(k).setZero();
    H_.col(k).setZero();
    g_[k] = 0.0;
  }
}

double ConstrainedDescent::attempt(double damping) {
  MatX<double> damped = H_;
  damped.diagonal() *= 1.0 + damping;
  damped.diagonal().array() += std::numeric_limits<double>::min();  // for what nothing depends on
  const VecX<double> step = Eigen::LDLT<MatX<double>>(damped).solve(VecX<double>(-g_));
  tried_ = p_ + step;
  for (Eigen::Index k = 0; k < p_.size(); ++k) {
    const Sign sign = parameters_[static_cast<std::size_t>(k)].sign;
    if (sign == Sign::kPositive) tried_[k] = std::max(tried_[k], 0.1 * p_[k]);
    if (sign == Sign::kNonNegative) tried_[k] = std::max(tried_[k], 0.0);
  }
  return then_ = cost_at(tried_, weighings_);
}

/// Jᵀ W e by the 18 numbers that a body's state and acceleration were smoothed to.
MatX<double> ConstrainedDescent::score_by_motion(std::size_t k, std::size_t body) const {
  MatX<double> out = MatX<double>::Zero(p_.size(), kPerBody);
  const int numbers = motion_.noise[body].angle[0] > 0.0 ? kPerBody : kPerBody / 2;
  for (int first = 0; first < numbers; first += kJetWidth) {
    const std::vector<JetD> e = residuals(
        model_.at(motion_.samples[k], seeded(p_, p_.size()), {static_cast<int>(body), first}),
        motion_.noise, weighings_[k], options_.lambda);
    for (int c = first; c < std::min(first + kJetWidth, numbers); ++c) {
      VecX<double> slope(static_cast<Eigen::Index>(e.size()));
      for (Eigen::Index i = 0; i < slope.size(); ++i) slope[i] = e[i].v[c - first];
      out.col(c) = weighted_[k].transpose() * slope;
    }
  }
  return out;
}

/// H⁻¹ S H⁻¹, S the covariance of the score: what the noise of each row of the sensors makes of it,
/// through all samples that it was smoothed into.
MatX<double> ConstrainedDescent::covariance() const {
  const Eigen::Index P = p_.size();
  MatX<double> S = MatX<double>::Zero(P, P);
  std::vector<MatX<double>> of_rows;  // (P, 6 a body) score by a row's turn and place
  const auto bodies = static_cast<Eigen::Index>(motion_.noise.size());
  for (std::size_t k = 0; k < weighings_.size(); ++k) {
    if (!weighings_[k].counts) continue;
    const BodySample& sample = motion_.samples[k];
    for (Eigen::Index b = 0; b < bodies; ++b) {
      const BodyNoise& noise = motion_.noise[static_cast<std::size_t>(b)];
      if (!(noise.position[0] > 0.0 || noise.angle[0] > 0.0)) continue;
      MatX<double> score = score_by_motion(k, static_cast<std::size_t>(b));
      const Eigen::Matrix3d to_body =
          to_eigen(sample.states[static_cast<std::size_t>(b)].X_WB.R).transpose();
      for (Eigen::Index c = 0; c < kPerBody; c += 3)  // rows of neighbours share the world's axes
        score.middleCols(c, 3) = (score.middleCols(c, 3) * to_body).eval();
      for (std::size_t i = 0; i < sample.weights.size(); ++i) {
        const std::size_t row = static_cast<std::size_t>(sample.first_row) + i;
        if (row >= of_rows.size()) of_rows.resize(row + 1, MatX<double>::Zero(P, 6 * bodies));
        for (Eigen::Index d = 0; d < 3; ++d) {
          const double c = sample.weights[i][static_cast<std::size_t>(d)];
          of_rows[row].middleCols(6 * b, 3) += c * noise.row_angle * score.middleCols(9 + 3 * d, 3);
          of_rows[row].middleCols(6 * b + 3, 3) +=
              c * noise.row_position * score.middleCols(3 * d, 3);
        }
      }
      if (!sample.weights.empty()) continue;
      for (Eigen::Index d = 0; d < 3; ++d) {
        const auto order = static_cast<std::size_t>(d);
        const MatX<double> turn = noise.angle[order] * score.middleCols(9 + 3 * d, 3),
                           place = noise.position[order] * score.middleCols(3 * d, 3);
        S += turn * turn.transpose() + place * place.transpose();
      }
    }
  }
  for (const MatX<double>& row : of_rows) S += row * row.transpose();
  S *= usual_ * usual_;
  VecX<double> size = H_.diagonal().cwiseSqrt();
  for (double& x : size)
    if (!(x > 0.0)) x = 1.0;
  const VecX<double> per = size.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(
      MatX<double>(per.asDiagonal() * H_ * per.asDiagonal()));
  const VecX<double>& l = eigen.eigenvalues();
  const MatX<double>& V = eigen.eigenvectors();
  VecX<double> inverse(P), unseen = VecX<double>::Zero(P);
  for (Eigen::Index k = 0; k < P; ++k) {
    const bool seen = l[k] > kUnseen * l[P - 1] && l[P - 1] > 0.0;
    inverse[k] = seen ? 1.0 / l[k] : 0.0;
    if (!seen) unseen += V.col(k).cwiseAbs2();
  }
  const MatX<double> G =
      per.asDiagonal() * V * inverse.asDiagonal() * V.transpose() * per.asDiagonal();
  MatX<double> out = G * S * G;
  for (Eigen::Index k = 0; k < P; ++k)
    if (unseen[k] > kPartOfUnseen) out(k, k) = std::numeric_limits<double>::infinity();
  return out;
}

std::vector<ConstraintError> ConstrainedDescent::errors() const {
  std::vector<ConstraintError> out;
  std::vector<long> counts;
  for (std::size_t k = 0; k < weighings_.size(); ++k) {
    const Weighing& w = weighings_[k];
    if (!w.counts) continue;
    const std::vector<ConstraintRow<double>> rows = model_.at(motion_.samples[k], p_).rows;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      auto at = std::ranges::find(out, rows[i].name, &ConstraintError::name);
      if (at == out.end()) {
        out.push_back({rows[i].name, 0.0, 0.0});
        counts.push_back(0);
        at = out.end() - 1;
      }
      if (!w.acts[i]) continue;
      const double over =
          rows[i].g / row_noise(rows[i], motion_.noise, rows[i].of_velocity ? 1 : 0);
      at->g += rows[i].g * rows[i].g;
      at->over_noise += over * over;
      ++counts[static_cast<std::size_t>(at - out.begin())];
    }
  }
  for (std::size_t c = 0; c < out.size(); ++c) {
    const auto n = static_cast<double>(std::max(1L, counts[c]));
    out[c].g = std::sqrt(out[c].g / n);
    out[c].over_noise = std::sqrt(out[c].over_noise / n);
  }
  return out;
}

}  // namespace

ConstrainedFit fit_constrained(const ConstrainedModel& model,
                               const std::vector<ConstrainedParameter>& parameters,
                               const BodyMotion& motion, const ConstrainedFitOptions& options) {
  require_bodies(model, parameters, motion);
  ConstrainedDescent descent(model, parameters, motion, options);
  ConstrainedFit out;
  const DescentEnd end =
      descend(descent, {options.max_iterations, options.tolerance}, out.iterations);
  out.converged = end != DescentEnd::kLimit;
  out.termination = end == DescentEnd::kLimit    ? "the largest number of iterations is reached"
                    : end == DescentEnd::kNoStep ? "no step makes it better"
                                                 : "the last step gained less than the tolerance";
  descent.linearise();
  out.p = descent.p();
  out.covariance = descent.covariance();
  out.chi2 = descent.cost();
  out.samples = descent.counting();
  out.constraints = descent.errors();
  return out;
}

}  // namespace diffnea
