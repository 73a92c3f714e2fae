#include "diagnose/search.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

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
  if (used_.empty()) used_.assign(evidence.rows(), true);
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
    ++revision_;
    projection_ = std::make_unique<Projection>(evidence_, *whitener_, prior());
    for (Term& t : terms) set_columns(t);
    fit(terms);
    if (samples_and_holds(terms)) return;
  }
}

double Search::shift(const Term& term) {
  if (term.effect.own) return 0.0;
  DrivePath<double> path{0.0, 0.0, 0.0};
  add_to_drive(term.effect, path);
  return clock_shift(term.effect) + path.delay;
}

bool Search::samples_and_holds(int joint, const std::vector<Term>& terms) const {
  double in_all = late(terms);
  for (const Term& t : terms)
    if (std::ranges::find(t.effect.joints, joint) != t.effect.joints.end())
      in_all += shift(t) / evidence_.series().front().dt;
  return in_all > evidence_.earliest_instant() && in_all < evidence_.latest_instant();
}

bool Search::samples_and_holds(const std::vector<Term>& terms) const {
  bool driven = false;
  for (std::size_t k = 0; k < evidence_.joints().size(); ++k) {
    if (evidence_.passive(k)) continue;
    if (samples_and_holds(evidence_.joints()[k], terms)) return true;
    driven = true;
  }
  return !driven;
}

double Search::late(const std::vector<Term>& terms) const {
  return projection_->parameters(torque_of(terms, evidence_.rows())).tail(1)[0];
}

Term Search::term_of(const Score& score) const {
  Term term = table_.term_of(score);
  set_columns(term);
  return term;
}

std::vector<Score> Search::scores(const std::vector<Term>& terms, const Wanted& wanted) const {
  std::vector<Score> out = table_.scores(terms, normal(terms), *projection_, wanted);
  const double left = residual_sum() - gain_of(terms), n = static_cast<double>(rows());
  for (Score& s : out)
    s.delta_bic = s.variant < 0 ? -1e9
                                : cost(left) - cost(left - s.gain) - s.parameters * std::log(n) -
                                      looked_elsewhere(s.candidate);
  std::ranges::sort(out, std::greater<>{}, &Score::delta_bic);
  return out;
}

void Search::set_columns(Term& term) const {
  set_torque(evidence_, candidates_[term.candidate], term);
  if (!projection_) return;
  MatX<double> both = term.columns;
  if (term.has_offset()) {
    both.conservativeResize(Eigen::NoChange, term.width() + 1);
    both.col(term.width()) = term.offset;
  }
  term.beside = projection_->beside(both);
  const MatX<double> left = product(term.beside, term.beside);
  term.shares.clear();
  for (long k = 0; k < term.width(); ++k)
    term.shares.push_back(std::sqrt(std::max(left(k, k), 0.0)) /
                          std::max(term.beside.whitened.col(k).norm(), 1e-300));
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
        if (evidence_.rests(i, k)) rows[k * evidence_.times() + i] = false;
    VecX<double> noise = period > 0.0 ? repeatable_noise(evidence_, left, period) : VecX<double>();
    repeatable_ = noise.size() > 0;
    std::vector<double> lost, least;
    blind_.clear();
    if (repeatable_) {
      for (long i = 0; i < noise.size(); ++i) rows[i] = rows[i] && std::isfinite(noise[i]);
      least = signals_noise(evidence_, left, rows);
    } else {
      const double fitted = static_cast<double>(projection_->rank() + num_parameters(terms)) /
                            static_cast<double>(evidence_.joints().size());
      // Late torques are no noise, whether or not the base may move their instant.
      Smoothed smoothed =
          beside_smooth_functions(evidence_, moving_.free, moving_.x0, left, rows, fitted);
      noise = std::move(smoothed.left);
      lost = std::move(smoothed.lost);
      blind_ = std::move(smoothed.blind);
    }
    std::vector<JointNoise> estimate = estimate_noise(evidence_, noise, rows, lost, least);
    projection_.reset();
    whitener_ = std::make_unique<Whitener>(evidence_, std::move(estimate), used_);
    set_projection(terms);
  }
  table_.measure(*projection_);
}

NormalEquations Search::normal(const std::vector<const Term*>& terms) const {
  long width = 0;
  for (const Term* t : terms) width += t->width();
  NormalEquations out{MatX<double>(width, width), VecX<double>(width), residual_sum(), {}};
  long row = 0;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const Term& a = *terms[i];
    const long k = a.width();
    VecX<double> with = projection_->with_residual(a.beside);
    if (a.has_offset()) out.left -= 2.0 * with[k];
    out.b.segment(row, k) = with.head(k);
    for (const bool sign : signs(a.effect, a.linear)) out.sign.push_back(sign);
    row += k;
  }
  row = 0;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const Term& a = *terms[i];
    const long k = a.width();
    long column = 0;
    for (std::size_t j = 0; j <= i; ++j) {
      const Term& b = *terms[j];
      const long l = b.width();
      const MatX<double> both = product(a.beside, b.beside);
      out.K.block(row, column, k, l) = both.topLeftCorner(k, l);
      if (j < i) out.K.block(column, row, l, k) = both.topLeftCorner(k, l).transpose();
      if (b.has_offset()) out.b.segment(row, k) -= both.col(l).head(k);
      if (a.has_offset() && j < i) out.b.segment(column, l) -= both.row(k).head(l).transpose();
      if (a.has_offset() && b.has_offset()) out.left += (j < i ? 2.0 : 1.0) * both(k, l);
      column += l;
    }
    row += k;
  }
  return out;
}

