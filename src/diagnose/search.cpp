#include "diagnose/search.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "diagnose/signed_fit.hpp"

namespace diffnea {
namespace {

/// A column of which the base leaves less than this share tells nothing: it is filter error and
/// rounding.
constexpr double kInvisible = 1e-4;
/// A shape whose derivative the linear parameters reproduce but for this share cannot be told from
/// them.
constexpr double kRedundant = 0.02;
/// Of an accepted effect's torque: so well do its columns have its shape (filters, the reference
/// model, terms of order two). What explains less beside it is not taken for another effect.
constexpr double kAccuracy = 0.02;
/// The same of dry friction: filtered, nothing is known of how it turns but for a few milliseconds.
constexpr double kDryAccuracy = 0.04;
/// χ²: what one or the other makes of a choice that the recording shows.
constexpr double kSideShows = 1.0;
/// Of a joint's measured torque.
constexpr double kWhole = 0.95;
constexpr double kMostGainError = 0.5;
/// Of a shape in one step: of its logarithm; of a ratio, which is about 1.
constexpr double kMostLog = 0.7, kMostPlain = 0.3;

Scale scale_of(const Term& term, int parameter) {
  return scale(term.effect.parameter_info[static_cast<std::size_t>(parameter)]);
}

std::vector<bool> signs(const BoundEffect& effect, const std::vector<int>& linear) {
  std::vector<bool> out;
  for (const int k : linear)
    out.push_back(effect.parameter_info[static_cast<std::size_t>(k)].sign != Sign::kFree);
  return out;
}

bool is_ripple(const Candidate& c) { return c.effect.info().name == "cogging"; }

/// Ripples of a candidate's grid, which is even (bounds.cpp).
void ripples_of(const Candidate& c, const Evidence& evidence,
                const std::function<void(int, MatX<double>)>& visit) {
  const double first = c.grid.front()[0], step = c.grid.size() > 1 ? c.grid[1][0] - first : 0.0;
  evidence.ripples(c.effect.joints[0], first, step, static_cast<int>(c.grid.size()), visit);
}

/// Dry friction, or a spring that its jumps wind up.
bool is_dry(const TriedEffect& effect) {
  if (std::holds_alternative<JointElasticity>(effect.type) && !effect.own)
    return JointElasticity::friction_share(effect.parameters.data()) < 1.0;
  return std::ranges::find(effect.parameter_info, "smoothing", &ParameterInfo::name) !=
         effect.parameter_info.end();
}

/// Columns of all terms, and the sum of their offsets.
struct Stack {
  MatX<double> G;
  VecX<double> offset;
};
Stack stack(const std::vector<Term>& terms, long rows) {
  long columns = 0;
  for (const Term& t : terms) columns += t.width();
  Stack out{MatX<double>(rows, columns), VecX<double>::Zero(rows)};
  columns = 0;
  for (const Term& t : terms) {
    out.G.middleCols(columns, t.width()) = t.projected.leftCols(t.width());
    if (t.has_offset()) out.offset += t.projected.col(t.width());
    columns += t.width();
  }
  return out;
}

}  // namespace

VecX<double> Term::values() const {
  VecX<double> out(static_cast<long>(linear.size()));
  for (std::size_t k = 0; k < linear.size(); ++k)
    out[static_cast<long>(k)] = effect.parameters[static_cast<std::size_t>(linear[k])];
  return out;
}

VecX<double> Term::torque() const {
  VecX<double> out = columns * values();
  if (has_offset()) out += offset;
  return out;
}

double Term::visible_share() const {
  VecX<double> seen = projected.leftCols(width()) * values();
  if (has_offset()) seen += projected.col(width());
  return norm > 0.0 ? seen.norm() / norm : 0.0;
}

Search::Search(const Evidence& evidence, const std::vector<Candidate>& candidates,
               const BasePrior& prior, const std::vector<bool>& used, double table_bytes)
    : evidence_(evidence), candidates_(candidates), prior_(prior), used_(used) {
  if (used_.empty()) used_.assign(static_cast<std::size_t>(evidence.rows()), true);
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

void Search::add_ripples(int candidate, bool keep) {
  const Candidate& c = candidates_[static_cast<std::size_t>(candidate)];
  const auto joint = std::ranges::find(evidence_.joints(), c.effect.joints[0]);
  if (joint == evidence_.joints().end()) return;
  const std::size_t first = variants_.size();
  for (std::size_t g = 0; g < c.grid.size(); ++g) {
    Variant v;
    v.candidate = candidate;
    v.point = static_cast<int>(g);
    v.offset = false;
    v.joints = {joint - evidence_.joints().begin()};
    v.kept = keep;
    variants_.push_back(std::move(v));
  }
  if (keep)
    ripples_of(c, evidence_, [&](int g, MatX<double> raw) {
      variants_[first + static_cast<std::size_t>(g)].raw = std::move(raw);
    });
}

void Search::sweep(const std::function<void(std::size_t, const MatX<double>&)>& visit) const {
  for (std::size_t i = 0; i < variants_.size(); ++i)
    if (!variants_[i].kept && variants_[i].point == 0)
      ripples_of(
          candidates_[static_cast<std::size_t>(variants_[i].candidate)], evidence_,
          [&](int g, const MatX<double>& raw) { visit(i + static_cast<std::size_t>(g), raw); });
}

void Search::fill(Variant& v) const {
  const long m = evidence_.times();
  const Term term = make_term(
      v.candidate,
      candidates_[static_cast<std::size_t>(v.candidate)].grid[static_cast<std::size_t>(v.point)]);
  // Most begin at no torque; a limit does not.
  v.offset = term.has_offset() && !term.offset.isZero(0.0);
  MatX<double> both(evidence_.rows(), term.width() + v.offset);
  both.leftCols(term.width()) = term.columns;
  if (v.offset) both.col(term.width()) = term.offset;
  v.joints.clear();
  for (long k = 0; k < static_cast<long>(evidence_.joints().size()); ++k)
    if (!both.middleRows(k * m, m).isZero(0.0)) v.joints.push_back(k);
  v.raw.resize(m * static_cast<long>(v.joints.size()), both.cols());
  for (std::size_t i = 0; i < v.joints.size(); ++i)
    v.raw.middleRows(static_cast<long>(i) * m, m) = both.middleRows(v.joints[i] * m, m);
}

void Search::recompute() {
  for (Variant& v : variants_)
    if (candidates_[static_cast<std::size_t>(v.candidate)].of_reference) fill(v);
}

Term Search::make_term(int candidate, const std::vector<double>& point) const {
  const Candidate& c = candidates_[static_cast<std::size_t>(candidate)];
  Term term;
  term.candidate = candidate;
  term.effect = c.effect;
  term.linear = c.linear;
  term.shapes = c.shapes;
  // A spring that is not there has a rest anywhere: its column shows at a stiffness of 1 alone.
  const bool has_rest =
      term.linear.size() > 1 && std::ranges::any_of(term.linear, [&](int k) {
        return scale_of(term, k) == Scale::kPlain &&
               term.effect.parameter_info[static_cast<std::size_t>(k)].sign == Sign::kFree;
      });
  for (const int k : term.linear)
    term.effect.parameters[static_cast<std::size_t>(k)] =
        has_rest && scale_of(term, k) == Scale::kLinear ? 1.0 : 0.0;
  c.set(point, term.effect);
  set_columns(term);
  return term;
}

void Search::set_columns(Term& term) const {
  const Candidate& c = candidates_[static_cast<std::size_t>(term.candidate)];
  term.columns = evidence_.columns(term.effect, term.linear);
  if (c.nonlinear) term.offset = evidence_.torque_of(term.effect) - term.columns * term.values();
  if (!projection_) return;
  MatX<double> both = term.columns;
  if (term.has_offset()) {
    both.conservativeResize(Eigen::NoChange, term.width() + 1);
    both.col(term.width()) = term.offset;
  }
  const MatX<double> whitened = (*whitener_)(both);
  const VecX<double> whole = whitened.colwise().norm().transpose();
  term.projected = projection_->project_whitened(whitened);
  term.rank = 0;
  for (long k = 0; k < term.width(); ++k)
    term.rank += term.projected.col(k).norm() > kInvisible * whole[k];
}

void Search::refresh(double period, std::vector<Term>& terms) {
  const bool first = !projection_;
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
        if (evidence_.rest()(i, static_cast<long>(k)) > 0.3)
          rows[k * static_cast<std::size_t>(evidence_.times()) + static_cast<std::size_t>(i)] =
              false;
    VecX<double> noise = period > 0.0 ? repeatable_noise(evidence_, left, period) : VecX<double>();
    repeatable_ = noise.size() > 0;
    double lost = 0.0;
    if (repeatable_) {
      for (long i = 0; i < noise.size(); ++i)
        rows[static_cast<std::size_t>(i)] =
            rows[static_cast<std::size_t>(i)] && std::isfinite(noise[i]);
    } else {
      noise = beside_smooth_functions(evidence_, prior_.free, prior_.x0, left, rows);
      lost = static_cast<double>(projection_->rank() + num_parameters(terms)) /
             static_cast<double>(evidence_.joints().size());
    }
    std::vector<JointNoise> estimate = estimate_noise(evidence_, noise, rows, lost);
    projection_.reset();
    whitener_ = std::make_unique<Whitener>(evidence_, std::move(estimate), used_);
    projection_ = std::make_unique<Projection>(evidence_, *whitener_, prior_);
    for (Term& t : terms) set_columns(t);
    fit(terms);
  }
  for (Variant& v : variants_)
    if (v.kept) measure(v, v.raw);
  sweep([&](std::size_t i, const MatX<double>& raw) {
    measure(variants_[i], raw);
    variants_[i].whitened.resize(0, 0);
  });
}

void Search::measure(Variant& v, const MatX<double>& raw) const {
  const long m = evidence_.times();
  const MatX<double>& Q = projection_->basis();
  v.whitened.resize(raw.rows(), raw.cols());
  MatX<double> onto_base = MatX<double>::Zero(Q.cols(), raw.cols());
  v.onto = VecX<double>::Zero(raw.cols());
  for (std::size_t i = 0; i < v.joints.size(); ++i) {
    auto block = v.whitened.middleRows(static_cast<long>(i) * m, m);
    block = whitener_->joint(v.joints[i], raw.middleRows(static_cast<long>(i) * m, m));
    onto_base.noalias() += Q.middleRows(v.joints[i] * m, m).transpose() * block;
    v.onto.noalias() += block.transpose() * projection_->residual().segment(v.joints[i] * m, m);
  }
  const MatX<double> whole = v.whitened.transpose() * v.whitened;
  v.norms = whole.diagonal().cwiseSqrt();
  v.gram = whole - onto_base.transpose() * onto_base;
}

std::vector<bool> Search::signs_of(const std::vector<Term>& terms) const {
  std::vector<bool> out;
  for (const Term& t : terms)
    for (const bool s : signs(t.effect, t.linear)) out.push_back(s);
  return out;
}

std::vector<Score> Search::scores(const std::vector<Term>& terms) const {
  const Stack S = stack(terms, projection_->residual().size());
  const VecX<double> r = projection_->residual() - S.offset;
  const MatX<double> SS = S.G.transpose() * S.G;
  const VecX<double> Sr = S.G.transpose() * r;
  const std::vector<bool> s_signs = signs_of(terms);
  const double before = signed_fit(SS, Sr, s_signs).gain, chi2 = r.squaredNorm();
  const double n = static_cast<double>(rows());
  const long m = evidence_.times();
  std::vector<Score> best(candidates_.size());
  for (std::size_t c = 0; c < candidates_.size(); ++c) best[c].candidate = static_cast<int>(c);
  const auto consider = [&](std::size_t i, const MatX<double>& whitened) {
    const Variant& v = variants_[i];
    const Candidate& c = candidates_[static_cast<std::size_t>(v.candidate)];
    const long k = v.width(), s = S.G.cols();
    double visible = 0.0, whole = 0.0;
    long rank = 0;
    for (long w = 0; w < k + v.offset; ++w) {
      const double left = std::max(v.gram(w, w), 0.0), all = v.norms[w] * v.norms[w];
      visible += left;
      whole += all;
      rank += w < k && left > kInvisible * kInvisible * all;
    }
    const double share = whole > 0.0 ? std::sqrt(visible / whole) : 0.0;
    Score& b = best[static_cast<std::size_t>(v.candidate)];
    b.visible_share = std::max(b.visible_share, share);
    if (share < kInvisible) return;
    MatX<double> SG = MatX<double>::Zero(s, k + v.offset);  // terms are beside the base: SᵀG⊥ = SᵀG
    VecX<double> Gr = v.onto;
    // Without terms that is all there is to know.
    for (std::size_t j = 0; !terms.empty() && j < v.joints.size(); ++j) {
      const auto block = whitened.middleRows(static_cast<long>(j) * m, m);
      SG.noalias() += S.G.middleRows(v.joints[j] * m, m).transpose() * block;
      Gr.noalias() -= block.transpose() * S.offset.segment(v.joints[j] * m, m);
    }
    MatX<double> K(s + k, s + k);
    K << SS, SG.leftCols(k), SG.leftCols(k).transpose(), v.gram.topLeftCorner(k, k);
    VecX<double> rhs(s + k);
    rhs << Sr, Gr.head(k);
    double gain = -before;
    if (v.offset) {
      rhs.head(s) -= SG.col(k);
      rhs.tail(k) -= v.gram.block(0, k, k, 1);
      gain += 2.0 * Gr[k] - v.gram(k, k);
    }
    std::vector<bool> sign = s_signs;
    for (const bool x : signs(c.effect, c.linear)) sign.push_back(x);
    gain += signed_fit(K, rhs, sign).gain;
    if (b.variant >= 0 && gain <= b.gain) return;
    b.gain = gain;
    b.variant = static_cast<int>(i);
    b.parameters = static_cast<int>(rank + static_cast<long>(c.shapes.size()));
  };
  for (std::size_t i = 0; i < variants_.size(); ++i)
    if (variants_[i].kept || terms.empty()) consider(i, variants_[i].whitened);
  if (!terms.empty())
    sweep([&](std::size_t i, const MatX<double>& raw) {
      consider(i, whitener_->joint(variants_[i].joints[0], raw));
    });
  for (Score& b : best)
    b.delta_bic = b.variant < 0 ? -1e9
                                : cost(chi2 - before) - cost(chi2 - before - b.gain) -
                                      b.parameters * std::log(n) - looked_elsewhere(b.candidate);
  std::ranges::sort(best, std::greater<>{}, &Score::delta_bic);
  return best;
}

Term Search::refined(const Score& score, const std::vector<Term>& terms) const {
  const Variant& v = variants_[static_cast<std::size_t>(score.variant)];
  const Candidate& c = candidates_[static_cast<std::size_t>(v.candidate)];
  return refined(make_term(v.candidate, c.grid[static_cast<std::size_t>(v.point)]), terms);
}

Term Search::refined(Term term, const std::vector<Term>& terms) const {
  Term best = descended(std::move(term), terms);
  const auto gain_with = [&](const Term& t) {
    std::vector<Term> with = terms;
    with.push_back(t);
    return fit(with);
  };
  // What is one or the other, each with the shapes that suit it.
  for (const int k : candidates_[static_cast<std::size_t>(best.candidate)].choices) {
    const Term from = best;
    for (const double value : best.effect.parameter_info[static_cast<std::size_t>(k)].choices) {
      if (value == from.effect.parameters[static_cast<std::size_t>(k)]) continue;
      Term other = from;
      other.effect.parameters[static_cast<std::size_t>(k)] = value;
      set_columns(other);
      other = descended(std::move(other), terms);
      const double gain = gain_with(other) - gain_with(best);
      if (plausible(other) == plausible(best) ? gain > kSideShows : plausible(other))
        best = std::move(other);
    }
  }
  hold_rotor(best);
  return best;
}

void Search::hold_rotor(Term& term) const {
  const Candidate& c = candidates_[static_cast<std::size_t>(term.candidate)];
  double* p = term.effect.parameters.data();  // stiffness, damping, inertia
  if (!(c.rotor > 0.0) || term.shapes.size() >= c.shapes.size() || !(p[2] > 0.0)) return;
  const double by = c.rotor / p[2];
  for (int k = 0; k < 3; ++k) p[k] *= by;
  set_columns(term);
}

Term Search::descended(Term term, const std::vector<Term>& terms) const {
  const Candidate& c = candidates_[static_cast<std::size_t>(term.candidate)];
  std::vector<Term> all = terms;
  all.push_back(std::move(term));
  double gain = fit(all);
  if (c.nonlinear) {  // the torque at the fitted values instead of its straight line
    set_columns(all.back());
    gain = std::max(gain_at(all), 0.0);
  }
  double shrink = 1.0;
  for (int step = 0; step < 12 && (!all.back().shapes.empty() || c.nonlinear); ++step) {
    const Stack S = stack(all, projection_->residual().size());
    const MatX<double> D =
        projection_->project(evidence_.columns(all.back().effect, all.back().shapes));
    if (step == 0 && drop_redundant(S.G, D, all.back())) {
      if (all.back().shapes.empty() && !c.nonlinear) break;
      continue;
    }
    const long shapes = D.cols();
    MatX<double> J(S.G.rows(), S.G.cols() + shapes);
    J << S.G, D;
    MatX<double> K = J.transpose() * J;
    VecX<double> scale = K.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    K = scale.asDiagonal() * K * scale.asDiagonal();
    K.diagonal().array() += 1e-6;
    const VecX<double> rhs =
        scale.cwiseProduct(J.transpose() * (projection_->residual() - S.offset));
    const VecX<double> x = scale.cwiseProduct(K.ldlt().solve(rhs));
    const VecX<double> now_values = all.back().values();
    std::vector<Term> fitted = all;
    fit(fitted);
    const VecX<double> target = fitted.back().values();
    bool better = false;
    const double before = gain;
    for (; shrink > 0.02 && !better; shrink *= better ? 1.0 : 0.3) {
      std::vector<Term> trial = all;
      Term& moved = trial.back();
      for (std::size_t k = 0; k < moved.linear.size(); ++k)
        moved.effect.parameters[static_cast<std::size_t>(moved.linear[k])] =
            now_values[static_cast<long>(k)] + shrink * (target - now_values)[static_cast<long>(k)];
      for (long s = 0; s < shapes; ++s) {
        const std::size_t k = static_cast<std::size_t>(moved.shapes[static_cast<std::size_t>(s)]);
        const auto at = std::ranges::find(c.shapes, static_cast<int>(k));
        double& value = moved.effect.parameters[k];
        const double by = shrink * x[S.G.cols() + s];
        if (scale_of(moved, static_cast<int>(k)) == Scale::kLog)
          value *= std::exp(std::clamp(by, -kMostLog, kMostLog));
        else
          value += std::clamp(by, -kMostPlain, kMostPlain);
        if (at == c.shapes.end()) continue;
        const std::size_t bound = static_cast<std::size_t>(at - c.shapes.begin());
        value = std::clamp(value, c.shape_low[bound], c.shape_high[bound]);
      }
      set_columns(moved);
      const double now = c.nonlinear ? gain_at(trial) : fit(trial);
      if (now > gain) {
        gain = now;
        all = std::move(trial);
        better = true;
      }
    }
    shrink = std::min(1.0, 3.0 * shrink);
    if (!better || gain - before < 0.02) break;  // far inside one unit of χ²
  }
  return all.back();
}

bool Search::drop_redundant(const MatX<double>& G, const MatX<double>& D, Term& term) const {
  const Eigen::HouseholderQR<MatX<double>> qr(G);
  const MatX<double> Q = qr.householderQ() * MatX<double>::Identity(G.rows(), G.cols());
  std::vector<int> kept;
  for (long s = 0; s < D.cols(); ++s) {
    const double left = (D.col(s) - Q * (Q.transpose() * D.col(s))).norm();
    if (left > kRedundant * D.col(s).norm())
      kept.push_back(term.shapes[static_cast<std::size_t>(s)]);
  }
  const bool dropped = kept.size() < term.shapes.size();
  term.shapes = std::move(kept);
  return dropped;
}

bool Search::plausible(const Term& term) const {
  // A rotor that its spring's damper does not let swing is a lag by another name.
  if (const auto* spring = std::get_if<JointElasticity>(&term.effect.type);
      spring && !term.effect.own) {
    const double* p = term.effect.parameters.data();  // stiffness, damping, inertia
    if (p[1] * p[1] > 4.0 * p[0] * p[2]) return false;
  }
  // A hidden rotor without inertia only bends the friction that turns with it.
  for (const int k : term.linear)
    if (term.effect.parameter_info[static_cast<std::size_t>(k)].name == "motor_inertia" &&
        !(term.effect.parameters[static_cast<std::size_t>(k)] > 0.0))
      return false;
  // At the least distance that shows, bristles are Coulomb friction.
  const Candidate& c = candidates_[static_cast<std::size_t>(term.candidate)];
  for (std::size_t s = 0; s < c.shapes.size(); ++s) {
    const std::size_t k = static_cast<std::size_t>(c.shapes[s]);
    if (term.effect.parameter_info[k].name == "presliding" &&
        !(term.effect.parameters[k] > c.shape_low[s]))
      return false;
  }
  // Beyond, no torque constant is off.
  for (const int k : term.linear)
    if (term.effect.parameter_info[static_cast<std::size_t>(k)].name == "gain_error" &&
        std::abs(term.effect.parameters[static_cast<std::size_t>(k)]) > kMostGainError)
      return false;
  const VecX<double> torque = term.torque();
  const long m = evidence_.times();
  for (long k = 0; k < static_cast<long>(evidence_.joints().size()); ++k)
    if (torque.segment(k * m, m).norm() >
        kWhole * evidence_.size(k) * std::sqrt(static_cast<double>(m)))
      return false;
  return true;
}

double Search::fit(std::vector<Term>& terms) const {
  if (terms.empty()) return 0.0;
  const Stack S = stack(terms, projection_->residual().size());
  const VecX<double> r = projection_->residual() - S.offset;
  const SignedFit f = signed_fit(S.G.transpose() * S.G, S.G.transpose() * r, signs_of(terms));
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
  const Stack S = stack(terms, projection_->residual().size());
  VecX<double> after = projection_->residual() - S.offset;
  long at = 0;
  for (const Term& t : terms) {
    after -= S.G.middleCols(at, t.width()) * t.values();
    at += t.width();
  }
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
  }
  return out;
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

std::vector<MatX<double>> Search::covariances(const std::vector<Term>& terms) const {
  std::vector<MatX<double>> columns;
  long width = 0;
  for (const Term& t : terms) {
    MatX<double> J(t.projected.rows(), t.width() + static_cast<long>(t.shapes.size()));
    J << t.projected.leftCols(t.width()),
        projection_->project(evidence_.columns(t.effect, t.shapes));
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
  K.diagonal().array() += 1e-9;
  MatX<double> C = K.llt().solve(MatX<double>::Identity(width, width));
  // Rows are in units of noise; a lack of fit that is left widens the intervals.
  const double chi2 =
      (residual_sum() - gain_of(terms)) / static_cast<double>(std::max<long>(rows() - width, 1));
  C = std::max(1.0, chi2) * (scale.asDiagonal() * C * scale.asDiagonal());
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
