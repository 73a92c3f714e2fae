#include "diagnose/ball_search.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/random.hpp>

#include "core/decompositions.hpp"
#include "diagnose/thresholds.hpp"

namespace diffnea {
namespace {

constexpr int kLags = 40;  ///< rows over which what is left may hang together
/// A column that the others leave less of than this is theirs.
constexpr double kSameColumn = 1e-6;

long count(const BallData& data) {
  long out = 0;
  for (const BallWindow& w : data.windows) out += 3 * std::ssize(w.time);
  return out;
}

}  // namespace

std::vector<RowMatX<double>> ball_errors(const FittedBall& ball, const FlightOptions& flight) {
  std::vector<RowMatX<double>> out;
  for (const BallWindow& w : ball.data.windows) {
    const std::vector<Vec3<double>> seen =
        predict_ball(ball.model, ball.layout, ball.p, ball.data, w, flight);
    RowMatX<double> e(std::ssize(seen), 3);
    for (std::size_t k = 0; k < seen.size(); ++k) {
      const Vec3<double> d = w.seen[k] - seen[k];
      e.row(k) << d.x, d.y, d.z;
    }
    out.push_back(std::move(e));
  }
  return out;
}

double correlation(const std::vector<RowMatX<double>>& stretches) {
  std::vector<double> sums(kLags + 1, 0.0);
  for (const RowMatX<double>& e : stretches)
    for (int lag = 0; lag <= std::min<long>(kLags, e.rows() - 1); ++lag)
      sums[lag] += (e.topRows(e.rows() - lag).array() * e.bottomRows(e.rows() - lag).array()).sum();
  double out = 1.0;
  for (int lag = 1; lag <= kLags && sums[lag] > 0.0; ++lag) out += 2.0 * sums[lag] / sums[0];
  return out;
}

BallSearch::BallSearch(const Model& model, std::vector<EffectSpec> base, bool fit_base,
                       BallData train, BallData test, const BallFitOptions& options,
                       std::function<bool(const std::string&, int)> progress)
    : model_(model),
      base_(std::move(base)),
      fit_base_(fit_base),
      train_(std::move(train)),
      test_(std::move(test)),
      options_(options),
      progress_(std::move(progress)),
      samples_(count(train_)) {}

BallLayout BallSearch::layout_of(const std::vector<EffectSpec>& terms) const {
  std::vector<EffectSpec> all = base_;
  all.insert(all.end(), terms.begin(), terms.end());
  BallLayout out = make_ball_layout(model_, all, fit_base_);
  for (BallParameter& p : out.parameters)
    if (!fit_base_ && p.effect >= 0 && p.effect < static_cast<int>(base_.size())) p.fixed = true;
  return out;
}

BallSolution BallSearch::solve(const std::vector<EffectSpec>& terms, const BallSolution* start,
                               double) const {
  BallLayout layout = layout_of(terms);
  std::vector<bool> fresh(layout.parameters.size(), true);
  if (start)
    for (std::size_t i = 0; i < layout.parameters.size(); ++i)
      for (std::size_t k = 0; k < start->ball.layout.parameters.size(); ++k) {
        BallParameter& p = layout.parameters[i];
        if (start->ball.layout.parameters[k].name != p.name || p.fixed) continue;
        p.value = start->ball.p[k];
        fresh[i] = false;
      }
  const BallData& data = start ? start->ball.data : train_;
  BallSolution best = solved(terms, layout, data);
  // Where a slope at 0 leads nowhere, others of the effect's own starts may: of one, of all at
  // once.
  BallLayout all = layout;
  int moved = 0;
  const auto try_from = [&](const BallLayout& elsewhere) {
    BallSolution other = solved(terms, elsewhere, data);
    if (other.cost < best.cost) best = std::move(other);
  };
  for (std::size_t i = 0; start && i < layout.parameters.size(); ++i) {
    const BallParameter& p = layout.parameters[i];
    if (p.effect < 0 || p.fixed || !fresh[i]) continue;
    const BoundEffect& e = layout.effects[p.effect];
    const auto& starts = e.parameter_info[p.index].search;
    for (const double value : starts) {
      BallLayout elsewhere = layout;
      elsewhere.parameters[i].value = value;
      try_from(elsewhere);
    }
    if (starts.empty()) continue;
    all.parameters[i].value = starts.front();
    ++moved;
  }
  if (moved > 1) try_from(all);
  return best;
}

BallSolution BallSearch::solved(const std::vector<EffectSpec>& terms, const BallLayout& layout,
                                const BallData& data) const {
  BallSolution out;
  out.terms = terms;
  out.ball = {model_, layout, {}, data};
  out.fit = fit_ball(model_, out.ball.layout, out.ball.data, options_,
                     [&](int, double) { return !progress_ || progress_("fitting the ball", 1); });
  out.ball.p = out.fit.p;
  out.cost =
      ball_cost(model_, out.ball.layout, out.ball.p, out.ball.data, options_.sigma, options_);
  return out;
}

double BallSearch::correlation(const BallSolution& at) const {
  const double most = 4.0 * options_.sigma;
  std::vector<RowMatX<double>> left = ball_errors(at.ball, options_.flight);
  for (RowMatX<double>& e : left) e = e.cwiseMax(-most).cwiseMin(most).eval();
  return diffnea::correlation(left);
}

double BallSearch::delta_bic(const BallSolution& a, const BallSolution& b) const {
  const auto n = static_cast<double>(samples_);
  const auto size = [](const BallSolution& s) {
    return static_cast<double>(std::ranges::count_if(
        s.ball.layout.parameters, [](const BallParameter& p) { return !p.fixed; }));
  };
  return window_delta_bic(a.cost, b.cost, n, correlation(b), size(b) - size(a));
}

std::vector<WindowScore> BallSearch::scores(const BallSolution& at,
                                          const std::vector<EffectSpec>& candidates) const {
  std::vector<EffectSpec> terms = at.terms;
  std::vector<WindowScore> out;
  for (const EffectSpec& c : candidates)
    if (!holds_effect(terms, c))
      out.push_back({.effect = c});
  for (const WindowScore& s : out) terms.push_back(s.effect);
  const BallLayout layout = layout_of(terms);
  VecX<double> p = layout.values();
  p.head(at.ball.p.size()) = at.ball.p;
  BallLayout moved = layout;
  bool stopped = false;
  const BallLinearisation linear =
      linearise_ball(model_, moved, p, at.ball.data, options_.sigma, options_, [&] {
        stopped = progress_ && !progress_("testing the ball", 0);
        return !stopped;
      });
  if (stopped) return {};
  const long known = std::ranges::count_if(at.ball.layout.parameters,
                                           [](const BallParameter& q) { return !q.fixed; });
  const long rows = linear.R.rows() - known;
  const MatX<double> G = linear.R.bottomRightCorner(rows, rows);
  const VecX<double> d = linear.d.tail(rows);
  const auto n = static_cast<double>(samples_);
  const double correlated = correlation(at);
  long column = 0;
  for (WindowScore& s : out) {
    const auto k = static_cast<long>(bind(s.effect, model_).parameters.size());
    const MatX<double> g = G.middleCols(column, k);
    const VecX<double> norms = linear.norms.segment(known + column, k);
    const Sign sign = layout.parameters[at.ball.p.size() + column].sign;
    column += k;
    s.visible_share = norms.norm() > 0.0 ? g.norm() / norms.norm() : 0.0;
    if (!(s.visible_share > kSameColumn)) {
      s.values = VecX<double>::Zero(k);
      continue;
    }
    s.values = g.colPivHouseholderQr().solve(d);
    if (k == 1 && sign != Sign::kFree && s.values[0] < 0.0) s.values.setZero();
    s.lm = std::max(0.0, d.squaredNorm() - (d - g * s.values).squaredNorm());
    s.delta_bic = window_delta_bic(at.cost, std::max(1e-9 * at.cost, at.cost - s.lm), n,
                                   correlated, static_cast<double>(k));
    s.promise = s.delta_bic;
  }
  std::ranges::stable_sort(out, std::ranges::greater{}, &WindowScore::delta_bic);
  return out;
}

HeldOutChange BallSearch::held_out(const BallSolution& a, const BallSolution& b,
                                   std::uint64_t seed) const {
  const auto errors = [&](const BallSolution& s) {
    const FittedBall there = fit_states(s.ball, test_, options_);
    std::vector<double> out;
    for (const RowMatX<double>& e : ball_errors(there, options_.flight)) {
      double sum = 0.0;  // outliers count as in the fit
      for (Eigen::Index k = 0; k < e.rows(); ++k) {
        const double u = e.row(k).norm() / (options_.sigma * std::sqrt(3.0));
        sum += 3.0 * std::min(u * u, 100.0);
      }
      out.push_back(sum);
    }
    return out;
  };
  return change_over({errors(a), errors(b), static_cast<double>(count(test_))}, seed);
}

bool BallSearch::is_far_from_linear(const EffectSpec& e) const {
  return std::ranges::any_of(find_effect(e.effect).parameters,
                             [](const ParameterInfo& p) { return !p.search.empty(); });
}

std::vector<CauseParameter> BallSearch::parameters_of(const BallSolution& at,
                                                      const EffectSpec& term) const {
  std::vector<CauseParameter> out;
  const double together = correlation(at);
  for (std::size_t k = 0; k < at.ball.layout.parameters.size(); ++k) {
    const BallParameter& p = at.ball.layout.parameters[k];
    if (p.effect < 0) continue;
    const BoundEffect& e = at.ball.layout.effects[p.effect];
    if (e.info().name != term.effect || e.where != term.where) continue;
    const auto i = static_cast<Eigen::Index>(k);
    const double value = at.ball.p[i], std = std::sqrt(at.fit.covariance(i, i) * together);
    out.push_back(
        {e.parameter_info[p.index].name, p.unit, value, std,
         p.sign == Sign::kFree ? value - kNormal95 * std : std::max(0.0, value - kNormal95 * std),
         value + kNormal95 * std});
  }
  return out;
}

double BallSearch::share_of_motion(double lm) const {
  return std::sqrt(std::max(0.0, lm) / static_cast<double>(samples_)) * options_.sigma /
         path_spread(train_);
}

}  // namespace diffnea
