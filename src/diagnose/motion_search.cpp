#include "diagnose/motion_search.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>

#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "core/statistics.hpp"
#include "diagnose/thresholds.hpp"
#include "identify/drives.hpp"
#include "identify/gears.hpp"
#include "identify/local_factors.hpp"
#include "identify/motionless.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

long count(const std::vector<MotionStretch>& stretches, const std::vector<MotionWindow>& windows) {
  long out = 0;
  for (const MotionWindow& w : windows) {
    const auto q = stretches[w.stretch].q.middleRows(w.first, w.rows).array();
    out += (q == q).count();
  }
  return out;
}

/// Fall of χ² that noise gives a parameter on average: scores beside both points are the same.
constexpr double kOfNoise = 1.0;

/// Mean square of each joint's errors, (n), over rows that have one.
Eigen::ArrayXd mean_squares(const RowMatX<double>& errors) {
  const auto known = errors.array() == errors.array();
  return known.select(errors.array().square(), 0.0).colwise().sum().transpose() /
         known.cast<double>().colwise().sum().transpose().max(1.0);
}

/// Scales of its joint's drive at which a cause may have to be looked for: where the model lacks
/// the cause, no sag and no swing may have said that the drive is as strong as any.
std::vector<double> other_scales(const MotionSolution& at, const EffectSpec& cause) {
  constexpr double kNear = 3.0;  // a fit finds what is within this factor
  constexpr double kFar[] = {0.1, 0.01};
  // Where a gear has been scored, its sizes and flanks are those of this drive.
  if (find_effect(cause.effect).motor != HiddenMotor::kNone) return {};
  for (std::size_t k = 0; k < at.layout.linear.size(); ++k) {
    const FitParameter& p = at.layout.linear[k];
    if (p.fixed || p.effect < 0 || !p.name.ends_with(".stiffness")) continue;
    const BoundEffect& drive = at.layout.effects[static_cast<std::size_t>(p.effect)];
    if (!drive.info().has(Trait::kReadsCommand) || drive.where != cause.where) continue;
    const long column = static_cast<long>(k);
    const double gain = at.fit.x[column];
    const auto link = std::ranges::find(at.model.links, drive.where, &ModelLink::joint);
    if (link->servo) {
      const double to_file = link->servo->kp / gain;
      if (to_file > kNear || to_file < 1.0 / kNear) return {to_file};
      return {};
    }
    if (std::sqrt(std::max(at.fit.covariance(column, column), 0.0)) < gain) return {};
    return {std::begin(kFar), std::end(kFar)};
  }
  return {};
}

/// Tells whether an effect is a body that a link holds.
bool is_body(const EffectSpec& effect) { return find_effect(effect.effect).has(Trait::kInertia); }

}  // namespace

int index_of(const FitLayout& layout, const EffectSpec& spec) {
  for (std::size_t e = 0; e < layout.effects.size(); ++e)
    if (layout.effects[e].info().name == spec.effect && layout.effects[e].where == spec.where)
      return static_cast<int>(e);
  return -1;
}

bool describes_gains(const Model& model) {
  return std::ranges::all_of(model.effects, [&](const EffectSpec& e) {
    return e.effect != "position_servo" ||
           std::ranges::find(model.links, e.where, &ModelLink::joint)->servo;
  });
}

bool is_chosen(const ParameterInfo& p) { return !p.search.empty() && std::isfinite(p.most); }

MotionSearch::MotionSearch(Model base, const MotionSearchData& data,
                           std::vector<Candidate> candidates,
                           std::function<bool(const std::string&, int)> progress)
    : base_(std::move(base)),
      data_(data),
      candidates_(std::move(candidates)),
      progress_(std::move(progress)) {
  windows_ = cut_windows(data.data.train, data.horizon);
  const double first = horizons(data.data.train, data.data.noise, data.options).front();
  set_measured_states(data.data.train, first, windows_);
  if (data.test) {
    held_ = data.data.test;
    held_windows_ = cut_windows(held_, data.horizon);
    set_measured_states(held_, first, held_windows_);
  } else {
    held_ = data.data.train;
    std::vector<MotionWindow> kept;
    for (std::size_t w = 0; w < windows_.size(); ++w)
      (w % kHeldOutWindow == kHeldOutWindow - 1 ? held_windows_ : kept).push_back(windows_[w]);
    windows_ = std::move(kept);
  }
  samples_ = count(data.data.train, windows_);
  brief_ = some_pieces(data.data.train, windows_, kTrialOfGears);
  set_measured_states(data.data.train, first, brief_);
}

