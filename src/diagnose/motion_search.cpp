#include "diagnose/motion_search.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "core/statistics.hpp"
#include "diagnose/chi_square.hpp"
#include "diagnose/gear_offers.hpp"
#include "diagnose/signed_fit.hpp"
#include "diagnose/thresholds.hpp"
#include "identify/drives.hpp"
#include "identify/gears.hpp"
#include "identify/local_factors.hpp"
#include "identify/motionless.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// Chance that nothing at all looks like a size.
constexpr double kChance = 0.05;
/// Weight of the least change, where the recording tells no other.
constexpr double kRidge = 1e-9;

long count(const std::vector<MotionStretch>& stretches, const std::vector<MotionWindow>& windows) {
  long out = 0;
  for (const MotionWindow& w : windows) {
    const auto q = stretches[w.stretch].q.middleRows(w.first, w.rows).array();
    out += (q == q).count();
  }
  return out;
}

/// Index among the layout's effects; −1: it is not there.
int index_of(const FitLayout& layout, const EffectSpec& spec) {
  for (std::size_t e = 0; e < layout.effects.size(); ++e)
    if (layout.effects[e].info().name == spec.effect && layout.effects[e].where == spec.where)
      return static_cast<int>(e);
  return -1;
}

/// Tells whether a shape has one of some values, within bounds: what a gear loses when it brakes.
bool is_chosen(const ParameterInfo& p) { return !p.search.empty() && std::isfinite(p.most); }

long free_count(const FitLayout& layout) {
  const auto is_free = [](const FitParameter& p) { return !p.fixed; };
  return std::ranges::count_if(layout.linear, is_free) +
         std::ranges::count_if(layout.shape, is_free);
}

/// All that a joint's drive, rotor and friction do times a factor.
void scale_drive(Model& model, const std::string& joint, double by) {
  for (EffectSpec& e : model.effects) {
    if (e.where != joint) continue;
    for (const ParameterInfo& info : find_effect(e.effect).parameters)
      if (info.linear && info.unit != "1")
        for (EffectParameter& p : e.parameters)
          if (p.name == info.name) p.value *= by;
  }
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

}  // namespace

struct MotionSearch::Variant {
  std::size_t score;       ///< index among the scores
  EffectSpec spec;         ///< at this point, no torque
  std::vector<int> linear; ///< its parameters that a fit solves for
};

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
  hold_motionless(still_joints(data_.data.train, data_.data.noise), joint_names(model), "", out,
                  unsaid);
  for (FitParameter& s : out.shape)  // the base has no such bound
    s.fixed = s.fixed || (is_bound_of_drive(out, s) && s.prior == no_bound(out, s));
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

MotionSolution MotionSearch::solve(const std::vector<EffectSpec>& terms,
                                   const MotionSolution* start) const {
  MotionSolution from;
  if (start) {
    from = *start;
    for (const EffectSpec& t : start->terms)
      if (!holds_effect(terms, t)) {
        std::erase_if(from.model.effects, [&](const EffectSpec& e) { return same_effect(e, t); });
        std::erase_if(from.held, [&](const std::string& pattern) {
          return pattern.starts_with(t.where + "." + t.effect + ".");
        });
      }
  } else {
    from.model = base_;
    from.windows = windows_;
  }
  std::vector<MotionSolution> begun;
  for (const EffectSpec& t : terms)
    if (start && !holds_effect(start->terms, t))
      for (const double by : other_scales(*start, t)) {
        begun.push_back(from);
        scale_drive(begun.back().model, t.where, by);
      }
  MotionSolution best = solved(std::move(from), terms);
  for (MotionSolution& other : begun)
    if (MotionSolution fit = solved(std::move(other), terms); fit.cost < best.cost)
      best = std::move(fit);
  return best;
}

