#include "identify/drive_bounds.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/text.hpp>

#include "core/constants.hpp"
#include "identify/drives.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// Windows that share threads, of which the first ones mostly decide.
constexpr std::size_t kTogether = 4;

bool is_derivative_time(const FitLayout& layout, const FitParameter& shape) {
  return is_bound_of_drive(layout, shape) && shape.name.ends_with(".derivative_time");
}

/// Value of a drive's parameter at a point of a fit; NaN: the layout has none.
double value_at(const FitLayout& layout, const MotionFit& at, int effect, const char* end) {
  const auto is_it = [&](const FitParameter& p) {
    return p.effect == effect && p.name.ends_with(end);
  };
  if (const auto p = std::ranges::find_if(layout.linear, is_it); p != layout.linear.end())
    return at.x[p - layout.linear.begin()];
  if (const auto s = std::ranges::find_if(layout.shape, is_it); s != layout.shape.end())
    return at.shape[s - layout.shape.begin()];
  return kNaN;
}

/// Bounds of drives that the fit moves, as indices of shapes.
std::vector<std::size_t> free_bounds(const FitLayout& layout) {
  std::vector<std::size_t> out;
  for (std::size_t k = 0; k < layout.shape.size(); ++k)
    if (!layout.shape[k].fixed && is_bound_of_drive(layout, layout.shape[k])) out.push_back(k);
  return out;
}

/// Fits the windows of a climb with a layout that holds other shapes, and goes on there unless that
/// is worse. Runs that blow up are not in the objective: without them it would look better.
/// @param shape  (s) where it begins, all else as it is
/// @param more   parameters that it has more
/// @param worse  ΔBIC by which it may be worse; below 0: must be better
/// @return whether it went on
bool go_on_with(FitLayout layout, const VecX<double>& shape, double more, double worse,
                const Model& model, const MotionData& data, const MotionOptions& options,
                MotionClimb& climb) {
  const MotionFit at = climb.fitter().now();
  const MotionProblem problem{
      model, layout, data.train, data.runs, data.noise.position, climb.beginning().scale};
  MotionFitter other(problem, options, at.x, shape);
  std::vector<MotionWindow> windows = climb.at().windows;
  other.fit(windows, kOnTheWay);
  const MotionFit fit = other.now();
  const double independent = climb.independent();
  if (fit.blown_up > at.blown_up ||
      bic(fit.objective, more, independent) > bic(at.objective, 0.0, independent) + worse)
    return false;
  climb.change(std::move(layout), fit.x, fit.shape, std::move(windows));
  return true;
}

/// Leaves bounds out and fits the rest anew: a delay makes up for a speed that hardly shows. A
/// bound that is not there holds back what was not seen: it must be beyond doubt.
/// @return whether the windows do without them
bool leave_out(const std::vector<std::size_t>& bounds, const Model& model, const MotionData& data,
               const MotionOptions& options, MotionClimb& climb) {
  const MotionFit at = climb.fitter().now();
  FitLayout layout = climb.layout();
  VecX<double> shape = at.shape;
  for (const std::size_t k : bounds) {
    layout.shape[k].fixed = true;
    layout.shape[k].prior = shape[static_cast<long>(k)] = no_bound(layout, layout.shape[k]);
  }
  if (!go_on_with(std::move(layout), shape, -static_cast<double>(bounds.size()), kVeryStrong, model,
                  data, options, climb))
    return false;
  climb.finish(kOnTheWay);
  return true;
}

/// Tells whether windows do as well without a bound, all else as it is.
bool is_idle(std::size_t bound, const Model& model, const MotionData& data,
             const MotionOptions& options, const MotionClimb& climb) {
  const MotionFit& at = climb.fitter().now();
  const FitLayout& layout = climb.layout();
  VecX<double> shape = at.shape;
  shape[static_cast<long>(bound)] = no_bound(layout, layout.shape[bound]);
  const MotionProblem problem{
      model, layout, data.train, data.runs, data.noise.position, climb.beginning().scale};
  const MotionFitter without(problem, options, at.x, shape);
  return does_as_well(without, climb, 1.0);
}

/// Tells whether a bound is within its error of none.
bool may_be_none(std::size_t bound, const MotionClimb& climb) {
  const MotionFit& fit = climb.fitter().now();
  const long column = fit.x.size() + static_cast<long>(bound);
  const double value = fit.shape[static_cast<long>(bound)],
               sure = kVeryStrong + std::log(climb.independent());  // squared, in its error
  return value * value <= sure * fit.covariance(column, column);
}

