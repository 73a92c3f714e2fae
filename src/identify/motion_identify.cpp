#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/identify/posterior.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "core/statistics.hpp"
#include "identify/drives.hpp"
#include "identify/local_factors.hpp"
#include "identify/motion_data.hpp"
#include "identify/motion_fit.hpp"
#include "identify/motionless.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// Horizon over which fits of drives compete for the right to go on [s]: some delays and swings of
/// a servo.
constexpr double kTrial = 1.0;

/// Windows of one set of data under one model, from horizon to horizon.
struct Ladder {
  std::vector<MotionWindow> windows;
  WindowErrors errors;

  /// Windows of the next horizon, from states of the present ones.
  void next(Workers workers, const std::vector<MotionStretch>& stretches, double horizon,
            double first) {
    if (!windows.empty()) {
      windows = continued(workers, stretches, windows, horizon, first);
      return;
    }
    windows = cut_windows(stretches, horizon);
    set_measured_states(stretches, first, windows);
  }
};

/// The output-error loss, from data to numbers.
class MotionIdentification {
 public:
  MotionIdentification(const Model& model, const RecordingSource& train,
                       const RecordingSource* test, const IdentifyOptions& options)
      : model_(model), train_(train), test_(test), options_(options) {}

  /// Begins drives at a share of their commands' largest speed (kSpeedShares).
  void begin_drives_at(double speed_share) { speed_share_ = speed_share; }

  /// Fits some stretches as far as the options' horizon. @return χ²/2 a position there; infinite:
  /// falls apart
  double trial() {
    brief_ = true;
    prepare();
    climb();
    const MotionFit& fit = fitter_->now();
    return whole_ && reached_ == ladder_.back()
               ? fit.objective / static_cast<double>(std::max<long>(fit.samples, 1))
               : kInfinity;
  }

  IdentifyResult run() {
    const auto start = std::chrono::steady_clock::now();
    prepare();
    climb();
    if (whole_ && !fitter_->now().interrupted) release_bounds();
    result_.summary.seconds_fitting = fitting_;
    evaluate();
    result_.summary.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return std::move(result_);
  }

 private:
  void require_derivatives() const {
    for (const FitParameter& s : layout_.shape) {
      const bool of_tree =
          s.effect < 0 ||
          layout_.effects[static_cast<std::size_t>(s.effect)].info().port == Port::kModelParameter;
      if (!s.fixed && of_tree)
        throw ModelError("identify: the motion loss does not fit " + s.name +
                         "; fit it with the inverse loss first, then hold it (--fix \"" + s.name +
                         "\")");
    }
    for (const FitParameter& p : layout_.linear)
      if (!p.fixed && p.effect >= 0 && layout_.effects[p.effect].info().has(Trait::kGain))
        throw ModelError(
            "identify: the motion loss does not fit torque gains; fit torque_gain with the "
            "inverse loss first, then hold it (--fix \"*torque_gain*\")");
  }

