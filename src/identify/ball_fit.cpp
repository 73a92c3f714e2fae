#include <algorithm>
#include <array>
#include <cmath>

#include "core/decompositions.hpp"
#include "core/statistics.hpp"
#include "identify/ball_cost.hpp"
#include "identify/ball_path.hpp"
#include "identify/ball_world.hpp"
#include "identify/descent.hpp"

namespace diffnea {
namespace {

/// Of a state's step, tried in turn where the whole one makes its window worse.
constexpr std::array kShares{0.25, 0.0625, 0.0};

/// Of states alone, whose errors are asked for and not they: stop when a step would gain a smaller
/// share of the cost.
constexpr double kStatesTolerance = 1e-5;

/// A window whose numbers cost this many times what the median window's or noise do may have gone
/// astray; where the median window's cost this many times what noise does, the descent may be lost.
constexpr double kAstray = 20.0, kLost = 100.0;
/// Of such a window, the times over which its first state is estimated one after the other.
constexpr std::array kHorizons{0.125, 0.25, 0.5, 1.0};
constexpr int kStateSteps = 10;  ///< over each of them, at most

double& number(ParticleState<double>& s, int k) {
  Vec3<double>& v = k < 3 ? s.x : s.v;
  return k % 3 == 0 ? v.x : k % 3 == 1 ? v.y : v.z;
}
ParticleState<double> moved(ParticleState<double> state, const VecX<double>& ds) {
  for (int k = 0; k < kBallState; ++k) number(state, k) += ds[k];
  return state;
}

/// What a step makes of a value: positive ones shrink tenfold at most, and none passes its limit.
double allowed(const BallParameter& p, double value, double step) {
  const double least = p.sign == Sign::kPositive ? 0.1 * value : -INFINITY;
  return std::clamp(value + step, least, std::max(least, p.most));
}

using States = std::vector<ParticleState<double>>;  ///< of the windows

/// A descent in the parameters; each window's state follows.
class BallDescent {
 public:
  BallDescent(const Model& model, const BallLayout& layout, BallData& data,
              const BallFitOptions& options, const std::function<bool(int, double)>& progress)
      : model_(model),
        layout_(layout),
        free_(free_parameters(layout)),
        data_(data),
        options_(options),
        progress_(progress),
        begun_(states()) {
    out_.p = layout.values();
    mark_taut(0.0);
    out_.sigma = noise();
  }
  BallFit fit();

  // Steps, for descend().
  double cost() { return now_ = cost(out_.p); }
  void linearise() { at_ = linearise_ball(model_, layout_, out_.p, data_, out_.sigma, options_); }
  double attempt(double damping) {
    before_ = states();
    tried_ = stepped(at_, damping);
    return move_states(at_, tried_, now_);
  }
  void refuse() { set_states(before_); }
  void accept() {
    out_.p = tried_;
    seen_ = noise();
  }
  bool stopped();
  bool settled() {
    const bool switched = mark_taut(seen_);
    return !switched && std::abs(seen_ - out_.sigma) < 1e-3 * out_.sigma;
  }
  void reweigh() { out_.sigma = seen_; }

 private:
  void run();
  void run_anew();
  bool restart_astray(double usual, double sigma);
  States states() const;
  void set_states(const States& states);
  double camera() const;
  double usual_cost(double sigma) const;
  double noise() const;
  bool mark_taut(double sigma);
  VecX<double> stepped(const BallLinearisation& at, double damping) const;
  double move_states(const BallLinearisation& at, const VecX<double>& p, double now);
  double cost_of(const VecX<double>& p, const BallWindow& window, double sigma) const {
    return ball_window_cost(model_, layout_, p, data_, window, sigma, options_);
  }
  double cost(const VecX<double>& p) const {
    return ball_cost(model_, layout_, p, data_, out_.sigma, options_);
  }

