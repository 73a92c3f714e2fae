#include "identify/motion_race.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <ranges>
#include <set>

#include <diffnea/core/error.hpp>
#include <diffnea/core/parallel.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/core/text.hpp>

#include "core/constants.hpp"
#include "identify/drives.hpp"
#include "identify/joint_bench.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// Windows in which beginnings compete [s]: some delays and swings of a servo. In shorter ones,
/// whose first states are free, wrong bounds win.
constexpr double kTrial = 1.0;
/// Pieces for each of a joint's parameters: as clusters of a covariance while beginnings compete,
/// and for the one that goes on, so that few steps are left for all of a long recording.
constexpr double kPieces = 5.0, kMorePieces = 20.0;
/// Scales at which a joint's drive is looked for, over where a fit has found it.
constexpr double kScales[] = {0.1, 3.0, 10.0, 30.0, 100.0, 1000.0};
/// And below, step by step, while the windows tell no two apart: down to a millionth.
constexpr double kSmaller = 0.3;
constexpr int kMostSmaller = 12;

/// Stretches that show what drives do at their bounds: of each joint, the one with its largest error
/// and the one with its fastest command.
std::set<std::size_t> stretches_at_bounds(const std::vector<MotionStretch>& stretches,
                                          const std::vector<bool>& commanded) {
  std::set<std::size_t> out;
  for (std::size_t j = 0; j < commanded.size(); ++j) {
    if (!commanded[j]) continue;
    const auto largest = [&](const std::function<double(const MotionStretch&)>& of) {
      return static_cast<std::size_t>(std::ranges::max_element(stretches, {}, of) -
                                      stretches.begin());
    };
    const int joint = static_cast<int>(j);
    out.insert(largest([&](const MotionStretch& s) { return largest_error(s, joint, 0.0, kNoBound); }));
    out.insert(largest([&](const MotionStretch& s) { return largest_rate(s, joint); }));
  }
  return out;
}

/// Pieces of the horizon's length: those in which bounds act most, and others drawn at random.
/// @param each  how many for each of a joint's parameters
MotionData pieces_of(const MotionData& data, const FitLayout& layout, double horizon, double each) {
  // A piece does not tell what an integrator has summed up before.
  if (std::ranges::any_of(layout.effects,
                          [](const BoundEffect& e) { return e.info().has(Trait::kIntegrates); }))
    return data;
  std::vector<MotionStretch> all;
  for (const MotionWindow& w : cut_windows(data.train, horizon)) {
    const MotionStretch& s = data.train[w.stretch];
    const auto time = s.time.begin() + w.first;
    all.push_back({s.run,
                   {time, time + w.rows},
                   s.q.middleRows(w.first, w.rows),
                   s.u.middleRows(w.first, w.rows),
                   s.u_end.middleRows(w.first, w.rows),
                   s.at_links,
                   s.command});
  }
  const double needed = each * count_free(layout) / layout.num_dofs;
  if (static_cast<double>(all.size()) <= needed) return data;
  std::set<std::size_t> drawn = stretches_at_bounds(all, commanded_joints(layout));
  Rng rng(1);
  while (static_cast<double>(drawn.size()) < needed)
    drawn.insert(static_cast<std::size_t>(rng.next() % all.size()));
  MotionData out = data;
  out.train.clear();
  for (const std::size_t k : drawn) out.train.push_back(std::move(all[k]));
  return out;
}

/// The layout with rotors that rule what the joints feel: behind a high gear they do. What no
/// torque tells is begun at from the links, and from there.
FitLayout with_heavy_rotors(FitLayout layout, const VecX<double>& inertia) {
  constexpr double kHeavy = 10.0;  // over the inertia that the links have about the joint
  for (FitParameter& p : layout.linear) {
    if (p.fixed || !is_rotor(layout, p)) continue;
    const int joint = layout.effects[static_cast<std::size_t>(p.effect)].joints.front();
    p.fixed = true;
    p.prior = std::max(p.prior, kHeavy * inertia[joint]);
  }
  return layout;
}

