#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/posterior.hpp>
#include <diffnea/identify/torque_regression.hpp>
#include <diffnea/recording/commands.hpp>

#include "core/decompositions.hpp"
#include "identify/gains.hpp"
#include "identify/motionless.hpp"
#include "identify/passes.hpp"
#include "identify/robust_loss.hpp"
#include "identify/score_covariance.hpp"
#include "identify/shape_steps.hpp"
#include "identify/torque_errors.hpp"
#include "identify/torque_notes.hpp"
#include "recording/time_unit.hpp"

namespace diffnea {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Passes that weights get in any case, however many the shapes have used up.
constexpr int kLeastReweightings = 5;

/// The inverse loss, from data to numbers.
class InverseFit {
 public:
  InverseFit(const Model& model, const RecordingSource& train, const RecordingSource* test,
             const IdentifyOptions& options)
      : model_(model), train_(train), test_(test), options_(options) {}

  IdentifyResult run() {
    const auto start = std::chrono::steady_clock::now();
    prepare();
    fit();
    result_.summary.seconds_fitting = seconds_since(start);
    evaluate();
    result_.summary.seconds = seconds_since(start);
    return std::move(result_);
  }

 private:
  void prepare() {
    const std::vector<Recording> sample = train_.sample();
    layout_ = layout_for(model_, train_, test_, options_.choice, result_.notes);
    gains_ = Gains(layout_);
    if (options_.loss == Loss::kForward && gains_.any_free())
      throw ModelError(
          "identify: the forward loss does not fit torque gains; fit torque_gain with the inverse "
          "loss first, then hold it (--fix \"*torque_gain*\")");
    result_.plan = plan_preprocess(sample, options_.preprocess);
    if (test_) {
      test_plan_ = plan_like(result_.plan, test_->sample());
      note_band(result_.plan, test_plan_, result_.notes);
    }
    nominal_ = layout_.prior();
    x_ = nominal_;
    shape_.resize(static_cast<long>(layout_.shape.size()));
    for (std::size_t s = 0; s < layout_.shape.size(); ++s) shape_[s] = layout_.shape[s].prior;
    shape_std_ = VecX<double>::Zero(shape_.size());
  }

  /// One pass at the present point; leaves rows and factors in regression_.
  Pass pass(const FitLayout& layout, bool weighted, bool in_torque = false) {
    RegressionOptions o;
    o.acceleration = options_.loss == Loss::kForward && !in_torque;
    weighted_ = weighted;
    cost_ = 0.0;
    if (weighted)
      o.weight = [this](int j, double r) {
        cost_ += robust_cost(options_.robust, r / fit_.sigma[j]);
        return influence_of(options_.robust, r / fit_.sigma[j]).weight;
      };
    regression_ = std::make_unique<TorqueRegression>(model_, layout, result_.plan,
                                                     RegressionPoint{x_, shape_}, o);
    Pass p = for_each_block(train_, result_.plan, "reading", result_.summary.passes, options_,
                            [&](const Preprocessed& b) { regression_->add(b); });
    ++result_.summary.passes;
    result_.summary.interrupted = result_.summary.interrupted || p.interrupted;
    return p;
  }

