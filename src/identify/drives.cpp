#include "identify/drives.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include <diffnea/core/text.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/recording/commands.hpp>

#include "core/constants.hpp"
#include "identify/ball_identify.hpp"

namespace diffnea {
namespace {

/// Steps of the delays that are looked at, and the finest of them [s].
constexpr double kDelayStep = 0.02, kFinestDelay = 4e-3;
/// Delay and bounds of a drive.
struct Bounds {
  double delay = 0.0, speed = kNoBound, reach = kNoBound;
};

/// Where a drive's fit may begin.
struct Guess {
  std::size_t effect = 0;
  double most_rate = 0.0;   // largest rate of the commands [rad/s] or [m/s]
  double most_error = 0.0;  // largest error of the position [rad] or [m]
  Bounds best = {};
  double left = kInfinity;  // Σ e² of its joint there, or its mean
};

/// Rows in which the joint's drive is off.
std::size_t count_off(const Recording& r, int joint) {
  const CommandPath path = command_path(r);
  return static_cast<std::size_t>(
      std::ranges::count_if(r.time, [&](double t) { return std::isnan(path.at(joint, t, 0.0)); }));
}

/// @throws DataError for a joint with commands whose drive is off in every row
void require_a_drive_that_is_on(const std::vector<Recording>& recordings, int joint,
                                const std::string& name) {
  const bool off = std::ranges::all_of(recordings, [&](const Recording& r) {
    return count_off(r, joint) == static_cast<std::size_t>(r.time.size());
  });
  if (off)
    throw DataError(recordings.front().source + ": the drive of '" + name +
                    "' is off in every row (torque_enable), so that nothing tells of it; to fit "
                    "friction to its swing, name it passive (--passive " +
                    name + ")");
}

/// The joint's drive as an effect of the model: as a fit has left it there, else as the file has
/// it, else one that does nothing.
EffectSpec& drive_at(Model& model, const std::string& joint) {
  for (EffectSpec& e : model.effects)
    if (e.where == joint && find_effect(e.effect).has(Trait::kReadsCommand)) return e;
  EffectSpec servo{"position_servo", joint, {{"stiffness", 0.0, ""}, {"damping", 0.0, ""}}};
  const ModelLink& link = *std::ranges::find(model.links, joint, &ModelLink::joint);
  if (link.servo) {
    servo.parameters = {{"stiffness", link.servo->kp, ""}, {"damping", link.servo->kd, ""}};
    if (std::isfinite(link.limits.effort) && link.limits.effort > 0.0 && link.servo->kp > 0.0) {
      servo.parameters.push_back({"reach", link.limits.effort / link.servo->kp, ""});
      if (link.servo->kd > 0.0)
        servo.parameters.push_back({"derivative_time", link.servo->kd / link.servo->kp, ""});
    }
  }
  model.effects.push_back(std::move(servo));
  return model.effects.back();
}

bool is_asked_for(const FitChoice& choice, const std::string& effect) {
  const auto names = [&](const std::string& entry) { return entry.find(effect) != entry.npos; };
  return (choice.effects && std::ranges::any_of(*choice.effects, names)) ||
         std::ranges::any_of(choice.fix, names);
}

/// Begins effects that follow the supply of a joint's drive, where they are asked for, at the one
/// that was logged.
/// @throws DataError if none was
void begin_at_supply(Model& model, const std::vector<Recording>& sample, int joint,
                     const std::string& name, const FitChoice& choice) {
  if (!choice.effects) return;
  for (const std::string& entry : *choice.effects) {
    const std::string effect = entry.substr(0, entry.find('@'));
    if (!find_effect(effect).has(Trait::kReadsSupply) ||
        (entry != effect && entry != effect + "@" + name))
      continue;
    if (std::ranges::any_of(model.effects, [&](const EffectSpec& e) {
          return e.effect == effect && e.where == name;
        }))
      continue;
    const double volts = median_supply(sample, joint);
    if (!(volts > 0.0))
      throw DataError(
          sample.front().source + ": " + effect + " at '" + name +
          "' needs the supply of the drive, and no row has one: expected a column voltage or "
          "voltage_" +
          name +
          " [V] with values above 0; map it (--map \"COLUMN=voltage [V]\"), or leave the effect "
          "out");
    model.effects.push_back({effect, name, {{"nominal", volts, "V"}}});
  }
}

/// Begins what a joint's drive is told beside its position: until a log says otherwise, drives give
/// the torque that they are told.
/// @return false: the caller's list of effects leaves it out
bool begin_fed(Model& model, const std::string& joint, const FitChoice& choice) {
  if (choice.effects && !is_asked_for(choice, "feed_forward")) return false;
  const auto is_it = [&](const EffectSpec& e) {
    return e.effect == "feed_forward" && e.where == joint;
  };
  if (std::ranges::none_of(model.effects, is_it))
    model.effects.push_back({"feed_forward", joint, {{"share", 1.0, ""}}});
  return true;
}

/// Beside a drive that is always on, viscous friction is one with what the motor brakes: held
/// beside it, it would bound the sum from below.
/// @return whether the model had some
bool give_friction_to_drive(Model& model, const std::string& joint) {
  double viscous = 0.0;
  const std::size_t there = model.effects.size();
  std::erase_if(model.effects, [&](const EffectSpec& e) {
    if (e.effect != "viscous_friction" || e.where != joint) return false;
    for (const EffectParameter& p : e.parameters) viscous += p.value;
    return true;
  });
  if (model.effects.size() == there) return false;
  EffectSpec& drive = drive_at(model, joint);
  const auto damping = std::ranges::find(drive.parameters, "damping", &EffectParameter::name);
  if (damping != drive.parameters.end())
    damping->value += viscous;
  else
    drive.parameters.push_back({"damping", viscous, ""});
  return true;
}

}  // namespace

std::vector<bool> commanded_joints(const FitLayout& layout) {
  std::vector<bool> out(static_cast<std::size_t>(layout.num_dofs), false);
  for (const BoundEffect& e : layout.effects)
    if (e.info().has(Trait::kReadsCommand))
      for (const int j : e.joints) out[static_cast<std::size_t>(j)] = true;
  return out;
}

bool is_rotor(const FitLayout& layout, const FitParameter& p) {
  return p.effect >= 0 &&
         layout.effects[static_cast<std::size_t>(p.effect)].info().name == "armature";
}

VecX<double> link_inertias(Model model, const PositionRange& range) {
  model.effects.clear();
  const VecX<double> q = 0.5 * (range.low + range.high);
  MassMatrixWorkspace<double, double> ws;
  return mass_matrix<double, double>(make_tree(model), q, ws).diagonal();
}

void scale_drive(const FitLayout& layout, const BoundEffect& drive, const VecX<double>& inertia,
                 double by, VecX<double>& x) {
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    const FitParameter& p = layout.linear[k];
    if (p.fixed || p.effect < 0 || p.theta >= 0 || p.unit == "1") continue;
    if (layout.effects[static_cast<std::size_t>(p.effect)].joints != drive.joints) continue;
    double& value = x[static_cast<long>(k)];
    const double links = is_rotor(layout, p) ? inertia[drive.joints.front()] : 0.0;
    value = links > 0.0 ? std::max(by * (value + links) - links, 0.0) : by * value;
  }
}