/// Tells whether windows, with the best states, cost less in all.
bool costs_less(const MotionFitter& at, const std::vector<MotionWindow>& windows, double most) {
  double cost = 0.0;
  for (std::size_t first = 0; first < windows.size() && cost < most; first += kTogether) {
    const auto begin = windows.begin() + static_cast<long>(first);
    std::vector<MotionWindow> some(
        begin, begin + static_cast<long>(std::min(kTogether, windows.size() - first)));
    at.fit_states(some, kOnTheWay, most - cost);
    cost += at.cost(some);
  }
  return cost < most;
}

/// Parameter of an effect of a model by its name; null: it has none.
template <class List>
auto* parameter_of(List& effects, const BoundEffect& of, const char* name) {
  using Found = decltype(effects.front().parameters.data());
  for (auto& e : effects)
    if (e.effect == of.info().name && e.where == of.where)
      for (auto& p : e.parameters)
        if (p.name == name) return Found{&p};
  return Found{nullptr};
}

}  // namespace

double bic(double objective, double free, double independent) {
  return independent * std::log(objective) + free * std::log(independent);
}

bool does_as_well(const MotionFitter& other, const MotionClimb& climb, double fewer) {
  const double independent = climb.independent(),
               most = climb.fitter().now().objective *
                      std::exp((fewer * std::log(independent) + kVeryStrong) / independent);
  const std::vector<MotionWindow>& whole = climb.at().windows;
  // A short piece of a long run mostly tells, which has a state of its own to do better by.
  const std::vector<MotionWindow> pieces = climb.pieces(kForgets);
  if (pieces.size() > whole.size() && !costs_less(other, pieces, most)) return false;
  return costs_less(other, whole, most);
}

std::vector<double> command_errors(const MotionStretch& stretch, int joint, double delay,
                                   double speed) {
  CommandPath limited;
  if (speed < kNoBound) {
    limited = *stretch.command;
    limited.limit_speed(joint, speed);
  }
  const CommandPath& led = speed < kNoBound ? limited : *stretch.command;
  std::vector<double> out;
  for (std::size_t k = 0; k < stretch.time.size(); ++k) {
    const double error = led.gain(joint) * std::abs(led.at(joint, stretch.time[k], delay) -
                                                    stretch.q(static_cast<long>(k), joint));
    if (std::isfinite(error)) out.push_back(error);
  }
  return out;
}

double largest_error(const MotionStretch& stretch, int joint, double delay, double speed) {
  double most = 0.0;
  for (const double error : command_errors(stretch, joint, delay, speed))
    most = std::max(most, error);
  return most;
}

double saturated_share(const std::vector<MotionStretch>& stretches, int joint, double delay,
                       double speed, double reach) {
  long on = 0, saturated = 0;
  for (const MotionStretch& s : stretches) {
    if (!s.command) continue;
    const std::vector<double> errors = command_errors(s, joint, delay, speed);
    on += static_cast<long>(errors.size());
    saturated += std::ranges::count_if(errors, [&](double e) { return e >= reach; });
  }
  return on > 0 ? static_cast<double>(saturated) / static_cast<double>(on) : 0.0;
}

double largest_rate(const MotionStretch& stretch, int joint) {
  double most = 0.0;
  for (const double t : stretch.time) {
    const double rate =
        (stretch.command->at(joint, t, 0.0) - stretch.command->at(joint, t, kMostDelay)) /
        kMostDelay;
    if (std::abs(rate) > most) most = std::abs(rate);
  }
  return most;
}

bool is_bound_of_drive(const FitLayout& layout, const FitParameter& shape) {
  return shape.effect >= 0 && !shape.name.ends_with(".delay") &&
         layout.effects[static_cast<std::size_t>(shape.effect)].info().has(Trait::kReadsCommand);
}

double no_bound(const FitLayout& layout, const FitParameter& shape) {
  return layout.effects[static_cast<std::size_t>(shape.effect)]
      .parameter_info[static_cast<std::size_t>(shape.index)]
      .initial;
}

void hold_bounds_off(FitLayout& layout, VecX<double>& shape) {
  for (std::size_t k = 0; k < layout.shape.size(); ++k) {
    FitParameter& s = layout.shape[k];
    if (s.fixed || !is_bound_of_drive(layout, s)) continue;
    s.fixed = true;
    s.prior = shape[static_cast<long>(k)] = no_bound(layout, s);
  }
}

