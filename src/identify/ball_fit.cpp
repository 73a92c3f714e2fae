#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "core/median.hpp"
#include "identify/ball_world.hpp"

namespace diffnea {
namespace {

constexpr int kState = 6;
/// A first state is known to a metre and a metre a second: holds what a taut string hides of it.
constexpr double kStatePrior = 1.0;
/// Huber's threshold, of the root mean square of a position's three errors over σ.
constexpr double kHuber = 3.0;

double norm(const Vec3<double>& v) { return std::sqrt(dot(v, v)); }
double axis(const Vec3<double>& v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }
double& axis(Vec3<double>& v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }

Vec3<double>& part(ParticleState<double>& s, int k) { return k < 3 ? s.x : s.v; }

double weight_of(const Vec3<double>& error, double sigma, bool robust) {
  const double u = norm(error) / (sigma * std::sqrt(3.0));
  return !robust || u <= kHuber ? 1.0 : kHuber / u;
}

/// What a step makes of a value: positive ones shrink tenfold at most, and none passes its limit.
double allowed(const BallParameter& p, double value, double step) {
  const double least = p.sign == Sign::kPositive ? 0.1 * value : -INFINITY;
  return std::clamp(value + step, least, std::max(least, p.most));
}

/// Errors, (3m), and their derivatives with respect to state and free parameters.
struct WindowColumns {
  VecX<double> error;
  MatX<double> J;  // (3m, 6 + F)
};

WindowColumns window_columns(const Model& model, const BallLayout& layout, const VecX<double>& p,
                             const std::vector<int>& free, const BallData& data,
                             const BallWindow& window, const FlightOptions& options) {
  const auto rows = static_cast<Eigen::Index>(window.time.size());
  const auto unknowns = kState + static_cast<int>(free.size());
  WindowColumns out{VecX<double>(3 * rows), MatX<double>(3 * rows, unknowns)};
  const HandMotion& hand = data.hands[static_cast<std::size_t>(window.hand)];
  for (int first = 0; first < unknowns; first += kJetWidth) {
    const auto seeded = [&](double x, int unknown) {
      const int k = unknown - first;
      return k >= 0 && k < kJetWidth ? JetD(x, k) : JetD(x);
    };
    std::vector<JetD> values;
    for (Eigen::Index i = 0; i < p.size(); ++i) values.emplace_back(p[i]);
    for (std::size_t f = 0; f < free.size(); ++f)
      values[free[f]] = seeded(p[free[f]], kState + static_cast<int>(f));
    const BallWorld<JetD> world(model, layout, hand, std::move(values));
    const Vec3<double>&x = window.state.x, &v = window.state.v;
    const ParticleState<JetD> state{{seeded(x.x, 0), seeded(x.y, 1), seeded(x.z, 2)},
                                    {seeded(v.x, 3), seeded(v.y, 4), seeded(v.z, 5)}};
    fly(world, window, state, options, [&](std::size_t k, const Vec3<JetD>& seen, const auto&) {
      const JetD* at[3] = {&seen.x, &seen.y, &seen.z};
      for (int c = 0; c < 3; ++c) {
        const auto row = 3 * static_cast<Eigen::Index>(k) + c;
        out.error[row] = axis(window.seen[k], c) - at[c]->a;
        for (int d = 0; d < kJetWidth && first + d < unknowns; ++d)
          out.J(row, first + d) = at[c]->v[d];
      }
    });
  }
  return out;
}

std::vector<int> free_parameters(const BallLayout& layout) {
  std::vector<int> out;
  for (std::size_t k = 0; k < layout.parameters.size(); ++k)
    if (!layout.parameters[k].fixed) out.push_back(static_cast<int>(k));
  return out;
}

VecX<double> errors_of(const Model& model, const BallLayout& layout, const VecX<double>& p,
                       const BallData& data, const BallWindow& window,
                       const FlightOptions& flight) {
  const std::vector<Vec3<double>> seen = predict_ball(model, layout, p, data, window, flight);
  VecX<double> out(3 * static_cast<Eigen::Index>(seen.size()));
  for (std::size_t k = 0; k < seen.size(); ++k)
    for (int c = 0; c < 3; ++c)
      out[3 * static_cast<Eigen::Index>(k) + c] = axis(window.seen[k], c) - axis(seen[k], c);
  return out;
}

/// σ from the median of |e|, for the numbers that parameters and states have used up.
double noise_of(const Model& model, const BallLayout& layout, const VecX<double>& p,
                const BallData& data, const FlightOptions& flight) {
  std::vector<double> all;
  for (const BallWindow& w : data.windows) {
    const VecX<double> e = errors_of(model, layout, p, data, w, flight);
    for (const double x : e) all.push_back(std::abs(x));
  }
  const double used = static_cast<double>(free_parameters(layout).size()) +
                      kState * static_cast<double>(data.windows.size());
  const auto n = static_cast<double>(all.size());
  return std::max(1e-9, 1.4826 * median(all) * std::sqrt(n / std::max(1.0, n - used)));
}

/// Whether the string is taut where windows begin: by the distance of their first rows.
bool mark_taut(const Model& model, const BallLayout& layout, const VecX<double>& p, double sigma,
               BallData& data) {
  if (!model.ball->string) return false;
  bool changed = false;
  for (BallWindow& w : data.windows) {
    const HandMotion& hand = data.hands[static_cast<std::size_t>(w.hand)];
    const BallWorld<double> world(model, layout, hand, {p.begin(), p.end()});
    const auto count = static_cast<int>(std::min<std::size_t>(5, w.time.size()));
    double excess = 0.0;
    for (int k = 0; k < count; ++k) excess += norm(w.seen[k] - world.anchor(w.time[k]).x) - world.r;
    const bool taut = excess / count > -std::max(3.0 * sigma / std::sqrt(count), 0.01 * world.r);
    changed = changed || taut != w.taut;
    w.taut = taut;
  }
  return changed;
}

}  // namespace

double ball_cost(const Model& model, const BallLayout& layout, const VecX<double>& p,
                 const BallData& data, double sigma, const BallFitOptions& options) {
  double sum = 0.0;
  for (const BallWindow& w : data.windows) {
    const VecX<double> e = errors_of(model, layout, p, data, w, options.flight);
    for (Eigen::Index k = 0; k < e.size(); k += 3) {
      const double u = e.segment<3>(k).norm() / (sigma * std::sqrt(3.0));
      sum += 3.0 * (!options.robust || u <= kHuber ? u * u : 2.0 * kHuber * u - kHuber * kHuber);
    }
  }
  return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
}

VecX<double> BallLayout::values() const {
  VecX<double> out(static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t k = 0; k < parameters.size(); ++k)
    out[static_cast<Eigen::Index>(k)] = parameters[k].value;
  return out;
}

BallLayout make_ball_layout(const Model& model, const std::vector<EffectSpec>& effects,
                            bool fit_string) {
  if (!model.ball)
    throw ModelError(model.name +
                     ": it has no ball; in an MJCF, a ball is a free body named 'ball', its string "
                     "a limited spatial tendon named 'string' from a site on the arm");
  BallLayout out;
  if (model.ball->string) {
    const StringSpec& s = *model.ball->string;
    out.parameters.push_back({"string.length", "m", Sign::kPositive, s.length, !fit_string, -1, 0});
    for (int k = 0; k < 3; ++k)
      out.parameters.push_back({std::string("string.attachment_") + "xyz"[k], "m", Sign::kFree,
                                axis(s.p_LS, k), !fit_string, -1, k + 1});
  }
  for (const EffectSpec& spec : effects) {
    const BoundEffect bound = bind(spec, model);
    if (!acts_on_ball(bound.info()))
      throw ModelError(spec.effect + " at '" + spec.where +
                       "': it is no effect of the ball, its string or the camera");
    const int e = static_cast<int>(out.effects.size());
    for (std::size_t k = 0; k < bound.parameters.size(); ++k) {
      const ParameterInfo& p = bound.parameter_info[k];
      out.parameters.push_back({spec.where + "." + spec.effect + "." + p.name, p.unit, p.sign,
                                bound.parameters[k], false, e, static_cast<int>(k), p.most});
    }
    out.effects.push_back(bound);
  }
  return out;
}

std::vector<Vec3<double>> predict_ball(const Model& model, const BallLayout& layout,
                                       const VecX<double>& p, const BallData& data,
                                       const BallWindow& window, const FlightOptions& flight) {
  const BallWorld<double> world(model, layout, data.hands[static_cast<std::size_t>(window.hand)],
                                {p.begin(), p.end()});
  std::vector<Vec3<double>> out;
  fly(world, window, window.state, flight,
      [&](std::size_t, const Vec3<double>& seen, const auto&) { out.push_back(seen); });
  return out;
}

BallLinearisation linearise_ball(const Model& model, const BallLayout& layout,
                                 const VecX<double>& p, const BallData& data, double sigma,
                                 const BallFitOptions& options,
                                 const std::function<bool()>& go_on) {
  const std::vector<int> free = free_parameters(layout);
  const auto F = static_cast<Eigen::Index>(free.size());
  BallLinearisation out;
  VecX<double> squares = VecX<double>::Zero(F);
  MatX<double> stacked = MatX<double>::Zero(2 * (F + 1), F + 1);
  for (const BallWindow& w : data.windows) {
    if (go_on && !go_on()) break;
    const WindowColumns c = window_columns(model, layout, p, free, data, w, options.flight);
    const Eigen::Index rows = c.error.size();
    MatX<double> M = MatX<double>::Zero(rows + kState, kState + F + 1);
    M.topLeftCorner(rows, kState + F) = c.J;
    M.topRightCorner(rows, 1) = c.error;
    for (Eigen::Index k = 0; k < rows; k += 3) {
      const Vec3<double> e{c.error[k], c.error[k + 1], c.error[k + 2]};
      M.middleRows(k, 3) *= std::sqrt(weight_of(e, sigma, options.robust)) / sigma;
    }
    out.chi2 += M.col(kState + F).head(rows).squaredNorm();
    out.samples += rows;
    squares += M.middleCols(kState, F).colwise().squaredNorm().transpose();
    for (int k = 0; k < kState; ++k) M(rows + k, k) = 1.0 / kStatePrior;
    const MatX<double> R = M.householderQr()
                               .matrixQR()
                               .topRows(kState + F + 1)
                               .template triangularView<Eigen::Upper>();
    // ds = R₁₁⁻¹ (d₁ − R₁₂ dp)
    MatX<double> right(kState, 1 + F);
    right << R.topRightCorner(kState, 1), R.block(0, kState, kState, F);
    out.state_steps.push_back(
        R.topLeftCorner(kState, kState).triangularView<Eigen::Upper>().solve(right));
    stacked.bottomRows(F + 1) = R.bottomRightCorner(F + 1, F + 1);
    const MatX<double> merged =
        stacked.householderQr().matrixQR().topRows(F + 1).template triangularView<Eigen::Upper>();
    stacked.topRows(F + 1) = merged;
  }
  out.R = stacked.topLeftCorner(F, F);
  out.d = stacked.col(F).head(F);
  out.norms = squares.cwiseSqrt();
  out.left = stacked(F, F) * stacked(F, F);
  return out;
}

BallFit fit_ball(const Model& model, const BallLayout& layout, BallData& data,
                 const BallFitOptions& options, const std::function<bool(int, double)>& progress) {
  const std::vector<int> free = free_parameters(layout);
  const auto F = static_cast<Eigen::Index>(free.size());
  BallFit out;
  out.p = layout.values();
  mark_taut(model, layout, out.p, 0.0, data);
  const auto noise = [&] {
    return options.sigma > 0.0 ? options.sigma
                               : noise_of(model, layout, out.p, data, options.flight);
  };
  out.sigma = noise();
  double now = ball_cost(model, layout, out.p, data, out.sigma, options), damping = 1e-3;
  BallLinearisation at;
  bool fresh = false;
  const auto stopped = [&](double sigma) {
    if (!progress || progress(out.iterations, sigma)) return false;
    out.interrupted = true;
    out.termination = "stopped by the caller";
    return true;
  };
  for (out.iterations = 0; out.iterations < options.max_iterations; ++out.iterations) {
    if (!fresh) at = linearise_ball(model, layout, out.p, data, out.sigma, options);
    fresh = true;
    // Parameters that a sign holds at 0 leave the step.
    VecX<double> step = VecX<double>::Zero(F);
    std::vector<bool> held(static_cast<std::size_t>(F), false);
    for (int round = 0; round <= F; ++round) {
      MatX<double> H = at.R.transpose() * at.R;
      VecX<double> g = at.R.transpose() * at.d;
      for (Eigen::Index k = 0; k < F; ++k) {
        H(k, k) += damping * H(k, k) + 1e-12;
        if (!held[k]) continue;
        H.row(k).setZero();
        H.col(k).setZero();
        H(k, k) = 1.0;
        g[k] = 0.0;
      }
      step = H.ldlt().solve(g);
      bool more = false;
      for (Eigen::Index k = 0; k < F; ++k) {
        const BallParameter& parameter = layout.parameters[free[k]];
        if (parameter.sign != Sign::kNonNegative || held[k] || out.p[free[k]] + step[k] >= 0.0)
          continue;
        held[k] = more = true;
      }
      if (!more) break;
    }
    VecX<double> p = out.p;
    for (Eigen::Index k = 0; k < F; ++k)
      p[free[k]] = held[k] ? 0.0 : allowed(layout.parameters[free[k]], p[free[k]], step[k]);
    std::vector<ParticleState<double>> before;
    for (std::size_t w = 0; w < data.windows.size(); ++w) {
      ParticleState<double>& s = data.windows[w].state;
      before.push_back(s);
      VecX<double> dp(F);
      for (Eigen::Index k = 0; k < F; ++k) dp[k] = p[free[k]] - out.p[free[k]];
      const VecX<double> ds = at.state_steps[w].col(0) - at.state_steps[w].rightCols(F) * dp;
      for (int k = 0; k < kState; ++k) axis(part(s, k), k % 3) += ds[k];
    }
    const double then = ball_cost(model, layout, p, data, out.sigma, options);
    if (!(then < now)) {
      for (std::size_t w = 0; w < before.size(); ++w) data.windows[w].state = before[w];
      damping *= 10.0;
      if (damping > 1e8) {
        out.converged = std::isfinite(now);
        out.termination = out.converged
                              ? "no step makes it better"
                              : "the ball's simulation blows up, and no step makes it better";
        break;
      }
      if (stopped(out.sigma)) break;
      continue;
    }
    const bool done = now - then < options.tolerance * now;
    out.p = p;
    now = then;
    damping = std::max(1e-9, damping * 0.1);
    fresh = false;
    const double sigma = noise();
    if (stopped(sigma)) break;
    const bool switched = mark_taut(model, layout, out.p, sigma, data);
    if (done && !switched && std::abs(sigma - out.sigma) < 1e-3 * out.sigma) {
      out.converged = true;
      out.termination = "the last step gained less than the tolerance";
      break;
    }
    out.sigma = sigma;
    now = ball_cost(model, layout, out.p, data, out.sigma, options);
  }
  if (out.termination.empty()) out.termination = "the largest number of iterations is reached";
  at = linearise_ball(model, layout, out.p, data, out.sigma, options);
  out.chi2 = at.chi2;
  out.samples = at.samples;
  out.covariance = MatX<double>::Zero(out.p.size(), out.p.size());
  MatX<double> H = at.R.transpose() * at.R;
  H.diagonal().array() += 1e-12;
  const MatX<double> C = H.ldlt().solve(MatX<double>::Identity(F, F));
  for (Eigen::Index i = 0; i < F; ++i)
    for (Eigen::Index j = 0; j < F; ++j) out.covariance(free[i], free[j]) = C(i, j);
  return out;
}

}  // namespace diffnea
