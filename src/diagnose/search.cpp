#include "diagnose/search.hpp"

#include <algorithm>
#include <cmath>

#include "core/decompositions.hpp"
#include "diagnose/signed_fit.hpp"

namespace diffnea {

Search::Search(const Evidence& evidence, const std::vector<Candidate>& candidates,
               const BasePrior& prior, const std::vector<bool>& used, double table_bytes)
    : evidence_(evidence),
      candidates_(candidates),
      moving_(prior),
      held_(prior),
      used_(used),
      table_(evidence, candidates, table_bytes) {
  if (used_.empty()) used_.assign(static_cast<std::size_t>(evidence.rows()), true);
  const int last = static_cast<int>(evidence.base().cols()) - 1;
  if (const auto at = std::ranges::find(held_.free, last); at != held_.free.end()) {
    const long k = at - held_.free.begin(), after = held_.root.cols() - k - 1;
    held_.root.middleCols(k, after) = held_.root.rightCols(after).eval();
    held_.root.conservativeResize(Eigen::NoChange, held_.root.cols() - 1);
    held_.free.erase(at);
  }
}

void Search::set_projection(std::vector<Term>& terms) {
  for (const bool moving : {true, false}) {
    instant_ = moving;
    projection_.reset();
    projection_ = std::make_unique<Projection>(evidence_, *whitener_, prior());
    for (Term& t : terms) set_columns(t);
    fit(terms);
    if (const double by = late(terms);
        by > evidence_.earliest_instant() && by < evidence_.latest_instant())
      return;
  }
}

double Search::late(const std::vector<Term>& terms) const {
  VecX<double> effects = VecX<double>::Zero(evidence_.rows());
  for (const Term& t : terms) effects += t.torque();
  const VecX<double> x = projection_->parameters(effects);
  return x[x.size() - 1];
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
      set_projection(terms);
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
    std::vector<double> lost, least;
    blind_.clear();
    if (repeatable_) {
      for (long i = 0; i < noise.size(); ++i)
        rows[static_cast<std::size_t>(i)] =
            rows[static_cast<std::size_t>(i)] && std::isfinite(noise[i]);
      least = signals_noise(evidence_, left, rows);
    } else {
      const double fitted = static_cast<double>(projection_->rank() + num_parameters(terms)) /
                            static_cast<double>(evidence_.joints().size());
      Smoothed smoothed =
          beside_smooth_functions(evidence_, prior().free, prior().x0, left, rows, fitted);
      noise = std::move(smoothed.left);
      lost = std::move(smoothed.lost);
      blind_ = std::move(smoothed.blind);
    }
    std::vector<JointNoise> estimate = estimate_noise(evidence_, noise, rows, lost, least);
    projection_.reset();
    whitener_ = std::make_unique<Whitener>(evidence_, std::move(estimate), used_);
    set_projection(terms);
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

double Search::gain_of(const std::vector<Term>& terms) const {
  std::vector<Term> copy = terms;
  return fit(copy);
}

int Search::num_parameters(const std::vector<Term>& terms) const {
  int out = 0;
  for (const Term& t : terms) out += t.num_parameters();
  return out;
}

double Search::cost(double chi2, double share) const {
  const double n = share * static_cast<double>(rows());
  if (repeatable_ && chi2 < n) return std::max(chi2, 0.0) - n;
  const double all = chi2 + (repeatable_ ? 0.0 : share * whitener_->assumed_sum());
  return n * std::log(std::max(all, 1e-300) / n);
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

double Search::visible_beyond(const Term& more, const Term& less) const {
  const auto beyond = [](const MatX<double>& all, const MatX<double>& of) {
    const Eigen::HouseholderQR<MatX<double>> qr(of);
    const MatX<double> Q = columns_of_q(qr.householderQ(), of.rows(), of.cols());
    return (all - Q * (Q.transpose() * all)).norm();
  };
  const double whole = beyond((*whitener_)(more.columns), (*whitener_)(less.columns));
  return whole > 0.0 ? beyond(more.projected.leftCols(more.width()),
                              less.projected.leftCols(less.width())) / whole
                     : 0.0;
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