  void fit() {
    require_torque(describe_joints(model_), train_.sample());
    FitLayout with_shapes = layout_;
    for (FitParameter& shape : layout_.shape)
      shape.fixed = true;  // no columns for them but in fit_shapes
    // Torques first, in any case: the forward loss is linear about a point, which must be near.
    Pass first = pass(layout_, false, true);
    result_.data_report = train_.report();
    result_.summary.rows = first.rows;
    training_runs_ = first.runs;
    result_.notes.insert(result_.notes.end(), first.notes.begin(), first.notes.end());
    const std::vector<int> still =
        motionless_joints(first.lowest, first.highest, result_.plan.q_noise);
    const std::string source = train_.sample().front().source;
    std::vector<std::string> said;
    hold_motionless(still, joint_names(model_), source, layout_, result_.notes);
    hold_motionless(still, joint_names(model_), source, with_shapes, said);
    if (const std::string question = detail::slow_rows(train_.sample());
        !question.empty() && std::ranges::all_of(regression_->factors(), [](const JointFactor& f) {
          return f.factor.rows() == 0;
        }))
      throw DataError(source + ": no torque sample is left after filtering; " + question);
    bool torque = false;
    for (const JointFactor& f : regression_->factors()) {
      result_.summary.fitted_rows += f.factor.rows();
      torque = torque || f.rmse(VecX<double>::Zero(x_.size())) > 0.0;
    }
    if (!torque && result_.summary.fitted_rows > 0)
      throw DataError(
          train_.sample().front().source +
          ": no joint has a measured torque, so that any multiple of the model fits; use the "
          "motion loss, which holds what cannot be seen at the model's values");

    for (const int c : absorbed_by_links(layout_, regression_->factors())) {
      if (gains_.owns(c)) continue;
      layout_.linear[c].fixed = with_shapes.linear[c].fixed = true;
      layout_.linear[c].absorbed = with_shapes.linear[c].absorbed = true;
      result_.notes.push_back(
          layout_.linear[c].name +
          " cannot be told from the links' inertia, which absorbs it: held at " +
          format_number(layout_.linear[c].prior));
    }

    if (gains_.any()) {  // in units of the recorded torque, whatever a step linearises about
      const VecX<double> scale = parameter_scales(layout_, regression_->factors());
      for (std::size_t c = 0; c < layout_.linear.size(); ++c)
        layout_.linear[c].scale = with_shapes.linear[c].scale = scale[static_cast<long>(c)];
    }
    const auto free = [](const FitParameter& p) { return !p.fixed; };
    if (std::ranges::none_of(layout_.linear, free) && std::ranges::any_of(with_shapes.shape, free))
      throw ModelError(
          "identify: a tilt, shapes and transforms are fitted beside parameters that torques are "
          "linear in, and all of these are held; fit an effect besides, e.g. viscous_friction, or "
          "inertia");
    if (gains_.any_free()) hold_undetermined_gains(with_shapes);
    solve(layout_);
    if (gains_.any_free() && hold_unknown_gains(with_shapes)) solve(layout_);
    const bool shapes = std::ranges::any_of(with_shapes.shape, free);
    const bool robust = options_.robust != Robust::kNone;
    const bool repeats = robust || options_.loss == Loss::kForward || reads_links(layout_);
    if (shapes) fit_shapes(with_shapes, false);
    if (repeats) follow();
    if (shapes && robust && options_.loss != Loss::kForward) {  // whose noise is of accelerations
      fit_shapes(with_shapes, true);
      follow();
    }
    use_sandwich(layout_, meat_of(gains_, fit_), fit_);
    if (moved_.fit.x.size() > 0) count_shapes_in();
    if (repeats) pass(layout_, false, true);  // errors are torques, of all rows
    note_rest(model_, *regression_, result_.notes);
    note_contact(model_, layout_, *regression_, x_, result_.notes);
    if (!gains_.any()) note_torque_scale(model_, layout_, *regression_, result_.notes);
  }

  /// Covariance of the score that knows of the residuals' autocorrelation, from the rows of the
  /// last pass.
  MatX<double> meat_of(const Gains& gains, const LinearFit& fit) const {
    const auto influence = [this](double u) { return influence_of(options_.robust, u); };
    MatX<double> meat = MatX<double>::Zero(fit.x.size(), fit.x.size());
    for (int j = 0; j < layout_.num_rows(); ++j) {
      const JointFactor& f = regression_->factors()[j];
      const MatX<double> T =
          f.inertia.size() > 0 ? f.without_scale(fit.x) : linearisation(gains, j, f.columns);
      meat(f.columns, f.columns) +=
          score_covariance(regression_->kept()[j], T, fit.x(f.columns), fit.sigma[j],
                           weighted_ ? std::function<Influence(double)>(influence) : nullptr);
    }
    return meat;
  }