MotionSolution MotionSearch::solved(MotionSolution from,
                                    const std::vector<EffectSpec>& terms) const {
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
  const std::vector<JointFactor> factors =
      hold_absorbed(model, data_.data.train, cut_windows(data_.data.train, first), out.layout,
                    unsaid);
  of.scale = parameter_scales(out.layout, factors);
  VecX<double> x = consistent_start(out.layout, of.scale),
               shape(static_cast<long>(out.layout.shape.size()));
  for (std::size_t k = 0; k < out.layout.linear.size(); ++k)
    if (out.layout.linear[k].fixed) x[static_cast<long>(k)] = out.layout.linear[k].prior;
  for (std::size_t s = 0; s < out.layout.shape.size(); ++s)
    shape[static_cast<long>(s)] = out.layout.shape[s].prior;
  MotionFitter fitter(of, data_.options, x, shape, [&](int, double) {
    return !progress_ || progress_("simulating", 1);
  });
  fitter.fit(out.windows, data_.options.tolerance);
  fitter.set_covariance(out.windows);
  out.fit = fitter.now();
  // A model under which some run blows up explains nothing, however well it does the others.
  out.cost = out.fit.blown_up > 0 ? kInfinity : 2.0 * out.fit.objective;
  out.model = apply_fit(model, out.layout, out.fit.x, out.fit.shape);
  set_rotors(out.model);
  return out;
}

std::vector<WindowScore> MotionSearch::scores(const MotionSolution& at,
                                              const std::vector<EffectSpec>& candidates) const {
  std::vector<WindowScore> out;
  std::vector<std::vector<Variant>> passes;  // an effect acts once at a joint
  const double together = correlation(at);
  for (const Candidate& c : candidates_) {
    const EffectSpec spec{c.effect.info().name, c.effect.where, {}};
    if (holds_effect(at.terms, spec) || !holds_effect(candidates, spec)) continue;
    if (clashes(at.model, c.effect)) continue;
    if (hides_motor(c.effect)) {
      if (progress_ && !progress_("testing", 0)) return {};
      if (std::optional<WindowScore> of = score_gear(at, c.effect, together))
        out.push_back(std::move(*of));
      continue;
    }
    out.push_back({.effect = spec, .delta_bic = -kInfinity, .promise = -kInfinity});
    for (std::size_t g = 0; g < c.grid.size(); ++g) {
      BoundEffect effect = c.effect;
      c.set(c.grid[g], effect);
      for (const int k : c.linear) effect.parameters[static_cast<std::size_t>(k)] = 0.0;
      if (g >= passes.size()) passes.emplace_back();
      passes[g].push_back({out.size() - 1, to_spec(effect), c.linear});
    }
  }
  for (const std::vector<Variant>& pass : passes) {
    if (progress_ && !progress_("testing", 0)) return {};
    score(at, pass, together, out);
  }
  std::ranges::stable_sort(out, std::ranges::greater{}, &WindowScore::promise);
  return out;
}