/// Tells whether the model has gains of drives: its file's, or those of an earlier fit.
bool has_gains(const FitLayout& layout) {
  return std::ranges::any_of(layout.linear, [&](const FitParameter& p) {
    return p.effect >= 0 && p.prior > 0.0 && p.name.ends_with(".stiffness") &&
           layout.effects[static_cast<std::size_t>(p.effect)].info().has(Trait::kReadsCommand);
  });
}

/// Where a fit of drives begins.
struct Start {
  std::optional<double> speed_share{};  ///< one of kSpeedShares; none: no bounds at all
  bool heavy_rotors = false;
  double reach_share = kSeldom;  ///< or one of kReachShares
  bool at_file = false;  ///< at the gains that the model has, whatever torques of one instant say
};

MotionBeginning beginning(const Model& model, const MotionData& data, const FitLayout& layout,
                          double first, const Start& from) {
  MotionBeginning out;
  out.layout = layout;
  out.shape.resize(static_cast<long>(layout.shape.size()));
  for (std::size_t s = 0; s < layout.shape.size(); ++s)
    out.shape[static_cast<long>(s)] = layout.shape[s].prior;
  const std::vector<MotionWindow> windows = cut_windows(data.train, first);
  const std::vector<bool> commanded = commanded_joints(layout);
  if (!from.speed_share) hold_bounds_off(out.layout, out.shape);
  if (from.reach_share < kSeldom)  // dead band and speed do not show then
    for (std::size_t k = 0; k < out.layout.shape.size(); ++k) {
      FitParameter& s = out.layout.shape[k];
      if (s.fixed || !is_bound_of_drive(out.layout, s) || s.name.ends_with(".reach")) continue;
      s.fixed = true;
      s.prior = out.shape[static_cast<long>(k)] = no_bound(out.layout, s);
    }
  if (std::ranges::any_of(commanded, std::identity()))
    guess_drives(model, data.train, windows, from.speed_share.value_or(1.0), from.reach_share,
                 out.layout, out.shape);
  std::vector<JointFactor> factors =
      hold_absorbed(model, data.train, windows, out.layout, out.notes);
  if (count_free(out.layout) == 0.0)
    throw ModelError(
        "identify: every parameter is held, nothing is left to fit; groups of fit: "
        "inertia, armature, effects, shapes");
  out.scale = parameter_scales(out.layout, factors);
  // Horizon 0: torques of one instant. A robot that nothing drives has none to fit.
  const bool driven = std::ranges::any_of(data.train, [](const MotionStretch& s) {
    return s.command || s.u.cwiseAbs().maxCoeff() > 0.0;
  });
  if (from.reach_share < kSeldom)
    factors =
        local_factors(model, out.layout, data.train, windows, middle_motions(data.train, windows),
                      steady_windows(data.train, out.layout, out.shape));
  if (driven && !from.at_file)
    out.guess = inverse_guess(
        from.heavy_rotors
            ? with_heavy_rotors(out.layout,
                                link_inertias(model, position_range(data.train, layout.num_dofs)))
            : out.layout,
        factors);
  out.start = consistent_start(out.layout, out.scale);
  for (std::size_t k = 0; k < layout.linear.size(); ++k)
    if (out.layout.linear[k].fixed) out.start[static_cast<long>(k)] = out.layout.linear[k].prior;
  sharpen(data.noise.position, out.layout, out.shape);  // torques of one instant know no rest
  return out;
}

/// Scales are those of the links' torques, which a drive with a rotor of its own is beyond: its
/// parameters may well be as far off as they are large.
void widen_scales(const FitLayout& layout, const VecX<double>& x, VecX<double>& scale) {
  for (std::size_t k = 0; k < layout.linear.size(); ++k)
    if (const FitParameter& p = layout.linear[k]; !p.fixed && p.effect >= 0 && p.theta < 0)
      scale[static_cast<long>(k)] =
          std::max(scale[static_cast<long>(k)], std::abs(x[static_cast<long>(k)]));
}

/// A beginning at the point of a fit.
MotionBeginning where_it_is(const MotionClimb& fit, double fitted_to) {
  MotionBeginning out = fit.beginning();
  out.start = fit.fitter().now().x;
  widen_scales(out.layout, out.start, out.scale);
  out.shape = fit.fitter().now().shape;
  out.guess = {};
  out.fitted_to = fitted_to;
  return out;
}

