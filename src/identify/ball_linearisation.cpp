#include <cmath>
#include <limits>

#include "core/decompositions.hpp"
#include "identify/ball_cost.hpp"
#include "identify/ball_world.hpp"

namespace diffnea {
namespace {

/// A first state is known to a metre and a metre a second: holds what a taut string hides of it.
constexpr double kStatePrior = 1.0;
/// Huber's threshold, of the root mean square of a position's three errors over σ.
constexpr double kHuberOfBall = 3.0;

double axis(const Vec3<double>& v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }

double weight_of(const Vec3<double>& error, double sigma, bool robust) {
  const double u = norm(error) / (sigma * std::sqrt(3.0));
  return !robust || u <= kHuberOfBall ? 1.0 : kHuberOfBall / u;
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
  const auto unknowns = kBallState + static_cast<int>(free.size());
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
      values[free[f]] = seeded(p[free[f]], kBallState + static_cast<int>(f));
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

}  // namespace

std::vector<int> free_parameters(const BallLayout& layout) {
  std::vector<int> out;
  for (std::size_t k = 0; k < layout.parameters.size(); ++k)
    if (!layout.parameters[k].fixed) out.push_back(static_cast<int>(k));
  return out;
}

VecX<double> ball_window_errors(const Model& model, const BallLayout& layout, const VecX<double>& p,
                                const BallData& data, const BallWindow& window,
                                const FlightOptions& flight) {
  const std::vector<Vec3<double>> seen = predict_ball(model, layout, p, data, window, flight);
  VecX<double> out(3 * static_cast<Eigen::Index>(seen.size()));
  for (std::size_t k = 0; k < seen.size(); ++k)
    for (int c = 0; c < 3; ++c)
      out[3 * static_cast<Eigen::Index>(k) + c] = axis(window.seen[k], c) - axis(seen[k], c);
  return out;
}

double ball_window_cost(const Model& model, const BallLayout& layout, const VecX<double>& p,
                        const BallData& data, const BallWindow& window, double sigma,
                        const BallFitOptions& options) {
  const VecX<double> e = ball_window_errors(model, layout, p, data, window, options.flight);
  double sum = 0.0;
  for (Eigen::Index k = 0; k < e.size(); k += 3) {
    const double u = e.segment<3>(k).norm() / (sigma * std::sqrt(3.0));
    sum += 3.0 * (!options.robust || u <= kHuberOfBall
                      ? u * u
                      : 2.0 * kHuberOfBall * u - kHuberOfBall * kHuberOfBall);
  }
  return std::isfinite(sum) ? sum : std::numeric_limits<double>::infinity();
}

double ball_cost(const Model& model, const BallLayout& layout, const VecX<double>& p,
                 const BallData& data, double sigma, const BallFitOptions& options) {
  double sum = 0.0;
  for (const BallWindow& w : data.windows)
    sum += ball_window_cost(model, layout, p, data, w, sigma, options);
  return sum;
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
    MatX<double> M = MatX<double>::Zero(rows + kBallState, kBallState + F + 1);
    M.topLeftCorner(rows, kBallState + F) = c.J;
    M.topRightCorner(rows, 1) = c.error;
    for (Eigen::Index k = 0; k < rows; k += 3) {
      const Vec3<double> e{c.error[k], c.error[k + 1], c.error[k + 2]};
      M.middleRows(k, 3) *= std::sqrt(weight_of(e, sigma, options.robust)) / sigma;
    }
    out.chi2 += M.col(kBallState + F).head(rows).squaredNorm();
    out.samples += rows;
    squares += M.middleCols(kBallState, F).colwise().squaredNorm().transpose();
    for (int k = 0; k < kBallState; ++k) M(rows + k, k) = 1.0 / kStatePrior;
    const MatX<double> R = M.householderQr()
                               .matrixQR()
                               .topRows(kBallState + F + 1)
                               .template triangularView<Eigen::Upper>();
    // ds = R₁₁⁻¹ (d₁ − R₁₂ dp)
    MatX<double> right(kBallState, 1 + F);
    right << R.topRightCorner(kBallState, 1), R.block(0, kBallState, kBallState, F);
    out.state_steps.push_back(
        R.topLeftCorner(kBallState, kBallState).triangularView<Eigen::Upper>().solve(right));
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

}  // namespace diffnea
