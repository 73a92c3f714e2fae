#include "identify/gears.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "identify/drives.hpp"
#include "identify/motion_race.hpp"

namespace diffnea {
namespace {

/// Stiffness of flanks over the drive's: under any torque they give way by 2 % of what the drive
/// does, whose gain a fit knows no better. Rigid ones would ring faster than any log shows.
constexpr double kFlank = 50.0;
/// Factor between neighbouring sizes of springs, and of gaps: teeth that meet in another order are
/// another minimum.
constexpr double kSpringStep = 3.0, kGapStep = 1.6;
/// Smallest gap over the noise of a position: its two flanks are that far apart for certain.
constexpr double kGapNoises = 4.0;
/// Windows in which sizes compete, and steps of each.
constexpr std::size_t kMostWindows = 20;
constexpr int kSteps = 4;

/// Values of an effect's parameters into the layout and the shapes of a beginning.
void take_shapes(std::size_t effect, MotionBeginning& of) {
  for (std::size_t s = 0; s < of.layout.shape.size(); ++s) {
    FitParameter& p = of.layout.shape[s];
    if (p.effect != static_cast<int>(effect)) continue;
    const double value = of.layout.effects[effect].parameters[static_cast<std::size_t>(p.index)];
    of.shape[static_cast<long>(s)] = value;
    if (p.fixed) p.prior = value;
  }
}

/// The shape that is a gear's size; −1: it is held.
int free_size(const FitLayout& layout, std::size_t effect) {
  for (std::size_t s = 0; s < layout.shape.size(); ++s) {
    const FitParameter& p = layout.shape[s];
    if (p.effect == static_cast<int>(effect) && !p.fixed &&
        p.index == static_cast<int>(gear_size(layout.effects[effect])))
      return static_cast<int>(s);
  }
  return -1;
}

/// Shape of a joint's drive by the end of its name; `none`: it has no such shape.
double drive_shape(const FitLayout& layout, const VecX<double>& shape, int joint, const char* end,
                   double none) {
  for (std::size_t k = 0; k < layout.shape.size(); ++k) {
    const FitParameter& p = layout.shape[k];
    if (p.effect < 0 || !p.name.ends_with(end)) continue;
    const BoundEffect& e = layout.effects[static_cast<std::size_t>(p.effect)];
    if (e.info().has(Trait::kReadsCommand) && std::ranges::find(e.joints, joint) != e.joints.end())
      return shape[static_cast<long>(k)];
  }
  return none;
}

/// Error at which a joint's drive saturates [rad] or [m]; kNoBound: nowhere, or none leads it.
double drive_reach(const FitLayout& layout, const VecX<double>& shape, int joint) {
  return drive_shape(layout, shape, joint, ".reach", kNoBound);
}

}  // namespace

std::vector<MotionWindow> some_pieces(const std::vector<MotionStretch>& stretches,
                                      const std::vector<MotionWindow>& windows, double horizon) {
  std::vector<MotionWindow> all = cut_windows(stretches, horizon, windows), out;
  const std::size_t every = (all.size() + kMostWindows - 1) / kMostWindows;
  for (std::size_t k = 0; k < all.size(); k += std::max<std::size_t>(every, 1))
    out.push_back(std::move(all[k]));
  return out;
}

bool has_gears(const FitLayout& layout) { return std::ranges::any_of(layout.effects, hides_motor); }

double drive_gain(const FitLayout& layout, const VecX<double>& x, int joint) {
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    const FitParameter& p = layout.linear[k];
    if (p.effect < 0 || !p.name.ends_with(".stiffness")) continue;
    const BoundEffect& e = layout.effects[static_cast<std::size_t>(p.effect)];
    if (e.info().has(Trait::kReadsCommand) && std::ranges::find(e.joints, joint) != e.joints.end())
      return x[static_cast<long>(k)];
  }
  return 0.0;
}

double rotor_of(const FitLayout& layout, const VecX<double>& x, int joint) {
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    const FitParameter& p = layout.linear[k];
    if (p.effect < 0) continue;
    const BoundEffect& e = layout.effects[static_cast<std::size_t>(p.effect)];
    if (e.info().has(Trait::kRotor) && std::ranges::find(e.joints, joint) != e.joints.end())
      return x[static_cast<long>(k)];
  }
  return 0.0;
}