FitLayout MotionSearch::layout_of(const Model& model, const std::vector<EffectSpec>& terms,
                                  const std::vector<std::string>& held) const {
  std::vector<std::string> unsaid;
  FitChoice choice = data_.choice;
  choice.effects = std::vector<std::string>{};
  choice.simulated = true;
  choice.fix.insert(choice.fix.end(), held.begin(), held.end());
  FitLayout out = layout_for(model, data_.train, data_.test, choice, unsaid);
  bound_delays(data_.data.noise.period, out);
  hold_without_commands(data_.data.train, joint_names(model), out, unsaid);
  hold_motionless(still_joints(data_.data.train, data_.data.noise), joint_names(model), "", out,
                  unsaid);
  // A term's shapes move with it: those that have starts of their own.
  for (const EffectSpec& t : terms) {
    const int e = index_of(out, t);
    for (FitParameter& s : out.shape)
      if (e >= 0 && s.effect == e) {
        const ParameterInfo& info = out.effects[static_cast<std::size_t>(e)]
                                        .parameter_info[static_cast<std::size_t>(s.index)];
        s.fixed = hides_motor(out.effects[static_cast<std::size_t>(e)])
                      ? !fits_of_gear(info)
                      : info.search.empty() || is_chosen(info);
      }
  }
  return out;
}

MotionProblem MotionSearch::problem(const Model& model, const FitLayout& layout) const {
  return {model, layout, data_.data.train, data_.data.runs, data_.data.noise.position, {}};
}

MotionSolution MotionSearch::at_scale(MotionSolution of, const std::string& joint,
                                      double by) const {
  // A rotor of nothing, where the links alone are heavier than all of it should be, is no start.
  const VecX<double> inertia = VecX<double>::Zero(of.layout.num_dofs);
  for (const BoundEffect& drive : of.layout.effects)
    if (drive.info().has(Trait::kReadsCommand) && drive.where == joint)
      scale_drive(of.layout, drive, inertia, by, of.fit.x);
  of.model = apply_fit(of.model, of.layout, of.fit.x, of.fit.shape);
  return of;
}

MotionSolution MotionSearch::with_described_gains(MotionSolution of) const {
  for (const ModelLink& link : of.model.links) {
    const std::string gain = link.joint + ".position_servo.stiffness";
    const auto known = std::ranges::find(of.layout.linear, gain, &FitParameter::name);
    if (!link.servo || known == of.layout.linear.end() || known->fixed) continue;
    of = at_scale(std::move(of), link.joint,
                  link.servo->kp / of.fit.x[known - of.layout.linear.begin()]);
    of.held.push_back(gain);
  }
  return of;
}

MotionSearch::Known& MotionSearch::known(const std::vector<EffectSpec>& terms,
                                         const std::vector<std::string>& held) {
  std::vector<std::string> key = names_of(terms);
  std::ranges::copy(held, std::back_inserter(key));
  std::ranges::sort(key);
  return known_[key];
}

MotionSolution MotionSearch::solve(const std::vector<EffectSpec>& terms,
                                   const MotionSolution* start, double to_beat) {
  MotionSolution from;
  if (start) {
    from = *start;
  } else {
    from.model = base_;
    from.windows = windows_;
    from.cost = kInfinity;
  }
  const auto with_terms = [&](MotionSolution one) {
    for (const EffectSpec& t : one.terms)
      if (!holds_effect(terms, t)) {
        std::erase_if(one.model.effects, [&](const EffectSpec& e) { return same_effect(e, t); });
        std::erase_if(one.held, [&](const std::string& pattern) {
          return pattern.starts_with(t.where + "." + t.effect + ".") ||
                 (is_body(t) && pattern.ends_with(".position_servo.stiffness"));
        });
      }
    const auto is_new = [&](const EffectSpec& t) {
      return is_body(t) && !holds_effect(one.terms, t);
    };
    if (start && std::ranges::any_of(terms, is_new)) return with_described_gains(std::move(one));
    return one;
  };
  Known& of = known(terms, with_terms(from).held);
  const std::vector<std::string> begun = names_of(from.terms);
  for (const Known::Run& run : of.runs)
    // A start that costs as much is as good, but for the share that a fit leaves.
    if (run.from == begun && from.cost >= run.cost * (1.0 - data_.options.tolerance) &&
        std::min(to_beat, of.best->cost) <= run.within_reach)
      return *of.best;
  Known::Run run{begun, from.cost, kInfinity};
  const auto take = [&](MotionSolution one) {
    run.within_reach = std::min(run.within_reach, one.within_reach);
    if (of.best && !(one.cost < of.best->cost)) return;
    if (!of.best || one.cost < of.best->cost - kOfNoise) {
      of.scored.clear();
      of.scores.clear();
    }
    of.best = std::move(one);
  };
  // With a score its drive has moved, too.
  take(solved(of.begun ? std::move(*of.begun) : with_terms(from), terms, to_beat));
  of.begun.reset();
  if (start)
    for (const EffectSpec& t : terms)
      if (!holds_effect(start->terms, t))
        for (const double by : other_scales(*start, t))
          take(solved(with_terms(at_scale(from, t.where, by)), terms,
                      std::min(to_beat, of.best->cost)));
  of.runs.push_back(std::move(run));
  return *of.best;
}