std::vector<std::string> release_bounds(const Model& model, const MotionData& data,
                                        const MotionOptions& options, bool all,
                                        MotionClimb& climb) {
  std::vector<std::size_t> bounds = free_bounds(climb.layout());
  const auto is_left_out = [&] {
    return !bounds.empty() && leave_out(bounds, model, data, options, climb);
  };
  if (!all || !is_left_out()) {
    climb.set_covariance();
    std::vector<std::size_t> idle;
    std::erase_if(bounds, [&](std::size_t k) {
      if (is_idle(k, model, data, options, climb))
        idle.push_back(k);
      else
        return !may_be_none(k, climb);
      return false;
    });
    if (!is_left_out()) {
      bounds = idle;
      if (!is_left_out()) return {};
    }
  }
  std::vector<std::string> names;
  for (const std::size_t k : bounds) names.push_back(climb.layout().shape[k].name);
  return names;
}

FitLayout with_held_derivatives(FitLayout layout) {
  for (FitParameter& s : layout.shape) s.fixed = s.fixed || is_derivative_time(layout, s);
  return layout;
}

void free_derivatives(const FitLayout& asked, const Model& model, const MotionData& data,
                      const MotionOptions& options, MotionClimb& climb) {
  const MotionFit at = climb.fitter().now();
  FitLayout layout = climb.layout();
  VecX<double> shape = at.shape;
  double freed = 0.0;
  for (std::size_t k = 0; k < asked.shape.size(); ++k) {
    if (asked.shape[k].fixed || !is_derivative_time(asked, asked.shape[k])) continue;
    const auto value = [&](const char* end) {
      return value_at(layout, at, layout.shape[k].effect, end);
    };
    if (!(value(".reach") < kNoBound) || !(value(".stiffness") > 0.0)) continue;
    layout.shape[k].fixed = false;
    shape[static_cast<long>(k)] = value(".damping") / value(".stiffness");
    freed += 1.0;
  }
  if (freed == 0.0) return;
  go_on_with(std::move(layout), shape, freed, -kVeryStrong, model, data, options, climb);
}

void keep_described_torques(const Model& described, const MotionData& data,
                            const MotionOptions& options, const MotionClimb& climb,
                            IdentifyResult& fitted) {
  const FitLayout& layout = climb.layout();
  const MotionFit& fit = climb.fitter().now();
  std::vector<std::string> kept, refuted;
  for (std::size_t k = 0; k < layout.shape.size(); ++k) {
    const FitParameter& reach = layout.shape[k];
    if (!is_bound_of_drive(layout, reach) || !reach.name.ends_with(".reach") ||
        fit.shape[static_cast<long>(k)] < kNoBound)
      continue;
    const BoundEffect& drive = layout.effects[static_cast<std::size_t>(reach.effect)];
    const auto gain = std::ranges::find_if(layout.linear, [&](const FitParameter& p) {
      return p.effect == reach.effect && p.name.ends_with(".stiffness");
    });
    const EffectParameter *told_gain = parameter_of(described.effects, drive, "stiffness"),
                          *told_reach = parameter_of(described.effects, drive, "reach");
    EffectParameter* now = parameter_of(fitted.model.effects, drive, "reach");
    if (gain == layout.linear.end() || !told_gain || !told_reach || !now ||
        !(told_reach->value < kNoBound))
      continue;
    const double bound = told_gain->value * told_reach->value / fit.x[gain - layout.linear.begin()];
    if (!(bound > 0.0) || !(bound < kNoBound)) continue;
    VecX<double> shape = fit.shape;
    shape[static_cast<long>(k)] = bound;
    const MotionProblem problem{
        described, layout, data.train, data.runs, data.noise.position, climb.beginning().scale};
    if (!does_as_well(MotionFitter(problem, options, fit.x, shape), climb, 0.0)) {
      refuted.push_back(drive.where);
      continue;
    }
    kept.push_back(drive.where);
    now->value = bound;
    for (ParameterEstimate& p : fitted.parameters)
      if (p.name == reach.name) p.value = p.prior = bound;
  }
  if (!kept.empty())
    fitted.notes.push_back(
        "the largest torque of the description stays where no run tells of it: " +
        detail::join(kept));
  if (!refuted.empty())
    fitted.notes.push_back(
        "the largest torque of the description is left out where runs are simulated better "
        "without it: " +
        detail::join(refuted));
}

}  // namespace diffnea
