#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/sim/mujoco_world.hpp>

#include "core/number_text.hpp"
#include "sim/desired_motion.hpp"
#include "sim/following_gains.hpp"
#include "sim/mujoco_plant.hpp"

namespace diffnea {
namespace {

void add_effect(Model& model, const char* name, const char* parameter, const ModelLink& link,
                double value, const char* unit, const char* unit_prismatic) {
  if (value == 0.0) return;
  for (EffectSpec& e : model.effects) {
    if (e.effect != name || e.where != link.joint) continue;
    for (EffectParameter& p : e.parameters)
      if (p.name == parameter) p.value += value;
    return;
  }
  model.effects.push_back(
      {name,
       link.joint,
       {{parameter, value, link.type == ModelJoint::kRevolute ? unit : unit_prismatic}}});
}

}  // namespace

/// Turns the cup about where a string is tied to it, else about its own origin; the axis moves to
/// any side.
void tilt_cup(Model& model, double largest, Rng& rng) {
  const auto frame = std::ranges::find(model.frames, "cup", &ModelFrame::name);
  if (frame == model.frames.end() || frame->link < 0) return;
  ModelLink& link = model.links[frame->link];
  if (link.type != ModelJoint::kFixed) return;
  const double side = rng.uniform(0.0, 2.0 * M_PI), angle = rng.uniform(0.0, largest);
  const bool tied = model.ball->string && model.ball->string->link == frame->link;
  const Vec3<double> p = tied ? model.ball->string->p_LS : frame->X_LF.p;
  const Mat3<double> R = rotation_about<double>(
      frame->X_LF.R * Vec3<double>{std::cos(side), std::sin(side), 0}, angle);
  link.X_PJ = link.X_PJ * Pose<double>{R, p - R * p};
}

/// Value of a parameter of an effect at a joint; 0 where there is none.
double value_of(const Model& model, const char* effect, const char* parameter,
                const std::string& joint) {
  double out = 0.0;
  for (const EffectSpec& e : model.effects)
    if (e.effect == effect && e.where == joint)
      for (const EffectParameter& p : e.parameters)
        if (p.name == parameter) out += p.value;
  return out;
}

/// Springs, stiction and delay. Every number is drawn, used or not.
void add_drives(Model& model, const Perturbation& p, Rng& rng) {
  for (const ModelLink& link : model.links) {
    if (link.type == ModelJoint::kFixed || link.passive) continue;
    const double wind_up = rng.uniform(p.wind_up_low, p.wind_up_high),
                 relaxation = rng.uniform(p.relaxation_low, p.relaxation_high),
                 stiction = rng.uniform(p.stiction_low, p.stiction_high),
                 stribeck = rng.uniform(p.stribeck_low, p.stribeck_high);
    const double rotor = value_of(model, "armature", "armature", link.joint),
                 coulomb = value_of(model, "coulomb_friction", "coulomb", link.joint);
    const bool turns = link.type == ModelJoint::kRevolute;
    if (wind_up > 0.0 && turns && rotor > 0.0 && std::isfinite(link.limits.effort) &&
        link.limits.effort > 0.0) {
      const double stiffness = link.limits.effort / wind_up;
      model.effects.push_back({"joint_elasticity",
                               link.joint,
                               {{"stiffness", stiffness, "N*m/rad"},
                                {"damping", relaxation * stiffness, "N*m*s/rad"},
                                {"motor_inertia", rotor, "kg*m^2"},
                                {"friction_share", 1.0, "1"}}});
    }
    if (stiction * coulomb > 0.0)
      model.effects.push_back({"stribeck_friction",
                               link.joint,
                               {{"stiction_excess", stiction * coulomb, turns ? "N*m" : "N"},
                                {"stribeck_velocity", stribeck, turns ? "rad/s" : "m/s"}}});
  }
  const double delay = rng.uniform(p.delay_low, p.delay_high),
               camera = rng.uniform(p.camera_delay_low, p.camera_delay_high);
  if (delay > 0.0) model.effects.push_back({"actuator_delay", "all", {{"delay", delay, "s"}}});
  if (camera > 0.0 && model.ball)
    model.effects.push_back({"camera_delay", "camera", {{"delay", camera, "s"}}});
}

Model perturbed(const Model& model, const Perturbation& p, std::uint64_t seed) {
  Model out = model;
  Rng rng(seed);
  const TreeMap map = map_to_tree(model);
  for (std::size_t i = 0; i < out.links.size(); ++i) {
    ModelLink& link = out.links[i];
    if (map.dof[i] < 0) continue;
    if (link.inertia.m > 0.0) {
      const double mass = link.inertia.m * (1.0 + rng.uniform(p.mass_low, p.mass_high));
      const double grow = 1.0 + rng.uniform(p.inertia_low, p.inertia_high);
      Vec3<double> shift{rng.normal(), rng.normal(), rng.normal()};
      shift = shift * (rng.uniform(0.0, p.com) / std::sqrt(dot(shift, shift)));
      const Sym3<double> I = inertia_about_com(link.inertia);
      link.inertia = inertia_from_com<double>(
          mass, link.inertia.h * (1.0 / link.inertia.m) + shift,
          {I.xx * grow, I.xy * grow, I.xz * grow, I.yy * grow, I.yz * grow, I.zz * grow});
    }
    if (link.type == ModelJoint::kFixed || link.passive) continue;
    const double scale = torque_scale(link);
    const double coulomb = scale * rng.uniform(p.coulomb_low, p.coulomb_high);
    const double viscous = scale * rng.uniform(p.viscous_low, p.viscous_high);
    const double armature = scale * rng.uniform(p.armature_low, p.armature_high);
    add_effect(out, "coulomb_friction", "coulomb", link, coulomb, "N*m", "N");
    add_effect(out, "viscous_friction", "viscous", link, viscous, "N*m*s/rad", "N*s/m");
    add_effect(out, "armature", "armature", link, armature, "kg*m^2", "kg");
  }
  if (out.ball && out.ball->string) {
    StringSpec& string = *out.ball->string;
    if (!(p.string < string.length))
      throw ModelError(model.source + ": its string of " + std::to_string(string.length) +
                       " m cannot become up to " + std::to_string(p.string) +
                       " m shorter; expected less than its length (`string` of the ranges that "
                       "perturb= names)");
    Vec3<double> shift{rng.normal(), rng.normal(), rng.normal()};
    shift = shift * (rng.uniform(0.0, p.attachment) / std::sqrt(dot(shift, shift)));
    string.p_LS = string.p_LS + shift;
    string.length += rng.uniform(-p.string, p.string);
  }
  if (out.ball && p.cup_tilt > 0.0) tilt_cup(out, p.cup_tilt, rng);
  add_drives(out, p, rng);
  return out;
}

SimulatedRecording averaged(const std::vector<SimulatedRecording>& repetitions) {
  if (repetitions.empty()) throw DataError("averaged: there is no recording");
  SimulatedRecording out = repetitions.front();
  Recording& mean = out.recording;
  long rows = mean.rows();
  for (const SimulatedRecording& r : repetitions) rows = std::min(rows, r.recording.rows());
  const auto average = [&](RowMatX<double> Recording::* channel) {
    RowMatX<double>& x = mean.*channel;
    if (x.size() == 0) return;
    x.conservativeResize(rows, x.cols());
    for (std::size_t k = 1; k < repetitions.size(); ++k) {
      const RowMatX<double>& other = repetitions[k].recording.*channel;
      require_size("averaged", other.cols(), x.cols(), "channel");
      x += other.topRows(rows);
    }
    x /= static_cast<double>(repetitions.size());
  };
  for (const auto channel : {&Recording::q, &Recording::qd, &Recording::qcmd, &Recording::qdcmd,
                             &Recording::tau, &Recording::ball})
    average(channel);
  mean.time.conservativeResize(rows);
  for (std::size_t k = 1; k < repetitions.size(); ++k) {
    out.saturated += repetitions[k].saturated;
    if (out.failure.empty()) out.failure = repetitions[k].failure;
  }
  return out;
}

SimulatedRecording record_in_mujoco(const std::string& mjcf, const Model& truth,
                                    const Model& controller, const Trajectory& trajectory,
                                    const RecordOptions& options) {
  require_fixed_base("a recording at rest", truth);
  sim::MujocoPlant plant(std::make_shared<const sim::MujocoRobot>(mjcf, truth, options.control_rate,
                                                                  options.physics_step));
  SimulatedRecording out = sim::run_control_loop(plant, truth, controller, trajectory, options);
  out.recording.source = "MuJoCo: " + truth.source;
  return out;
}

namespace {

/// The rows of a motion from one time on, and what is between them there.
Trajectory piece(const Trajectory& t, double from, double seconds) {
  Trajectory out = t;
  std::vector<long> kept;
  for (long k = 0; k < t.rows(); ++k) {
    const bool next_begins = k + 1 < t.rows() && t.time[k + 1] <= from;
    const bool before_ended = k > 0 && t.time[k - 1] >= from + seconds;
    if (!next_begins && !before_ended) kept.push_back(k);
  }
  out.time = t.time(kept).eval();
  for (auto member : {&Trajectory::q, &Trajectory::qd, &Trajectory::qdd})
    if ((t.*member).rows() == t.rows()) out.*member = (t.*member)(kept, Eigen::all).eval();
  return out;
}

}  // namespace

std::vector<SimulatedRecording> record_flights(const std::string& mjcf, const Model& truth,
                                               const Model& controller,
                                               const Trajectory& trajectory,
                                               const RecordOptions& options) {
  for (const Model* model : {&truth, &controller}) {
    if (!model->free_base)
      throw ModelError("simulate: the base of " + model->source +
                       " is fixed, expected one that floats; --free-base (free_base=True) lets a "
                       "URDF's or JSON's float");
    require_no_constraints("simulate of flights", *model);
  }
  if (!(options.flight > 0.0)) throw Error("record: flight must be positive");
  const double seconds = options.flight,
               whole = trajectory.time[trajectory.rows() - 1] - trajectory.time[0];
  const long count = static_cast<long>(std::floor(whole / seconds + 1e-9));
  if (count < 1)
    throw DataError(trajectory.source + ": lasts " + detail::number_text(whole, 4) +
                    " s, expected one flight of " + detail::number_text(seconds, 4) +
                    " s or more; a longer motion, or shorter flights (--flight)");
  RecordOptions own = options;
  own.period = 0.0;  // no flight repeats another
  if (options.follow) {
    const VecX<double> q0 =
        sim::desired_motion(trajectory, joint_names(truth), nullptr).q.row(0).transpose();
    const JointGains gains = sim::following_gains(truth, controller, trajectory, options, q0);
    own.kp = gains.kp;
    own.kd = gains.kd;
    own.follow = false;
  }
  sim::MujocoPlant plant(std::make_shared<const sim::MujocoRobot>(mjcf, truth, options.control_rate,
                                                                  options.physics_step));
  const Pose<double>& X_WB = truth.links[0].X_PJ;
  Rng rng(options.seed ^ 0x7468726f77ULL);
  std::vector<SimulatedRecording> out;
  for (long k = 0; k < count; ++k) {
    const auto turning = [&] { return options.spin * rng.normal(); };
    const sim::Launch thrown{X_WB,
                             {{turning(), turning(), turning()},
                              transpose(X_WB.R) * (truth.gravity * (-0.5 * seconds))}};
    own.seed = options.seed + static_cast<std::uint64_t>(k) * 0x9e3779b97f4a7c15ULL;
    const double from = trajectory.time[0] + static_cast<double>(k) * seconds;
    out.push_back(sim::run_control_loop(plant, truth, controller, piece(trajectory, from, seconds),
                                        own, &thrown));
    out.back().recording.run = static_cast<int>(k);
    out.back().recording.source = "MuJoCo: " + truth.source + ", flight " + std::to_string(k + 1);
    if (!out.back().failure.empty()) break;
  }
  return out;
}

}  // namespace diffnea