void require_a_scale(const std::vector<MotionStretch>& stretches, const FitLayout& layout) {
  const FitParameter *gain = nullptr, *mass = nullptr;
  for (const FitParameter& p : layout.linear)
    if (!p.fixed && p.name.ends_with(".stiffness") && p.effect >= 0 &&
        layout.effects[static_cast<std::size_t>(p.effect)].info().has(Trait::kReadsCommand))
      gain = &p;
  const auto is_unknown = [&](const MotionStretch& s) {
    return std::ranges::any_of(layout.linear, [&](const FitParameter& p) {
      if (p.fixed || p.theta != 0 || p.effect < 0) return false;
      mass = &p;
      const std::vector<int>& runs = layout.effects[static_cast<std::size_t>(p.effect)].runs;
      return runs.empty() || std::ranges::find(runs, s.run) != runs.end();
    });
  };
  if (gain && std::ranges::all_of(stretches, is_unknown) && mass)
    throw ModelError("identify: " + mass->name + " and " + gain->name +
                     " are both unknown in all recordings, and without a torque only their ratio "
                     "is told. Give one: --fix \"" +
                     mass->name +
                     "=KG\" (a sidecar's payload, "
                     "weighed), --fix \"" +
                     gain->name + "=K\", or a recording without a payload");
}