MotionSolution MotionSearch::solved(MotionSolution from, const std::vector<EffectSpec>& terms,
                                    double to_beat) const {
  MotionSolution out;
  out.terms = terms;
  out.held = std::move(from.held);
  out.windows = std::move(from.windows);
  Model model = std::move(from.model);
  for (const EffectSpec& t : terms)
    if (!holds_effect(model.effects, t)) model.effects.push_back(to_spec(bind(t, model)));
  out.layout = layout_of(model, terms, out.held);
  std::vector<std::string> unsaid;
  const double first = horizons(data_.data.train, data_.data.noise, data_.options).front();
  MotionProblem of = problem(model, out.layout);
  const std::vector<JointFactor> factors = hold_absorbed(
      model, data_.data.train, cut_windows(data_.data.train, first), out.layout, unsaid);
  of.scale = parameter_scales(out.layout, factors);
  VecX<double> x = consistent_start(out.layout, of.scale),
               shape(static_cast<long>(out.layout.shape.size()));
  for (std::size_t k = 0; k < out.layout.linear.size(); ++k)
    if (out.layout.linear[k].fixed) x[static_cast<long>(k)] = out.layout.linear[k].prior;
  for (std::size_t s = 0; s < out.layout.shape.size(); ++s)
    shape[static_cast<long>(s)] = out.layout.shape[s].prior;
  MotionFitter fitter(of, data_.options, x, shape,
                      [&](int, double) { return !progress_ || progress_("simulating", 1); });
  fitter.fit(out.windows, data_.options.tolerance, 0.5 * to_beat);
  fitter.set_covariance(out.windows);
  out.fit = fitter.now();
  if (out.fit.within_reach > 0.0) out.within_reach = 2.0 * out.fit.within_reach;
  // A model under which some run blows up explains nothing, however well it does the others.
  out.cost = out.fit.blown_up > 0 ? kInfinity : 2.0 * out.fit.objective;
  out.model = apply_fit(model, out.layout, out.fit.x, out.fit.shape);
  set_rotors(out.model);
  return out;
}

double MotionSearch::correlation(const MotionSolution& at) const {
  double sum = 0.0, squares = 0.0;
  for (const RowMatX<double>& e : errors(at, data_.data.train, at.windows, false))
    for (long j = 0; j < e.cols(); ++j) {
      std::vector<double> r;
      double own = 0.0;
      for (const double x : e.col(j)) {
        if (!std::isfinite(x)) continue;
        r.push_back(x);
        own += x * x;
      }
      squares += own;
      sum += own * correlation_time(r);
    }
  return squares > 0.0 ? sum / squares : 1.0;
}

std::vector<bool> MotionSearch::at_noise(const MotionSolution& at) const {
  std::vector<bool> out(static_cast<std::size_t>(at.layout.num_dofs), at.cost < kInfinity);
  if (!(at.cost < kInfinity)) return out;
  for (const RowMatX<double>& e : held_out_errors(at)) {
    const Eigen::ArrayXd beyond = mean_squares(e) - 1.0;
    for (std::size_t j = 0; j < out.size(); ++j)
      out[j] = out[j] && beyond[static_cast<long>(j)] < kHiddenByNoise;
  }
  return out;
}

bool MotionSearch::is_at_noise(const MotionSolution& at) const {
  return std::ranges::all_of(at_noise(at), std::identity());
}

bool MotionSearch::is_hidden(const MotionSolution& less, const MotionSolution& more) const {
  if (!(less.cost < kInfinity)) return false;  // a simulation blows up
  const std::vector<RowMatX<double>> of_less = held_out_errors(less),
                                     of_more = held_out_errors(more);
  for (std::size_t w = 0; w < of_less.size(); ++w)
    if (!((mean_squares(of_less[w]) - mean_squares(of_more[w])).maxCoeff() < kHiddenByNoise))
      return false;
  return true;
}

