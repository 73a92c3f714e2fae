#include "identify/motion_race.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <ranges>
#include <set>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

#include "core/constants.hpp"
#include "identify/drives.hpp"
#include "identify/local_factors.hpp"

namespace diffnea {
namespace {

/// Horizon up to which beginnings compete [s]: some delays and swings of a servo.
constexpr double kTrial = 1.0;
/// ΔBIC that is very strong evidence (Kass, Raftery 1995).
constexpr double kVeryStrong = 10.0;

/// BIC of fits to the same positions.
/// @param independent  errors among them
double bic(double objective, double free, double independent) {
  return independent * std::log(objective) + free * std::log(independent);
}

double count_free(const FitLayout& layout) {
  const auto is_free = [](const FitParameter& p) { return !p.fixed; };
  return static_cast<double>(std::ranges::count_if(layout.linear, is_free) +
                             std::ranges::count_if(layout.shape, is_free));
}

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

/// Pieces of the horizon's length: those in which bounds act most, and others drawn at random, as
/// many as each of a joint's parameters needs.
MotionData pieces_of(const MotionData& data, const FitLayout& layout, double horizon) {
  constexpr double kPieces = 5.0;  // a parameter, as clusters of a covariance
  std::vector<MotionStretch> all;
  for (const MotionWindow& w : cut_windows(data.train, horizon)) {
    const MotionStretch& s = data.train[w.stretch];
    const auto time = s.time.begin() + w.first;
    all.push_back({s.run,
                   {time, time + w.rows},
                   s.q.middleRows(w.first, w.rows),
                   s.u.middleRows(w.first, w.rows),
                   s.u_end.middleRows(w.first, w.rows),
                   s.command});
  }
  const double needed = kPieces * count_free(layout) / layout.num_dofs;
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

/// Linear parameters that fit the torques of one instant; empty where these are too few.
VecX<double> inverse_guess(const FitLayout& layout, const std::vector<JointFactor>& factors) {
  try {
    return fit_linear(layout, factors).x;
  } catch (const DataError&) {
    return {};
  }
}

void hold_bounds_off(FitLayout& layout, VecX<double>& shape) {
  for (std::size_t k = 0; k < layout.shape.size(); ++k) {
    FitParameter& s = layout.shape[k];
    if (s.fixed || !is_bound_of_drive(layout, s)) continue;
    s.fixed = true;
    s.prior = shape[static_cast<long>(k)] = no_bound(layout, s);
  }
}

/// The layout with rotors that rule what the joints feel: behind a high gear they do. What no
/// torque tells is begun at from the links, and from there.
FitLayout with_heavy_rotors(FitLayout layout, const Model& model, const PositionRange& range) {
  constexpr double kHeavy = 10.0;  // over the inertia that the links have about the joint
  const VecX<double> q = 0.5 * (range.low + range.high);
  MassMatrixWorkspace<double, double> ws;
  const MatX<double> M = mass_matrix<double, double>(make_tree(model), q, ws);
  for (FitParameter& p : layout.linear) {
    if (p.fixed || p.effect < 0) continue;
    const BoundEffect& e = layout.effects[static_cast<std::size_t>(p.effect)];
    if (e.info().name != "armature") continue;
    p.fixed = true;
    p.prior = std::max(p.prior, kHeavy * M(e.joints.front(), e.joints.front()));
  }
  return layout;
}

/// Where a fit of drives begins.
struct Start {
  std::optional<double> speed_share{};  ///< one of kSpeedShares; none: no bounds at all
  bool heavy_rotors = false;
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
  if (std::ranges::any_of(commanded, std::identity()))
    guess_drives(model, data.train, windows, from.speed_share.value_or(1.0), out.layout, out.shape);
  const std::vector<JointFactor> factors =
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
  if (driven)
    out.guess = inverse_guess(
        from.heavy_rotors
            ? with_heavy_rotors(out.layout, model, position_range(data.train, layout.num_dofs))
            : out.layout,
        factors);
  out.start = consistent_start(out.layout, out.scale);
  for (std::size_t k = 0; k < layout.linear.size(); ++k)
    if (out.layout.linear[k].fixed) out.start[static_cast<long>(k)] = out.layout.linear[k].prior;
  return out;
}

}  // namespace

MotionBeginning best_beginning(const Model& model, const MotionData& data, const FitLayout& layout,
                               const std::vector<double>& ladder, const MotionOptions& options,
                               const std::function<bool(int, double)>& progress) {
  const double first = ladder.front();
  if (std::ranges::none_of(layout.shape, [&](const FitParameter& s) {
        return !s.fixed && is_bound_of_drive(layout, s);
      }))
    return beginning(model, data, layout, first, {});
  const MotionData some = pieces_of(data, layout, std::min(kTrial, ladder.back()));
  const VecX<double> limit = apart_limit(some);
  std::vector<std::unique_ptr<MotionClimb>> fits;
  std::vector<Start> starts{{}, {.heavy_rotors = true}};
  for (const double share : kSpeedShares) starts.push_back({.speed_share = share});
  for (const Start& start : starts) {
    fits.push_back(std::make_unique<MotionClimb>(
        model, some, beginning(model, some, layout, first, start), limit, options, progress));
    fits.back()->begin(first);
  }
  for (const double horizon : ladder) {
    if (horizon > kTrial) break;
    std::vector<std::unique_ptr<MotionClimb>> up;
    const auto cost = [](const auto& f) { return f->fitter().now().objective; };
    double independent = 1.0, best = kInfinity;
    const auto of = [&](const auto& f) {
      return bic(cost(f), count_free(f->layout()), independent);
    };
    for (std::unique_ptr<MotionClimb>& f : fits) {
      // Objective at which this one would still be in the race.
      const double to_beat =
          std::exp((best + kVeryStrong - bic(1.0, count_free(f->layout()), independent)) / independent);
      if (f->advance(horizon, kOnTheWay, to_beat) != Rung::kReached || !f->whole() ||
          f->fitter().now().blown_up > 0)
        continue;
      if (up.empty() || cost(f) < cost(up.front())) {
        independent = f->independent();
        up.insert(up.begin(), std::move(f));
      } else {
        up.push_back(std::move(f));
      }
      best = std::ranges::min(up | std::views::transform(of));
      if (up.front()->fitter().now().interrupted) break;
    }
    if (up.empty()) break;  // none holds together for so long
    std::erase(fits, nullptr);
    fits = std::move(up);
    std::ranges::sort(fits, {}, of);
    std::erase_if(fits, [&](const auto& f) { return of(f) > best + kVeryStrong; });
    if (fits.front()->fitter().now().interrupted) break;
  }
  MotionBeginning out = fits.front()->beginning();
  out.start = fits.front()->fitter().now().x;
  out.shape = fits.front()->fitter().now().shape;
  out.guess = {};
  out.fitted_to = fits.front()->reached();
  return out;
}

std::vector<std::string> release_bounds(const Model& model, const MotionData& data,
                                        const MotionOptions& options, MotionClimb& climb) {
  const MotionFit at = climb.fitter().now();
  const double independent = climb.independent();
  const auto is_enough = [&](double objective, double bounds) {
    return bic(objective, 0.0, independent) < bic(at.objective, bounds, independent);
  };
  FitLayout layout = climb.layout();
  std::vector<std::size_t> bounds;
  for (std::size_t k = 0; k < layout.shape.size(); ++k)
    if (!layout.shape[k].fixed && is_bound_of_drive(layout, layout.shape[k])) bounds.push_back(k);
  if (bounds.empty()) return {};
  // All at once, the others fitted beside: a delay makes up for a speed that hardly shows.
  VecX<double> x = at.x, shape = at.shape;
  std::vector<MotionWindow> windows = climb.at().windows;
  hold_bounds_off(layout, shape);
  const MotionProblem problem{model, layout, data.train, data.runs, data.noise.position,
                              climb.beginning().scale};
  MotionFitter without(problem, options, x, shape);
  without.fit(windows, kOnTheWay);
  std::vector<std::string> left_out;
  // Runs that blow up are not in the objective: without them it would look better.
  if (without.now().blown_up <= at.blown_up &&
      is_enough(without.now().objective, static_cast<double>(bounds.size()))) {
    for (const std::size_t k : bounds) left_out.push_back(layout.shape[k].name);
    climb.change(layout, without.now().x, without.now().shape, std::move(windows));
  } else {
    layout = climb.layout();
    shape = at.shape;
    for (const std::size_t k : bounds) {
      VecX<double> one = shape;
      one[static_cast<long>(k)] = no_bound(layout, layout.shape[k]);
      const MotionFitter tried(problem, options, x, one);
      std::vector<MotionWindow> at_best = climb.at().windows;
      tried.fit_states(at_best, kOnTheWay);
      if (!is_enough(tried.cost(at_best), 1.0)) continue;
      layout.shape[k].fixed = true;
      layout.shape[k].prior = shape[static_cast<long>(k)] = one[static_cast<long>(k)];
      left_out.push_back(layout.shape[k].name);
    }
    if (!left_out.empty()) climb.change(layout, x, shape, climb.at().windows);
  }
  if (!left_out.empty()) climb.finish(options.tolerance);
  return left_out;
}

}  // namespace diffnea