/// Stiffness of a drive; −1: it is held.
int free_stiffness(const FitLayout& layout, std::size_t drive) {
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    const FitParameter& p = layout.linear[k];
    if (p.effect == static_cast<int>(drive) && !p.fixed && p.name.ends_with(".stiffness"))
      return static_cast<int>(k);
  }
  return -1;
}

/// The beginning with drives, rotors and friction of each joint at the scale of the model's gains,
/// unless the windows speak against it beyond doubt; at another one for which they speak as
/// strongly. Empty: they are there.
std::optional<MotionBeginning> at_other_scales(const Model& model, const MotionData& data,
                                               const MotionOptions& options, const MotionClimb& fit,
                                               double fitted_to) {
  MotionBeginning out = where_it_is(fit, fitted_to);
  const FitLayout& layout = fit.layout();
  const MotionProblem problem{model, layout, data.train, data.runs, data.noise.position, out.scale};
  const double independent = fit.independent();
  const auto misfit = [&](const VecX<double>& x) {  // −2 ln of its likelihood
    const MotionFitter at(problem, options, x, out.shape);
    const double c = at.cost(fit.at().windows);
    return std::isfinite(c) ? bic(c, 0.0, independent) : kInfinity;
  };
  const VecX<double> inertia = link_inertias(model, position_range(data.train, layout.num_dofs));
  double least = misfit(out.start);
  bool moved = false;
  for (std::size_t e = 0; e < layout.effects.size(); ++e) {
    const BoundEffect& drive = layout.effects[e];
    const int stiffness = free_stiffness(layout, e);
    if (!drive.info().has(Trait::kReadsCommand) || stiffness < 0) continue;
    const auto scaled = [&](double by) {
      VecX<double> x = out.start;
      scale_drive(layout, drive, inertia, by, x);
      return x;
    };
    const double prior = layout.linear[static_cast<std::size_t>(stiffness)].prior,
                 to_model = prior / out.start[stiffness];
    if (prior > 0.0 && std::isfinite(to_model))
      if (const double there = misfit(scaled(to_model)); there < least + kVeryStrong) {
        out.start = scaled(to_model);
        least = there;
        moved = true;
      }
    double best = 1.0, lower = prior > 0.0 ? least - kVeryStrong : least;
    for (const double by : kScales)
      if (const double there = misfit(scaled(by)); there < lower) {
        lower = there;
        best = by;
      }
    if (best != 1.0) {
      out.start = scaled(best);
      least = lower;
      moved = true;
    }
    // The smallest of scales that windows do not tell apart: beyond, the links weigh nothing, and
    // there is no end to them.
    for (int k = 0; k < kMostSmaller && !(prior > 0.0); ++k) {
      const VecX<double> smaller = scaled(kSmaller);
      if (!(misfit(smaller) < least + kVeryStrong)) break;
      out.start = smaller;
      moved = true;
    }
  }
  widen_scales(layout, out.start, out.scale);
  return moved ? std::optional(out) : std::nullopt;
}

/// A callback for races side by side: it is called by one at a time, and once it said stop, all are
/// told so. @param progress  outlives it
std::function<bool(int, double)> shared(const std::function<bool(int, double)>& progress) {
  return [&progress, lock = std::make_shared<std::mutex>(),
          stopped = std::make_shared<bool>(false)](int iteration, double objective) {
    const std::scoped_lock one_at_a_time(*lock);
    *stopped = *stopped || !progress(iteration, objective);
    return !*stopped;
  };
}

/// A race for each joint's drive, on its bench.
MotionBeginning joint_by_joint(const Model& model, const MotionData& data, const FitLayout& layout,
                               const std::vector<JointBench>& benches,
                               const std::vector<double>& ladder, const MotionOptions& options,
                               const std::function<bool(int, double)>& progress) {
  MotionBeginning out = beginning(model, data, layout, ladder.front(), {.at_file = true});
  std::vector<MotionBeginning> of_joints(benches.size());
  MotionOptions own = options;
  own.threads = 1;
  const auto one = progress ? shared(progress) : progress;
  parallel_for(benches.size(), static_cast<std::size_t>(std::max(options.threads, 1)),
               [&](std::size_t k, std::size_t) {
                 const JointBench& b = benches[k];
                 of_joints[k] = best_beginning(b.model(), b.data(), b.layout(), ladder, own, one);
               });
  for (std::size_t k = 0; k < benches.size(); ++k) {
    benches[k].put(of_joints[k], out);
    out.notes.insert(out.notes.end(), of_joints[k].notes.begin(), of_joints[k].notes.end());
  }
  return out;
}

}  // namespace