  /// Errors of the shapes, and of all else as far as it is known without knowing them.
  void count_shapes_in() {
    const long p = x_.size(), s = moved_.fit.x.size() - p;
    moved_.fit.base_parameters = fit_.base_parameters;
    // A shape counts as identified if it is known to half of what its weak prior allows.
    moved_.fit.scale.tail(s) *= 0.5 * options_.linear.prior_width;
    use_sandwich(moved_.layout, moved_.meat, moved_.fit);
    if (options_.loss != Loss::kForward) {  // whose other parameters have errors of their own
      fit_.std = moved_.fit.std.head(p);
      std::copy_n(moved_.fit.identifiable.begin(), p, fit_.identifiable.begin());
      fit_.base_parameters = moved_.fit.base_parameters;
      MatX<double> steps = moved_.fit.information.bottomRightCorner(s, s);
      steps.diagonal() += moved_.fit.weak.tail(s);
      const MatX<double> cross = moved_.fit.information.topRightCorner(p, s);
      fit_.information = moved_.fit.information.topLeftCorner(p, p) -
                         cross * steps.ldlt().solve(MatX<double>(cross.transpose()));
    }
    long k = p;
    for (std::size_t i = 0; i < moved_.layout.shape.size(); ++i)
      if (const FitParameter& shape = moved_.layout.shape[i]; !shape.fixed)
        shape_std_[static_cast<long>(i)] =
            moved_.fit.std[k++] * (shape.logarithmic ? shape_[static_cast<long>(i)] : 1.0);
  }

  /// What makes the rows of joint j linear about the present point; the forward loss holds its
  /// gains.
  MatX<double> linearisation(const Gains& gains, int j, const std::vector<int>& columns) const {
    const long p = static_cast<long>(columns.size());
    return linearise() ? gains.linearisation(j, columns, x_)
                       : MatX<double>(MatX<double>::Identity(p + 1, p + 1));
  }
  bool linearise() const { return gains_.any() && options_.loss != Loss::kForward; }
  std::vector<JointFactor> factors() const {
    return linearise() ? gains_.linearised(regression_->factors(), x_) : regression_->factors();
  }

  /// Without a known mass all torque constants have one scale in common with all masses.
  void hold_undetermined_gains(FitLayout& with_shapes) {
    std::vector<int> moving;
    for (std::size_t c = 0; c < layout_.linear.size(); ++c)
      if (gains_.owns(static_cast<int>(c)) && !layout_.linear[c].fixed)
        moving.push_back(static_cast<int>(c));
    for (const int c : moving) layout_.linear[c].fixed = true;
    const auto free = [](const FitParameter& p) { return !p.fixed; };
    if (std::ranges::any_of(layout_.linear, free)) solve(layout_);  // masses to linearise about
    for (const int c : moving) layout_.linear[c].fixed = false;
    std::string names;
    for (const int c : gains_.undetermined(factors())) {
      layout_.linear[c].fixed = with_shapes.linear[c].fixed = true;
      names += (names.empty() ? "" : ", ") + layout_.linear[c].name;
    }
    if (!names.empty())
      result_.notes.push_back(
          names +
          ": not identifiable, and held: these recordings hold no known mass, so that all torque "
          "constants and all masses may be larger by one factor. Give a recording with a payload "
          "of known "
          "mass and one without it, or hold one gain (the others are then relative to it)");
  }

  /// A gain that the data tell no better than a torque constant is known anyway says nothing, and
  /// its noise would turn the torque around. @return whether there was one
  bool hold_unknown_gains(FitLayout& with_shapes) {
    std::string names;
    for (std::size_t c = 0; c < layout_.linear.size(); ++c) {
      if (!gains_.owns(static_cast<int>(c)) || layout_.linear[c].fixed || fit_.identifiable[c])
        continue;
      layout_.linear[c].fixed = with_shapes.linear[c].fixed = true;
      names += (names.empty() ? "" : ", ") + layout_.linear[c].name;
    }
    if (names.empty()) return false;
    const std::string text =
        names + ": not identifiable, and held: these recordings tell it no better than to " +
        format_number(100.0 * kGainScale) + " %";
    if (std::ranges::all_of(layout_.linear, &FitParameter::fixed))
      throw DataError("identify: " + text +
                      ", and nothing else is fitted; give recordings in which "
                      "these joints carry a known weight, or fit inertias or friction too");
    result_.notes.push_back(text);
    return true;
  }

  /// Gauss–Newton over the gains, from the factors alone; one linear fit where nothing is bilinear.
  void solve(const FitLayout& layout) {
    constexpr int kMaxSteps = 30;  // converges quadratically, in 3 to 6
    const long p = static_cast<long>(layout_.linear.size());
    bool settled = false;
    for (int step = 0; step < kMaxSteps && !settled; ++step) {
      const VecX<double> before = x_;
      fit_ = fit_linear(layout, factors(), options_.linear);
      x_ = fit_.x.head(p);
      settled = true;
      for (long c = 0; linearise() && c < p;
           ++c)  // a thousandth of a standard error, or of its scale
        if (gains_.owns(static_cast<int>(c)) || layout_.linear[c].dof >= 0 ||
            layout_.linear[c].theta >= 0)
          settled = settled && std::abs(x_[c] - before[c]) <=
                                   1e-3 * (fit_.std[c] > 0.0 ? fit_.std[c] : fit_.scale[c]);
    }
    if (!settled) fit_.solver.converged = false;
    result_.summary.converged = fit_.solver.converged;
    result_.summary.iterations = fit_.solver.iterations;
    if (options_.progress)
      options_.progress(
          {"fitting", result_.summary.passes, result_.summary.rows, fit_.solver.objective});
  }

