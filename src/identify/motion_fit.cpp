#include "identify/motion_fit.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <diffnea/core/parallel.hpp>

#include "core/constants.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// Residuals this far below the noise hold nothing more, share of χ²/2 that noise would leave.
constexpr double kBelowNoise = 1e-3;

/// Share of a window's excess that half a step of its state must change for others to be tried, and
/// share of what all windows gain that the excess of some must be.
constexpr double kMatters = 0.1;
/// Share of the objective that a linearisation promises and need not keep: friction has corners.
constexpr double kUnkept = 1e-3;
/// Steps without a gain, though one is promised, that are enough; and what may be promised then by
/// a fit that has converged (SciPy's xtol, whose steps come to nothing): half of that of an error.
constexpr int kStalls = 5;
constexpr double kUnkeptAtLast = 0.05;

/// Steps like the last one that a fit may need to catch up with its rival.
constexpr double kPatience = 10.0;

/// Cost of a set of windows: first those whose simulation blows up, whatever the others gain.
struct Cost {
  long blown_up = 0;
  double sum = 0.0;  ///< of the others

  bool operator<(const Cost& other) const {
    return blown_up < other.blown_up || (blown_up == other.blown_up && sum < other.sum);
  }
};

Cost total(const std::vector<double>& parts) {
  Cost out;
  for (const double c : parts) {
    if (std::isfinite(c))
      out.sum += c;
    else
      ++out.blown_up;
  }
  return out;
}

std::vector<VecX<double>> states_of(const std::vector<MotionWindow>& windows) {
  std::vector<VecX<double>> out;
  for (const MotionWindow& w : windows) out.push_back(w.state);
  return out;
}

void set_states(const std::vector<VecX<double>>& states, std::vector<MotionWindow>& windows) {
  for (std::size_t i = 0; i < windows.size(); ++i) windows[i].state = states[i];
}

long samples_of(const std::vector<MotionStretch>& stretches,
                const std::vector<MotionWindow>& windows) {
  long out = 0;
  for (const MotionWindow& w : windows)
    for (const double q : stretches[w.stretch].q.middleRows(w.first, w.rows).reshaped())
      out += std::isnan(q) ? 0 : 1;
  return out;
}

}  // namespace

MotionFitter::MotionFitter(const MotionProblem& problem, const MotionOptions& options,
                           VecX<double> start, VecX<double> shape,
                           std::function<bool(int, double)> progress)
    : problem_(problem),
      options_(options),
      start_(std::move(start)),
      start_shape_(std::move(shape)),
      progress_(std::move(progress)) {
  const FitLayout& layout = problem.layout;
  for (std::size_t c = 0; c < layout.linear.size(); ++c)
    if (!layout.linear[c].fixed) free_.push_back(static_cast<int>(c));
  for (std::size_t s = 0; s < layout.shape.size(); ++s)
    if (!layout.shape[s].fixed) free_.push_back(static_cast<int>(layout.linear.size() + s));
  now_.x = start_;
  now_.shape = start_shape_;
}

std::vector<ModelOfRuns> MotionFitter::models_of(const Model& model) const {
  std::map<std::vector<bool>, std::vector<int>> alike;  // runs by the effects that act in them
  for (const int run : problem_.runs) {
    std::vector<bool> acts;
    for (const BoundEffect& e : problem_.layout.effects) acts.push_back(e.acts_in(run));
    alike[acts].push_back(run);
  }
  std::vector<ModelOfRuns> out;
  for (const auto& [acts, runs] : alike)
    out.push_back({runs, extend(model, problem_.runs, runs.front())});
  return out;
}

Workers MotionFitter::workers_at(const VecX<double>& x, const VecX<double>& shape,
                                 const std::vector<int>& free) const {
  const FitLayout& layout = problem_.layout;
  std::vector<BoundEffect> effects = layout.effects;
  const auto set = [&](const FitParameter& p, double value) {
    if (p.effect >= 0)
      effects[static_cast<std::size_t>(p.effect)].parameters[static_cast<std::size_t>(p.index)] =
          value;
  };
  const long p = static_cast<long>(layout.linear.size());
  for (long c = 0; c < p; ++c) set(layout.linear[static_cast<std::size_t>(c)], x[c]);
  for (std::size_t s = 0; s < layout.shape.size(); ++s)
    set(layout.shape[s], shape[static_cast<long>(s)]);
  std::vector<MotionParameter> parameters;
  for (const int c : free) {
    const FitParameter& from = c < p ? layout.linear[static_cast<std::size_t>(c)]
                                     : layout.shape[static_cast<std::size_t>(c - p)];
    parameters.push_back(
        {from.dof, from.theta, from.effect, from.index, c >= p && from.logarithmic});
  }
  const std::vector<ModelOfRuns> models = models_of(apply_fit(problem_.model, layout, x, shape));
  Workers out;
  for (int t = 0; t < std::max(options_.threads, 1); ++t)
    out.push_back(std::make_unique<JointWindows>(models, effects, parameters, options_.stepping));
  return out;
}