void bound_delays(const VecX<double>& period, FitLayout& layout) {
  for (FitParameter& s : layout.shape) {
    if (s.effect < 0 || !s.name.ends_with(".delay")) continue;
    const BoundEffect& e = layout.effects[static_cast<std::size_t>(s.effect)];
    if (e.info().has(Trait::kReadsCommand)) s.least = -period[e.joints.front()];
  }
}

void hold_without_commands(const std::vector<MotionStretch>& stretches,
                           const std::vector<std::string>& joints, FitLayout& layout,
                           std::vector<std::string>& notes) {
  for (FitParameter& s : layout.shape) {
    if (s.effect < 0) continue;
    const BoundEffect& e = layout.effects[static_cast<std::size_t>(s.effect)];
    s.fixed = s.fixed || (e.info().has(Trait::kReadsSupply) &&
                          std::ranges::none_of(stretches, [&](const MotionStretch& m) {
                            return m.command && m.command->supply(e.joints.front(), 0.0) > 0.0;
                          }));
  }
  for (FitParameter& p : layout.linear) {
    if (p.effect < 0) continue;
    const BoundEffect& e = layout.effects[static_cast<std::size_t>(p.effect)];
    const int j = e.joints.front();
    p.fixed =
        p.fixed || (e.info().has(Trait::kFedForward) &&
                    std::ranges::none_of(stretches, [&](const MotionStretch& m) {
                      return m.command && (p.name.ends_with(".share") ? m.command->has_torque(j)
                                                                      : m.command->has_velocity(j));
                    }));
  }
  for (std::size_t e = 0; e < layout.effects.size(); ++e) {
    const BoundEffect& drive = layout.effects[e];
    if (!drive.info().has(Trait::kReadsCommand)) continue;
    const int j = drive.joints.front();
    const auto is_constant = [&](const MotionStretch& s) {
      double low = kInfinity, high = -kInfinity;
      for (const double t : s.time)
        if (const double c = s.command->at(j, t, 0.0); std::isfinite(c)) {
          low = std::min(low, c);
          high = std::max(high, c);
        }
      return !(high > low);
    };
    if (!std::ranges::all_of(stretches, is_constant)) continue;
    for (FitParameter& s : layout.shape)
      if (s.effect == static_cast<int>(e) &&
          (s.name.ends_with(".delay") || s.name.ends_with(".speed")))
        s.fixed = true;
    const std::string& name = joints[static_cast<std::size_t>(j)];
    notes.push_back(kWarning +
                    ("qcmd_" + name +
                     " never changes within a run: delay and speed of the drive of " + name +
                     " are not told and stay at the model's values; gain, damping and friction are "
                     "told by what else moves the joint, and by nothing where it rests. Record "
                     "waves of several speeds, then steps"));
  }
}