std::size_t gear_size(const BoundEffect& gear) {
  const auto searched = [](const ParameterInfo& p) { return !p.search.empty(); };
  return static_cast<std::size_t>(std::ranges::find_if(gear.parameter_info, searched) -
                                  gear.parameter_info.begin());
}

std::vector<double> gear_sizes(const BoundEffect& gear, const FitLayout& layout,
                               const VecX<double>& x, const VecX<double>& shape,
                               const MotionData& data) {
  std::vector<double> out = gear.parameter_info[gear_size(gear)].search;
  const int joint = gear.joints.front();
  const double gain = drive_gain(layout, x, joint);
  const double noise = data.noise.position[joint];
  const bool spring = gear.info().motor == HiddenMotor::kSpring;
  if (!spring) {
    const double most = out.back();
    out.clear();
    for (double gap = kGapNoises * noise; gap < most; gap *= kGapStep) out.push_back(gap);
  } else if (gain > 0.0) {
    double error = 0.0;
    for (const MotionStretch& s : data.train)
      if (s.command) error = std::max(error, largest_error(s, joint, 0.0, kNoBound));
    error = std::min(error, drive_reach(layout, shape, joint));
    out.clear();
    for (double k = gain; k * noise < gain * error; k *= kSpringStep) out.push_back(k);
    std::ranges::reverse(out);
  } else {
    std::ranges::reverse(out);
  }
  return out;
}

void set_flanks(double gain, double rotor, BoundEffect& gear) {
  if (gear.info().motor == HiddenMotor::kSpring) return;
  for (std::size_t k = 0; k < gear.parameters.size(); ++k) {
    const ParameterInfo& p = gear.parameter_info[k];
    if (p.name == "stiffness" && gear.parameters[k] == p.initial && gain > 0.0)
      gear.parameters[k] = kFlank * gain;
    // Bounces are over before a log shows them, and each is a kink of the run.
    if (p.name == "restitution" && gear.parameters[k] == p.initial) gear.parameters[k] = 0.0;
    if (p.name == "motor_inertia") gear.parameters[k] = std::max(rotor, 0.0);
  }
}

double flank_give(const BoundEffect& gear, const FitLayout& layout, const VecX<double>& x,
                  const VecX<double>& shape, const MotionData& data) {
  if (gear.info().motor == HiddenMotor::kSpring) return 0.0;
  const int joint = gear.joints.front();
  const double reach = drive_reach(layout, shape, joint),
               delay = drive_shape(layout, shape, joint, ".delay", 0.0),
               speed = drive_shape(layout, shape, joint, ".speed", kNoBound);
  double sum = 0.0, rows = 0.0;
  for (const MotionStretch& s : data.train) {
    if (!s.command) continue;
    for (const double error : command_errors(s, joint, delay, speed)) {
      sum += std::min(error, reach);
      rows += 1.0;
    }
  }
  return rows > 0.0 ? 2.0 * drive_gain(layout, x, joint) * sum / rows / motor_spring(gear).stiffness
                    : 0.0;
}

void set_rotors(Model& model) {
  const bool any = std::ranges::any_of(model.effects, [](const EffectSpec& e) {
    return find_effect(e.effect).motor != HiddenMotor::kNone;
  });
  if (!any) return;
  const Tree<double> tree = make_tree(model);
  for (EffectSpec& spec : model.effects) {
    if (find_effect(spec.effect).motor == HiddenMotor::kNone) continue;
    const BoundEffect e = bind(spec, model);
    if (e.joints.size() != 1) continue;
    spec = to_spec(e);
    for (EffectParameter& p : spec.parameters)
      if (p.name == "motor_inertia")
        p.value = tree.links[static_cast<std::size_t>(e.links.front())].armature;
  }
}

LayoutPart without(const FitLayout& layout,
                   const std::function<bool(const BoundEffect&)>& leave_out) {
  LayoutPart out;
  out.layout = layout;
  out.layout.effects.clear();
  out.layout.shape.clear();
  std::vector<int> now(layout.effects.size(), -1);
  for (std::size_t e = 0; e < layout.effects.size(); ++e) {
    if (leave_out(layout.effects[e])) continue;
    now[e] = static_cast<int>(out.effects.size());
    out.effects.push_back(static_cast<int>(e));
    out.layout.effects.push_back(layout.effects[e]);
  }
  for (FitParameter& p : out.layout.linear)
    if (p.effect >= 0) p.effect = now[static_cast<std::size_t>(p.effect)];
  for (std::size_t s = 0; s < layout.shape.size(); ++s) {
    FitParameter p = layout.shape[s];
    if (p.effect >= 0 && now[static_cast<std::size_t>(p.effect)] < 0) continue;
    if (p.effect >= 0) p.effect = now[static_cast<std::size_t>(p.effect)];
    out.layout.shape.push_back(std::move(p));
    out.shapes.push_back(static_cast<int>(s));
  }
  return out;
}

