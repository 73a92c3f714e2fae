#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "core/decompositions.hpp"
#include "identify/ball_path.hpp"
#include "identify/ball_world.hpp"
#include "identify/descent.hpp"

namespace diffnea {
namespace {

/// Rows on either side that a row's acceleration is read from: as few as noise allows, for many
/// flatten it.
constexpr long kLeastHalfWidth = 2, kMostHalfWidth = 6;
constexpr double kNoisyAcceleration = 0.3;  ///< [m/s²]
/// What else a position is off by: the hand, and what smoothing makes of the path. Less noise than
/// this would have every row count as an outlier [m].
constexpr double kLeastNoise = 1e-4;
/// Sharpness of g = softplus(h) [1/m²] from round to round: from soft, where every row pulls at the
/// length, to hard.
constexpr std::array<double, 4> kSharpness{20.0, 100.0, 500.0, 2500.0};
/// The sharpest leaves this much of g's noise at h = 0, so that less noise is less bias.
constexpr double kSoftest = 0.5;
/// Stabilisation answers the camera's noise, too: none to speak of.
constexpr double kSettle = 10.0;  // [s]

/// A row with its derivatives, smoothed.
struct SmoothRow {
  const BallWindow* window;
  const HandMotion* hand;
  double time;
  Vec3<double> x, v, a;
};

/// How much of white noise the smoothed x, v and a of a window keep, from the weights of the
/// cubics.
std::array<double, 3> noise_gains(double step, long half) {
  const long n = 2 * half + 1;
  MatX<double> A(n, 4);
  for (long k = 0; k < n; ++k) {
    const double t = step * static_cast<double>(k - half);
    A.row(k) << 1.0, t, 0.5 * t * t, t * t * t / 6.0;
  }
  const MatX<double> C = (A.transpose() * A).inverse();
  return {std::sqrt(C(0, 0)), std::sqrt(C(1, 1)), std::sqrt(C(2, 2))};
}

std::vector<SmoothRow> smooth_rows(const BallData& data, long half) {
  std::vector<SmoothRow> out;
  for (const BallWindow& w : data.windows) {
    const auto n = static_cast<long>(w.time.size());
    for (long k = half; k + half < n; ++k) {
      const long rows = 2 * half + 1;
      MatX<double> A(rows, 4), y(rows, 3);
      for (long i = 0; i < rows; ++i) {
        const long at = k - half + i;
        const double t = w.time[at] - w.time[k];
        A.row(i) << 1.0, t, 0.5 * t * t, t * t * t / 6.0;
        y.row(i) << w.seen[at].x, w.seen[at].y, w.seen[at].z;
      }
      const MatX<double> c = A.colPivHouseholderQr().solve(y);
      const auto point = [&](int i) { return Vec3<double>{c(i, 0), c(i, 1), c(i, 2)}; };
      out.push_back({&w, &data.hands[static_cast<std::size_t>(w.hand)], w.time[k], point(0),
                     point(1), point(2)});
    }
  }
  return out;
}

/// What the six residuals of a row are divided by.
struct RowNoise {
  double acceleration = 1.0, g = 1.0, g_d = 1.0, g_dd = 1.0;
};

template <class T>
std::array<T, 6> residuals(const BallWorld<T>& world, const SmoothRow& row, const RowNoise& noise,
                           double sharpness, const std::array<double, 3>& lambda) {
  using std::exp;
  using std::log1p;
  const ParticleState<T> ball{row.x.template cast<T>(), row.v.template cast<T>()};
  BallSample<T> sample;
  sample.time = T(row.time);
  sample.ball = ball;
  sample.spin = row.window->spin.template cast<T>();
  std::array<T, 6> out{};
  const Vec3<T> measured = row.a.template cast<T>();
  const auto put = [&](const Vec3<T>& e) {
    const T per(1.0 / noise.acceleration);
    out[0] = e.x * per, out[1] = e.y * per, out[2] = e.z * per;
  };
  if (!world.has_string()) {
    put(measured - world.acceleration(sample));
    return out;
  }
  const FreeString<T> string = world.string(T(row.time), ball.x);
  sample.anchor = string.anchor;
  sample.length = string.length;
  const Vec3<T> delta = ball.x - sample.anchor.x, delta_d = ball.v - sample.anchor.v,
                delta_dd = measured - sample.anchor.a;
  const T r = string.length, h = dot(delta, delta) - r * r;
  const T h_d = T(2.0) * dot(delta, delta_d),
          h_dd = T(2.0) * (dot(delta, delta_dd) + dot(delta_d, delta_d));
  using std::sqrt;
  sample.taut = value(h) > -2.0 * noise.g;
  sample.u = delta * (T(1.0) / sqrt(dot(delta, delta)));
  const StringSmoothing smoothing{.pull = 10.0 * sharpness / kSharpness.back(),
                                  .switching = 0.5 * sharpness,
                                  .settle = kSettle};
  put(measured -
      string_acceleration(ball, sample.anchor, world.acceleration(sample), r, smoothing));
  // g = softplus(h), ġ = σ ḣ, g̈ = σ ḧ + σ′ ḣ², σ the sigmoid.
  const T s(sharpness), z = h * s;
  const T gate = value(z) > 0.0 ? T(1.0) / (T(1.0) + exp(-z)) : exp(z) / (T(1.0) + exp(z));
  const T g = (value(z) > 0.0 ? z + log1p(exp(-z)) : log1p(exp(z))) / s;
  // At h = 0, g is ln 2/s: while s is soft, no error.
  out[3] = g * T(std::sqrt(lambda[0]) / std::hypot(noise.g, std::log(2.0) / sharpness));
  out[4] = gate * h_d * T(std::sqrt(lambda[1]) / noise.g_d);
  out[5] =
      (gate * h_dd + s * gate * (T(1.0) - gate) * h_d * h_d) * T(std::sqrt(lambda[2]) / noise.g_dd);
  return out;
}

/// The parameters' descent at one sharpness of softplus.
class ConstrainedDescent {
 public:
  ConstrainedDescent(const Model& model, const BallLayout& layout, const std::vector<int>& free,
                     const std::vector<SmoothRow>& rows, const RowNoise& noise,
                     const BallFitOptions& options, VecX<double> p)
      : model_(model),
        layout_(layout),
        free_(free),
        rows_(rows),
        noise_(noise),
        options_(options),
        p_(std::move(p)) {}