std::optional<WindowScore> MotionSearch::score_gear(const MotionSolution& at,
                                                    const BoundEffect& gear,
                                                    double correlation) const {
  constexpr int kSteps = 4;  // steps that lead away from where the base has bent to
  const auto tried = [&](const MotionSolution& from, const EffectSpec& spec, int steps) {
    MotionSolution out = from;
    if (!holds_effect(out.model.effects, spec)) out.model.effects.push_back(spec);
    out.layout = layout_of(out.model, with_effect(at.terms, spec), at.held);
    for (FitParameter& p : out.layout.linear) {
      const auto known = std::ranges::find(at.layout.linear, p.name, &FitParameter::name);
      if (known != at.layout.linear.end()) p.fixed = known->fixed;
    }
    VecX<double> shape(static_cast<long>(out.layout.shape.size()));
    for (std::size_t s = 0; s < out.layout.shape.size(); ++s)
      shape[static_cast<long>(s)] = out.layout.shape[s].prior;
    MotionProblem of = problem(out.model, out.layout);
    of.scale = VecX<double>::Ones(static_cast<long>(out.layout.linear.size()));
    MotionOptions few = data_.options;
    few.max_iterations = steps;
    MotionFitter fitter(of, few, out.layout.prior(), shape);
    fitter.fit(out.windows, data_.options.tolerance);
    out.fit = fitter.now();
    out.cost = out.fit.blown_up > 0 ? kInfinity : 2.0 * out.fit.objective;
    out.model = apply_fit(out.model, out.layout, out.fit.x, out.fit.shape);
    return out;
  };
  std::vector<MotionSolution> begun;  // the best of each side
  for (const std::vector<EffectSpec>& side : gear_offers(gear, at.layout, at.fit.x, data_.data)) {
    std::optional<MotionSolution> first;
    for (const EffectSpec& spec : side)
      if (MotionSolution s = tried(at, spec, 1); !first || s.cost < first->cost)
        first = std::move(s);
    if (first) begun.push_back(std::move(*first));
  }
  const EffectSpec spec{gear.info().name, gear.where, {}};
  const MotionSolution* best = nullptr;
  for (MotionSolution& s : begun) {
    if (s.cost < kInfinity) s = tried(s, spec, kSteps);
    if (s.cost < kInfinity && (!best || s.cost < best->cost)) best = &s;
  }
  if (!best) return {};
  const double lm = std::max(at.cost - best->cost, 0.0),
               parameters =
                   1.0 + static_cast<double>(free_count(best->layout) - free_count(at.layout));
  const auto better = [&](double together) {
    return window_delta_bic(at.cost, at.cost - lm, samples(), together, parameters);
  };
  return WindowScore{
      .effect = *std::ranges::find_if(best->model.effects,
                                      [&](const EffectSpec& e) { return same_effect(e, spec); }),
      .lm = lm,
      .delta_bic = better(correlation),
      .promise = better(1.0),
      .parameters = parameters,
      .visible_share = 1.0};
}

