#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/effects/stepping.hpp>
#include <diffnea/identify/posterior.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "core/statistics.hpp"
#include "identify/drive_bounds.hpp"
#include "identify/drive_notes.hpp"
#include "identify/drives.hpp"
#include "identify/gears.hpp"
#include "identify/motion_race.hpp"
#include "identify/motionless.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// The output-error loss, from data to numbers.
class MotionIdentification {
 public:
  MotionIdentification(const Model& model, const RecordingSource& train,
                       const RecordingSource* test, const IdentifyOptions& options)
      : model_(model), train_(train), test_(test), options_(options) {}

  IdentifyResult run() {
    const auto start = std::chrono::steady_clock::now();
    prepare();
    climb();
    if (closed_loop_ && !climb_->whole() && !fit().interrupted) {
      closed_loop_ = false;
      ladder_ = horizons(data_.train, data_.noise, options_.motion);
      climb();
    }
    climb_->set_covariance();
    if (closed_loop_) follow_whole_runs();
    result_.summary.seconds_fitting = fitting_ + climb_->seconds();
    evaluate();
    result_.summary.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return std::move(result_);
  }

 private:
  static void require_derivatives(const FitLayout& layout) {
    for (const FitParameter& s : layout.shape) {
      const bool of_tree =
          s.effect < 0 ||
          layout.effects[static_cast<std::size_t>(s.effect)].info().port == Port::kModelParameter;
      if (!s.fixed && of_tree)
        throw ModelError("identify: the motion loss does not fit " + s.name +
                         "; fit it with the inverse loss first, then hold it (--fix \"" + s.name +
                         "\")");
    }
    for (const FitParameter& p : layout.linear)
      if (!p.fixed && p.effect >= 0 && layout.effects[p.effect].info().has(Trait::kGain))
        throw ModelError(
            "identify: the motion loss does not fit torque gains; fit torque_gain with the "
            "inverse loss first, then hold it (--fix \"*torque_gain*\")");
  }

