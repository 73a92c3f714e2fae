#include "identify/motion_climb.hpp"

#include <algorithm>
#include <chrono>

namespace diffnea {
namespace {

/// Adds the time that it lives to a sum.
class Stopwatch {
 public:
  explicit Stopwatch(double& sum) : sum_(sum) {}
  ~Stopwatch() {
    sum_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  double& sum_;
  const std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

void Ladder::next(Workers workers, const std::vector<MotionStretch>& stretches, double horizon,
                  double first) {
  if (!windows.empty()) {
    windows = continued(workers, stretches, windows, horizon, first);
    return;
  }
  windows = cut_windows(stretches, horizon);
  set_measured_states(stretches, first, windows);
}

MotionClimb::MotionClimb(const Model& model, const MotionData& data, MotionBeginning from,
                         const VecX<double>& limit, const MotionOptions& options,
                         std::function<bool(int, double)> progress)
    : model_(model),
      data_(data),
      from_(std::move(from)),
      limit_(limit),
      options_(options),
      progress_(std::move(progress)),
      problem_{model_, from_.layout, data_.train, data_.runs, data_.noise.position, from_.scale} {
  begin_fitter(from_.start, from_.shape, 0);
}

void MotionClimb::begin_fitter(const VecX<double>& x, const VecX<double>& shape, int iterations) {
  fitter_.emplace(problem_, options_, x, shape, progress_);
  MotionFit from = fitter_->now();
  from.iterations = iterations;
  fitter_->restore(std::move(from));
}

void MotionClimb::begin(double first_horizon) {
  first_ = first_horizon;
  if (from_.guess.size() == 0) return;
  std::vector<MotionWindow> windows = cut_windows(data_.train, first_);
  set_measured_states(data_.train, first_, windows);
  const double of_model = fitter_->cost(windows);
  fitter_->begin_at(from_.guess);
  if (!(fitter_->cost(windows) < of_model)) fitter_->begin_at(from_.start);
}

Rung MotionClimb::advance(double horizon, double tolerance, double to_beat) {
  const Stopwatch watch(seconds_);
  Ladder next = at_;
  next.next(fitter_->workers(), data_.train, horizon, first_);
  const bool shortest = at_.windows.empty();
  if (!shortest) {
    Workers workers = fitter_->workers();
    drowned_ = torque_noise_share(*workers.front(), data_.train, next.windows, data_.noise.density,
                                  limit_);
    if (drowned_ > 1.0) return Rung::kDrowned;
  }
  const MotionFit before = fitter_->now();
  if (horizon < from_.fitted_to)
    fitter_->fit_states(next.windows, tolerance);
  else
    fitter_->fit(next.windows, tolerance, to_beat);
  return settle(horizon, std::move(next), before);
}

Rung MotionClimb::follow(double horizon, double tolerance) {
  const Stopwatch watch(seconds_);
  Ladder next = at_;
  next.next(fitter_->workers(), data_.train, horizon, first_);
  fitter_->fit_states(next.windows, tolerance);
  return settle(horizon, std::move(next), fitter_->now());
}

Rung MotionClimb::settle(double horizon, Ladder next, const MotionFit& before) {
  Workers workers = fitter_->workers();
  next.errors = window_errors(workers, data_.train, next.windows, limit_);
  const bool shortest = at_.windows.empty(),
             apart = 2 * next.errors.apart.size() >= next.windows.size();
  if (apart) apart_ = next;
  if (apart && !shortest && !fitter_->now().interrupted) {
    MotionFit back = before;
    back.iterations = fitter_->now().iterations;
    fitter_->restore(std::move(back));
    return Rung::kFellBack;
  }
  at_ = std::move(next);
  reached_ = horizon;
  whole_ = !apart;
  return Rung::kReached;
}

void MotionClimb::finish(double tolerance) {
  const Stopwatch watch(seconds_);
  fitter_->fit(at_.windows, tolerance);
  Workers workers = fitter_->workers();
  at_.errors = window_errors(workers, data_.train, at_.windows, limit_);
}

void MotionClimb::change(FitLayout layout, const VecX<double>& x, const VecX<double>& shape,
                         std::vector<MotionWindow> windows) {
  const int iterations = fitter_->now().iterations;
  from_.layout = std::move(layout);
  at_.windows = std::move(windows);
  begin_fitter(x, shape, iterations);
}

std::vector<MotionWindow> MotionClimb::pieces(double horizon) const {
  std::vector<MotionWindow> out = cut_windows(data_.train, horizon, at_.windows);
  set_measured_states(data_.train, first_, out);
  return out;
}

double MotionClimb::independent() const {
  const MotionFit& fit = fitter_->now();
  const double n = static_cast<double>(std::max(fit.samples, 1L));
  if (!(fit.objective > 0.0)) return n;  // an exact fit
  return std::clamp(2.0 * fit.objective / fitter_->correlation(at_.windows), 1.0, n);
}

}  // namespace diffnea
