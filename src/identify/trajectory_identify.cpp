#include <algorithm>
#include <chrono>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/posterior.hpp>
#include <diffnea/identify/torque_regression.hpp>
#include <diffnea/identify/trajectory_fit.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "identify/passes.hpp"
#include "identify/whole_runs.hpp"

namespace diffnea {
namespace {

std::vector<bool> passive_joints(const Recording& recording) {
  std::vector<bool> out;
  for (const std::string& joint : recording.joint_names)
    out.push_back(std::ranges::find(recording.info.passive, joint) != recording.info.passive.end());
  return out;
}

/// @param first_run  number of the source's first recording
/// @param notes      of recordings that are left out, added to
/// @throws DataError if no recording holds a window
std::vector<ShootingWindow> windows_of(const RecordingSource& source,
                                       const IdentifyOptions& options, int first_run,
                                       std::vector<std::string>& notes) {
  std::vector<ShootingWindow> out;
  std::vector<std::string> without;
  const auto cut = [&](const Recording& r) {
    try {
      for (ShootingWindow& w : make_windows(r, options.trajectory.window,
                                            options.preprocess.filter_hz, passive_joints(r))) {
        w.run = first_run + r.run;
        out.push_back(std::move(w));
      }
    } catch (const DataError& error) {  // one brief recording of many is no reason to stop
      without.emplace_back(error.what());
    }
  };
  for_each_run(source, [](const Recording&) { return true; }, cut);
  if (out.empty() && !without.empty()) throw DataError(without.front());
  for (const std::string& why : without) notes.push_back("left out: " + why);
  return out;
}

std::vector<ShootingWindow> as_measured(std::vector<ShootingWindow> windows) {
  for (ShootingWindow& w : windows) w.state = w.measured_state;
  return windows;
}

/// The output-error loss, from data to numbers.
class TrajectoryIdentification {
 public:
  TrajectoryIdentification(const Model& model, const RecordingSource& train,
                           const RecordingSource* test, const IdentifyOptions& options)
      : model_(model), train_(train), test_(test), options_(options) {}

  IdentifyResult run() {
    const auto start = std::chrono::steady_clock::now();
    const auto seconds = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    prepare();
    fit_ = fit_trajectories(
        model_, layout_, start_, scale_, windows_, options_.trajectory,
        [this](const char* stage, int iteration, double objective) {
          return !options_.progress ||
                 options_.progress({stage, iteration, result_.summary.rows, objective});
        });
    result_.summary.seconds_fitting = seconds();
    evaluate();
    result_.summary.seconds = seconds();
    return std::move(result_);
  }

 private:
  void prepare() {
    layout_ = layout_for(model_, train_, test_, options_.choice, result_.notes);
    for (const BoundEffect& e : layout_.effects)
      if (!e.runs.empty())
        throw ModelError("identify: " + e.info().name + "@" + e.where +
                         " acts in some recordings only, which the "
                         "trajectory loss does not know; use the inverse loss");
    for (const FitParameter& s : layout_.shape)
      if (!s.fixed)
        throw ModelError("identify: the trajectory loss does not fit " + s.name +
                         "; fit it with the inverse loss first, then hold it (--fix \"" + s.name +
                         "\")");
    for (const FitParameter& p : layout_.linear)
      if (!p.fixed && p.effect >= 0 && layout_.effects[p.effect].info().has(Trait::kGain))
        throw ModelError(
            "identify: the trajectory loss does not fit torque gains; fit torque_gain with the "
            "inverse loss first, then hold it (--fix \"*torque_gain*\")");
    result_.plan = plan_preprocess(train_.sample(), options_.preprocess);
    windows_ = windows_of(train_, options_, 0, result_.notes);
    if (test_)
      held_out_ =
          windows_of(*test_, options_, static_cast<int>(train_.runs().size()), result_.notes);
    result_.data_report = train_.report();
    VecX<double> shape(static_cast<long>(layout_.shape.size()));
    for (std::size_t s = 0; s < layout_.shape.size(); ++s)
      shape[static_cast<long>(s)] = layout_.shape[s].prior;
    shape_ = shape;
    // One pass of the inverse regression: for scales, and for what the links' inertia absorbs.
    TorqueRegression regression(model_, layout_, result_.plan, {layout_.prior(), shape});
    const Pass pass = for_each_block(train_, result_.plan, "reading", 0, options_,
                                     [&](const Preprocessed& b) { regression.add(b); });
    result_.summary.rows = pass.rows;
    result_.summary.passes = 1;
    result_.notes.insert(result_.notes.end(), pass.notes.begin(), pass.notes.end());
    for (const int c : absorbed_by_links(layout_, regression.factors())) {
      layout_.linear[static_cast<std::size_t>(c)].fixed = true;
      layout_.linear[static_cast<std::size_t>(c)].absorbed = true;
      result_.notes.push_back(
          layout_.linear[static_cast<std::size_t>(c)].name +
          " cannot be told from the links' inertia, which absorbs it: held at " +
          format_number(layout_.linear[static_cast<std::size_t>(c)].prior));
    }
    if (std::ranges::all_of(layout_.linear, [](const FitParameter& p) { return p.fixed; }))
      throw ModelError(
          "identify: every parameter is held, nothing is left to fit; groups of fit: "
          "inertia, armature, effects");
    scale_ = parameter_scales(layout_, regression.factors());
    start_ = consistent_start(layout_, scale_);
    for (std::size_t k = 0; k < layout_.linear.size(); ++k)
      if (layout_.linear[k].fixed) start_[static_cast<long>(k)] = layout_.linear[k].prior;
  }