MotionBeginning beginning_with_gears(const Model& model, const MotionData& data,
                                     const FitLayout& layout, const std::vector<double>& ladder,
                                     const MotionOptions& options,
                                     const std::function<bool(int, double)>& progress) {
  Model rigid = model;
  std::erase_if(rigid.effects, [](const EffectSpec& e) {
    return find_effect(e.effect).motor != HiddenMotor::kNone;
  });
  const LayoutPart part = without(layout, hides_motor);
  const MotionBeginning from = best_beginning(rigid, data, part.layout, ladder, options, progress);
  MotionBeginning out = from;
  out.layout.effects = layout.effects;
  out.layout.shape = layout.shape;
  for (std::size_t e = 0; e < part.effects.size(); ++e)
    out.layout.effects[static_cast<std::size_t>(part.effects[e])] = from.layout.effects[e];
  for (FitParameter& p : out.layout.linear)
    if (p.effect >= 0) p.effect = part.effects[static_cast<std::size_t>(p.effect)];
  out.shape.resize(static_cast<long>(layout.shape.size()));
  for (std::size_t s = 0; s < layout.shape.size(); ++s)
    out.shape[static_cast<long>(s)] = layout.shape[s].prior;
  for (std::size_t s = 0; s < part.shapes.size(); ++s) {
    FitParameter p = from.layout.shape[s];
    if (p.effect >= 0) p.effect = part.effects[static_cast<std::size_t>(p.effect)];
    out.layout.shape[static_cast<std::size_t>(part.shapes[s])] = std::move(p);
    out.shape[part.shapes[s]] = from.shape[static_cast<long>(s)];
  }
  if (out.guess.size() > 0) out.start = out.guess;
  out.guess = {};
  std::vector<std::size_t> searched;
  std::vector<std::vector<double>> sizes;
  for (std::size_t e = 0; e < layout.effects.size(); ++e) {
    BoundEffect& gear = out.layout.effects[e];
    if (!hides_motor(gear)) continue;
    const double gain = drive_gain(out.layout, out.start, gear.joints.front());
    set_flanks(gain, rotor_of(out.layout, out.start, gear.joints.front()), gear);
    const std::size_t size = gear_size(gear);
    const bool given = gear.parameters[size] != gear.parameter_info[size].initial;
    if (!given && free_size(out.layout, e) >= 0) {
      const std::vector<double> of = gear_sizes(gear, out.layout, out.start, out.shape, data);
      if (!of.empty()) {
        gear.parameters[size] = of.front();
        searched.push_back(e);
        sizes.push_back(of);
      }
    }
    take_shapes(e, out);
  }
  MotionOptions few = options;
  few.max_iterations = kSteps;
  std::vector<MotionWindow> windows =
      some_pieces(data.train, cut_windows(data.train, ladder.back()), kTrialOfGears);
  set_measured_states(data.train, ladder.front(), windows);
  const MotionProblem problem{model,     out.layout,          data.train,
                              data.runs, data.noise.position, out.scale};
  for (std::size_t k = 0; k < searched.size(); ++k) {
    const int shape = free_size(out.layout, searched[k]);
    MotionFit best;
    double least = kInfinity;
    for (const double size : sizes[k]) {
      VecX<double> at = out.shape;
      at[shape] = size;
      MotionFitter fitter(problem, few, out.start, at, progress);
      std::vector<MotionWindow> of = windows;
      fitter.fit(of, 1e-3);
      const MotionFit& fit = fitter.now();
      if (fit.interrupted) return out;
      if (fit.blown_up > 0 || !(fit.objective < least)) continue;
      least = fit.objective;
      best = fit;
    }
    if (least == kInfinity) continue;
    out.start = best.x;
    out.shape = best.shape;
  }
  return out;
}

}  // namespace diffnea