  const VecX<double>& p() const { return p_; }
  /// (F, F) Jᵀ W J of the last linearisation.
  const MatX<double>& curvature() const { return H_; }
  void set_sharpness(double sharpness) {
    sharpness_ = sharpness;
    now_ = sum_at(p_);
  }

  // Steps, for descend().
  double cost() const { return now_; }
  void linearise();
  double attempt(double damping);
  void accept() {
    p_ = tried_;
    now_ = then_;
  }
  void refuse() {}
  bool stopped() const { return false; }
  bool settled() const { return true; }  // Huber's ρ is in the cost itself
  void reweigh() {}

 private:
  double sum_at(const VecX<double>& p) const;
  /// Huber's weight of a row.
  double weight(const Eigen::Matrix<double, 6, 1>& e) const {
    const double u = e.norm() / std::sqrt(6.0);
    return !options_.robust || u <= 3.0 ? 1.0 : 3.0 / u;
  }

  const Model& model_;
  const BallLayout& layout_;
  const std::vector<int>& free_;
  const std::vector<SmoothRow>& rows_;
  const RowNoise& noise_;
  const BallFitOptions& options_;
  VecX<double> p_, tried_, g_;
  MatX<double> H_;
  double sharpness_ = 0.0, now_ = 0.0, then_ = 0.0;
};

double ConstrainedDescent::sum_at(const VecX<double>& p) const {
  double sum = 0.0;
  for (const SmoothRow& row : rows_) {
    const BallWorld<double> world(model_, layout_, *row.hand, {p.begin(), p.end()});
    const std::array<double, 6> r = residuals(world, row, noise_, sharpness_, options_.lambda);
    const Eigen::Matrix<double, 6, 1> e = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(r.data());
    const double w = weight(e);
    sum += w * (2.0 - w) * e.squaredNorm();
  }
  return sum;
}

void ConstrainedDescent::linearise() {
  const auto F = static_cast<Eigen::Index>(free_.size());
  H_ = MatX<double>::Zero(F, F);
  g_ = VecX<double>::Zero(F);
  for (const SmoothRow& row : rows_) {
    MatX<double> J = MatX<double>::Zero(6, F);
    Eigen::Matrix<double, 6, 1> e;
    for (Eigen::Index begin = 0; begin < F; begin += kJetWidth) {
      const Eigen::Index end = std::min<Eigen::Index>(F, begin + kJetWidth);
      std::vector<JetD> values;
      for (const double x : p_) values.emplace_back(x);
      for (Eigen::Index k = begin; k < end; ++k)
        values[free_[k]] = JetD(p_[free_[k]], static_cast<int>(k - begin));
      const BallWorld<JetD> world(model_, layout_, *row.hand, std::move(values));
      const std::array<JetD, 6> r = residuals(world, row, noise_, sharpness_, options_.lambda);
      for (int i = 0; i < 6; ++i) {
        e[i] = r[static_cast<std::size_t>(i)].a;
        for (Eigen::Index k = begin; k < end; ++k)
          J(i, k) = r[static_cast<std::size_t>(i)].v[k - begin];
      }
    }
    const double w = weight(e);
    H_ += w * J.transpose() * J;
    g_ += w * J.transpose() * e;
  }
}

double ConstrainedDescent::attempt(double damping) {
  MatX<double> damped = H_;
  damped.diagonal() *= 1.0 + damping;
  damped.diagonal().array() += 1e-12;
  const VecX<double> step = damped.ldlt().solve(-g_);
  tried_ = p_;
  for (Eigen::Index k = 0; k < step.size(); ++k) {
    double& x = tried_[free_[k]];
    x += step[k];
    const Sign sign = layout_.parameters[free_[k]].sign;
    if (sign != Sign::kFree) x = std::max(x, sign == Sign::kPositive ? 0.1 * p_[free_[k]] : 0.0);
  }
  return then_ = sum_at(tried_);
}

}  // namespace

BallFit fit_ball_constrained(const Model& model, const BallLayout& layout, const BallData& data,
                             const BallFitOptions& options) {
  for (const BoundEffect& e : layout.effects)
    if (e.info().port == Port::kBallView || e.info().has(Trait::kJumps))
      throw ModelError(e.info().name + " at " + e.where +
                       ": the constrained loss compares accelerations and cannot fit it; use the "
                       "trajectory loss");
  std::vector<int> free;
  for (std::size_t k = 0; k < layout.parameters.size(); ++k)
    if (!layout.parameters[k].fixed) free.push_back(static_cast<int>(k));
  BallFit out;
  out.p = layout.values();
  out.sigma = options.sigma > 0.0 ? options.sigma : camera_noise(data, options.longest_gap);
  if (!std::isfinite(out.sigma)) out.sigma = 1e-3;
  const double length = model.ball->string ? model.ball->string->length : 1.0;
  const BallWindow& first = data.windows.front();
  const double period =
      (first.time.back() - first.time.front()) / static_cast<double>(first.time.size() - 1);
  long half = kLeastHalfWidth;
  while (half < kMostHalfWidth && out.sigma * noise_gains(period, half)[2] > kNoisyAcceleration)
    ++half;
  const std::array<double, 3> gain = noise_gains(period, half);
  const std::vector<SmoothRow> rows = smooth_rows(data, half);
  if (rows.size() < 10 * free.size())
    throw DataError("constrained loss: " + std::to_string(rows.size()) +
                    " rows with enough neighbours are left, too few for " +
                    std::to_string(free.size()) + " parameters");
  const double known = std::max(out.sigma, kLeastNoise), at_length = 2.0 * length * known;
  const RowNoise noise{known * gain[2], at_length * gain[0], at_length * gain[1],
                       at_length * gain[2]};
  ConstrainedDescent descent(model, layout, free, rows, noise, options, out.p);
  std::vector<double> rounds(kSharpness.begin(), kSharpness.end());
  while (std::log(2.0) / rounds.back() > kSoftest * noise.g) rounds.push_back(3.0 * rounds.back());
  DescentEnd end = DescentEnd::kConverged;
  for (const double sharpness : rounds) {
    descent.set_sharpness(sharpness);
    end = descend(descent, {options.max_iterations, options.tolerance}, out.iterations);
  }
  out.p = descent.p();
  out.chi2 = descent.cost();
  out.converged = end != DescentEnd::kLimit;
  out.termination = end == DescentEnd::kLimit
                        ? "the largest number of iterations is reached at the greatest sharpness"
                    : end == DescentEnd::kNoStep
                        ? "no step makes it better at the greatest sharpness"
                        : "the last step at the greatest sharpness gained less than the tolerance";
  out.samples = 3 * static_cast<long>(rows.size());
  descent.linearise();
  const auto F = static_cast<Eigen::Index>(free.size());
  MatX<double> H = descent.curvature();
  H.diagonal().array() += 1e-12;
  const MatX<double> C = H.ldlt().solve(MatX<double>::Identity(F, F)) *
                         static_cast<double>(2 * half + 1);  // neighbours share rows
  out.covariance = MatX<double>::Zero(out.p.size(), out.p.size());
  for (Eigen::Index i = 0; i < F; ++i)
    for (Eigen::Index j = 0; j < F; ++j) out.covariance(free[i], free[j]) = C(i, j);
  return out;
}

}  // namespace diffnea