  /// Estimates the windows' own initial states with the parameters held at x.
  void fit_states(const VecX<double>& x, std::vector<ShootingWindow>& windows) const {
    FitLayout held = layout_;
    for (FitParameter& p : held.linear) p.fixed = true;
    fit_trajectories(model_, held, x, scale_, windows, options_.trajectory);
  }

  void evaluate() {
    const long p = fit_.x.size();
    result_.model = apply_fit(model_, layout_, fit_.x, shape_);
    VecX<double> std = VecX<double>::Zero(p);
    std::vector<bool> identifiable(static_cast<std::size_t>(p), false);
    std::vector<int> at_bound;
    for (long k = 0; k < p; ++k) {
      const FitParameter& def = layout_.linear[static_cast<std::size_t>(k)];
      if (def.fixed) continue;
      const double s = std::sqrt(std::max(fit_.covariance(k, k), 0.0));
      const double informed = fit_.R.col(k).norm() > 0.0 ? s : kNaN;
      identifiable[static_cast<std::size_t>(k)] = informed < scale_[k];
      std[k] = identifiable[static_cast<std::size_t>(k)] ? s : kNaN;
      if (def.sign != Sign::kFree && fit_.x[k] < 1e-4 * scale_[k])
        at_bound.push_back(static_cast<int>(k));
    }
    result_.parameters = parameter_estimates(layout_, fit_.x, shape_, std, identifiable, at_bound);
    const Posterior arm = posterior_of(layout_, fit_.x, information(), train_);
    result_.model.posterior = joined(&arm, model_.posterior ? &*model_.posterior : nullptr);
    result_.physically_consistent = true;

    // Errors: every window from its own estimated initial state, before and after alike.
    std::vector<ShootingWindow> nominal = as_measured(windows_);
    fit_states(layout_.prior(), nominal);
    const SteppingOptions& stepping = options_.trajectory.stepping;
    const WindowErrors fitted = window_errors(result_.model, windows_, false, stepping);
    const VecX<double> train = fitted.rmse();
    const VecX<double> before = window_errors(model_, nominal, false, stepping).rmse();
    VecX<double> test = VecX<double>::Constant(layout_.num_dofs, kNaN), nominal_test = test,
                 raw = test;
    if (test_) {
      std::vector<ShootingWindow> old = held_out_;
      raw = window_errors(result_.model, held_out_, true, stepping).rmse();
      fit_states(fit_.x, held_out_);
      const WindowErrors held_out = window_errors(result_.model, held_out_, false, stepping);
      test = held_out.rmse();
      if (held_out.blown_up() > 0)
        result_.notes.push_back("the simulation of " + std::to_string(held_out.blown_up()) +
                                " of " + std::to_string(held_out_.size()) +
                                " held-out windows blows up; the errors are of the others" +
                                (test.array().isNaN().all() ? ", and there is none" : ""));
      fit_states(layout_.prior(), old);
      nominal_test = window_errors(model_, old, false, stepping).rmse();
      result_.test_series = series(held_out_, old);
    }
    result_.train_series = series(windows_, nominal);
    for (int j = 0; j < layout_.num_dofs; ++j) {
      JointError e = blank_error(model_, j, false);
      e.train = train[j];
      e.nominal_train = before[j];
      e.test = test[j];
      e.nominal_test = nominal_test[j];
      e.test_all = test[j];
      e.test_raw = raw[j];
      result_.errors.push_back(e);
    }
    FitSummary& s = result_.summary;
    s.converged = fit_.converged;
    s.interrupted = fit_.interrupted;
    s.termination = fit_.termination;
    s.iterations = fit_.iterations;
    s.fitted_rows = fit_.samples;
    result_.notes.push_back(
        std::to_string(windows_.size()) + " windows of " +
        format_number(options_.trajectory.window) +
        " s; errors are of positions, each window from its own estimated initial "
        "state (test_raw: from the measured one)");
    if (std::string text = unlike_the_others(fitted, windows_, joint_names(model_)); !text.empty())
      result_.notes.push_back(std::move(text));
  }