std::vector<ReducedWindow> MotionFitter::linearise(Workers& workers,
                                                   const std::vector<MotionWindow>& windows,
                                                   int free) const {
  std::vector<ReducedWindow> out(windows.size());
  parallel_for(windows.size(), workers.size(), [&](std::size_t i, std::size_t t) {
    const int states = workers[t]->states();
    TriangularFactor rows(states + free);
    const bool finite = workers[t]->linearise(problem_.stretches[windows[i].stretch], windows[i],
                                              problem_.sigma, rows);
    out[i] = eliminate(rows, states, finite);
  });
  return out;
}

/// Costs of all windows at the ends of their states' steps. Where a window is worse than before,
/// and that matters, shorter steps of its state are tried: one near an unstable equilibrium must
/// not hold back the others.
/// @param windows  with the states where the step begins
/// @param to       states where it ends; moved back where that is worse
/// @param before   costs at the beginning
std::vector<double> MotionFitter::costs(Workers& workers, const std::vector<MotionWindow>& windows,
                                        std::vector<VecX<double>>& to,
                                        const std::vector<double>& before) const {
  std::vector<double> out(windows.size());
  parallel_for(windows.size(), workers.size(), [&](std::size_t i, std::size_t t) {
    MotionWindow w = windows[i];
    w.state = to[i];
    out[i] = workers[t]->cost(problem_.stretches[w.stretch], w, problem_.sigma);
  });
  const auto shorten = [&](std::size_t i, JointWindows& simulator) {
    const MotionStretch& stretch = problem_.stretches[windows[i].stretch];
    MotionWindow w = windows[i];
    const VecX<double> from = w.state, full = to[i] - from;
    const auto attempt = [&](double share) {
      w.state = from + share * full;
      const double c = simulator.cost(stretch, w, problem_.sigma);
      if (!(c < out[i])) return;
      out[i] = c;
      to[i] = w.state;
    };
    for (const double share : {0.5, 0.2, 0.05}) {
      if (out[i] <= before[i]) return;
      const double excess = out[i] - before[i];
      attempt(share);
      // A loop that is closed forgets its first state: hardly any would make up for the parameters.
      if (excess - (out[i] - before[i]) < kMatters * excess) break;
    }
    // At a jump, as where a hidden rotor begins on the other flank, the shortest step is too long.
    if (out[i] > before[i]) attempt(0.0);
  };
  std::vector<std::size_t> worse;
  double gained = 0.0;
  for (std::size_t i = 0; i < out.size(); ++i)
    if (out[i] > before[i])
      worse.push_back(i);
    else if (before[i] < kInfinity)
      gained += before[i] - out[i];
  const auto excess = [&](std::size_t i) { return out[i] - before[i]; };
  std::ranges::stable_sort(worse, std::greater(), excess);
  std::vector<double> left(worse.size() + 1, 0.0);  // excess of a window and those after it
  for (std::size_t k = worse.size(); k-- > 0;) left[k] = left[k + 1] + excess(worse[k]);
  // Some at a time, however many threads there are, until the others matter no more.
  constexpr std::size_t kAtOnce = 4;
  for (std::size_t k = 0; k < worse.size(); k += kAtOnce) {
    if (!(left[k] > kMatters * gained) || gained < 0.0) break;
    const std::size_t count = std::min(kAtOnce, worse.size() - k);
    parallel_for(count, workers.size(),
                 [&](std::size_t i, std::size_t t) { shorten(worse[k + i], *workers[t]); });
    for (std::size_t i = 0; i < count; ++i) gained -= excess(worse[k + i]);
  }
  return out;
}