  const Model& model_;
  const BallLayout& layout_;
  std::vector<int> free_;
  BallData& data_;
  const BallFitOptions& options_;
  const std::function<bool(int, double)>& progress_;
  const States begun_;  ///< that the fit began with
  BallFit out_;
  double now_ = 0.0;   ///< cost at the present point
  double seen_ = 0.0;  ///< noise at the present point, not in use yet [m]
  BallLinearisation at_;
  VecX<double> tried_;  ///< parameters of the last attempt
  States before_;       ///< before it
};

States BallDescent::states() const {
  States out;
  for (const BallWindow& w : data_.windows) out.push_back(w.state);
  return out;
}
void BallDescent::set_states(const States& states) {
  for (std::size_t w = 0; w < states.size(); ++w) data_.windows[w].state = states[w];
}

/// σ from the median of |e|, for the numbers that parameters and states have used up.
double BallDescent::noise() const {
  if (options_.sigma > 0.0) return options_.sigma;
  std::vector<double> all;
  for (const BallWindow& w : data_.windows)
    for (const double x : ball_window_errors(model_, layout_, out_.p, data_, w, options_.flight))
      all.push_back(std::abs(x));
  const double used =
      static_cast<double>(free_.size()) + kBallState * static_cast<double>(data_.windows.size());
  const auto n = static_cast<double>(all.size());
  return std::max(1e-9, 1.4826 * median(all) * std::sqrt(n / std::max(1.0, n - used)));
}

/// Whether the string is taut where windows begin: by the distance of their first rows.
bool BallDescent::mark_taut(double sigma) {
  if (!model_.ball->string) return false;
  bool changed = false;
  for (BallWindow& w : data_.windows) {
    const HandMotion& hand = data_.hands[static_cast<std::size_t>(w.hand)];
    const BallWorld<double> world(model_, layout_, hand, {out_.p.begin(), out_.p.end()});
    const auto count = static_cast<int>(std::min<std::size_t>(5, w.time.size()));
    double excess = 0.0;
    for (int k = 0; k < count; ++k) {
      const Vec3<double> delta = w.seen[k] - world.anchor(w.time[k]).x;
      excess += std::sqrt(dot(delta, delta)) - world.r;
    }
    const bool taut = excess / count > -std::max(3.0 * sigma / std::sqrt(count), 0.01 * world.r);
    changed = changed || taut != w.taut;
    w.taut = taut;
  }
  return changed;
}

bool BallDescent::stopped() {
  if (!progress_ || progress_(out_.iterations, seen_)) return false;
  out_.interrupted = true;
  out_.termination = "stopped by the caller";
  return true;
}

/// The parameters after a step; those that a sign holds at 0 leave it.
VecX<double> BallDescent::stepped(const BallLinearisation& at, double damping) const {
  const auto F = static_cast<Eigen::Index>(free_.size());
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
      const BallParameter& parameter = layout_.parameters[free_[k]];
      if (parameter.sign != Sign::kNonNegative || held[k] || out_.p[free_[k]] + step[k] >= 0.0)
        continue;
      held[k] = more = true;
    }
    if (!more) break;
  }
  VecX<double> p = out_.p;
  for (Eigen::Index k = 0; k < F; ++k)
    p[free_[k]] = held[k] ? 0.0 : allowed(layout_.parameters[free_[k]], p[free_[k]], step[k]);
  return p;
}

/// Moves the states as `p` asks; where that gains nothing, those whose window would get worse move
/// less: one must not hold up the others. (Damping is of the parameters alone.)
/// @return the cost at p and the new states
double BallDescent::move_states(const BallLinearisation& at, const VecX<double>& p, double now) {
  const auto F = static_cast<Eigen::Index>(free_.size());
  VecX<double> dp(F);
  for (Eigen::Index k = 0; k < F; ++k) dp[k] = p[free_[k]] - out_.p[free_[k]];
  const States before = states();
  std::vector<VecX<double>> steps;
  for (std::size_t w = 0; w < before.size(); ++w) {
    steps.push_back(at.state_steps[w].col(0) - at.state_steps[w].rightCols(F) * dp);
    data_.windows[w].state = moved(before[w], steps[w]);
  }
  double sum = cost(p);
  if (sum < now) return sum;
  sum = 0.0;
  for (std::size_t w = 0; w < before.size(); ++w) {
    BallWindow& window = data_.windows[w];
    double least = cost_of(p, window, out_.sigma);
    BallWindow tried = window;
    tried.state = before[w];
    const double was = cost_of(out_.p, tried, out_.sigma);
    for (const double share : kShares) {
      if (least <= was) break;
      tried.state = moved(before[w], share * steps[w]);
      const double less = cost_of(p, tried, out_.sigma);
      if (!(less < least)) continue;
      least = less;
      window.state = tried.state;
    }
    sum += least;
  }
  return sum;
}

void BallDescent::run() {
  if (out_.interrupted) return;
  const double tolerance =
      free_.empty() ? std::max(kStatesTolerance, options_.tolerance) : options_.tolerance;
  seen_ = out_.sigma;
  out_.converged = false;
  switch (descend(*this, {options_.max_iterations, tolerance}, out_.iterations)) {
    case DescentEnd::kConverged:
      out_.converged = true;
      out_.termination = "the last step gained less than the tolerance";
      break;
    case DescentEnd::kNoStep:
      out_.converged = std::isfinite(now_);
      out_.termination = out_.converged
                             ? "no step makes it better"
                             : "the ball's simulation blows up, and no step makes it better";
      break;
    case DescentEnd::kLimit:
      out_.termination = "the largest number of iterations is reached";
      break;
    case DescentEnd::kStopped:
      break;
  }
}

