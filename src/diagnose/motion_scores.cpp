/// Scores of candidates beside a fit of simulated runs.

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "diagnose/gear_offers.hpp"
#include "diagnose/motion_search.hpp"
#include "diagnose/signed_fit.hpp"
#include "diagnose/window_selection.hpp"
#include "identify/gears.hpp"
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

}  // namespace

bool is_scored_by_steps(const BoundEffect& effect) {
  return hides_motor(effect) || effect.info().has(Trait::kOfServo);
}

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
  constexpr int kBrief = 4;  // steps by which the base takes back what it had bent by
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
  std::optional<MotionSolution> brief;
  const std::vector<EffectSpec> hidden =
      by_steps.empty() ? std::vector<EffectSpec>{} : hidden_by_noise(at, candidates);
  for (const BoundEffect* effect : by_steps) {
    if (progress_ && !progress_("testing", 0)) return {};
    if (holds_effect(hidden, {effect->info().name, effect->where, {}})) continue;
    if (!brief) brief = stepped(at, at.terms, brief_, kBrief);
    // The last of those that are refitted; what stays behind it need not be known better.
    const double to_beat =
        std::ssize(out) < windows::kRefitted ? kInfinity : at.cost - out[windows::kRefitted - 1].lm;
    if (std::optional<WindowScore> of = score_by_steps(at, *brief, *effect, together, to_beat))
      out.push_back(std::move(*of));
    sort();
  }
  return out;
}

MotionSolution MotionSearch::stepped(MotionSolution from, const std::vector<EffectSpec>& terms,
                                     const std::vector<MotionWindow>& windows, int steps,
                                     double to_beat, const BoundEffect* of) const {
  MotionSolution out = std::move(from);
  const FitLayout before = std::move(out.layout);
  for (const EffectSpec& t : terms)
    if (!holds_effect(out.model.effects, t)) out.model.effects.push_back(t);
  out.windows = windows;
  out.layout = layout_of(out.model, terms, out.held);
  for (FitParameter& p : out.layout.linear) {
    const auto known = std::ranges::find(before.linear, p.name, &FitParameter::name);
    if (known != before.linear.end()) p.fixed = known->fixed;
  }
  for (auto* list : {&out.layout.linear, &out.layout.shape})
    for (FitParameter& p : *list)
      if (of && p.effect >= 0)
        p.fixed =
            p.fixed || out.layout.effects[static_cast<std::size_t>(p.effect)].joints != of->joints;
  VecX<double> shape(static_cast<long>(out.layout.shape.size()));
  for (std::size_t s = 0; s < out.layout.shape.size(); ++s)
    shape[static_cast<long>(s)] = out.layout.shape[s].prior;
  MotionProblem all = problem(out.model, out.layout);
  all.scale = VecX<double>::Ones(static_cast<long>(out.layout.linear.size()));
  MotionOptions few = data_.options;
  few.max_iterations = steps;
  MotionFitter fitter(all, few, out.layout.prior(), shape,
                      [&](int, double) { return !progress_ || progress_("testing", 0); });
  fitter.fit(out.windows, data_.options.tolerance, 0.5 * to_beat);
  out.fit = fitter.now();
  out.cost = out.fit.blown_up > 0 ? kInfinity : 2.0 * out.fit.objective;
  out.model = apply_fit(out.model, out.layout, out.fit.x, out.fit.shape);
  return out;
}

std::optional<WindowScore> MotionSearch::score_by_steps(const MotionSolution& at,
                                                        const MotionSolution& brief,
                                                        const BoundEffect& effect,
                                                        double correlation, double to_beat) {
  constexpr int kFirst = 2;           // steps in brief windows, by which sizes compete
  constexpr int kSteps = 4;           // steps that lead away from where the base has bent to
  std::vector<MotionSolution> begun;  // the best of each side
  const std::vector<std::vector<EffectSpec>> offers =
      hides_motor(effect)
          ? gear_offers(effect, brief.layout, brief.fit.x, brief.fit.shape, data_.data)
          : std::vector<std::vector<EffectSpec>>{offers_of_law(effect)};
  for (const std::vector<EffectSpec>& side : offers) {
    std::optional<MotionSolution> first;
    for (const EffectSpec& spec : side)
      if (MotionSolution s = stepped(brief, with_effect(at.terms, spec), brief.windows, kFirst,
                                     first ? first->cost : kInfinity, &effect);
          !first || s.cost < first->cost)
        first = std::move(s);
    if (first) begun.push_back(std::move(*first));
  }
  const EffectSpec spec{effect.info().name, effect.where, {}};
  const MotionSolution* best = nullptr;
  for (MotionSolution& s : begun) {
    s.layout = at.layout;
    if (s.cost < kInfinity)
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