  /// Whether one more pass over the data may be made, of a loop that began after `begin` of them.
  bool may_pass(int begin, int least) const {
    return !result_.summary.interrupted &&
           result_.summary.passes < std::max(options_.max_passes, begin + least);
  }

  /// Gauss–Newton in the shapes with the linear parameters solved along, one pass over the data a
  /// step.
  /// @param layout    with the shapes that are to be fitted
  /// @param weighted  by the robust loss, whose noise is known by then and held
  void fit_shapes(const FitLayout& layout, bool weighted) {
    FitLayout moving = with_shape_steps(layout);
    FitLayout held = moving;  // the same columns, the steps at zero
    for (std::size_t k = layout.linear.size(); k < held.linear.size(); ++k)
      held.linear[k].fixed = true;
    // Rows of the forward loss change with every M⁻¹; those of torques can be compared.
    const bool in_torque = options_.loss == Loss::kForward;
    VecX<double> sigma;
    const long p = x_.size(), s = static_cast<long>(moving.linear.size()) - p;
    const auto misfit = [&] {  // χ²/2 in units of the noise at the start
      VecX<double> x = VecX<double>::Zero(p + s);
      x.head(p) = x_;
      double sum = 0.0;
      for (std::size_t j = 0; j < regression_->factors().size(); ++j)
        sum += 0.5 *
               regression_->factors()[j].sum_of_squares(
                   Gains(moving).effective(static_cast<int>(j), x)) /
               (sigma[j] * sigma[j]);
      return sum;
    };
    const auto fit_steps = [&] {
      return fit_linear(moving,
                        linearise() ? Gains(moving).linearised(regression_->factors(), x_)
                                    : regression_->factors(),
                        options_.linear);
    };
    VecX<double> best_x = x_, best_shape = shape_, step = VecX<double>::Zero(s);
    bool at_best = false;  // the last pass was at the best point
    double best = std::numeric_limits<double>::infinity(), shrink = 1.0;
    VecX<double> along = x_;  // weights hold at a point alone: the linear parameters step, too
    const int begin = result_.summary.passes, least = weighted ? kLeastReweightings : 0;
    shapes_settled_ = false;
    while (may_pass(begin, least)) {
      const VecX<double> at = x_;
      pass(layout, weighted, in_torque);
      if (!weighted) solve(held);  // the linear optimum at these shapes
      if (sigma.size() == 0) sigma = fit_.sigma;
      const double now = weighted ? cost_ : misfit();
      at_best = now < best;
      if (at_best) {
        const double gained = best - now;
        best = now;
        best_x = x_;
        best_shape = shape_;
        shrink = std::min(1.0, 2.0 * shrink);
        const VecX<double> x = fit_steps().x;
        step = x.tail(s);
        along = x.head(p) - best_x;
        use_amplitudes(layout, at, x, step);
        // A hundredth of a unit in χ²/2: far inside one σ.
        if ((shapes_settled_ = gained < 0.01)) break;
      } else {
        shrink *= 0.25;
      }
      shapes_settled_ = !(shrink * step.cwiseAbs().maxCoeff() > options_.shape_tolerance);
      if (shapes_settled_) break;
      if (weighted) x_ = best_x + shrink * along;
      long k = 0;
      for (std::size_t i = 0; i < layout.shape.size(); ++i)
        if (!layout.shape[i].fixed)
          shape_[i] = stepped(layout.shape[i], best_shape[i], shrink * step[k++]);
    }
    x_ = best_x;
    shape_ = best_shape;
    if (!at_best) {
      pass(layout, weighted, in_torque);
      if (!weighted) solve(held);
    }
    moved_ = {moving, fit_steps(), {}};
    moved_.meat = meat_of(Gains(moving), moved_.fit);
    if (weighted) return;  // follow() goes on
    pass(layout_, false);
    solve(layout_);
  }