/// What the camera's noise alone would leave [m]: given, or seen.
double BallDescent::camera() const {
  if (options_.sigma > 0.0) return options_.sigma;
  const double seen = camera_noise(data_, options_.longest_gap);
  return std::isfinite(seen) ? std::max(seen, 1e-9) : out_.sigma;
}

/// Of a number, in the median window.
double BallDescent::usual_cost(double sigma) const {
  std::vector<double> each;
  for (const BallWindow& w : data_.windows)
    each.push_back(cost_of(out_.p, w, sigma) / (3.0 * static_cast<double>(w.time.size())));
  return median(each);
}

/// Estimates the first states of windows that may have gone astray anew, over times that grow:
/// over a long one, a flight that becomes taut too early or too late has other minima.
/// @param usual  cost of a number at `sigma`  @return whether that made one of them better
bool BallDescent::restart_astray(double usual, double sigma) {
  if (out_.interrupted) return false;
  BallLayout held = layout_;
  for (std::size_t k = 0; k < held.parameters.size(); ++k) {
    held.parameters[k].fixed = true;
    held.parameters[k].value = out_.p[static_cast<Eigen::Index>(k)];
  }
  BallFitOptions options = options_;
  options.sigma = sigma;
  options.max_iterations = kStateSteps;
  bool better = false;
  const auto astray = [&](double cost, const BallWindow& window) {
    return !(cost <= kAstray * usual * 3.0 * static_cast<double>(window.time.size()));
  };
  for (BallWindow& window : data_.windows) {
    const double before = cost_of(out_.p, window, sigma);
    if (!astray(before, window)) continue;
    BallData one;
    one.hands = {data_.hands[static_cast<std::size_t>(window.hand)]};
    one.windows = {window};
    BallWindow& tried = one.windows.front();
    tried.hand = 0;
    for (const double horizon : kHorizons) {
      const auto rows =
          static_cast<std::ptrdiff_t>(std::ceil(horizon * static_cast<double>(window.time.size())));
      tried.time.assign(window.time.begin(), window.time.begin() + rows);
      tried.seen.assign(window.seen.begin(), window.seen.begin() + rows);
      BallDescent states(model_, held, one, options, progress_);
      states.run();
      if (states.out_.interrupted) {
        out_.interrupted = true;
        out_.termination = states.out_.termination;
        return better;
      }
      // Where no state leads along, it is the parameters that are wrong.
      if (astray(states.cost(states.out_.p), tried)) break;
    }
    tried.time = window.time;
    tried.seen = window.seen;
    tried.hand = window.hand;
    if (!(cost_of(out_.p, tried, sigma) < before)) continue;
    window.state = tried.state;
    window.taut = tried.taut;
    better = true;
  }
  return better;
}

/// Another descent from the first parameters, with states that follow what was seen; the better
/// one of both stays.
void BallDescent::run_anew() {
  const double sigma = camera();
  const auto cost_now = [&] { return ball_cost(model_, layout_, out_.p, data_, sigma, options_); };
  const double before = cost_now();
  BallFit first = out_;
  const States reached = states();
  out_.p = layout_.values();
  set_states(begun_);
  mark_taut(sigma);
  restart_astray(1.0, sigma);
  out_.sigma = noise();
  run();
  if (cost_now() < before) return;
  first.iterations = out_.iterations;
  if (out_.interrupted) {
    first.interrupted = true;
    first.converged = false;
    first.termination = out_.termination;
  }
  out_ = std::move(first);
  set_states(reached);
  mark_taut(out_.sigma);
}

BallFit BallDescent::fit() {
  run();
  if (!free_.empty() && !out_.interrupted && usual_cost(camera()) > kLost) run_anew();
  if (restart_astray(std::max(1.0, usual_cost(out_.sigma)), out_.sigma)) run();
  const auto F = static_cast<Eigen::Index>(free_.size());
  const BallLinearisation at = linearise_ball(model_, layout_, out_.p, data_, out_.sigma, options_);
  out_.chi2 = at.chi2;
  out_.samples = at.samples;
  out_.covariance = MatX<double>::Zero(out_.p.size(), out_.p.size());
  MatX<double> H = at.R.transpose() * at.R;
  H.diagonal().array() += 1e-12;
  const MatX<double> C = H.ldlt().solve(MatX<double>::Identity(F, F));
  for (Eigen::Index i = 0; i < F; ++i)
    for (Eigen::Index j = 0; j < F; ++j) out_.covariance(free_[i], free_[j]) = C(i, j);
  return out_;
}

}  // namespace

BallFit fit_ball(const Model& model, const BallLayout& layout, BallData& data,
                 const BallFitOptions& options, const std::function<bool(int, double)>& progress) {
  return BallDescent(model, layout, data, options, progress).fit();
}

}  // namespace diffnea