MotionBeginning best_beginning(const Model& model, const MotionData& data, const FitLayout& asked,
                               const std::vector<double>& ladder, const MotionOptions& options,
                               const std::function<bool(int, double)>& progress) {
  const double first = ladder.front(), trial = std::min(kTrial, ladder.back());
  if (std::ranges::none_of(asked.shape, [&](const FitParameter& s) {
        return !s.fixed && is_bound_of_drive(asked, s);
      }))
    return beginning(model, data, asked, first, {});
  if (const std::vector<JointBench> benches = joint_benches(model, data, asked, first);
      !benches.empty())
    return joint_by_joint(model, data, asked, benches, ladder, options, progress);
  const FitLayout layout = with_held_derivatives(asked);
  const MotionData some = pieces_of(data, layout, trial, kPieces);
  const VecX<double> limit = apart_limit(some);
  std::vector<Start> starts{{}, {.heavy_rotors = true}};
  if (has_gains(layout)) starts.push_back({.at_file = true});
  for (const double share : kSpeedShares) starts.push_back({.speed_share = share});
  for (const double share : kReachShares)
    starts.push_back({.speed_share = 1.0, .reach_share = share});
  const auto cost = [](const auto& f) { return f->fitter().now().objective; };
  double independent = 1.0, least = kInfinity;
  std::unique_ptr<MotionClimb> winner;
  for (const Start& start : starts) {
    auto own = std::make_unique<MotionClimb>(
        model, some, beginning(model, some, layout, first, start), limit, options, progress);
    MotionClimb& f = *own;
    f.begin(first);
    const auto bic_of = [&](double objective) {  // bounds must be beyond doubt
      return bic(objective, count_free(f.layout()), independent) +
             (start.speed_share ? kVeryStrong : 0.0);
    };
    // Objective at which this one would still be in the race.
    const double to_beat = std::exp((least + kVeryStrong - bic_of(1.0)) / independent);
    f.advance(trial, kOnTheWay, to_beat);
    const bool better =
        f.fitter().now().blown_up == 0 && (least == kInfinity || bic_of(cost(&f)) < least);
    if (better) {
      if (least == kInfinity) independent = f.independent();
      least = bic_of(cost(&f));
    }
    if (better || !winner) winner = std::move(own);
    if (f.fitter().now().interrupted) break;
  }
  MotionClimb* best = winner.get();
  std::vector<std::string> released;
  std::optional<MotionClimb> scaled;
  if (!best->fitter().now().interrupted)
    if (std::optional<MotionBeginning> at = at_other_scales(model, some, options, *best, trial)) {
      scaled.emplace(model, some, std::move(*at), limit, options, progress);
      scaled->begin(first);
      scaled->advance(trial, kOnTheWay);
      if (scaled->fitter().now().blown_up == 0 &&
          bic(cost(&*scaled), 0.0, independent) < bic(cost(best), 0.0, independent) + kVeryStrong)
        best = &*scaled;
    }
  if (!best->fitter().now().interrupted)
    released = release_bounds(model, some, options, true, *best);
  MotionBeginning out = where_it_is(*best, trial);
  if (const MotionData more = pieces_of(data, out.layout, trial, kMorePieces);
      more.train.size() > some.train.size() && !best->fitter().now().interrupted) {
    MotionClimb next(model, more, out, limit, options, progress);
    next.begin(first);
    next.advance(trial, kOnTheWay);
    if (next.fitter().now().blown_up == 0) {
      for (std::string& name : release_bounds(model, more, options, false, next))
        released.push_back(std::move(name));
      out = where_it_is(next, trial);
    }
  }
  if (!released.empty())
    out.notes.push_back("left at no bound, which the recording does not need: " +
                        detail::join(released));
  return out;
}

}  // namespace diffnea
