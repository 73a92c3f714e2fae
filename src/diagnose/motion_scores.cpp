/// Scores of candidates beside a fit of simulated runs.

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "diagnose/gear_offers.hpp"
#include "diagnose/motion_search.hpp"
#include "diagnose/signed_fit.hpp"
#include "diagnose/window_selection.hpp"
#include "identify/drives.hpp"
#include "identify/gears.hpp"
#include "identify/joint_bench.hpp"
#include "identify/passes.hpp"

namespace diffnea {

namespace {

/// Variants that one simulation has sensitivities by: with more, the QR of their columns, by the
/// square of their number, takes longer than the simulation that they share.
constexpr std::size_t kMostVariants = 64;

/// A part of a drive's law at the values from which its first parameter is looked for.
std::vector<EffectSpec> offers_of_law(BoundEffect effect) {
  std::vector<EffectSpec> out;
  for (const double value : effect.parameter_info.front().search) {
    effect.parameters.front() = value;
    out.push_back(to_spec(effect));
  }
  return out;
}

/// Σ (e/σ)² of a fit; infinite where some run blows up.
double cost_of(const MotionFit& fit) { return fit.blown_up > 0 ? kInfinity : 2.0 * fit.objective; }

}  // namespace

bool is_scored_by_steps(const BoundEffect& effect) {
  return hides_motor(effect) || effect.info().has(Trait::kOfServo);
}

/// Score of an effect on the bench of its joint.
struct MotionSearch::OnBench {
  std::vector<MotionSolution> begun;     ///< the best of each side, but for those of no use
  std::optional<WindowScore> useless{};  ///< the score where none is of use
};

struct MotionSearch::Variant {
  std::size_t score;        ///< index among the scores
  BoundEffect effect;       ///< at this point, no torque
  std::vector<int> linear;  ///< its parameters that a fit solves for
};

std::vector<WindowScore> MotionSearch::scores(const MotionSolution& at,
                                              const std::vector<EffectSpec>& candidates) {
  Known& of = known(at.terms, at.held);
  const bool is_best = of.best && of.best->cost == at.cost;
  if (is_best && !of.scores.empty() && std::ranges::all_of(candidates, [&](const EffectSpec& e) {
        return holds_effect(of.scored, e);
      })) {
    std::vector<WindowScore> out = of.scores;
    std::erase_if(out, [&](const WindowScore& s) { return !holds_effect(candidates, s.effect); });
    return out;
  }
  std::vector<WindowScore> out = new_scores(at, candidates);
  if (is_best) {
    of.scored = candidates;
    of.scores = out;
  }
  return out;
}

std::vector<EffectSpec> MotionSearch::hidden_by_noise(
    const MotionSolution& at, const std::vector<EffectSpec>& candidates) const {
  std::vector<const BoundEffect*> by_steps;
  for (const Candidate& c : candidates_)
    if (is_scored_by_steps(c.effect) &&
        holds_effect(candidates, {c.effect.info().name, c.effect.where, {}}))
      by_steps.push_back(&c.effect);
  std::vector<EffectSpec> out;
  if (by_steps.empty() || by_steps.size() == candidates.size()) return out;
  const std::vector<bool> quiet = at_noise(at);
  for (const BoundEffect* e : by_steps)
    if (std::ranges::all_of(e->joints, [&](int joint) { return quiet[joint]; }))
      out.push_back({e->info().name, e->where, {}});
  return out;
}

std::vector<WindowScore> MotionSearch::new_scores(const MotionSolution& at,
                                                  const std::vector<EffectSpec>& candidates) {
  std::vector<WindowScore> out;
  // Beside effects that read accelerations a simulation takes other steps.
  std::vector<std::vector<Variant>> explicit_passes, implicit_passes;
  const double together = correlation(at);
  std::vector<const BoundEffect*> by_steps;
  for (const Candidate& c : candidates_) {
    const EffectSpec spec{c.effect.info().name, c.effect.where, {}};
    if (holds_effect(at.terms, spec) || !holds_effect(candidates, spec)) continue;
    if (clashes(at.model, c.effect)) continue;
    if (is_scored_by_steps(c.effect)) {
      by_steps.push_back(&c.effect);
      continue;
    }
    out.push_back({.effect = spec, .delta_bic = -kInfinity, .promise = -kInfinity});
    for (std::size_t g = 0; g < c.grid.size(); ++g) {
      BoundEffect effect = c.effect;
      c.set(c.grid[g], effect);
      for (const int k : c.linear) effect.parameters[static_cast<std::size_t>(k)] = 0.0;
      auto& passes = reads_acceleration(effect) ? implicit_passes : explicit_passes;
      if (passes.empty() || passes.back().size() >= kMostVariants) passes.emplace_back();
      passes.back().push_back({out.size() - 1, std::move(effect), c.linear});
    }
  }
  for (const auto* passes : {&explicit_passes, &implicit_passes})
    for (const std::vector<Variant>& pass : *passes) {
      if (progress_ && !progress_("testing", 0)) return {};
      score(at, pass, together, out);
    }
  const auto sort = [&] {
    std::ranges::stable_sort(out, std::ranges::greater{}, &WindowScore::promise);
  };
  sort();
  Beside beside;
  const std::vector<EffectSpec> hidden =
      by_steps.empty() ? std::vector<EffectSpec>{} : hidden_by_noise(at, candidates);
  for (const BoundEffect* effect : by_steps) {
    if (progress_ && !progress_("testing", 0)) return {};
    if (holds_effect(hidden, {effect->info().name, effect->where, {}})) continue;
    // The last of those that are refitted; what stays behind it need not be known better.
    const double to_beat =
        std::ssize(out) < windows::kRefitted ? kInfinity : at.cost - out[windows::kRefitted - 1].lm;
    if (std::optional<WindowScore> of = score_by_steps(at, beside, *effect, together, to_beat))
      out.push_back(std::move(*of));
    sort();
  }
  return out;
}

FitLayout MotionSearch::layout_as_before(const Model& model, const std::vector<EffectSpec>& terms,
                                         const std::vector<std::string>& held,
                                         const FitLayout& before, const BoundEffect* of) const {
  FitLayout out = layout_of(model, terms, held);
  for (FitParameter& p : out.linear) {
    const auto known = std::ranges::find(before.linear, p.name, &FitParameter::name);
    if (known != before.linear.end()) p.fixed = known->fixed;
  }
  for (auto* list : {&out.linear, &out.shape})
    for (FitParameter& p : *list)
      if (of && p.effect >= 0)
        p.fixed = p.fixed || out.effects[static_cast<std::size_t>(p.effect)].joints != of->joints;
  return out;
}

MotionFit MotionSearch::steps_of(const MotionProblem& of, const VecX<double>& x,
                                 std::vector<MotionWindow>& windows, int steps,
                                 double to_beat) const {
  MotionProblem all = of;
  all.scale = VecX<double>::Ones(static_cast<long>(of.layout.linear.size()));
  MotionOptions few = data_.options;
  few.max_iterations = steps;
  VecX<double> shape(static_cast<long>(of.layout.shape.size()));
  for (std::size_t s = 0; s < of.layout.shape.size(); ++s)
    shape[static_cast<long>(s)] = of.layout.shape[s].prior;
  MotionFitter fitter(all, few, x, shape,
                      [&](int, double) { return !progress_ || progress_("testing", 0); });
  fitter.fit(windows, data_.options.tolerance, 0.5 * to_beat);
  return fitter.now();
}

MotionSolution MotionSearch::stepped(MotionSolution from, const std::vector<EffectSpec>& terms,
                                     const std::vector<MotionWindow>& windows, int steps,
                                     double to_beat, const BoundEffect* of) const {
  MotionSolution out = std::move(from);
  for (const EffectSpec& t : terms)
    if (!holds_effect(out.model.effects, t)) out.model.effects.push_back(t);
  out.windows = windows;
  out.layout = layout_as_before(out.model, terms, out.held, out.layout, of);
  out.fit =
      steps_of(problem(out.model, out.layout), out.layout.prior(), out.windows, steps, to_beat);
  out.cost = cost_of(out.fit);
  out.model = apply_fit(out.model, out.layout, out.fit.x, out.fit.shape);
  return out;
}

std::optional<MotionSearch::OnBench> MotionSearch::begun_on_bench(
    const MotionSolution& at, std::optional<std::vector<MotionStretch>>& moves,
    const BoundEffect& effect, const std::vector<std::vector<EffectSpec>>& offers) const {
  constexpr int kFirst = 4;  // steps by which sizes compete
  constexpr int kMore = 20;  // steps of the best, away from where the base has bent to
  constexpr std::size_t kPieces = 8;
  const double first = horizons(data_.data.train, data_.data.noise, data_.options).front();
  const EffectSpec& any = offers.front().front();
  const std::vector<EffectSpec> terms = with_effect(at.terms, any);
  MotionSolution with = at;
  with.model.effects.push_back(any);
  const FitLayout layout = layout_as_before(with.model, terms, at.held, at.layout);
  if (!has_benches(with.model, layout)) return {};
  const int joint = effect.joints.front();
  if (!moves) moves = simulated(at);
  const JointBench bench(with.model, data_.data, *moves, layout, joint, BenchGears::kTaken);
  const int there = index_of(bench.layout(), any);
  if (!bench.is_whole() || there < 0) return {};
  std::vector<MotionWindow> measured;
  for (std::size_t k = 0; k < brief_.size(); k += (brief_.size() + kPieces - 1) / kPieces)
    measured.push_back(brief_[k]);
  set_measured_states(bench.data().train, first, measured);
  bool stopped = false;
  const auto fit = [&](const FitLayout& l, int steps, double to_beat) {
    std::vector<MotionWindow> windows = measured;
    const MotionProblem of{
        bench.model(), l, bench.data().train, bench.data().runs, bench.data().noise.position, {}};
    MotionFit now = steps_of(of, l.prior(), windows, steps, to_beat);
    stopped = stopped || now.interrupted;
    return now;
  };
  const auto is_its = [&](const FitParameter& p) { return p.effect == there; };
  // The joint without it takes back what the bench is off by, as it does with it.
  FitLayout without = bench.layout();
  std::erase_if(without.linear, is_its);
  std::erase_if(without.shape, is_its);
  without.effects.pop_back();
  const double cost = cost_of(fit(without, kFirst, kInfinity));
  OnBench out;
  for (const std::vector<EffectSpec>& side : offers) {
    MotionBeginning best;
    double least = kInfinity;
    long samples = 0;
    std::size_t chosen = 0;
    const auto take = [&](FitLayout l, const MotionFit& now) {
      least = cost_of(now);
      samples = now.samples;
      best = {.layout = std::move(l),
              .scale = VecX<double>::Zero(now.x.size()),
              .start = now.x,
              .shape = now.shape};
    };
    const auto offer = [&](std::size_t i) {
      if (stopped) return;
      FitLayout l = bench.layout();
      std::vector<double>& values = l.effects[static_cast<std::size_t>(there)].parameters;
      for (std::size_t k = 0; k < values.size(); ++k) values[k] = side[i].parameters[k].value;
      for (auto* list : {&l.linear, &l.shape})
        for (FitParameter& p : *list)
          if (is_its(p)) p.prior = values[static_cast<std::size_t>(p.index)];
      const MotionFit now = fit(l, kFirst, std::min(least, cost));
      if (!(cost_of(now) < least)) return;
      chosen = i;
      take(std::move(l), now);
    };
    // Every other size, then those beside the best.
    for (std::size_t i = 0; i < side.size(); i += 2) offer(i);
    for (const std::size_t i : {chosen - 1, chosen + 1})
      if (i < side.size()) offer(i);
    if (stopped) return OnBench{};
    if (!(least < kInfinity)) continue;
    FitLayout from = best.layout;
    for (std::size_t k = 0; k < from.linear.size(); ++k)
      from.linear[k].prior = best.start[static_cast<long>(k)];
    for (std::size_t k = 0; k < from.shape.size(); ++k)
      from.shape[k].prior = best.shape[static_cast<long>(k)];
    const MotionFit end = fit(from, kMore, cost);
    if (cost_of(end) < least) take(std::move(from), end);
    const double more = count_free(best.layout) - count_free(without),
                 better = window_delta_bic(cost, least, static_cast<double>(samples), 1.0, more);
    if (!out.useless || better > out.useless->delta_bic)
      out.useless = WindowScore{.effect = to_spec(effect),
                                .lm = std::max(cost - least, 0.0),
                                .delta_bic = better,
                                .promise = better,
                                .parameters = more,
                                .visible_share = 1.0};
    if (!(better > 0.0)) continue;
    MotionBeginning whole{.layout = layout,
                          .scale = VecX<double>::Zero(static_cast<long>(layout.linear.size())),
                          .start = layout.prior(),
                          .shape = VecX<double>(static_cast<long>(layout.shape.size()))};
    for (std::size_t s = 0; s < layout.shape.size(); ++s)
      whole.shape[static_cast<long>(s)] = layout.shape[s].prior;
    bench.put(best, whole);
    MotionSolution s = with;
    s.model = apply_fit(with.model, whole.layout, whole.start, whole.shape);
    out.begun.push_back(std::move(s));
  }
  return out;
}

std::vector<MotionSolution> MotionSearch::begun_with_all(
    const MotionSolution& at, const MotionSolution& brief, const BoundEffect& effect,
    const std::vector<std::vector<EffectSpec>>& offers) const {
  constexpr int kSteps = 2;
  std::vector<MotionSolution> out;
  for (const std::vector<EffectSpec>& side : offers) {
    std::optional<MotionSolution> best;
    for (const EffectSpec& spec : side)
      if (MotionSolution s = stepped(brief, with_effect(at.terms, spec), brief.windows, kSteps,
                                     best ? best->cost : kInfinity, &effect);
          !best || s.cost < best->cost)
        best = std::move(s);
    if (best && best->cost < kInfinity) out.push_back(std::move(*best));
  }
  return out;
}

std::optional<WindowScore> MotionSearch::score_by_steps(const MotionSolution& at, Beside& beside,
                                                        const BoundEffect& effect,
                                                        double correlation, double to_beat) {
  constexpr int kBrief = 4;  // steps by which the base takes back what it had bent by
  constexpr int kSteps = 4;  // steps that lead away from where the base has bent to
  const EffectSpec spec{effect.info().name, effect.where, {}};
  const auto offers_at = [&](const MotionSolution& s) {
    return hides_motor(effect) ? gear_offers(effect, s.layout, s.fit.x, s.fit.shape, data_.data)
                               : std::vector<std::vector<EffectSpec>>{offers_of_law(effect)};
  };
  std::vector<std::vector<EffectSpec>> offers = offers_at(at);
  std::optional<OnBench> bench = begun_on_bench(at, beside.moves, effect, offers);
  std::vector<MotionSolution> begun;
  if (bench) {
    begun = std::move(bench->begun);
  } else {
    if (!beside.brief) beside.brief = stepped(at, at.terms, brief_, kBrief);
    offers = offers_at(*beside.brief);
    begun = begun_with_all(at, *beside.brief, effect, offers);
  }
  if (begun.empty()) return bench ? bench->useless : std::nullopt;
  const MotionSolution* best = nullptr;
  for (MotionSolution& s : begun) {
    s.layout = at.layout;
    s = stepped(std::move(s), with_effect(at.terms, spec), at.windows, kSteps, to_beat);
    if (s.cost < kInfinity && (!best || s.cost < best->cost)) best = &s;
  }
  if (!best) return {};
  known(with_effect(at.terms, spec), best->held).begun = *best;
  const double lm = std::max(at.cost - best->cost, 0.0),
               sides = static_cast<double>(offers.size() - 1),
               parameters = sides + count_free(best->layout) - count_free(at.layout);
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
  // An effect acts once at a joint of a model: of its variants, which have no torque, the first.
  // The layout has columns of all.
  Model model = at.model;
  for (const Variant& v : variants)
    if (const EffectSpec spec = to_spec(v.effect); !holds_effect(model.effects, spec))
      model.effects.push_back(spec);
  FitLayout layout = layout_of(model, at.terms, at.held);
  std::vector<int> variant_of(layout.effects.size(), -1);
  for (std::size_t v = 0; v < variants.size(); ++v) {
    const int first = index_of(layout, to_spec(variants[v].effect));
    if (variant_of[static_cast<std::size_t>(first)] < 0) {
      variant_of[static_cast<std::size_t>(first)] = static_cast<int>(v);
      continue;
    }
    const auto add_copies = [&](std::vector<FitParameter>& list) {
      for (std::size_t k = 0, n = list.size(); k < n; ++k) {
        if (list[k].effect != first) continue;
        FitParameter copy = list[k];
        copy.effect = static_cast<int>(layout.effects.size());
        copy.prior = variants[v].effect.parameters[static_cast<std::size_t>(copy.index)];
        list.push_back(std::move(copy));
      }
    };
    add_copies(layout.linear);
    add_copies(layout.shape);
    layout.effects.push_back(variants[v].effect);
    variant_of.push_back(static_cast<int>(v));
  }
  const auto of_variant = [&](const FitParameter& p) {
    return p.effect < 0 ? -1 : variant_of[static_cast<std::size_t>(p.effect)];
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
  const VecX<double> slope =
      R.transpose() * factor.d();  // gradient of [J | r]: a step is −K⁻¹ slope

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
    signs[static_cast<std::size_t>(v)].push_back(layout.linear[static_cast<std::size_t>(c)].sign !=
                                                 Sign::kFree);
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
    best.effect = to_spec(variants[v].effect);
    for (std::size_t k = 0; k < own[v].size(); ++k) {
      const int c = fitter.free()[static_cast<std::size_t>(own[v][k])];
      best.effect
          .parameters[static_cast<std::size_t>(layout.linear[static_cast<std::size_t>(c)].index)]
          .value = fit.x[static_cast<long>(k)];
    }
  }
}

}  // namespace diffnea