double MotionSearch::reach(const MotionSolution& less, const MotionSolution& best,
                           double within) const {
  const double n = samples(), more = count_free(best.layout) - count_free(less.layout);
  return best.cost * std::exp((within + more * std::log(n)) * correlation(best) / n);
}

double MotionSearch::delta_bic(const MotionSolution& a, const MotionSolution& b) const {
  return window_delta_bic(a.cost, b.cost, samples(), correlation(b),
                          count_free(b.layout) - count_free(a.layout));
}

std::vector<RowMatX<double>> MotionSearch::positions(const MotionSolution& at,
                                                     const std::vector<MotionStretch>& stretches,
                                                     std::vector<MotionWindow> windows,
                                                     bool fit_states) const {
  MotionProblem of{at.model,
                   at.layout,
                   stretches,
                   data_.data.runs,
                   data_.data.noise.position,
                   VecX<double>::Ones(static_cast<long>(at.layout.linear.size()))};
  const MotionFitter fitter(of, data_.options, at.fit.x, at.fit.shape);
  if (fit_states) fitter.fit_states(windows, data_.options.tolerance);
  Workers workers = fitter.workers();
  std::vector<RowMatX<double>> out;
  for (const MotionWindow& w : windows)
    out.push_back(workers.front()->positions(stretches[w.stretch], w));
  return out;
}

std::vector<MotionStretch> MotionSearch::simulated(const MotionSolution& at) const {
  std::vector<MotionStretch> out = data_.data.train;
  const std::vector<RowMatX<double>> q = positions(at, out, at.windows, false);
  for (std::size_t k = 0; k < q.size(); ++k) {
    const MotionWindow& w = at.windows[k];
    out[w.stretch].q.middleRows(w.first, w.rows) = q[k];
  }
  return out;
}

std::vector<RowMatX<double>> MotionSearch::errors(const MotionSolution& at,
                                                  const std::vector<MotionStretch>& stretches,
                                                  const std::vector<MotionWindow>& windows,
                                                  bool fit_states) const {
  std::vector<RowMatX<double>> out = positions(at, stretches, windows, fit_states);
  for (std::size_t k = 0; k < out.size(); ++k) {
    const MotionWindow& w = windows[k];
    out[k] -= stretches[w.stretch].q.middleRows(w.first, w.rows);
    out[k].array().rowwise() /= data_.data.noise.position.transpose().array();
  }
  return out;
}

std::vector<RowMatX<double>> MotionSearch::held_out_errors(const MotionSolution& at) const {
  return errors(at, held_, held_windows_, true);
}

HeldOutBlocks MotionSearch::held_out_blocks(const MotionSolution& a,
                                            const MotionSolution& b) const {
  const std::vector<RowMatX<double>> of_a = held_out_errors(a), of_b = held_out_errors(b);
  // Beyond all of a joint's motion, or blown up, an error counts as that motion.
  const VecX<double> most = motion_size(held_).cwiseQuotient(data_.data.noise.position);
  const auto square = [](double error, double limit) {
    return std::isfinite(error) ? std::min(error * error, limit * limit) : limit * limit;
  };
  HeldOutBlocks out;
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    const MotionWindow& w = held_windows_[i];
    const MotionStretch& s = held_[w.stretch];
    double ends = -kInfinity;
    for (long k = 0; k < w.rows; ++k) {
      const double t = s.time[static_cast<std::size_t>(w.first + k)];
      if (t >= ends) {
        out.before.push_back(0.0);
        out.after.push_back(0.0);
        ends = t + kBlockSeconds;
      }
      for (long j = 0; j < of_a[i].cols(); ++j) {
        if (std::isnan(s.q(w.first + k, j))) continue;
        out.before.back() += square(of_a[i](k, j), most[j]);
        out.after.back() += square(of_b[i](k, j), most[j]);
        out.n += 1.0;
      }
    }
  }
  return out;
}

HeldOutChange MotionSearch::held_out(const MotionSolution& a, const MotionSolution& b,
                                     std::uint64_t seed) const {
  return change_over(held_out_blocks(a, b), seed);
}

double MotionSearch::share_of_motion(double lm) const {
  const VecX<double> size = motion_size(data_.data.train).cwiseQuotient(data_.data.noise.position);
  const double motion = size.norm() / std::sqrt(static_cast<double>(size.size()));
  return motion > 0.0 ? std::sqrt(std::max(0.0, lm) / samples()) / motion : 0.0;
}

}  // namespace diffnea