void MotionFitter::fit(std::vector<MotionWindow>& windows, double tolerance, double to_beat) {
  const int f = static_cast<int>(free_.size());
  const long p = static_cast<long>(problem_.layout.linear.size());
  const long columns = p + static_cast<long>(problem_.layout.shape.size());
  now_.samples = samples_of(problem_.stretches, windows);
  const double noise = 0.5 * static_cast<double>(now_.samples);
  Workers simulators = workers();
  std::vector<VecX<double>> states = states_of(windows);
  std::vector<double> parts =
      costs(simulators, windows, states, std::vector<double>(windows.size(), kInfinity));
  Cost now = total(parts);
  now_.objective = now.sum;
  double damping = 1e-4;
  int stalls = 0;
  blur_ = blur(windows);
  double blurred = now.sum;
  now_.converged = false;
  now_.within_reach = 0.0;
  now_.termination = "iteration limit";
  for (int iteration = 0; iteration < options_.max_iterations; ++iteration) {
    const std::vector<ReducedWindow> reduced = linearise(simulators, windows, f);
    TriangularFactor whole(f);
    for (const ReducedWindow& r : reduced)
      if (r.finite) whole.add(r.rows);
    const MatX<double> R = whole.R();
    now_.R = MatX<double>::Zero(f, columns);
    VecX<double> at(f);
    for (int k = 0; k < f; ++k) {
      now_.R.col(free_[static_cast<std::size_t>(k)]) = R.col(k);
      at[k] = coordinate(free_[static_cast<std::size_t>(k)], now_.x, now_.shape);
    }
    const VecX<double> d = R * at - whole.d();  // R (x_new − x) = −r

    bool accepted = false;
    double gained = 0.0, refused = kInfinity;  // length of the last step
    for (int attempt = 0; attempt < 8 && !accepted; ++attempt) {
      const Step to = shorter_step(d, refused, damping);
      std::vector<VecX<double>> next = states_of(windows);
      for (std::size_t i = 0; i < windows.size(); ++i)
        if (reduced[i].finite) next[i] += reduced[i].state_step(to.change);
      Workers tried = workers_at(to.x, to.shape, free_);
      std::vector<double> parts_new = costs(tried, windows, next, parts);
      const Cost after = total(parts_new);
      if (after < now) {
        gained = after.blown_up < now.blown_up ? kInfinity : now.sum - after.sum;
        now = after;
        parts = std::move(parts_new);
        simulators = std::move(tried);
        now_.x = to.x;
        now_.shape = to.shape;
        set_states(next, windows);
        damping = std::max(damping * 0.2, 1e-9);
        accepted = true;
      } else {
        damping *= 10.0;
        refused = to.length;
      }
    }
    ++now_.iterations;
    now_.objective = now.sum;
    if (now.sum < 0.5 * blurred) {
      blur_ = blur(windows);
      blurred = now.sum;
    }
    if (progress_ && !progress_(now_.iterations, now.sum)) {
      now_.interrupted = true;
      now_.termination = "interrupted";
      now_.blown_up = now.blown_up;
      return;
    }
    if (const double reached = now.sum - kPatience * gained; reached > to_beat) {
      now_.within_reach = reached;
      now_.termination = "another fit is out of reach";
      break;
    }
    const bool exact = now.sum < kBelowNoise * noise;
    if (accepted && gained >= tolerance * now.sum && !exact) continue;
    // A small gain may be that of a small step: what would a long one gain?
    const double promised = exact ? 0.0 : promise(reduced, d);
    const bool nothing_left = promised < kUnkept * now.sum;
    if (accepted && !nothing_left) {
      damping = std::min(damping, 1.0);
      if (++stalls < kStalls) continue;
    }
    now_.converged = promised < kUnkeptAtLast * now.sum && now.blown_up == 0;
    now_.termination = nothing_left
                           ? "gain below tolerance"
                           : "no lower point along the step, which promises " +
                                 format_number(100.0 * promised / now.sum) + " % of the objective";
    break;
  }
  now_.blown_up = now.blown_up;
  if (now.blown_up > 0)
    now_.termination += "; the simulation of " + std::to_string(now.blown_up) + " of " +
                        std::to_string(windows.size()) + " windows blows up";
}

TriangularFactor MotionFitter::factor(const std::vector<MotionWindow>& windows) const {
  const int f = static_cast<int>(free_.size());
  Workers simulators = workers();
  TriangularFactor out(f);
  for (const ReducedWindow& r : linearise(simulators, windows, f))
    if (r.finite) out.add(r.rows);
  return out;
}

void MotionFitter::fit_states(std::vector<MotionWindow>& windows, double tolerance,
                              double most) const {
  Workers simulators = workers_at(now_.x, now_.shape, {});
  // Windows know nothing of each other: each goes its own way.
  parallel_for(windows.size(), simulators.size(), [&](std::size_t i, std::size_t t) {
    MotionWindow& w = windows[i];
    const double noise =
        0.5 * static_cast<double>(w.rows) * static_cast<double>(problem_.sigma.size());
    fit_state(*simulators[t], problem_.stretches[w.stretch], w, problem_.sigma,
              {.max_iterations = options_.max_iterations,
               .tolerance = tolerance,
               .enough = kBelowNoise * noise,
               .most = most});
  });
}

double MotionFitter::cost(const std::vector<MotionWindow>& windows) const {
  Workers simulators = workers_at(now_.x, now_.shape, {});
  std::vector<double> parts(windows.size());
  parallel_for(windows.size(), simulators.size(), [&](std::size_t i, std::size_t t) {
    parts[i] =
        simulators[t]->cost(problem_.stretches[windows[i].stretch], windows[i], problem_.sigma);
  });
  double out = 0.0;
  for (const double c : parts) out += c;
  return out;
}

}  // namespace diffnea