void MotionSearch::score(const MotionSolution& at, const std::vector<Variant>& variants,
                         double correlation, std::vector<WindowScore>& out) const {
  Model model = at.model;
  for (const Variant& v : variants) model.effects.push_back(v.spec);
  FitLayout layout = layout_of(model, at.terms, at.held);
  const auto of_variant = [&](const FitParameter& p) {
    for (std::size_t v = 0; p.effect >= 0 && v < variants.size(); ++v)
      if (index_of(layout, variants[v].spec) == p.effect) return static_cast<int>(v);
    return -1;
  };
  for (FitParameter& p : layout.linear) {
    const int v = of_variant(p);
    if (v >= 0) {
      p.fixed = std::ranges::find(variants[static_cast<std::size_t>(v)].linear, p.index) ==
                variants[static_cast<std::size_t>(v)].linear.end();
      continue;
    }
    const auto known = std::ranges::find(at.layout.linear, p.name, &FitParameter::name);
    if (known != at.layout.linear.end()) p.fixed = known->fixed;
  }
  for (FitParameter& p : layout.shape)
    if (of_variant(p) >= 0) p.fixed = true;
  MotionProblem of = problem(model, layout);
  of.scale = VecX<double>::Ones(static_cast<long>(layout.linear.size()));
  VecX<double> shape(static_cast<long>(layout.shape.size()));
  for (std::size_t s = 0; s < layout.shape.size(); ++s)
    shape[static_cast<long>(s)] = layout.shape[s].prior;
  const MotionFitter fitter(of, data_.options, layout.prior(), shape);
  const TriangularFactor factor = fitter.factor(at.windows);
  const MatX<double> R = factor.R();
  const MatX<double> K = R.transpose() * R;
  const VecX<double> slope = R.transpose() * factor.d();  // gradient of [J | r]: a step is −K⁻¹ slope

  const long p = static_cast<long>(layout.linear.size());
  std::vector<int> base;
  std::vector<std::vector<int>> own(variants.size());
  std::vector<std::vector<bool>> signs(variants.size());
  for (std::size_t k = 0; k < fitter.free().size(); ++k) {
    const int c = fitter.free()[k];
    const int v = c < p ? of_variant(layout.linear[static_cast<std::size_t>(c)]) : -1;
    if (v < 0) {
      base.push_back(static_cast<int>(k));
      continue;
    }
    own[static_cast<std::size_t>(v)].push_back(static_cast<int>(k));
    signs[static_cast<std::size_t>(v)].push_back(
        layout.linear[static_cast<std::size_t>(c)].sign != Sign::kFree);
  }
  MatX<double> B = K(base, base);
  B.diagonal() += kRidge * B.diagonal() + VecX<double>::Constant(B.rows(), 1e-300);
  const Eigen::LDLT<MatX<double>> solver(B);
  for (std::size_t v = 0; v < variants.size(); ++v) {
    if (own[v].empty()) continue;
    const MatX<double> cross = K(base, own[v]), alone = K(own[v], own[v]),
                       left = alone - cross.transpose() * solver.solve(cross);
    const VecX<double> b =
        -(slope(own[v]) - cross.transpose() * solver.solve(VecX<double>(slope(base))));
    double visible = 0.0;
    for (long k = 0; k < left.rows(); ++k)
      if (alone(k, k) > 0.0)
        visible = std::max(visible, std::sqrt(std::max(left(k, k), 0.0) / alone(k, k)));
    WindowScore& best = out[variants[v].score];
    best.visible_share = std::max(best.visible_share, visible);
    MatX<double> A = left;
    A.diagonal() += kRidge * alone.diagonal() + VecX<double>::Constant(A.rows(), 1e-300);
    const SignedFit fit = signed_fit(A, b, signs[v]);
    // A linear model may promise more than all that is left.
    const double lm = std::clamp(fit.gain, 0.0, (1.0 - 1e-9) * at.cost);
    const long shapes = std::ranges::count_if(layout.shape, [&](const FitParameter& s) {
      return of_variant(s) == static_cast<int>(v) &&
             !layout.effects[static_cast<std::size_t>(s.effect)]
                  .parameter_info[static_cast<std::size_t>(s.index)]
                  .search.empty();
    });
    const double parameters = static_cast<double>(left.rows() + shapes), n = samples();
    const auto better = [&](double together) {
      return window_delta_bic(at.cost, at.cost - lm, n, together, parameters);
    };
    if (!(better(correlation) > best.delta_bic)) continue;
    best.delta_bic = better(correlation);
    best.promise = better(1.0);  // once it is there, what is left may hang together no more
    best.parameters = parameters;
    best.lm = lm;
    best.values = fit.x;
    best.effect = variants[v].spec;
    for (std::size_t k = 0; k < own[v].size(); ++k) {
      const int c = fitter.free()[static_cast<std::size_t>(own[v][k])];
      best.effect.parameters[static_cast<std::size_t>(
          layout.linear[static_cast<std::size_t>(c)].index)].value = fit.x[static_cast<long>(k)];
    }
  }
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

double MotionSearch::delta_bic(const MotionSolution& a, const MotionSolution& b) const {
  return window_delta_bic(a.cost, b.cost, samples(), correlation(b),
                          static_cast<double>(free_count(b.layout) - free_count(a.layout)));
}

std::vector<RowMatX<double>> MotionSearch::errors(const MotionSolution& at,
                                                  const std::vector<MotionStretch>& stretches,
                                                  std::vector<MotionWindow> windows,
                                                  bool fit_states) const {
  MotionProblem of{at.model,       at.layout,  stretches, data_.data.runs, data_.data.noise.position,
                   VecX<double>::Ones(static_cast<long>(at.layout.linear.size()))};
  const MotionFitter fitter(of, data_.options, at.fit.x, at.fit.shape);
  if (fit_states) fitter.fit_states(windows, data_.options.tolerance);
  Workers workers = fitter.workers();
  std::vector<RowMatX<double>> out;
  for (const MotionWindow& w : windows) {
    const MotionStretch& s = stretches[w.stretch];
    RowMatX<double> e = workers.front()->positions(s, w) - s.q.middleRows(w.first, w.rows);
    e.array().rowwise() /= data_.data.noise.position.transpose().array();
    out.push_back(std::move(e));
  }
  return out;
}

std::vector<RowMatX<double>> MotionSearch::held_out_errors(const MotionSolution& at) const {
  return errors(at, held_, held_windows_, true);
}

HeldOutChange MotionSearch::held_out(const MotionSolution& a, const MotionSolution& b,
                                     std::uint64_t seed) const {
  const std::vector<RowMatX<double>> of_a = held_out_errors(a), of_b = held_out_errors(b);
  // Beyond all of a joint's motion, or blown up, an error counts as that motion.
  const VecX<double> most = motion_size(held_).cwiseQuotient(data_.data.noise.position);
  const auto square = [](double error, double limit) {
    return std::isfinite(error) ? std::min(error * error, limit * limit) : limit * limit;
  };
  std::vector<double> before, after;
  double n = 0.0;
  for (std::size_t i = 0; i < of_a.size(); ++i) {
    const MotionWindow& w = held_windows_[i];
    const MotionStretch& s = held_[w.stretch];
    double ends = -kInfinity;
    for (long k = 0; k < w.rows; ++k) {
      const double t = s.time[static_cast<std::size_t>(w.first + k)];
      if (t >= ends) {
        before.push_back(0.0);
        after.push_back(0.0);
        ends = t + kBlockSeconds;
      }
      for (long j = 0; j < of_a[i].cols(); ++j) {
        if (std::isnan(s.q(w.first + k, j))) continue;
        before.back() += square(of_a[i](k, j), most[j]);
        after.back() += square(of_b[i](k, j), most[j]);
        n += 1.0;
      }
    }
  }
  return change_over_blocks(before, after, std::max(n, 1.0), seed);
}

std::vector<CauseParameter> MotionSearch::parameters_of(const MotionSolution& at,
                                                        const EffectSpec& term) const {
  std::vector<CauseParameter> out;
  const int e = index_of(at.layout, term);
  if (e < 0) return out;
  const BoundEffect& effect = at.layout.effects[static_cast<std::size_t>(e)];
  const long p = static_cast<long>(at.layout.linear.size());
  for (std::size_t k = 0; k < effect.parameter_info.size(); ++k) {
    const ParameterInfo& info = effect.parameter_info[k];
    CauseParameter of{info.name, "", effect.parameters[k]};
    const auto take = [&](const std::vector<FitParameter>& list, const VecX<double>& values,
                          long from) {
      for (std::size_t c = 0; c < list.size(); ++c) {
        if (list[c].effect != e || list[c].index != static_cast<int>(k)) continue;
        of.unit = list[c].unit;
        of.value = values[static_cast<long>(c)];
        if (list[c].fixed) continue;
        const long at_column = from + static_cast<long>(c);
        of.std = std::sqrt(std::max(at.fit.covariance(at_column, at_column), 0.0));
        of.low = of.value - kNormal95 * of.std;
        of.high = of.value + kNormal95 * of.std;
        if (list[c].sign != Sign::kFree) of.low = std::max(of.low, 0.0);
      }
    };
    take(at.layout.linear, at.fit.x, 0);
    take(at.layout.shape, at.fit.shape, p);
    if (info.name == "motor_inertia")  // the joint's armature, as set_rotors() has it
      for (const EffectSpec& spec : at.model.effects)
        for (const EffectParameter& own : spec.parameters)
          if (same_effect(spec, term) && own.name == info.name) of.value = own.value;
    out.push_back(of);
  }
  return out;
}

double MotionSearch::share_of_motion(double lm) const {
  const VecX<double> size = motion_size(data_.data.train).cwiseQuotient(data_.data.noise.position);
  const double motion = size.norm() / std::sqrt(static_cast<double>(size.size()));
  return motion > 0.0
             ? std::sqrt(std::max(0.0, lm) / samples()) / motion
             : 0.0;
}

std::vector<long> MotionSearch::sizes_of(const MotionSolution& at, const EffectSpec& term) const {
  std::vector<long> out;
  const int e = index_of(at.layout, term);
  for (std::size_t c = 0; c < at.layout.linear.size(); ++c)
    if (at.layout.linear[c].effect == e && !at.layout.linear[c].fixed)
      out.push_back(static_cast<long>(c));
  return out;
}

/// Tells whether a gear may as well be rigid: its size within its own error, or where the encoder's
/// noise hides it.
bool MotionSearch::may_be_rigid(const MotionSolution& at, int gear) const {
  const BoundEffect& e = at.layout.effects[static_cast<std::size_t>(gear)];
  const std::vector<double> sizes =
      gear_sizes(e, drive_gain(at.layout, at.fit.x, e.joints.front()), data_.data);
  if (sizes.empty()) return true;
  for (std::size_t s = 0; s < at.layout.shape.size(); ++s) {
    const FitParameter& p = at.layout.shape[s];
    if (p.effect != gear || p.index != static_cast<int>(gear_size(e)) || p.fixed) continue;
    const long column = at.fit.x.size() + static_cast<long>(s);
    const double size = at.fit.shape[static_cast<long>(s)],
                 std = std::sqrt(std::max(at.fit.covariance(column, column), 0.0));
    const bool hidden =
        e.info().motor == HiddenMotor::kSpring ? size > sizes.front() : size < sizes.front();
    return hidden || size < kNormal95 * std;
  }
  return false;
}

bool MotionSearch::may_be_nothing(const MotionSolution& at, const EffectSpec& term) const {
  if (const int e = index_of(at.layout, term);
      e >= 0 && hides_motor(at.layout.effects[static_cast<std::size_t>(e)]))
    return may_be_rigid(at, e);
  const std::vector<long> sizes = sizes_of(at, term);
  if (sizes.empty()) return false;
  const VecX<double> x = at.fit.x(sizes);
  MatX<double> C = at.fit.covariance(sizes, sizes);
  C.diagonal() *= 1.0 + kRidge;
  const double square = x.dot(C.ldlt().solve(x));
  return chi_square_tail(square, static_cast<int>(sizes.size())) > kChance;
}

MotionSolution MotionSearch::with_told_sizes(const MotionSolution& at) const {
  MotionSolution out = at;
  for (const EffectSpec& t : at.terms) {
    for (const ParameterInfo& p : find_effect(t.effect).parameters) {
      if (!is_chosen(p)) continue;
      const auto with = [&](double value) {
        MotionSolution other = out;
        for (EffectSpec& e : other.model.effects)
          for (EffectParameter& of : e.parameters)
            if (same_effect(e, t) && of.name == p.name) of.value = value;
        return solved(std::move(other), at.terms);
      };
      // First order chose one. The plain one stays, unless the fits tell another apart from it.
      MotionSolution best = with(p.initial);
      for (const double value : p.search)
        if (value != p.initial)
          if (MotionSolution other = with(value); delta_bic(best, other) > kToldApart)
            best = std::move(other);
      out = std::move(best);
    }
    const std::vector<long> sizes = sizes_of(out, t);
    const bool untold =
        sizes.size() > 1 && std::ranges::all_of(sizes, [&](long c) {
          return out.fit.x[c] < kNormal95 * std::sqrt(out.fit.covariance(c, c)) &&
                 out.layout.linear[static_cast<std::size_t>(c)].sign != Sign::kFree;
        });
    if (!untold || may_be_nothing(out, t)) continue;
    const long least =
        *std::ranges::min_element(sizes, {}, [&](long c) { return out.fit.x[c]; });
    out.held.push_back(out.layout.linear[static_cast<std::size_t>(least)].name + "=0");
    out = solved(std::move(out), at.terms);
  }
  return out;
}

}  // namespace diffnea