  void prepare() {
    const auto start = std::chrono::steady_clock::now();
    layout_ = layout_for(model_, train_, test_, options_.choice, result_.notes);
    require_derivatives();
    const std::vector<bool> commanded = commanded_joints(layout_);
    data_ = motion_data(train_, test_, commanded, result_.notes);
    result_.data_report = train_.report();
    result_.summary.rows = data_.rows;
    result_.summary.passes = 1;
    require_motion(train_.sample().front().source);
    if (test_ && still_joints(data_.test, data_.noise).size() == static_cast<std::size_t>(layout_.num_dofs))
      throw DataError(test_->sample().front().source + ": held-out data: no joint moves (" +
                      detail::join(joint_names(model_)) + ")");
    ladder_ = horizons(data_.train, data_.noise, options_.motion);
    if (brief_) thin_out();
    limit_ = apart_limit(data_);
    describe_noise();

    shape_.resize(static_cast<long>(layout_.shape.size()));
    for (std::size_t s = 0; s < layout_.shape.size(); ++s)
      shape_[static_cast<long>(s)] = layout_.shape[s].prior;
    if (std::ranges::any_of(commanded, std::identity()))
      guess_drives(model_, data_.train, cut_windows(data_.train, ladder_.front()), speed_share_,
                   layout_, shape_);
    const std::vector<JointFactor> factors = hold_absorbed(
        model_, data_.train, cut_windows(data_.train, ladder_.front()), layout_, result_.notes);
    const auto fixed = [](const FitParameter& p) { return p.fixed; };
    if (std::ranges::all_of(layout_.linear, fixed) && std::ranges::all_of(layout_.shape, fixed))
      throw ModelError(
          "identify: every parameter is held, nothing is left to fit; groups of fit: "
          "inertia, armature, effects, shapes");
    scale_ = parameter_scales(layout_, factors);
    // Horizon 0: torques of one instant. A robot that nothing drives has none to fit.
    const bool driven = std::ranges::any_of(
        data_.train, [](const MotionStretch& s) { return s.command || s.u.cwiseAbs().maxCoeff() > 0.0; });
    if (driven) guess_ = inverse_guess(factors);
    start_ = consistent_start(layout_, scale_);
    for (std::size_t k = 0; k < layout_.linear.size(); ++k)
      if (layout_.linear[k].fixed) start_[static_cast<long>(k)] = layout_.linear[k].prior;
    fitting_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

  /// Leaves stretches drawn at random, as many as have windows enough for every parameter.
  void thin_out() {
    constexpr double kWindows = 5.0;  // a parameter, as clusters of a covariance
    const auto is_free = [](const FitParameter& p) { return !p.fixed; };
    const double parameters = static_cast<double>(std::ranges::count_if(layout_.linear, is_free) +
                                                  std::ranges::count_if(layout_.shape, is_free));
    Rng rng(1);
    double windows = 0.0;
    std::size_t kept = 0;
    while (kept < data_.train.size() && windows < kWindows * parameters) {
      const std::size_t left = data_.train.size() - kept;
      const std::size_t drawn = kept + static_cast<std::size_t>(rng.next() % left);
      std::swap(data_.train[kept], data_.train[drawn]);
      windows += data_.train[kept++].length() / ladder_.back();
    }
    data_.train.resize(kept);
  }

  /// @throws DataError if no joint moves, or there are fewer positions than numbers to fit to them
  void require_motion(const std::string& source) {
    const std::size_t n = static_cast<std::size_t>(layout_.num_dofs);
    long positions = 0;
    for (const MotionStretch& s : data_.train) positions += (s.q.array() == s.q.array()).count();
    const auto is_free = [](const FitParameter& p) { return !p.fixed; };
    const long states = static_cast<long>(2 * n * data_.train.size()),
               parameters = std::ranges::count_if(layout_.linear, is_free) +
                            std::ranges::count_if(layout_.shape, is_free);
    if (positions < states + parameters)
      throw DataError(source + ": " + std::to_string(positions) + " positions for " +
                      std::to_string(states) + " initial states and " + std::to_string(parameters) +
                      " parameters; record longer, or fix parameters");
    hold_motionless(still_joints(data_.train, data_.noise), joint_names(model_), source, layout_, result_.notes);
  }

  /// Notes on sensors: slow ones, and those that show no noise.
  void describe_noise() {
    PreprocessPlan& plan = result_.plan;
    plan.dt = data_.noise.period.minCoeff();
    plan.q_noise.assign(data_.noise.position.data(), data_.noise.position.data() + data_.noise.position.size());
    plan.tau_noise.assign(data_.noise.torque.data(), data_.noise.torque.data() + data_.noise.torque.size());
    const std::vector<std::string> names = joint_names(model_);
    for (std::size_t j = 0; j < names.size(); ++j) {
      if (data_.noise.refresh[j] > 1)
        result_.notes.push_back(names[j] + ": its sensor has a new position every " +
                                std::to_string(data_.noise.refresh[j]) +
                                " rows; the others do not "
                                "count");
      if (data_.noise.position[static_cast<long>(j)] <= kPositionFloor)
        result_.notes.push_back(names[j] + ": its position shows no noise; " +
                                format_number(kPositionFloor) + " is taken as its least");
    }
  }

  /// Linear parameters that fit the torques of one instant; empty where these are too few.
  VecX<double> inverse_guess(const std::vector<JointFactor>& factors) const {
    try {
      return fit_linear(layout_, factors).x;
    } catch (const DataError&) {
      return {};
    }
  }

  /// Starts at what simulates the shortest windows best: the model, or the torques of one instant.
  void begin() {
    if (guess_.size() == 0) return;
    std::vector<MotionWindow> windows = cut_windows(data_.train, ladder_.front());
    set_measured_states(data_.train, ladder_.front(), windows);
    const double of_model = fitter_->best_cost(windows);
    fitter_->begin_at(guess_);
    if (!(fitter_->best_cost(windows) < of_model)) fitter_->begin_at(start_);
  }

  /// @param iterations  that were made before
  void begin_fitter(const VecX<double>& x, const VecX<double>& shape, int iterations) {
    fitter_.emplace(*problem_, options_.motion, x, shape, [this](int iteration, double objective) {
      return !options_.progress ||
             options_.progress({"simulating", iteration, result_.summary.rows, objective});
    });
    MotionFit from = fitter_->now();
    from.iterations = iterations;
    fitter_->restore(std::move(from));
  }

  /// From horizon to horizon, as far as windows hold together.
  void climb() {
    const MotionProblem problem{model_, layout_, data_.train, data_.runs, data_.noise.position, scale_};
    problem_.emplace(problem);
    begin_fitter(start_, shape_, 0);
    held_problem_.emplace(
        MotionProblem{model_, layout_, data_.test, data_.runs, data_.noise.position, scale_});
    nominal_fitter_.emplace(*problem_, options_.motion, layout_.prior(), shape_);
    const double first = ladder_.front();
    begin();
    for (const double horizon : ladder_) {
      const auto start = std::chrono::steady_clock::now();
      Ladder next = fitted_;
      next.next(fitter_->workers(), data_.train, horizon, first);
      if (horizon > first && drowned(next, horizon)) break;
      const MotionFit before = fitter_->now();
      // Where the next horizon goes on, this one need not be exact.
      fitter_->fit(next.windows, horizon == ladder_.back() ? options_.motion.tolerance : kOnTheWay);
      Workers workers = fitter_->workers();
      next.errors = window_errors(workers, data_.train, next.windows, limit_);
      fitting_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      const bool apart = 2 * next.errors.apart.size() >= next.windows.size();
      if (apart) say_apart(next, horizon, horizon > first);
      if (apart && horizon > first && !fitter_->now().interrupted) {
        MotionFit back = before;
        back.iterations = fitter_->now().iterations;
        fitter_->restore(back);
        break;
      }
      fitted_ = std::move(next);
      reached_ = horizon;
      whole_ = !apart;
      measure(horizon);
      if (apart || fitter_->now().interrupted) break;
    }
    if (reached_ < ladder_.back() && !fitter_->now().interrupted) finish();
  }

  /// Leaves out bounds of drives that the recordings do not need, at no bound at all: at the edge
  /// of what was seen they would hold back motion that was not.
  void release_bounds() {
    const MotionFit at = fitter_->now();
    const double n = static_cast<double>(std::max(at.samples, 1L)), cost = at.objective,
                 together = std::max(fitter_->correlation(fitted_.windows) * n / (2.0 * cost), 1.0);
    // BIC, of rows that count as one together
    const auto is_enough = [&](double objective, double bounds) {
      return n / together * std::log(objective / cost) < bounds * std::log(n);
    };
    std::vector<std::size_t> bounds;
    for (std::size_t k = 0; k < layout_.shape.size(); ++k)
      if (!layout_.shape[k].fixed && is_bound_of_drive(layout_, layout_.shape[k]))
        bounds.push_back(k);
    if (bounds.empty()) return;
    VecX<double> x = at.x, shape = at.shape;
    std::vector<std::string> left_out;
    const auto leave_out = [&](std::size_t k) {
      FitParameter& s = layout_.shape[k];
      s.fixed = true;
      s.prior = shape[static_cast<long>(k)] = no_bound(layout_, s);
      left_out.push_back(s.name);
    };
    // All at once, the others fitted beside: a delay makes up for a speed that hardly shows.
    const FitLayout with_bounds = layout_;
    for (const std::size_t k : bounds) leave_out(k);
    MotionFitter without(*problem_, options_.motion, x, shape);
    std::vector<MotionWindow> windows = fitted_.windows;
    without.fit(windows, kOnTheWay);
    if (is_enough(without.now().objective, static_cast<double>(bounds.size()))) {
      x = without.now().x;
      shape = without.now().shape;
      fitted_.windows = std::move(windows);
    } else {
      layout_ = with_bounds;
      left_out.clear();
      shape = at.shape;
      for (const std::size_t k : bounds) {
        VecX<double> one = shape;
        one[static_cast<long>(k)] = no_bound(layout_, layout_.shape[k]);
        const MotionFitter tried(*problem_, options_.motion, x, one);
        if (is_enough(tried.best_cost(fitted_.windows), 1.0)) leave_out(k);
      }
    }
    if (left_out.empty()) return;
    result_.notes.push_back("left at no bound, which the recording does not need: " +
                            detail::join(left_out));
    begin_fitter(x, shape, at.iterations);
    finish();
  }

  /// Fits the horizon that turned out to be the last one exactly.
  void finish() {
    const auto start = std::chrono::steady_clock::now();
    fitter_->fit(fitted_.windows, options_.motion.tolerance);
    Workers workers = fitter_->workers();
    fitted_.errors = window_errors(workers, data_.train, fitted_.windows, limit_);
    fitting_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    result_.horizons.resize(result_.horizons.size() - static_cast<std::size_t>(layout_.num_dofs));
    measure(reached_);
  }

  bool drowned(const Ladder& next, double horizon) {
    Workers workers = fitter_->workers();
    const double share =
        torque_noise_share(*workers.front(), data_.train, next.windows, data_.noise.density, limit_);
    if (share <= 1.0) return false;
    result_.notes.push_back("windows end at " + format_number(reached_) + " s: over " +
                            format_number(horizon) +
                            " s noise of the measured torques would move the robot by " +
                            format_number(100.0 * kApart * share) + " % of its motion");
    return true;
  }

  /// "falls apart at a horizon of 2 s: in 3 of 8 windows, after 0.4 s (median), e.g. elbow at 3 s"
  std::string apart_words(const Ladder& at, const std::vector<MotionStretch>& stretches,
                          double horizon, int first_run) const {
    const Apart& a = at.errors.apart[at.errors.apart.size() / 2];
    const MotionWindow& w = at.windows[a.window];
    const MotionStretch& s = stretches[w.stretch];
    std::vector<double> after;
    for (const Apart& each : at.errors.apart) after.push_back(each.after);
    return "falls apart at a horizon of " + format_number(horizon) + " s: in " +
           std::to_string(at.errors.apart.size()) + " of " + std::to_string(at.windows.size()) +
           " windows, after " + format_number(median(after)) + " s (median), e.g. " +
           joint_names(model_)[static_cast<std::size_t>(a.joint)] + " at " +
           format_number(s.time[static_cast<std::size_t>(w.first)] + a.after) + " s" +
           (s.run > first_run ? " of run " + std::to_string(s.run - first_run) : "");
  }

  /// @param earlier  a shorter horizon holds together
  void say_apart(const Ladder& at, double horizon, bool earlier) {
    result_.notes.push_back(
        std::string(earlier ? "" : kWarning) + "the simulation " +
        apart_words(at, data_.train, horizon, 0) +
        "; the model lacks something that acts within that time" +
        (earlier ? ", and the result is that of " + format_number(reached_) + " s" : ""));
  }

  /// Errors of this horizon: held out, and of the model before the fit.
  void measure(double horizon) {
    const double first = ladder_.front();
    const auto of_model = [&](const MotionFitter& fitter,
                              const std::vector<MotionStretch>& stretches, Ladder& ladder) {
      ladder.next(fitter.workers(), stretches, horizon, first);
      fitter.fit_states(ladder.windows);
      Workers workers = fitter.workers();
      ladder.errors = window_errors(workers, stretches, ladder.windows, limit_);
    };
    of_model(*nominal_fitter_, data_.train, nominal_);
    VecX<double> test = VecX<double>::Constant(layout_.num_dofs, kNaN), nominal_test = test;
    if (test_) {
      const MotionFitter fitter(*held_problem_, options_.motion, fitter_->now().x,
                                fitter_->now().shape);
      const MotionFitter before(*held_problem_, options_.motion, layout_.prior(), shape_);
      of_model(fitter, data_.test, test_fitted_);
      of_model(before, data_.test, test_nominal_);
      test = test_fitted_.errors.rmse();
      nominal_test = test_nominal_.errors.rmse();
    }
    const VecX<double> train = fitted_.errors.rmse(), nominal = nominal_.errors.rmse();
    const std::vector<std::string> names = joint_names(model_);
    for (int j = 0; j < layout_.num_dofs; ++j) {
      HorizonError e;
      e.horizon = horizon;
      e.joint = names[static_cast<std::size_t>(j)];
      e.unit = unit_of_joint(model_, j, false);
      e.train = train[j];
      e.nominal_train = nominal[j];
      e.test = test[j];
      e.nominal_test = nominal_test[j];
      e.windows = static_cast<int>(fitted_.windows.size());
      e.apart = static_cast<int>(fitted_.errors.apart.size());
      e.test_windows = static_cast<int>(test_fitted_.windows.size());
      e.test_apart = static_cast<int>(test_fitted_.errors.apart.size());
      result_.horizons.push_back(e);
    }
  }

  void evaluate() {
    fitter_->set_covariance(fitted_.windows);
    const MotionFit& fit = fitter_->now();
    const long p = fit.x.size();
    result_.model = apply_fit(model_, layout_, fit.x, fit.shape);
    VecX<double> std = VecX<double>::Zero(p), shape_std = VecX<double>::Zero(fit.shape.size());
    std::vector<bool> identifiable(static_cast<std::size_t>(p), false);
    std::vector<int> at_bound;
    const auto error_of = [&](long k) {
      return fit.R.col(k).norm() > 0.0 ? std::sqrt(std::max(fit.covariance(k, k), 0.0)) : kNaN;
    };
    for (long k = 0; k < p; ++k) {
      const FitParameter& def = layout_.linear[static_cast<std::size_t>(k)];
      if (def.fixed) continue;
      const double s = error_of(k);
      identifiable[static_cast<std::size_t>(k)] = s < scale_[k];
      std[k] = identifiable[static_cast<std::size_t>(k)] ? s : kNaN;
      if (def.sign != Sign::kFree && fit.x[k] < 1e-4 * scale_[k])
        at_bound.push_back(static_cast<int>(k));
    }
    for (long k = 0; k < shape_std.size(); ++k) {
      const FitParameter& def = layout_.shape[static_cast<std::size_t>(k)];
      if (def.fixed) continue;
      const double s = error_of(p + k);
      // Known to a factor of e, or to 1 rad or m, as in the inverse loss.
      shape_std[k] = s < (def.logarithmic ? fit.shape[k] : 1.0) ? s : kNaN;
    }
    result_.parameters =
        parameter_estimates(layout_, fit.x, fit.shape, std, identifiable, at_bound, shape_std);
    const Posterior arm = posterior_of(layout_, fit.x, information(fit), train_);
    result_.model.posterior = joined(&arm, model_.posterior ? &*model_.posterior : nullptr);
    result_.physically_consistent = true;
    add_errors();
    summarise(fit);
  }

  /// Errors at the longest horizon; test_raw from states that the positions alone give.
  void add_errors() {
    VecX<double> raw = VecX<double>::Constant(layout_.num_dofs, kNaN);
    if (test_) {
      std::vector<MotionWindow> measured = test_fitted_.windows;
      set_measured_states(data_.test, ladder_.front(), measured);
      Workers workers = fitter_->workers();
      raw = window_errors(workers, data_.test, measured, limit_).rmse();
      if (!test_fitted_.errors.apart.empty())
        result_.notes.push_back(
            kWarning + ("the simulation of held-out data " +
                        apart_words(test_fitted_, data_.test, reached_,
                                    static_cast<int>(train_.runs().size()))) +
            "; the held-out errors above say no more than that");
      const long blown = test_fitted_.errors.blown_up();
      if (blown > 0)
        result_.notes.push_back(
            "the simulation of " + std::to_string(blown) + " of " +
            std::to_string(test_fitted_.windows.size()) +
            " held-out windows blows up; the errors are of the others" +
            (test_fitted_.errors.rmse().array().isNaN().all() ? ", and there is none" : ""));
      Workers before = nominal_fitter_->workers();
      result_.test_series = series(data_.test, test_fitted_, workers, test_nominal_, before);
    }
    Workers after = fitter_->workers(), before = nominal_fitter_->workers();
    result_.train_series = series(data_.train, fitted_, after, nominal_, before);
    const std::size_t n = static_cast<std::size_t>(layout_.num_dofs);
    for (std::size_t j = 0; j < n; ++j) {
      const HorizonError& at = result_.horizons[result_.horizons.size() - n + j];
      JointError e = blank_error(model_, static_cast<int>(j), false);
      e.train = at.train;
      e.nominal_train = at.nominal_train;
      e.test = e.test_all = at.test;
      e.nominal_test = at.nominal_test;
      e.test_raw = raw[static_cast<long>(j)];
      result_.errors.push_back(e);
    }
  }

  void summarise(const MotionFit& fit) {
    FitSummary& s = result_.summary;
    s.converged = fit.converged && whole_;
    s.interrupted = fit.interrupted;
    s.termination = fit.termination;
    if (!whole_) s.termination += "; windows fall apart at the shortest horizon";
    s.iterations = fit.iterations;
    s.fitted_rows = fit.samples;
    s.horizon = reached_;
    result_.notes.push_back(
        std::to_string(fitted_.windows.size()) +
        (fitted_.windows.size() == 1 ? " window of " : " windows of ") + format_number(reached_) +
        " s; errors are of positions, each window from its own estimated initial state (test_raw: "
        "from the measured one)");
    if (!fitted_.errors.apart.empty() && whole_)
      result_.notes.push_back(
          std::to_string(fitted_.errors.apart.size()) + " of " +
          std::to_string(fitted_.windows.size()) + " windows of " + format_number(reached_) +
          " s fall apart: there the error is more than half of a joint's motion about its mean");
    if (std::string text =
            unlike_the_others(fitted_.errors, data_.train, fitted_.windows, joint_names(model_));
        !text.empty())
      result_.notes.push_back(std::move(text));
  }

  MatX<double> information(const MotionFit& fit) const {
    const long p = fit.x.size();
    MatX<double> out = MatX<double>::Zero(p, p);
    std::vector<int> free;
    for (long k = 0; k < p; ++k)
      if (!layout_.linear[static_cast<std::size_t>(k)].fixed) free.push_back(static_cast<int>(k));
    MatX<double> c = fit.covariance(free, free);
    const VecX<double> s = c.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    c = s.asDiagonal() * c * s.asDiagonal();
    c.diagonal().array() += 1e-10;  // clusters fewer than parameters leave it singular
    out(free, free) = s.asDiagonal() *
                      c.ldlt().solve(MatX<double>(MatX<double>::Identity(c.rows(), c.cols()))) *
                      s.asDiagonal();
    return out;
  }

  std::vector<TorqueSeries> series(const std::vector<MotionStretch>& stretches,
                                   const Ladder& fitted, Workers& after, const Ladder& nominal,
                                   Workers& before) const {
    std::vector<TorqueSeries> out;
    for (const JointDescription& j : describe_joints(model_)) {
      TorqueSeries s;
      s.joint = j.name;
      s.unit = j.prismatic ? "m" : "rad";
      out.push_back(s);
    }
    for (std::size_t i = 0; i < fitted.windows.size() && out[0].time.size() < kMaxSeriesRows; ++i) {
      const MotionWindow& w = fitted.windows[i];
      const MotionStretch& stretch = stretches[w.stretch];
      const RowMatX<double> a = after.front()->positions(stretch, w);
      const RowMatX<double> b = before.front()->positions(stretch, nominal.windows[i]);
      const long room = static_cast<long>(kMaxSeriesRows - out[0].time.size());
      for (long k = 0; k < std::min<long>(a.rows(), room); ++k)
        for (std::size_t j = 0; j < out.size(); ++j) {
          const long column = static_cast<long>(j);
          out[j].time.push_back(stretch.time[static_cast<std::size_t>(w.first + k)]);
          out[j].measured.push_back(stretch.q(w.first + k, column));
          out[j].fitted.push_back(a(k, column));
          out[j].nominal.push_back(b(k, column));
        }
    }
    return out;
  }

  /// Share of the objective that a step gains at least before the next horizon is tried.
  static constexpr double kOnTheWay = 1e-3;

  const Model& model_;
  const RecordingSource& train_;
  const RecordingSource* test_;
  const IdentifyOptions& options_;
  IdentifyResult result_;
  FitLayout layout_;
  MotionData data_;
  std::vector<double> ladder_;
  VecX<double> limit_;  ///< (n) error beyond which a window is apart
  VecX<double> scale_, start_, shape_;
  VecX<double> guess_;  ///< linear parameters from torques of one instant; may be empty
  std::optional<MotionProblem> problem_, held_problem_;
  std::optional<MotionFitter> fitter_, nominal_fitter_;
  Ladder fitted_, nominal_, test_fitted_, test_nominal_;
  double reached_ = 0.0, fitting_ = 0.0, speed_share_ = 1.0;
  bool brief_ = false;  ///< a trial
  bool whole_ = true;   ///< windows of the horizon that was reached hold together
};

}  // namespace

IdentifyResult identify_by_motion(const Model& model, const RecordingSource& train,
                                  const RecordingSource* test, const IdentifyOptions& options) {
  MotionIdentification whole(model, train, test, options);
  std::vector<std::string> unused;
  const std::vector<bool> commanded =
      commanded_joints(layout_for(model, train, test, options.choice, unused));
  if (std::ranges::any_of(commanded, std::identity())) {
    IdentifyOptions brief = options;
    brief.motion.horizon = options.motion.horizon > 0.0 ? std::min(kTrial, options.motion.horizon)
                                                        : kTrial;
    double best = kInfinity;
    for (const double share : kSpeedShares) {
      MotionIdentification some(model, train, nullptr, brief);
      some.begin_drives_at(share);
      const double cost = some.trial();
      if (cost < best) {
        best = cost;
        whole.begin_drives_at(share);
      }
    }
  }
  return whole.run();
}

}  // namespace diffnea