  /// Σ n_j ln σ_j of the rows' residuals at the present point: minus the log-likelihood, noise of
  /// each joint unknown.
  double misfit() const {
    double sum = 0.0;
    for (const JointFactor& f : regression_->factors())
      if (const double error = f.rmse(x_); error > 0.0)
        sum += static_cast<double>(f.factor.rows()) * std::log(error);
    return sum;
  }

  /// Robust weights, the forward loss's linearisation and friction of the transmitted torque follow
  /// the parameters: solve and read anew in turn. A step of the forward loss, Gauss–Newton, is
  /// halved where it does not lower the loss.
  void follow() {
    const int begin = result_.summary.passes;
    const bool robust = options_.robust != Robust::kNone,
               descends = options_.loss == Loss::kForward && !robust;
    double least = std::numeric_limits<double>::infinity();
    VecX<double> best = x_;
    settled_ = false;
    while (!settled_ && may_pass(begin, kLeastReweightings)) {
      const VecX<double> before = x_, std = fit_.std;
      pass(layout_, robust);
      if (const double now = descends ? misfit() : 0.0; descends && now > least) {
        x_ = 0.5 * (best + before);
      } else {
        least = descends ? now : least;
        best = x_;
        solve(layout_);
      }
      double change = 0.0;
      for (long k = 0; k < x_.size(); ++k)
        if (std[k] > 0.0) change = std::max(change, std::abs(x_[k] - before[k]) / std[k]);
      settled_ = change < 1e-2;  // a hundredth of each standard error
    }
  }

  void evaluate() {
    result_.model = apply_fit(model_, layout_, x_, shape_);
    const Posterior arm = posterior_of(layout_, x_, fit_.information, train_);
    result_.model.posterior = joined(&arm, model_.posterior ? &*model_.posterior : nullptr);
    result_.parameters = parameter_estimates(layout_, x_, shape_, fit_.std, fit_.identifiable,
                                             fit_.solver.active_nonnegative, shape_std_);
    result_.base_parameters = fit_.base_parameters;
    result_.torque_constants = calibrated_constants(model_, layout_, gains_, fit_, train_);
    note_payloads(layout_, gains_, fit_, result_.notes);
    result_.physically_consistent = options_.linear.physical;
    note_consistency(layout_, fit_, result_);
    FitSummary& s = result_.summary;
    const std::string open = shapes_settled_ && settled_ ? ""
                             : shapes_settled_           ? "the parameters"
                             : settled_                  ? "the shapes"
                                                         : "shapes and parameters";
    s.termination = s.interrupted   ? "interrupted; fitted to what had been read"
                    : !open.empty() ? std::to_string(s.passes) +
                                          " passes over the data, as many as may be made, and " +
                                          open + " have not settled"
                    : s.converged ? "converged"
                                  : "the barrier method stopped before its tolerance";
    s.converged = s.converged && open.empty() && !s.interrupted;
    set_torque_errors({model_, layout_, result_.plan, test_plan_, nominal_, x_, shape_,
                       *regression_, training_runs_},
                      train_, test_, options_, result_);
  }

  const Model& model_;
  const RecordingSource& train_;
  const RecordingSource* test_;
  const IdentifyOptions& options_;
  IdentifyResult result_;
  PreprocessPlan test_plan_;
  FitLayout layout_;
  Gains gains_{layout_};
  int training_runs_ = 0;
  VecX<double> nominal_, x_, shape_;
  VecX<double> shape_std_;  ///< 0: held; NaN: fitted, and not identifiable
  std::unique_ptr<TorqueRegression> regression_;
  bool weighted_ = false;  ///< the rows of regression_ are
  double cost_ = 0.0;      ///< of the robust loss at the point of the last weighted pass
  bool shapes_settled_ = true, settled_ = true;  ///< their loops came to their ends
  LinearFit fit_;
  /// The last step of fitted shapes: what their errors follow from.
  struct {
    FitLayout layout;
    LinearFit fit;
    MatX<double> meat;
  } moved_;
};

}  // namespace

IdentifyResult identify_by_torque(const Model& model, const RecordingSource& train,
                                  const RecordingSource* test, const IdentifyOptions& options) {
  return InverseFit(model, train, test, options).run();
}

}  // namespace diffnea