  void prepare() {
    const auto start = std::chrono::steady_clock::now();
    FitChoice choice = options_.choice;
    choice.simulated = true;
    FitLayout layout = layout_for(model_, train_, test_, choice, result_.notes);
    require_derivatives(layout);
    begun_shape_.resize(static_cast<long>(layout.shape.size()));
    for (std::size_t k = 0; k < layout.shape.size(); ++k)
      begun_shape_[static_cast<long>(k)] = layout.shape[k].prior;
    n_ = layout.num_dofs;
    const std::vector<bool> commanded = commanded_joints(layout);
    data_ = motion_data(model_, train_, test_, commanded, result_.notes);
    bound_delays(data_.noise.period, layout);
    hold_without_commands(data_.train, joint_names(model_), layout, result_.notes);
    require_a_scale(data_.train, layout);
    result_.data_report = train_.report();
    result_.summary.rows = data_.rows;
    result_.summary.passes = 1;
    require_motion(train_.sample().front().source, layout);
    if (test_ && still_joints(data_.test, data_.noise).size() == static_cast<std::size_t>(n_))
      throw DataError(test_->sample().front().source + ": held-out data: no joint moves (" +
                      detail::join(joint_names(model_)) + ")");
    ladder_ = horizons(data_.train, data_.noise, options_.motion);
    first_ = ladder_.front();
    limit_ = apart_limit(data_);
    describe_noise();
    progress_ = [this](int iteration, double objective) {
      return !options_.progress ||
             options_.progress({"simulating", iteration, result_.summary.rows, objective});
    };
    const auto begin = has_gears(layout) ? beginning_with_gears : best_beginning;
    asked_ = layout;
    from_ = begin(model_, data_, layout, ladder_, options_.motion, progress_);
    // A loop that is closed holds motion together: nothing adds up from horizon to horizon.
    closed_loop_ = std::ranges::all_of(commanded, std::identity());
    longest_ = ladder_.back();
    if (closed_loop_) ladder_ = {std::min(kForgets, longest_)};
    result_.notes.insert(result_.notes.end(), from_.notes.begin(), from_.notes.end());
    fitting_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

  /// @throws DataError if no joint moves, or there are fewer positions than numbers to fit to them
  void require_motion(const std::string& source, FitLayout& layout) {
    const std::size_t n = static_cast<std::size_t>(layout.num_dofs);
    long positions = 0;
    for (const MotionStretch& s : data_.train) positions += (s.q.array() == s.q.array()).count();
    const auto is_free = [](const FitParameter& p) { return !p.fixed; };
    const long states = static_cast<long>(2 * n * data_.train.size()),
               parameters = std::ranges::count_if(layout.linear, is_free) +
                            std::ranges::count_if(layout.shape, is_free);
    if (positions < states + parameters)
      throw DataError(source + ": " + std::to_string(positions) + " positions for " +
                      std::to_string(states) + " initial states and " + std::to_string(parameters) +
                      " parameters; record longer, or fix parameters");
    hold_motionless(still_joints(data_.train, data_.noise), joint_names(model_), source, layout,
                    result_.notes);
  }

  /// Notes on sensors: slow ones, and those that show no noise.
  void describe_noise() {
    PreprocessPlan& plan = result_.plan;
    plan.dt = data_.noise.period.minCoeff();
    plan.q_noise.assign(data_.noise.position.data(),
                        data_.noise.position.data() + data_.noise.position.size());
    plan.tau_noise.assign(data_.noise.torque.data(),
                          data_.noise.torque.data() + data_.noise.torque.size());
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

  /// Whole runs by what windows of them have told.
  void follow_whole_runs() {
    if (!climb_->whole() || climb_->reached() >= longest_ || fit().interrupted) return;
    if (climb_->follow(longest_, kOnTheWay) == Rung::kFellBack)
      say_apart(climb_->apart(), longest_, true);
    else
      measure(longest_);
  }

  /// From horizon to horizon, as far as windows hold together.
  void climb() {
    result_.horizons.clear();
    nominal_ = test_fitted_ = test_nominal_ = {};
    climb_.emplace(model_, data_, from_, limit_, options_.motion, progress_);
    held_problem_.emplace(MotionProblem{model_, climb_->layout(), data_.test, data_.runs,
                                        data_.noise.position, climb_->beginning().scale});
    // A gear that is fitted beside the model is none of the model's.
    const LayoutPart own = without(climb_->layout(), [&](const BoundEffect& e) {
      return hides_motor(e) && std::ranges::none_of(model_.effects, [&](const EffectSpec& s) {
               return s.effect == e.info().name && s.where == e.where;
             });
    });
    nominal_layout_ = own.layout;
    nominal_shape_ = begun_shape_(own.shapes);
    nominal_problem_.emplace(MotionProblem{model_, nominal_layout_, data_.train, data_.runs,
                                           data_.noise.position, climb_->beginning().scale});
    nominal_fitter_.emplace(*nominal_problem_, options_.motion, nominal_layout_.prior(),
                            nominal_shape_);
    nominal_test_problem_.emplace(MotionProblem{model_, nominal_layout_, data_.test, data_.runs,
                                                data_.noise.position, climb_->beginning().scale});
    climb_->begin(first_);
    for (const double horizon : ladder_) {
      const bool first = horizon == ladder_.front(), last = horizon == ladder_.back();
      // Where the next horizon goes on, this one need not be exact.
      const bool goes_on = !last || closed_loop_;
      const Rung rung = climb_->advance(horizon, goes_on ? kOnTheWay : options_.motion.tolerance);
      if (rung == Rung::kDrowned) {
        result_.notes.push_back(
            "windows end at " + format_number(climb_->reached()) + " s: over " +
            format_number(horizon) + " s noise of the measured torques would move the robot by " +
            format_number(100.0 * kApart * climb_->drowned()) + " % of its motion");
        break;
      }
      if ((rung == Rung::kFellBack || !climb_->whole()) && !closed_loop_)
        say_apart(climb_->apart(), horizon, !first);
      if (rung == Rung::kFellBack) break;
      if (closed_loop_ && !fit().interrupted) {
        free_derivatives(asked_, model_, data_, options_.motion, *climb_);
        climb_->finish(options_.motion.tolerance);
      }
      measure(horizon);
      if (!climb_->whole() || fit().interrupted) break;
    }
    if (climb_->reached() < ladder_.back() && !fit().interrupted) {
      climb_->finish(options_.motion.tolerance);
      measure_anew();
    }
  }

  /// Errors of the horizon that was reached, which has been fitted again.
  void measure_anew() {
    result_.horizons.resize(result_.horizons.size() - static_cast<std::size_t>(n_));
    measure(climb_->reached());
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
        (earlier ? ", and the result is that of " + format_number(climb_->reached()) + " s" : ""));
  }

  /// Errors of this horizon: held out, and of the model before the fit.
  void measure(double horizon) {
    constexpr double kRoughly = 1e-2;  // half a percent of an error that is large
    // A model that is apart all the time has no state that would help.
    const VecX<double> off = limit_.cwiseQuotient(data_.noise.position);
    const auto of_model = [&](const MotionFitter& fitter, double tolerance,
                              const std::vector<MotionStretch>& stretches, Ladder& ladder) {
      ladder.next(fitter.workers(), stretches, horizon, first_);
      double rows = 0.0;
      for (const MotionWindow& w : ladder.windows) rows += static_cast<double>(w.rows);
      fitter.fit_states(ladder.windows, tolerance, 0.5 * rows * off.squaredNorm());
      Workers workers = fitter.workers();
      ladder.errors = window_errors(workers, stretches, ladder.windows, limit_);
    };
    of_model(*nominal_fitter_, kRoughly, data_.train, nominal_);
    VecX<double> test = VecX<double>::Constant(n_, kNaN), nominal_test = test;
    if (test_) {
      const MotionFitter fitter(*held_problem_, options_.motion, fit().x, fit().shape);
      const MotionFitter before(*nominal_test_problem_, options_.motion, nominal_layout_.prior(),
                                nominal_shape_);
      of_model(fitter, kOnTheWay, data_.test, test_fitted_);
      of_model(before, kRoughly, data_.test, test_nominal_);
      test = test_fitted_.errors.rmse();
      nominal_test = test_nominal_.errors.rmse();
    }
    const Ladder& fitted = climb_->at();
    const VecX<double> train = fitted.errors.rmse(), nominal = nominal_.errors.rmse();
    const std::vector<std::string> names = joint_names(model_);
    for (int j = 0; j < n_; ++j) {
      HorizonError e;
      e.horizon = horizon;
      e.joint = names[static_cast<std::size_t>(j)];
      e.unit = unit_of_joint(model_, j, false);
      e.train = train[j];
      e.nominal_train = nominal[j];
      e.test = test[j];
      e.nominal_test = nominal_test[j];
      e.windows = static_cast<int>(fitted.windows.size());
      e.apart = static_cast<int>(fitted.errors.apart.size());
      e.test_windows = static_cast<int>(test_fitted_.windows.size());
      e.test_apart = static_cast<int>(test_fitted_.errors.apart.size());
      result_.horizons.push_back(e);
    }
  }

  void evaluate() {
    const MotionFit& fit = this->fit();
    const FitLayout& layout = climb_->layout();
    const VecX<double>& scale = climb_->beginning().scale;
    const long p = fit.x.size();
    result_.model = apply_fit(model_, layout, fit.x, fit.shape);
    set_rotors(result_.model);
    VecX<double> std = VecX<double>::Zero(p), shape_std = VecX<double>::Zero(fit.shape.size());
    std::vector<bool> identifiable(static_cast<std::size_t>(p), false);
    std::vector<int> at_bound;
    const auto error_of = [&](long k) {
      return fit.R.col(k).norm() > 0.0 ? std::sqrt(std::max(fit.covariance(k, k), 0.0)) : kNaN;
    };
    for (long k = 0; k < p; ++k) {
      const FitParameter& def = layout.linear[static_cast<std::size_t>(k)];
      if (def.fixed) continue;
      const double s = error_of(k);
      identifiable[static_cast<std::size_t>(k)] = s < scale[k];
      std[k] = identifiable[static_cast<std::size_t>(k)] ? s : kNaN;
      if (def.sign != Sign::kFree && fit.x[k] < 1e-4 * scale[k])
        at_bound.push_back(static_cast<int>(k));
    }
    for (long k = 0; k < shape_std.size(); ++k) {
      const FitParameter& def = layout.shape[static_cast<std::size_t>(k)];
      if (def.fixed) continue;
      const double s = error_of(p + k);
      // Known to a factor of e, or to 1 rad or m, as in the inverse loss.
      shape_std[k] = s < (def.logarithmic ? fit.shape[k] : 1.0) ? s : kNaN;
    }
    if (!fit.interrupted)
      note_drives(data_, *climb_, model_, options_.motion, {std, shape_std, identifiable},
                  result_.notes);
    result_.parameters =
        parameter_estimates(layout, fit.x, fit.shape, std, identifiable, at_bound, shape_std);
    if (!fit.interrupted) keep_described_torques(model_, data_, options_.motion, *climb_, result_);
    for (const EffectSpec& e : result_.model.effects)  // rotors, as set_rotors() has them
      for (const EffectParameter& rotor : e.parameters)
        for (ParameterEstimate& of : result_.parameters)
          if (rotor.name == "motor_inertia" &&
              of.name == e.where + "." + e.effect + "." + rotor.name)
            of.value = rotor.value;
    for (std::size_t k = 0; k < layout.shape.size(); ++k)
      if (const FitParameter& s = layout.shape[k];
          !s.fixed && fit.shape[static_cast<long>(k)] <= s.least)
        result_.notes.push_back(s.name + " is held at " + format_number(s.least) + " " + s.unit +
                                ", one row early: no drive acts before it is told");
    const Posterior arm = posterior_of(layout, fit.x, information(), train_);
    result_.model.posterior = joined(&arm, model_.posterior ? &*model_.posterior : nullptr);
    result_.physically_consistent = true;
    add_errors();
    summarise();
  }

  /// Errors at the longest horizon; test_raw from states that the positions alone give.
  void add_errors() {
    VecX<double> raw = VecX<double>::Constant(n_, kNaN);
    if (test_) {
      std::vector<MotionWindow> measured = test_fitted_.windows;
      set_measured_states(data_.test, first_, measured);
      Workers workers = climb_->fitter().workers();
      raw = window_errors(workers, data_.test, measured, limit_).rmse();
      if (!test_fitted_.errors.apart.empty())
        result_.notes.push_back(kWarning +
                                ("the simulation of held-out data " +
                                 apart_words(test_fitted_, data_.test, climb_->reached(),
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
    Workers after = climb_->fitter().workers(), before = nominal_fitter_->workers();
    result_.train_series = series(data_.train, climb_->at(), after, nominal_, before);
    const std::size_t n = static_cast<std::size_t>(n_);
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

  void summarise() {
    FitSummary& s = result_.summary;
    const MotionFit& fit = this->fit();
    const Ladder& fitted = climb_->at();
    s.converged = fit.converged && climb_->whole();
    s.interrupted = fit.interrupted;
    s.termination = fit.termination;
    if (!climb_->whole()) s.termination += "; windows fall apart at the shortest horizon";
    s.iterations = fit.iterations;
    s.fitted_rows = fit.samples;
    s.horizon = climb_->reached();
    if (test_) s.test_horizon = longest(data_.test, test_fitted_.windows);
    result_.notes.push_back(
        std::to_string(fitted.windows.size()) +
        (fitted.windows.size() == 1 ? " window of " : " windows of ") +
        format_number(climb_->reached()) +
        " s; errors are of positions, each window from its own estimated initial state (test_raw: "
        "from the measured one)");
    if (!fitted.errors.apart.empty() && climb_->whole())
      result_.notes.push_back(
          std::to_string(fitted.errors.apart.size()) + " of " +
          std::to_string(fitted.windows.size()) + " windows of " +
          format_number(climb_->reached()) +
          " s fall apart: there the error is more than half of a joint's motion about its mean");
    if (std::string text =
            unlike_the_others(fitted.errors, data_.train, fitted.windows, joint_names(model_));
        !text.empty())
      result_.notes.push_back(std::move(text));
  }

  static double longest(const std::vector<MotionStretch>& stretches,
                        const std::vector<MotionWindow>& windows) {
    double out = 0.0;
    for (const MotionWindow& w : windows) {
      const auto time = stretches[w.stretch].time.begin() + w.first;
      out = std::max(out, time[w.rows - 1] - time[0]);
    }
    return out;
  }

  MatX<double> information() const {
    const MotionFit& fit = this->fit();
    const FitLayout& layout = climb_->layout();
    const long p = fit.x.size();
    MatX<double> out = MatX<double>::Zero(p, p);
    std::vector<int> free;
    for (long k = 0; k < p; ++k)
      if (!layout.linear[static_cast<std::size_t>(k)].fixed) free.push_back(static_cast<int>(k));
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

  const MotionFit& fit() const { return climb_->fitter().now(); }

  const Model& model_;
  const RecordingSource& train_;
  const RecordingSource* test_;
  const IdentifyOptions& options_;
  IdentifyResult result_;
  int n_ = 0;
  MotionData data_;
  std::vector<double> ladder_;
  double first_ = 0.0;        ///< shortest horizon [s]
  double longest_ = 0.0;      ///< whole runs, or as long as asked for [s]
  bool closed_loop_ = false;  ///< drives of the model lead all joints
  VecX<double> limit_;        ///< (n) error beyond which a window is apart
  std::function<bool(int, double)> progress_;
  MotionBeginning from_;
  std::optional<MotionClimb> climb_;
  VecX<double> begun_shape_;  ///< (s) as the model has them
  FitLayout asked_;           ///< before beginnings hold what they leave out
  FitLayout nominal_layout_;  ///< parameters that the model has before the fit
  VecX<double> nominal_shape_;
  std::optional<MotionProblem> held_problem_, nominal_problem_, nominal_test_problem_;
  std::optional<MotionFitter> nominal_fitter_;
  Ladder nominal_, test_fitted_, test_nominal_;
  double fitting_ = 0.0;  ///< time before the climb [s]
};

}  // namespace

IdentifyResult fit_motion(const Model& model, const RecordingSource& train,
                          const RecordingSource* test, const IdentifyOptions& options) {
  return MotionIdentification(model, train, test, options).run();
}

}  // namespace diffnea
