#include "diagnose/search.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "diagnose/signed_fit.hpp"

namespace diffnea {
namespace {

/// Of an accepted effect's torque: so well do its columns have its shape (filters, the reference
/// model, terms of order two). What explains less beside it is not taken for another effect.
constexpr double kAccuracy = 0.02;
/// The same of dry friction: filtered, nothing is known of how it turns but for a few milliseconds.
constexpr double kDryAccuracy = 0.04;
/// The same of dry friction F that is the base's, whose turns are fitted beside its size
/// (turn_columns()), at the least.
constexpr double kBaseDryAccuracy = 0.01;
/// How late one of its turns may be against the others [s]: what holds a joint meanwhile is nothing
/// that its motion tells. Each leaves 2 F for so long, which the filter spreads over 1/cut-off.
constexpr double kLateTurn = 1.75e-3;

/// χ² over its degrees of freedom beyond which what is left goes with the motion; rows of so long
/// [s], in every period, are one then.
constexpr double kMisfit = 1.3, kMisfitBlock = 1.0;

/// Eigenvalue of columns of length 1, below which no row tells of their combination.
constexpr double kUntold = 1e-6;

/// Parameters at their bounds that no row tells, or only with others: a half of an asymmetric
/// friction beside the base's, which has what both have in common.
/// @param K  (parameters, parameters) products of columns of length 1; of length 0 if untold alone
std::vector<long> held_at_bounds(const MatX<double>& K, const std::vector<bool>& at_bound) {
  std::vector<long> out;
  if (std::ranges::none_of(at_bound, std::identity())) return out;
  const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(K);
  for (long k = 0; k < K.cols(); ++k)
    for (long e = 0; e < K.cols(); ++e)
      if (at_bound[static_cast<std::size_t>(k)] && eigen.eigenvalues()[e] < kUntold &&
          std::abs(eigen.eigenvectors()(k, e)) > 0.1) {
        out.push_back(k);
        break;
      }
  return out;
}

}  // namespace

Search::Search(const Evidence& evidence, const std::vector<Candidate>& candidates,
               const BasePrior& prior, const std::vector<bool>& used, double table_bytes)
    : evidence_(evidence),
      candidates_(candidates),
      prior_(prior),
      used_(used),
      table_(evidence, candidates, table_bytes) {
  if (used_.empty()) used_.assign(static_cast<std::size_t>(evidence.rows()), true);
}

Term Search::term_of(const Score& score) const {
  Term term = table_.term_of(score);
  set_columns(term);
  return term;
}

std::vector<Score> Search::scores(const std::vector<Term>& terms, const Wanted& wanted) const {
  std::vector<Score> out = table_.scores(terms, *whitener_, *projection_, wanted);
  const double left = residual_sum() - gain_of(terms), n = static_cast<double>(rows());
  for (Score& s : out)
    s.delta_bic = s.variant < 0 ? -1e9
                                : cost(left) - cost(left - s.gain) - s.parameters * std::log(n) -
                                      looked_elsewhere(s.candidate);
  std::ranges::sort(out, std::greater<>{}, &Score::delta_bic);
  return out;
}

void Search::set_columns(Term& term) const {
  set_torque(evidence_, candidates_[static_cast<std::size_t>(term.candidate)], term);
  if (!projection_) return;
  MatX<double> both = term.columns;
  if (term.has_offset()) {
    both.conservativeResize(Eigen::NoChange, term.width() + 1);
    both.col(term.width()) = term.offset;
  }
  const MatX<double> whitened = (*whitener_)(both);
  const VecX<double> whole = whitened.colwise().norm().transpose();
  term.projected = projection_->project_whitened(whitened);
  term.shares.clear();
  for (long k = 0; k < term.width(); ++k)
    term.shares.push_back(term.projected.col(k).norm() / std::max(whole[k], 1e-300));
}

void Search::refresh(double period, std::vector<Term>& terms) {
  const bool first = !projection_;
  period_ = period;
  for (int round = 0; round < (first ? 3 : 1); ++round) {
    VecX<double> left;
    if (projection_) {
      left = residual(terms);
    } else {
      whitener_ = std::make_unique<Whitener>(evidence_, white_noise(evidence_), used_);
      projection_ = std::make_unique<Projection>(evidence_, *whitener_, prior_);
      left = residual(terms);
    }
    std::vector<bool> rows = used_;
    for (std::size_t k = 0; k < evidence_.joints().size();
         ++k)  // at rest the torque is not the model's
      for (long i = 0; i < evidence_.times(); ++i)
        if (evidence_.rests(i, static_cast<long>(k)))
          rows[k * static_cast<std::size_t>(evidence_.times()) + static_cast<std::size_t>(i)] =
              false;
    VecX<double> noise = period > 0.0 ? repeatable_noise(evidence_, left, period) : VecX<double>();
    repeatable_ = noise.size() > 0;
    std::vector<double> lost;
    blind_.clear();
    if (repeatable_) {
      for (long i = 0; i < noise.size(); ++i)
        rows[static_cast<std::size_t>(i)] =
            rows[static_cast<std::size_t>(i)] && std::isfinite(noise[i]);
    } else {
      const double fitted = static_cast<double>(projection_->rank() + num_parameters(terms)) /
                            static_cast<double>(evidence_.joints().size());
      Smoothed smoothed =
          beside_smooth_functions(evidence_, prior_.free, prior_.x0, left, rows, fitted);
      noise = std::move(smoothed.left);
      lost = std::move(smoothed.lost);
      blind_ = std::move(smoothed.blind);
    }
    std::vector<JointNoise> estimate = estimate_noise(evidence_, noise, rows, lost);
    projection_.reset();
    whitener_ = std::make_unique<Whitener>(evidence_, std::move(estimate), used_);
    projection_ = std::make_unique<Projection>(evidence_, *whitener_, prior_);
    for (Term& t : terms) set_columns(t);
    fit(terms);
  }
  table_.measure(*whitener_, *projection_);
}

double Search::fit(std::vector<Term>& terms) const {
  if (terms.empty()) return 0.0;
  const Stack S = stack(terms, projection_->residual().size());
  const VecX<double> r = projection_->residual() - S.offset;
  const SignedFit f = signed_fit(S.G.transpose() * S.G, S.G.transpose() * r, signs(terms));
  long at = 0;
  for (Term& t : terms) {
    for (const int k : t.linear) t.effect.parameters[static_cast<std::size_t>(k)] = f.x[at++];
    t.norm = (*whitener_)(t.torque()).norm();
  }
  return f.gain + residual_sum() - r.squaredNorm();
}

double Search::gain_at(const std::vector<Term>& terms) const {
  const Stack S = stack(terms, projection_->residual().size());
  VecX<double> x(S.G.cols());
  long at = 0;
  for (const Term& t : terms) {
    x.segment(at, t.width()) = t.values();
    at += t.width();
  }
  return residual_sum() - (projection_->residual() - S.offset - S.G * x).squaredNorm();
}

double Search::inexact_at(const Term& term, const std::vector<Term>& terms) const {
  const VecX<double> after = left_by(terms);
  const VecX<double> unknown = inexact_friction(terms, is_like_friction(term.effect));
  const long m = evidence_.times();
  const Port port = term.effect.info().port;
  const bool local = port == Port::kJointTorque || port == Port::kMemory;
  double out = 0.0;
  for (std::size_t k = 0; k < evidence_.joints().size(); ++k) {
    if (local &&
        std::ranges::find(term.effect.joints, evidence_.joints()[k]) == term.effect.joints.end())
      continue;
    const long begin = static_cast<long>(k) * m;
    const bool dry = std::ranges::any_of(terms, [&](const Term& t) {
      return std::ranges::find(t.effect.joints, evidence_.joints()[k]) != t.effect.joints.end() &&
             is_dry(t.effect);
    });
    const double accuracy = dry ? kDryAccuracy : kAccuracy;
    out += accuracy * accuracy *
           std::max(0.0, projection_->residual().segment(begin, m).squaredNorm() -
                             after.segment(begin, m).squaredNorm());
    out += unknown[static_cast<long>(k)];
  }
  return out;
}

VecX<double> Search::inexact_friction(const std::vector<Term>& terms, bool of_late_turns) const {
  const VecX<double> friction = dry_friction(terms);
  const long m = evidence_.times();
  VecX<double> out(static_cast<long>(evidence_.joints().size()));
  for (long k = 0; k < out.size(); ++k) {
    double share = kBaseDryAccuracy * kBaseDryAccuracy;
    if (of_late_turns || evidence_.late(k) > 0.0) {
      const double late = std::max(kLateTurn, evidence_.late(k));
      share =
          std::max(share, 4.0 * late * late * evidence_.cut_off() * evidence_.turns_per_second(k));
    }
    out[k] = share * friction.segment(k * m, m).squaredNorm();
  }
  return out;
}

double Search::late_turns(const Term& term, const std::vector<Term>& terms) const {
  const VecX<double> unknown = inexact_friction(terms, true);
  double out = 0.0;
  for (long k = 0; k < unknown.size(); ++k)
    if (const int j = evidence_.joints()[static_cast<std::size_t>(k)];
        evidence_.late(k) > 0.0 &&
        std::ranges::find(term.effect.joints, j) != term.effect.joints.end())
      out += unknown[k];
  return out;
}

VecX<double> Search::dry_friction(const std::vector<Term>& terms) const {
  const std::vector<int>& dry = evidence_.dry_columns();
  if (dry.empty()) return VecX<double>::Zero(evidence_.rows());
  VecX<double> effects = VecX<double>::Zero(evidence_.rows());
  for (const Term& t : terms) effects += t.torque();
  const VecX<double> x = projection_->parameters(effects);
  return (*whitener_)(evidence_.base()(Eigen::all, dry) * x(dry));
}

double Search::gain_of(const std::vector<Term>& terms) const {
  std::vector<Term> copy = terms;
  return fit(copy);
}

int Search::num_parameters(const std::vector<Term>& terms) const {
  int out = 0;
  for (const Term& t : terms) out += t.num_parameters();
  return out;
}

double Search::cost(double chi2) const {
  const double n = static_cast<double>(rows());
  if (repeatable_ && chi2 < n) return std::max(chi2, 0.0) - n;
  return n * std::log(std::max(chi2, 1e-300) / n);
}

double Search::bic(double gain, const std::vector<Term>& terms) const {
  const double n = static_cast<double>(rows());
  double out = cost(residual_sum() - gain) + num_parameters(terms) * std::log(n);
  for (const Term& t : terms) out += looked_elsewhere(t.candidate);
  return out;
}

double Search::looked_elsewhere(int candidate) const {
  return 2.0 * std::log(static_cast<double>(
                   candidates_[static_cast<std::size_t>(candidate)].grid.size()));
}

VecX<double> Search::left_by(const std::vector<Term>& terms) const {
  const Stack S = stack(terms, projection_->residual().size());
  VecX<double> out = projection_->residual() - S.offset;
  long at = 0;
  for (const Term& t : terms) {
    out -= S.G.middleCols(at, t.width()) * t.values();
    at += t.width();
  }
  return out;
}

VecX<double> Search::clustered(const MatX<double>& influence, const VecX<double>& left) const {
  const long m = evidence_.times();
  std::map<long, VecX<double>> clusters;
  for (long i = 0; i < m; ++i) {
    double t = evidence_.time()[static_cast<std::size_t>(i)];
    if (period_ > 0.0) t = std::fmod(t, period_);
    VecX<double>& sum = clusters
                            .try_emplace(std::lround(std::floor(t / kMisfitBlock)),
                                         VecX<double>::Zero(influence.rows()))
                            .first->second;
    for (long row = i; row < evidence_.rows(); row += m) sum += influence.col(row) * left[row];
  }
  VecX<double> out = VecX<double>::Zero(influence.rows());
  for (const auto& [cluster, sum] : clusters) out += sum.cwiseAbs2();
  const double count = static_cast<double>(clusters.size());
  return out * (count / std::max(count - 1.0, 1.0));
}

std::vector<MatX<double>> Search::covariances(const std::vector<Term>& terms) const {
  std::vector<MatX<double>> columns;
  std::vector<bool> at_bound;
  long width = 0;
  for (const Term& t : terms) {
    MatX<double> J(t.projected.rows(), t.width() + static_cast<long>(t.shapes.size()));
    J << t.projected.leftCols(t.width()),
        projection_->project(evidence_.columns(t.effect, t.shapes));
    const std::vector<bool> nonnegative = signs(t.effect, t.linear);
    for (long k = 0; k < t.width(); ++k) {
      at_bound.push_back(nonnegative[static_cast<std::size_t>(k)] && t.values()[k] == 0.0);
      if (at_bound.back() && !t.told(k)) J.col(k).setZero();
    }
    at_bound.resize(at_bound.size() + t.shapes.size(), false);
    width += J.cols();
    columns.push_back(std::move(J));
  }
  MatX<double> J(projection_->residual().size(), width);
  width = 0;
  for (const MatX<double>& c : columns) {
    J.middleCols(width, c.cols()) = c;
    width += c.cols();
  }
  MatX<double> K = J.transpose() * J;
  VecX<double> scale = K.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
  K = scale.asDiagonal() * K * scale.asDiagonal();
  const std::vector<long> held = held_at_bounds(K, at_bound);
  for (const long k : held) {
    K.row(k).setZero();
    K.col(k).setZero();
    K(k, k) = 1.0;
  }
  K.diagonal().array() += 1e-9;
  MatX<double> C = K.llt().solve(MatX<double>::Identity(width, width));
  for (const long k : held) C(k, k) = 0.0;
  // Rows are in units of noise; a lack of fit that is left widens the intervals.
  const double chi2 =
      (residual_sum() - gain_of(terms)) / static_cast<double>(std::max<long>(rows() - width, 1));
  C = scale.asDiagonal() * C * scale.asDiagonal();
  VecX<double> more = VecX<double>::Constant(width, std::max(1.0, chi2));
  if (chi2 > kMisfit)
    more = more.cwiseMax(
        clustered(C * J.transpose(), left_by(terms)).cwiseQuotient(C.diagonal().cwiseMax(1e-300)));
  more = more.cwiseSqrt();
  C = more.asDiagonal() * C * more.asDiagonal();
  std::vector<MatX<double>> out;
  long at = 0;
  for (const MatX<double>& c : columns) {
    out.push_back(C.block(at, at, c.cols(), c.cols()));
    at += c.cols();
  }
  return out;
}

double Search::replaced_share(const Term& term, const Term& by,
                              const std::vector<Term>& beside) const {
  VecX<double> y = term.projected.leftCols(term.width()) * term.values();
  if (term.has_offset()) y += term.projected.col(term.width());
  const Stack rest = stack(beside, y.size());
  const auto left_of = [&](const MatX<double>& G, const std::vector<bool>& nonnegative,
                           const VecX<double>& target) {
    return target.squaredNorm() -
           signed_fit(G.transpose() * G, G.transpose() * target, nonnegative).gain;
  };
  std::vector<bool> nonnegative(static_cast<std::size_t>(rest.G.cols()), false);
  const double alone = left_of(rest.G, nonnegative, y);
  MatX<double> G(y.size(), rest.G.cols() + by.width());
  G << rest.G, by.projected.leftCols(by.width());
  for (const bool s : signs(by.effect, by.linear)) nonnegative.push_back(s);
  if (by.has_offset()) y -= by.projected.col(by.width());
  return alone > 0.0 ? 1.0 - left_of(G, nonnegative, y) / alone : 0.0;
}

VecX<double> Search::residual(const std::vector<Term>& terms) const {
  VecX<double> effects = VecX<double>::Zero(evidence_.rows());
  for (const Term& t : terms) effects += t.torque();
  return evidence_.torque() - effects - evidence_.base() * projection_->parameters(effects);
}

double Search::torque_share(const Term& term) const {
  const VecX<double> torque = term.torque();
  const std::vector<int>& acts = term.effect.joints;
  const long times = evidence_.times();
  double own = 0.0, measured = 0.0;
  for (std::size_t k = 0; k < evidence_.joints().size(); ++k) {
    if (std::ranges::find(acts, evidence_.joints()[k]) == acts.end()) continue;
    const double size = evidence_.size(static_cast<long>(k));
    own += torque.segment(static_cast<long>(k) * times, times).squaredNorm();
    measured += size * size * static_cast<double>(times);
  }
  return measured > 0.0 ? std::sqrt(own / measured) : 0.0;
}

}  // namespace diffnea