NormalEquations Search::normal(const std::vector<Term>& terms) const {
  std::vector<const Term*> all;
  for (const Term& t : terms) all.push_back(&t);
  return normal(all);
}

double Search::fit(std::vector<Term>& terms) const {
  if (terms.empty()) return 0.0;
  const NormalEquations n = normal(terms);
  const SignedFit f = signed_fit(n.K, n.b, n.sign);
  long at = 0;
  for (Term& t : terms)
    for (const int k : t.linear) t.effect.parameters[k] = f.x[at++];
  return f.gain + residual_sum() - n.left;
}

double Search::gain_of(const std::vector<Term>& terms) const {
  if (terms.empty()) return 0.0;
  const NormalEquations n = normal(terms);
  return signed_fit(n.K, n.b, n.sign).gain + residual_sum() - n.left;
}

double Search::gain_by_shape(const std::vector<Term>& terms, std::size_t which, int shape) const {
  const Beside D = projection_->beside(evidence_.columns(terms[which].effect, {shape}));
  const VecX<double> left = left_by(terms);
  const NormalEquations n = normal(terms);
  VecX<double> with(n.b.size());
  for (long at = 0; const Term& t : terms) {
    with.segment(at, t.width()) = product(t.beside, D).col(0).head(t.width());
    at += t.width();
  }
  const double square = left_beside(n.K, with, product(D, D)(0, 0));
  const double onto = projection_->expanded(D).col(0).dot(left);
  return square > 0.0 ? onto * onto / square : 0.0;
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
  return 2.0 * std::log(static_cast<double>(candidates_[candidate].grid.size()));
}

VecX<double> Search::left_by(const std::vector<Term>& terms) const {
  VecX<double> onto = VecX<double>::Zero(projection_->rank());
  VecX<double> out = projection_->residual();
  const long m = evidence_.times();
  for (const Term& t : terms) {
    const Beside torque = t.torque_beside();
    for (std::size_t i = 0; i < torque.joints.size(); ++i)
      out.segment(torque.joints[i] * m, m) -= torque.of(i);
    onto += torque.onto;
  }
  if (!terms.empty()) out.noalias() += projection_->basis() * onto;
  return out;
}

double Search::replaced_share(const Term& term, const Term& by,
                              const std::vector<Term>& beside) const {
  const Beside torque = term.torque_beside();
  std::vector<const Term*> all;
  for (const Term& t : beside) all.push_back(&t);
  const auto left_of = [&](bool free) {
    NormalEquations n = normal(all);
    double square = product(torque, torque)(0, 0);
    long at = 0;
    for (const Term* t : all) {  // the torque in the place of the residual, and of all but `by`
      const VecX<double> with = product(t->beside, torque).col(0);
      n.b.segment(at, t->width()) = with.head(t->width());
      at += t->width();
    }
    if (!free && by.has_offset()) {
      const MatX<double> own = product(by.beside, by.beside);
      const long k = by.width();
      square += own(k, k) - 2.0 * product(by.beside, torque)(k, 0);
      at = 0;
      for (const Term* t : all) {
        n.b.segment(at, t->width()) -= product(t->beside, by.beside).col(k).head(t->width());
        at += t->width();
      }
    }
    for (std::size_t k = 0; k < n.sign.size(); ++k)
      n.sign[k] = n.sign[k] && !free && static_cast<long>(k) >= n.b.size() - by.width();
    return square - signed_fit(n.K, n.b, n.sign).gain;
  };
  const double alone = left_of(true);
  all.push_back(&by);
  return alone > 0.0 ? 1.0 - left_of(false) / alone : 0.0;
}

double Search::visible_beyond(const Term& more, const Term& less) const {
  const auto beyond = [&](bool beside_base) {
    Beside all = more.beside, of = less.beside;
    if (!beside_base) {
      all.onto.setZero();
      of.onto.setZero();
    }
    const MatX<double> square = product(all, all), with = product(of, all), own = product(of, of);
    double out = 0.0;
    const long k = less.width();
    for (long c = 0; c < more.width(); ++c)
      out += left_beside(own.topLeftCorner(k, k), with.col(c).head(k), square(c, c));
    return std::sqrt(out);
  };
  const double whole = beyond(false);
  return whole > 0.0 ? beyond(true) / whole : 0.0;
}

VecX<double> Search::residual(const std::vector<Term>& terms) const {
  const VecX<double> effects = torque_of(terms, evidence_.rows());
  return evidence_.torque() - effects - evidence_.base() * projection_->parameters(effects);
}

double Search::torque_share(const Term& term) const {
  const VecX<double> torque = term.torque();
  const long times = evidence_.times();
  double own = 0.0, measured = 0.0;
  for (const long k : evidence_.reached(term.effect.joints)) {
    const double size = evidence_.size(k);
    own += torque.segment(k * times, times).squaredNorm();
    measured += size * size * static_cast<double>(times);
  }
  return measured > 0.0 ? std::sqrt(own / measured) : 0.0;
}

}  // namespace diffnea