  MatX<double> information() const {
    const long p = fit_.x.size();
    MatX<double> out = MatX<double>::Zero(p, p);
    std::vector<int> free;
    for (long k = 0; k < p; ++k)
      if (!layout_.linear[static_cast<std::size_t>(k)].fixed) free.push_back(static_cast<int>(k));
    MatX<double> c = fit_.covariance(free, free);
    const VecX<double> s = c.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    c = s.asDiagonal() * c * s.asDiagonal();
    c.diagonal().array() += 1e-10;  // clusters fewer than parameters leave it singular
    out(free, free) = s.asDiagonal() *
                      c.ldlt().solve(MatX<double>(MatX<double>::Identity(c.rows(), c.cols()))) *
                      s.asDiagonal();
    return out;
  }

  std::vector<TorqueSeries> series(const std::vector<ShootingWindow>& fitted,
                                   const std::vector<ShootingWindow>& nominal) const {
    std::vector<TorqueSeries> out;
    for (const JointDescription& j : describe_joints(model_)) {
      TorqueSeries s;
      s.joint = j.name;
      s.unit = j.prismatic ? "m" : "rad";
      out.push_back(s);
    }
    ForwardDynamics after(extend(result_.model)), before(extend(model_));
    for (std::size_t i = 0; i < fitted.size() && out[0].time.size() < kMaxSeriesRows; ++i) {
      const ShootingWindow& w = fitted[i];
      const RowMatX<double> a = simulate_window(after, w, w.state, options_.trajectory.stepping);
      const RowMatX<double> b =
          simulate_window(before, nominal[i], nominal[i].state, options_.trajectory.stepping);
      const long room = static_cast<long>(kMaxSeriesRows - out[0].time.size());
      for (long k = 0; k < std::min<long>(a.rows(), room); ++k)
        for (std::size_t j = 0; j < out.size(); ++j) {
          const long column = static_cast<long>(j);
          out[j].time.push_back(w.time[static_cast<std::size_t>(k)]);
          out[j].measured.push_back(w.q(k, column));
          out[j].fitted.push_back(a(k, column));
          out[j].nominal.push_back(b(k, column));
        }
    }
    return out;
  }

  const Model& model_;
  const RecordingSource& train_;
  const RecordingSource* test_;
  const IdentifyOptions& options_;
  IdentifyResult result_;
  FitLayout layout_;
  VecX<double> scale_, start_, shape_;
  std::vector<ShootingWindow> windows_, held_out_;
  TrajectoryFit fit_;
};

}  // namespace

IdentifyResult identify_by_trajectory(const Model& model, const RecordingSource& train,
                                      const RecordingSource* test, const IdentifyOptions& options) {
  return TrajectoryIdentification(model, train, test, options).run();
}

}  // namespace diffnea
