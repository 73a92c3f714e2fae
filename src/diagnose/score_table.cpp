#include "diagnose/score_table.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "diagnose/signed_fit.hpp"

namespace diffnea {
namespace {

bool is_ripple(const Candidate& c) { return c.bound() == SearchBound::kRipple; }

/// Ripples of a candidate's grid, which is even (bounds.cpp).
void ripples_of(const Candidate& c, const Evidence& evidence,
                const std::function<void(int, MatX<double>)>& visit) {
  const double first = c.grid.front()[0], step = c.grid.size() > 1 ? c.grid[1][0] - first : 0.0;
  evidence.ripples(c.effect.joints[0], first, step, static_cast<int>(c.grid.size()), visit);
}

}  // namespace

ScoreTable::ScoreTable(const Evidence& evidence, const std::vector<Candidate>& candidates,
                       double table_bytes)
    : evidence_(evidence), candidates_(candidates) {
  double ripples = 0.0;
  for (const Candidate& c : candidates)
    if (is_ripple(c)) ripples += static_cast<double>(c.grid.size());
  const double bytes_each = 2.0 * 2.0 * sizeof(double) * static_cast<double>(evidence.times());
  for (std::size_t c = 0; c < candidates.size(); ++c) {
    if (is_ripple(candidates[c])) {
      add_ripples(static_cast<int>(c), ripples * bytes_each <= table_bytes);
      continue;
    }
    for (std::size_t g = 0; g < candidates[c].grid.size(); ++g) {
      Variant v;
      v.candidate = static_cast<int>(c);
      v.point = static_cast<int>(g);
      fill(v);
      variants_.push_back(std::move(v));
    }
  }
}

void ScoreTable::add_ripples(int candidate, bool keep) {
  const Candidate& c = candidates_[candidate];
  const std::vector<long> reached = evidence_.reached({c.effect.joints[0]});
  if (reached.empty()) return;
  const std::size_t first = variants_.size();
  for (std::size_t g = 0; g < c.grid.size(); ++g) {
    Variant v;
    v.candidate = candidate;
    v.point = static_cast<int>(g);
    v.offset = false;
    v.joints = reached;
    v.kept = keep;
    variants_.push_back(std::move(v));
  }
  if (keep)
    ripples_of(c, evidence_,
               [&](int g, MatX<double> raw) { variants_[first + g].raw = std::move(raw); });
}

void ScoreTable::sweep(const Wanted& wanted,
                       const std::function<void(std::size_t, const MatX<double>&)>& visit) const {
  for (std::size_t i = 0; i < variants_.size(); ++i)
    if (!variants_[i].kept && variants_[i].point == 0 &&
        (!wanted || wanted(variants_[i].candidate)))
      ripples_of(
          candidates_[variants_[i].candidate], evidence_,
          [&](int g, const MatX<double>& raw) { visit(i + static_cast<std::size_t>(g), raw); });
}

void ScoreTable::fill(Variant& v) const {
  const long m = evidence_.times();
  const Candidate& c = candidates_[v.candidate];
  Term term = term_at(c, v.candidate, c.grid[v.point]);
  if (!term.effect.own && hides_motor(term.effect) && is_dry(term.effect) &&
      !evidence_.has_friction(term.effect.joints.front())) {
    v.joints.clear();  // friction on either side of its spring, of which there is none
    v.offset = false;
    v.raw.resize(0, 0);
    return;
  }
  set_torque(evidence_, c, term);
  // Most begin at no torque; a limit does not.
  v.offset = term.has_offset() && !term.offset.isZero(0.0);
  MatX<double> both(evidence_.rows(), term.width() + v.offset);
  both.leftCols(term.width()) = term.columns;
  if (v.offset) both.col(term.width()) = term.offset;
  v.joints.clear();
  for (long k = 0; k < std::ssize(evidence_.joints()); ++k)
    if (both.cols() > 0 && !both.middleRows(k * m, m).isZero(0.0)) v.joints.push_back(k);
  v.raw.resize(m * std::ssize(v.joints), both.cols());
  for (std::size_t i = 0; i < v.joints.size(); ++i)
    v.raw.middleRows(i * m, m) = both.middleRows(v.joints[i] * m, m);
}

void ScoreTable::recompute(const std::vector<bool>& joints) {
  for (Variant& v : variants_) {
    const Candidate& c = candidates_[v.candidate];
    const bool moved = c.effect.joints.empty() ||
                       std::ranges::any_of(c.effect.joints, [&](int j) { return joints[j]; });
    if (c.of_reference && moved) fill(v);
  }
}

void ScoreTable::measure(const Projection& projection) {
  std::vector<std::pair<std::vector<long>, const MatX<double>*>> raw;
  for (const Variant& v : variants_)
    if (v.kept) raw.emplace_back(v.joints, &v.raw);
  std::vector<Beside> beside = projection.beside(raw);
  auto next = beside.begin();
  for (Variant& v : variants_)
    if (v.kept) measure(v, std::move(*next++), projection);
  sweep({}, [&](std::size_t i, const MatX<double>& columns) {
    measure(variants_[i], projection.beside(variants_[i].joints, columns), projection);
    variants_[i].beside.whitened.resize(0, 0);
  });
}

void ScoreTable::measure(Variant& v, Beside beside, const Projection& projection) const {
  v.beside = std::move(beside);
  v.with_residual = projection.with_residual(v.beside);
  v.norms = v.beside.whitened.colwise().norm().transpose();
  v.gram = product(v.beside, v.beside);
}

const std::vector<double>& ScoreTable::point_of(const Score& score) const {
  const Variant& v = variants_[score.variant];
  const Candidate& c = candidates_[v.candidate];
  return c.grid[v.point];
}

Term ScoreTable::term_of(const Score& score) const {
  return term_at(candidates_[score.candidate], score.candidate, point_of(score));
}

std::vector<Score> ScoreTable::scores(const std::vector<Term>& terms,
                                      const NormalEquations& of_terms,
                                      const Projection& projection, const Wanted& wanted) const {
  const long s = of_terms.b.size();
  const SignedFit before = signed_fit(of_terms.K, of_terms.b, of_terms.sign);
  std::vector<Score> best(candidates_.size());
  for (std::size_t c = 0; c < candidates_.size(); ++c) best[c].candidate = static_cast<int>(c);
  const auto consider = [&](std::size_t i, const Beside& beside) {
    const Variant& v = variants_[i];
    const Candidate& c = candidates_[v.candidate];
    const long k = v.width();
    double visible = 0.0, whole = 0.0;
    long rank = 0;
    for (long w = 0; w < k + v.offset; ++w) {
      const double left = std::max(v.gram(w, w), 0.0), all = v.norms[w] * v.norms[w];
      visible += left;
      whole += all;
      rank += w < k && left > kInvisible * kInvisible * all;
    }
    const double share = whole > 0.0 ? std::sqrt(visible / whole) : 0.0;
    Score& b = best[v.candidate];
    b.visible_share = std::max(b.visible_share, share);
    if (share < kInvisible) return;
    MatX<double> SG(s, k + v.offset);
    VecX<double> Gr = v.with_residual;
    for (long at = 0; const Term& t : terms) {
      const MatX<double> both = product(t.beside, beside);
      SG.middleRows(at, t.width()) = both.topRows(t.width());
      if (t.has_offset()) Gr -= both.row(t.width()).transpose();
      at += t.width();
    }
    MatX<double> K(s + k, s + k);
    K << of_terms.K, SG.leftCols(k), SG.leftCols(k).transpose(), v.gram.topLeftCorner(k, k);
    VecX<double> rhs(s + k);
    rhs << of_terms.b, Gr.head(k);
    double gain = -before.gain;
    if (v.offset) {
      rhs.head(s) -= SG.col(k);
      rhs.tail(k) -= v.gram.block(0, k, k, 1);
      gain += 2.0 * Gr[k] - v.gram(k, k);
    }
    std::vector<bool> sign = of_terms.sign;
    for (const bool x : signs(c.effect, c.linear)) sign.push_back(x);
    VecX<double> start = VecX<double>::Zero(s + k);
    start.head(s) = before.x;
    gain += signed_fit(K, rhs, sign, start).gain;
    if (b.variant >= 0 && gain <= b.gain) return;
    b.gain = gain;
    b.variant = static_cast<int>(i);
    b.parameters = static_cast<int>(rank + std::ssize(c.shapes));
  };
  for (std::size_t i = 0; i < variants_.size(); ++i)
    if ((variants_[i].kept || terms.empty()) && (!wanted || wanted(variants_[i].candidate)))
      consider(i, variants_[i].beside);
  if (!terms.empty())
    sweep(wanted, [&](std::size_t i, const MatX<double>& raw) {
      consider(i, projection.beside(variants_[i].joints, raw));
    });
  return best;
}

}  // namespace diffnea
