#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/constraints.hpp>
#include <diffnea/identify/constrained_loss.hpp>

#include "identify/ball_cost.hpp"
#include "identify/ball_path.hpp"
#include "identify/ball_world.hpp"

namespace diffnea {
namespace {

/// Error of the hand, which a position shares [m].
constexpr double kLeastNoise = 1e-4;
/// Noise of the smoothed distance from which a ball is no longer taut for effects that ask.
constexpr double kTaut = 2.0;

/// Body 0 is the anchor, body 1 the ball; both keep the world's axes.
constexpr std::size_t kAnchor = 0, kBall = 1;

/// Smoothed windows of the ball's path; a window is a stretch.
BodyMotion ball_motion(const BallData& data, double sigma) {
  std::vector<PosedRow> rows;
  for (std::size_t w = 0; w < data.windows.size(); ++w)
    for (std::size_t k = 0; k < data.windows[w].time.size(); ++k)
      rows.push_back({data.windows[w].time[k],
                      static_cast<int>(w),
                      {Pose<double>::translation(data.windows[w].seen[k])}});
  BodyMotion out = smooth_bodies(rows);
  for (BodySample& s : out.samples) {
    s.states.insert(s.states.begin(), BodyState<double>{});
    s.accelerations.insert(s.accelerations.begin(), Twist<double>{});
  }
  out.noise.insert(out.noise.begin(), BodyNoise{});
  BodyNoise& noise = out.noise[kBall];
  const double more = std::max(1.0, kLeastNoise / sigma);
  for (double& x : noise.position) x *= more;
  noise.row_position *= more;
  return out;
}

/// A ball, the forces on it, and its string if it has one, at a sample.
struct BallSystem {
  const Model& model;
  const BallLayout& layout;
  const BallData& data;
  const std::vector<int> free;
  const double noise;  ///< standard deviation of a smoothed position [m]

  template <class T>
  void operator()(const BodySample& at, const VecX<T>& p, ConstrainedSystem<T>& system) const {
    std::vector<T> values;
    for (const double x : layout.values()) values.emplace_back(x);
    for (std::size_t k = 0; k < free.size(); ++k) values[free[k]] = p[static_cast<long>(k)];
    const BallWindow& window = data.windows[static_cast<std::size_t>(at.stretch)];
    const BallWorld<T> world(model, layout, data.hands[static_cast<std::size_t>(window.hand)],
                             std::move(values));
    const Vec3<T> zero{T(0.0), T(0.0), T(0.0)};
    BallSample<T> sample;
    sample.time = T(at.time);
    sample.ball = {system.states[kBall].X_WB.p, system.states[kBall].V.linear};
    sample.spin = window.spin.template cast<T>();
    if (world.has_string()) {
      const FreeString<T> string = world.string(sample.time, sample.ball.x);
      sample.anchor = string.anchor;
      sample.length = string.length;
      system.states[kAnchor] = {Pose<T>::translation(string.anchor.x), {zero, string.anchor.v}};
      system.accelerations[kAnchor] = {zero, string.anchor.a};
      append_rows(String<T>{{zero, zero, string.length}}, "string", {kAnchor, kBall}, system.states,
                  system.rows);
      using std::sqrt;
      const Vec3<T> delta = sample.ball.x - sample.anchor.x;
      const T distance = sqrt(dot(delta, delta));
      sample.u = delta * (T(1.0) / distance);
      sample.taut = value(distance) > value(string.length) - kTaut * noise;
    }
    // The mass cancels; weight is among the ball's accelerations.
    system.bodies = {{BodyKind::kPrescribed, {}}, particle(T(1.0))};
    system.gravity = zero;
    system.applied[kBall].force = world.acceleration(sample);
  }
};

}  // namespace

BallFit fit_ball_constrained(const Model& model, const BallLayout& layout, const BallData& data,
                             const BallFitOptions& options) {
  for (const BoundEffect& e : layout.effects)
    if (e.info().port == Port::kBallView || e.info().has(Trait::kJumps))
      throw ModelError(e.info().name + " at " + e.where +
                       ": the constrained loss compares accelerations and cannot fit it; use the "
                       "trajectory loss");
  BallFit out;
  out.p = layout.values();
  out.covariance = MatX<double>::Zero(out.p.size(), out.p.size());
  out.sigma = options.sigma > 0.0 ? options.sigma : camera_noise(data, options.longest_gap);
  if (!std::isfinite(out.sigma)) out.sigma = 1e-3;
  const BodyMotion motion = ball_motion(data, out.sigma);
  const std::vector<int> free = free_parameters(layout);
  std::vector<ConstrainedParameter> parameters;
  for (const int k : free) {
    const BallParameter& p = layout.parameters[static_cast<std::size_t>(k)];
    parameters.push_back({p.name, p.unit, p.value, p.sign});
  }
  const ConstrainedFit fit = fit_constrained(
      ConstrainedModel(BallSystem{model, layout, data, free, motion.noise[kBall].position[0]}),
      parameters, motion,
      {options.lambda, options.robust, options.max_iterations, options.tolerance});
  out.chi2 = fit.chi2;
  out.samples = 3 * fit.samples;
  out.iterations = fit.iterations;
  out.converged = fit.converged;
  out.termination = fit.termination;
  for (std::size_t i = 0; i < free.size(); ++i) {
    out.p[free[i]] = fit.p[static_cast<long>(i)];
    for (std::size_t j = 0; j < free.size(); ++j)
      out.covariance(free[i], free[j]) = fit.covariance(static_cast<long>(i), static_cast<long>(j));
  }
  return out;
}

}  // namespace diffnea