bool fit_drives(Model& model, const RecordingSource& train, IdentifyOptions& options,
                std::vector<std::string>& notes) {
  const std::vector<Recording> sample = train.sample();
  const std::vector<std::string> joints = joint_names(model);
  std::vector<std::string> led, effects, damped, unused;
  // Beside a torque that is known, a joint without one is prescribed.
  if (has_torque(train) || std::ranges::any_of(sample, [](const Recording& r) {
        return !r.info.passive.empty();
      }))
    return false;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const auto is_led = [&](const Recording& r) { return is_logged(r.qcmd, static_cast<long>(j)); };
    if (!std::ranges::any_of(sample, is_led)) continue;
    require_a_drive_that_is_on(sample, static_cast<int>(j), joints[j]);
    led.push_back(joints[j]);
    begin_at_supply(model, sample, static_cast<int>(j), joints[j], options.choice);
    if (std::ranges::find(model.links, joints[j], &ModelLink::joint)->servo)
      drive_at(model, joints[j]);
    if (std::ranges::any_of(sample, [&](const Recording& r) {
          return is_led(r) && count_off(r, static_cast<int>(j)) > 0;
        }))
      effects.push_back("viscous_friction@" + joints[j]);
    else if (!is_asked_for(options.choice, "viscous_friction") &&
             give_friction_to_drive(model, joints[j]))
      damped.push_back(joints[j]);
    for (const char* effect : {"position_servo", "armature", "coulomb_friction", "torque_offset"})
      effects.push_back(std::string(effect) + "@" + joints[j]);
    if (std::ranges::any_of(sample, [&](const Recording& r) {
          return is_logged(r.qdcmd, static_cast<long>(j)) ||
                 is_logged(r.taucmd, static_cast<long>(j));
        })) {
      effects.push_back("feed_forward@" + joints[j]);
      if (!begin_fed(model, joints[j], options.choice)) unused.push_back(joints[j]);
    }
  }
  if (led.empty()) return false;
  require_commands(describe_joints(model), sample);
  if (!damped.empty())
    notes.push_back("viscous friction of the description at " + detail::join(damped) +
                    " is where the damping of the drives there begins: a drive that is always on "
                    "does not tell the two apart");
  if (!unused.empty())
    notes.push_back(kWarning + ("drives were told velocities or torques beside positions (qdcmd_, "
                                "taucmd_) at " +
                                detail::join(unused) +
                                ", which do nothing here: add feed_forward to --effects"));
  options.loss = Loss::kMotion;
  if (!options.choice.effects) options.choice.effects = effects;
  if (options.choice.fit == FitChoice{}.fit) std::erase(options.choice.fit, "inertia");
  const bool holds_gains = std::ranges::any_of(options.choice.fix, [](const std::string& entry) {
    return entry.find(".stiffness") != entry.npos;
  });
  notes.push_back("no torque was recorded at " + detail::join(led) +
                  ", commanded positions were: their drives are fitted as position servos, by the "
                  "motion they make. " +
                  (holds_gains
                       ? "The gains that are held and the links' inertias, which the model has, "
                         "set the scale of friction and rotors"
                       : "The links' inertias, which the model has, set the scale: were all of "
                         "them twice as large, so would be gains, friction and rotors"));
  return true;
}

void sharpen(const VecX<double>& noise, BoundEffect& effect) {
  for (std::size_t k = 0; k < effect.parameters.size(); ++k) {
    const ParameterInfo& info = effect.parameter_info[k];
    if (info.name != "smoothing" || effect.parameters[k] != info.initial) continue;
    for (const int j : effect.joints)
      effect.parameters[k] = std::min(effect.parameters[k], noise[j] / kForgets);
  }
}

void sharpen(const VecX<double>& noise, FitLayout& layout, VecX<double>& shape) {
  if (std::ranges::none_of(commanded_joints(layout), std::identity())) return;
  for (BoundEffect& e : layout.effects) sharpen(noise, e);
  for (std::size_t s = 0; s < layout.shape.size(); ++s)
    if (FitParameter& p = layout.shape[s]; p.fixed && p.name.ends_with(".smoothing"))
      p.prior = shape[static_cast<long>(s)] = layout.effects[static_cast<std::size_t>(p.effect)]
                                                  .parameters[static_cast<std::size_t>(p.index)];
}

CountsFor steady_windows(const std::vector<MotionStretch>& stretches, const FitLayout& layout,
                         const VecX<double>& shape) {
  std::vector<double> delay(static_cast<std::size_t>(layout.num_dofs), kNaN);
  for (std::size_t s = 0; s < layout.shape.size(); ++s) {
    const FitParameter& p = layout.shape[s];
    if (p.effect < 0 || !p.name.ends_with(".delay")) continue;
    const BoundEffect& e = layout.effects[static_cast<std::size_t>(p.effect)];
    if (e.info().has(Trait::kReadsCommand))
      delay[static_cast<std::size_t>(e.joints.front())] = shape[static_cast<long>(s)];
  }
  return [&stretches, delay](const MotionWindow& w, int joint) {
    const double late = delay[static_cast<std::size_t>(joint)];
    const MotionStretch& s = stretches[w.stretch];
    if (std::isnan(late) || !s.command) return true;
    bool forth = false, back = false;
    for (long k = w.first; k < w.first + w.rows; ++k) {
      const double error =
          s.command->at(joint, s.time[static_cast<std::size_t>(k)], late) - s.q(k, joint);
      forth = forth || error > 0.0;
      back = back || error < 0.0;
    }
    return !(forth && back);
  };
}

void guess_drives(const Model& model, const std::vector<MotionStretch>& stretches,
                  const std::vector<MotionWindow>& windows, double speed_share, double reach_share,
                  FitLayout& layout, VecX<double>& shape) {
  const bool saturates = reach_share < kSeldom;
  const auto most_of = [&](const auto& value, int joint) {
    double most = 0.0;
    for (const MotionStretch& s : stretches) most = std::max(most, value(s, joint));
    return most;
  };
  const auto any_error = [](const MotionStretch& s, int joint) {
    return largest_error(s, joint, 0.0, kNoBound);
  };
  std::vector<Guess> drives;
  for (std::size_t e = 0; e < layout.effects.size(); ++e)
    if (layout.effects[e].info().has(Trait::kReadsCommand)) {
      const int joint = layout.effects[e].joints.front();
      drives.push_back({e, most_of(largest_rate, joint), most_of(any_error, joint)});
    }
  const auto set = [&](std::size_t e, const char* name, double value) {
    const std::vector<ParameterInfo>& info = layout.effects[e].parameter_info;
    const int index = static_cast<int>(
        std::ranges::find(info, name, &ParameterInfo::name) - info.begin());
    for (std::size_t s = 0; s < layout.shape.size(); ++s) {
      const FitParameter& p = layout.shape[s];
      if (p.effect != static_cast<int>(e) || p.index != index || p.fixed) continue;
      layout.effects[e].parameters[static_cast<std::size_t>(index)] = value;
      shape[static_cast<long>(s)] = value;
    }
  };
  const auto set_all = [&](const Guess& g, const Bounds& b) {
    set(g.effect, "delay", b.delay);
    set(g.effect, "speed", b.speed);
    set(g.effect, "reach", b.reach);
  };
  const std::vector<LocalMotion> motions = middle_motions(stretches, windows);
  const auto try_delays = [&](const std::function<double(const Guess&)>& delay) {
    const auto bounds = [&](const Guess& g) {
      const bool is_slow = speed_share < 1.0 && g.most_rate > 0.0;  // a constant command has none
      return Bounds{delay(g), is_slow ? speed_share * g.most_rate : kNoBound,
                    saturates && g.most_error > 0.0 ? reach_share * g.most_error : kNoBound};
    };
    std::vector<Bounds> tried;
    for (const Guess& g : drives) {
      tried.push_back(bounds(g));
      set_all(g, tried.back());
    }
    const CountsFor counts = saturates ? steady_windows(stretches, layout, shape) : CountsFor{};
    const std::vector<JointFactor> factors =
        local_factors(model, layout, stretches, windows, motions, counts);
    const VecX<double> x = inverse_guess(layout, factors);
    if (x.size() == 0) return;
    for (std::size_t k = 0; k < drives.size(); ++k) {
      Guess& g = drives[k];
      const int j = layout.effects[g.effect].joints.front();
      double left = factors[static_cast<std::size_t>(j)].sum_of_squares(x);
      if (counts)
        left /= static_cast<double>(
            std::ranges::count_if(windows, [&](const MotionWindow& w) { return counts(w, j); }));
      if (!(left < g.left)) continue;
      g.left = left;
      g.best = tried[k];
    }
  };
  for (double delay = 0.0; delay < kMostDelay + 1e-9; delay += kDelayStep)
    try_delays([&](const Guess&) { return delay; });
  // Nearer, each drive about its own.
  for (double step = 0.5 * kDelayStep; step > kFinestDelay; step *= 0.5) {
    std::vector<double> about;
    for (const Guess& g : drives) about.push_back(g.best.delay);
    for (const double side : {-step, step})
      try_delays([&](const Guess& g) {
        return std::max(about[static_cast<std::size_t>(&g - drives.data())] + side, 0.0);
      });
  }
  for (Guess& g : drives) {
    const auto error = [&](const MotionStretch& s, int joint) {
      return largest_error(s, joint, g.best.delay, g.best.speed);
    };
    if (!saturates)
      g.best.reach = reach_share * most_of(error, layout.effects[g.effect].joints.front());
    if (!(g.best.reach > 0.0)) g.best.reach = kNoBound;
    set_all(g, g.best);
  }
}

}  // namespace diffnea
