#include <algorithm>
#include <cmath>
#include <cstdio>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/effects/ball_network.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/effects/hidden_motor.hpp>
#include <diffnea/sim/model_simulator.hpp>

#include "sim/pack_world.hpp"

namespace diffnea {
namespace {

using sim::MakePackWorld;
using sim::PackDraw;
using sim::PackSpec;

MakePackWorld* kernel(const std::string& instruction_set) {
  const std::vector<std::string> there = batch_instruction_sets();
  const std::string name = instruction_set.empty() ? there.front() : instruction_set;
  if (std::ranges::find(there, name) == there.end()) {
    std::string names;
    for (const std::string& n : there) names += (names.empty() ? "" : ", ") + n;
    throw Error("simulator: this build and processor have no instruction set '" + name +
                "'; choices: " + names);
  }
#ifdef DIFFNEA_HAS_X86_KERNELS
  if (name == "avx512") return sim::avx512::make_pack_world;
  if (name == "avx2") return sim::avx2::make_pack_world;
  return sim::sse2::make_pack_world;
#else
  return sim::base::make_pack_world;
#endif
}

/// What is in the log alone, and of the camera: the motion does not know of it.
bool is_of_log(const BoundEffect& e) {
  const EffectInfo& info = e.info();
  return info.port == Port::kBallView || info.name == "time_shift" ||
         info.name == "velocity_filter_lag";
}

void refuse(const Model& model, const BoundEffect& e) {
  throw ModelError(
      model.source + ": " + e.info().name + " at '" + e.where +
      "' is not simulated here (gaps, encoders, impacts, what reads the acceleration); "
      "leave it out of the model that the policy is learned in");
}

/// Effects with memory that sim/pack_drives.hpp simulates.
bool is_of_drives(const BoundEffect& e) {
  return std::holds_alternative<JointElasticity>(e.type) ||
         std::holds_alternative<PreslidingDahl>(e.type) ||
         std::holds_alternative<PreslidingLugre>(e.type) ||
         std::holds_alternative<ActuatorDelay>(e.type) ||
         std::holds_alternative<ActuatorLag>(e.type) || std::holds_alternative<Saturation>(e.type);
}

/// @throws ModelError if a joint has two springs
MotorShares motor_shares(const Model& model, const std::vector<BoundEffect>& drives) {
  MotorShares out(joint_names(model).size(), -1.0);
  for (const BoundEffect& e : drives)
    if (std::holds_alternative<JointElasticity>(e.type))
      for (const int j : e.joints) {
        double& share = out[static_cast<std::size_t>(j)];
        if (share >= 0.0)
          throw ModelError(model.source + ": joint_elasticity at '" + e.where +
                           "': the joint has a hidden motor already; one elasticity a joint");
        share = JointElasticity::friction_share(e.parameters.data());
      }
  return out;
}

/// A draw's effects by the side of the springs that they act on.
struct DrawnEffects {
  Model model;
  ExtendedTree tree;
  std::vector<BoundEffect> drives, links, motors;
  MotorShares shares;
};

/// Which side an effect of one instant acts on: both, in all draws, where they do not agree.
void take_sides(std::vector<DrawnEffects>& draws) {
  for (DrawnEffects& d : draws)
    for (const BoundEffect& whole : d.tree.effects)
      for (const BoundEffect& e : parts_at_motors(whole, d.shares)) {
        double least = 1.0, most = 0.0;
        for (const DrawnEffects& other : draws) {
          const double share = share_at_motors(e, other.shares);
          least = std::min(least, share);
          most = std::max(most, share);
        }
        const double share = share_at_motors(e, d.shares);
        if (most > 0.0) d.motors.push_back(scaled(e, share));
        if (least < 1.0) d.links.push_back(most > 0.0 ? scaled(e, 1.0 - share) : e);
      }
}

/// Whether its torque depends on another joint's speed.
bool reads_other_speed(const BoundEffect& e) {
  const Residual* residual = std::get_if<Residual>(&e.type);
  return residual && std::ranges::any_of(residual->axes, [&](const Residual::Axis& a) {
           return a.velocity && a.joint != e.joints.front();
         });
}

/// What its torque depends on, asked with numbers that no formula survives: one that is finite did
/// not look at them.
sim::EffectKind kind_of(const BoundEffect& e, const Tree<double>& tree) {
  if (reads_other_speed(e)) return sim::EffectKind::kGeneral;
  const std::size_t n = static_cast<std::size_t>(e.num_joints);
  const std::vector<double> anything(n, std::nan(""));
  std::vector<double> parameters = e.parameters;  // 0 in one draw need not be in another
  for (double& p : parameters) p = p == 0.0 ? 1.0 : p;
  const auto torque = [&](double speed) {
    const std::vector<double> qd(n, speed);
    std::vector<double> tau(n, 0.0);
    JointSample<double> x;
    x.time = std::nan("");
    x.q = x.qdd = x.tau = anything.data();
    x.qd = qd.data();
    add_torque(e, tree, x, parameters.data(), tau.data());
    return Eigen::Map<const VecX<double>>(tau.data(), e.num_joints).eval();
  };
  if (torque(std::nan("")).allFinite()) return sim::EffectKind::kConstant;
  if (!torque(0.0).isZero(0.0)) return sim::EffectKind::kGeneral;
  constexpr double kRounding = 1e-12;
  const VecX<double> one = torque(1.0);
  for (const double speed : {-3.0, -1e-4, 1e-3, 2.0})
    if (!(torque(speed) - speed * one).isZero(kRounding * one.cwiseAbs().maxCoeff()))
      return sim::EffectKind::kDissipative;
  return sim::EffectKind::kLinear;
}

/// Of all draws: where they do not agree (a shape may be what makes a friction linear in one of
/// them), nothing is taken for granted.
sim::EffectKind kind_in_all(const std::vector<DrawnEffects>& draws, std::size_t e) {
  const sim::EffectKind first = kind_of(draws.front().links[e], draws.front().tree.tree);
  for (const DrawnEffects& d : draws)
    if (kind_of(d.links[e], d.tree.tree) != first) return sim::EffectKind::kGeneral;
  return first;
}

/// A delay's commands are all kept: a longer one is no delay.
void check_delay(const Model& model, const BoundEffect& e) {
  constexpr int kLongest = 10;  // [s]
  if (!std::holds_alternative<ActuatorDelay>(e.type) || e.parameters[0] <= kLongest) return;
  throw ModelError(model.source + ": actuator_delay at '" + e.where +
                   "': delay = " + std::to_string(e.parameters[0]) + " s, expected at most " +
                   std::to_string(kLongest) + " s here");
}

struct BallEffects {
  std::vector<BoundEffect> forces;
  Vec3<double> p_LS;
};

/// The ball's own effects: forces as they are, what moves the string's knot in the knot.
BallEffects ball_effects(const Model& model) {
  BallEffects out;
  if (model.ball && model.ball->string) out.p_LS = model.ball->string->p_LS;
  for (const EffectSpec& spec : model.effects) {
    const EffectInfo& known = info(find_effect(spec.effect));
    if (!acts_on_ball(known)) continue;
    const BoundEffect e = bind(spec, model);
    if (is_of_log(e)) continue;
    if (known.port == Port::kStringAnchor) {
      std::visit(
          [&](const auto& formula) {
            if constexpr (requires { formula.add_to_anchor(e.parameters.data(), out.p_LS); })
              formula.add_to_anchor(e.parameters.data(), out.p_LS);
          },
          e.type);
    } else if ((known.port == Port::kBallForce && known.name != "string_extension") ||
               known.port == Port::kStringContact) {
      out.forces.push_back(e);
    } else {
      refuse(model, e);
    }
  }
  return out;
}

PackDraw draw_of(const DrawnEffects& drawn, const BallEffects& ball, const TreeMap& map) {
  const Model& model = drawn.model;
  PackDraw out;
  out.tree = drawn.tree.tree;
  for (const BoundEffect& e : drawn.links) out.effects.push_back(e.parameters);
  for (const BoundEffect& e : drawn.drives) out.drives.push_back(e.parameters);
  for (const BoundEffect& e : drawn.motors) out.motor_effects.push_back(e.parameters);
  for (const BoundEffect& e : ball.forces) out.ball_effects.push_back(e.parameters);
  if (model.ball && model.ball->string) {
    out.length = model.ball->string->length;
    const int link = model.ball->string->link;
    out.p_LS = ball.p_LS;
    if (link >= 0) {
      const Pose<double>& X = map.X_LF[static_cast<std::size_t>(link)];
      out.p_LS = X.R * ball.p_LS + X.p;
    }
  }
  return out;
}

std::vector<std::pair<std::string, std::string>> names(const std::vector<BoundEffect>& effects) {
  std::vector<std::pair<std::string, std::string>> out;
  for (const BoundEffect& e : effects) out.emplace_back(e.info().name, e.where);
  return out;
}

bool same_poses(const Tree<double>& a, const Tree<double>& b) {
  for (std::size_t i = 0; i < a.links.size(); ++i) {
    const Pose<double>&x = a.links[i].X_PJ, &y = b.links[i].X_PJ;
    if ((to_eigen(x.R) - to_eigen(y.R)).cwiseAbs().maxCoeff() > 0.0 ||
        (to_eigen(x.p) - to_eigen(y.p)).cwiseAbs().maxCoeff() > 0.0)
      return false;
  }
  return true;
}

std::string milliseconds(double seconds) {
  char text[40];
  std::snprintf(text, sizeof text, "%.4g ms", 1e3 * seconds);
  return text;
}

/// The tree's link that a link of the model is part of, and its pose in it.
std::pair<int, Pose<double>> in_tree(const TreeMap& map, int link) {
  if (link < 0) return {-1, Pose<double>::identity()};
  return {map.dof[static_cast<std::size_t>(link)], map.X_LF[static_cast<std::size_t>(link)]};
}

void take_ball(const Model& model, PackSpec& spec) {
  const TreeMap map = map_to_tree(model);
  if (model.ball && model.ball->string) {
    spec.has_ball = true;
    spec.string_link = in_tree(map, model.ball->string->link).first;
    spec.ball_mass = model.ball->mass;
    spec.ball_radius = model.ball->radius;
  } else if (model.ball) {
    throw ModelError(model.source + ": its ball hangs on no string; expected one on a string");
  }
  const auto frame = std::ranges::find(model.frames, "cup", &ModelFrame::name);
  if (frame != model.frames.end()) {
    const auto [link, X_LF] = in_tree(map, frame->link);
    spec.shows_cup = true;
    spec.cup_link = link;
    spec.X_LC = X_LF * frame->X_LF;
  }
  if (!spec.has_ball) return;
  if (spec.shows_cup) spec.cup = model.cup;
  for (CapsuleSpec o : model.obstacles) {
    const auto [link, X_LF] = in_tree(map, o.link);
    o.link = link;
    o.p_LA = X_LF.R * o.p_LA + X_LF.p;
    o.p_LB = X_LF.R * o.p_LB + X_LF.p;
    spec.obstacles.push_back(o);
  }
}

/// @throws ModelError if the network cannot move this ball
void check_network(const BallNetwork& network, const PackSpec& spec, const std::string& model) {
  if (spec.string_link < 0)
    throw ModelError(network.source + ": " + model +
                     ": its ball hangs on no link that moves, which the network is asked about");
  const double step = spec.period / spec.arm_steps;
  constexpr double kRounding = 1e-9;  // of a rate's inverse [s]
  if (std::abs(network.step - step) > kRounding)
    throw ModelError(network.source + ".step: the network was trained at steps of " +
                     milliseconds(network.step) + ", the simulated arm has steps of " +
                     milliseconds(step) + "; train it at these, or choose the controller's rate");
}

PackSpec spec_of(const std::vector<Model>& draws, const Model& controller,
                 const ModelSimulatorOptions& o) {
  if (draws.empty()) throw ModelError("simulator: got no model, expected one or more");
  const Model& first = draws.front();
  if (!(o.arm_step > 0.0) || !(o.ball_step > 0.0) || !(o.controller.control_rate > 0.0))
    throw Error("simulator: control_rate, arm_step and ball_step must be positive");
  if (joint_names(first) != joint_names(controller))
    throw ModelError(controller.source + ": its joints are not those of the robot, " +
                     first.source);
  PackSpec out;
  out.joints = static_cast<int>(joint_names(first).size());
  out.period = 1.0 / o.controller.control_rate;
  out.arm_steps = std::max(1, static_cast<int>(std::ceil(out.period / o.arm_step - 1e-9)));
  const double arm_step = out.period / out.arm_steps;
  out.ball_steps = std::max(1, static_cast<int>(std::ceil(arm_step / o.ball_step - 1e-9)));
  out.settle_time = o.settle_time;
  out.least_upright = o.least_upright;
  out.law = o.controller.law;
  out.gravity_compensation = o.controller.gravity_compensation;
  out.nominal = extend(controller).tree;
  if (!out.gravity_compensation) out.nominal.gravity = {0, 0, 0};
  for (Link<double>& link : out.nominal.links)
    if (out.law == ControlLaw::kPd) link.armature = 0.0;  // gravity alone
  for (const int i : moving_links(first)) {
    out.limit.push_back(first.links[i].limits.effort);
    out.passive.push_back(first.links[i].passive);
  }
  take_ball(first, out);
  if (o.ball_network) check_network(*o.ball_network, out, first.source);
  out.network = o.ball_network;
  std::vector<DrawnEffects> drawn;
  for (const Model& model : draws) {
    DrawnEffects& d = drawn.emplace_back();
    d.model = model;
    d.tree = extend(model, {0});
    for (const BoundEffect& e : d.tree.series) {
      check_delay(model, e);
      if (is_of_drives(e))
        d.drives.push_back(e);
      else if (!is_of_log(e) && !acts_on_ball(e.info()))
        refuse(model, e);
    }
    for (const BoundEffect& e : d.tree.effects)
      if (reads_acceleration(e) || e.info().name == "torque_gain") refuse(model, e);
    if (joint_names(model) != joint_names(first) ||
        names(d.tree.effects) != names(drawn.front().tree.effects) ||
        names(d.drives) != names(drawn.front().drives))
      throw ModelError(model.source + ": draws must have the joints and effects of the first");
    d.shares = motor_shares(model, d.drives);
  }
  take_sides(drawn);
  const BallEffects first_ball = ball_effects(first);
  out.effects = drawn.front().links;
  out.drives = drawn.front().drives;
  out.motor_effects = drawn.front().motors;
  out.ball_effects = first_ball.forces;
  for (std::size_t e = 0; e < out.effects.size(); ++e) out.kinds.push_back(kind_in_all(drawn, e));
  for (const DrawnEffects& d : drawn) {
    const BallEffects ball = ball_effects(d.model);
    if (names(ball.forces) != names(out.ball_effects))
      throw ModelError(d.model.source + ": draws must have the joints and effects of the first");
    out.draws.push_back(draw_of(d, ball, map_to_tree(d.model)));
    out.same_kinematics = out.same_kinematics && same_poses(out.nominal, d.tree.tree);
  }
  return out;
}

}  // namespace

struct ModelSimulator::Parts {
  PackSpec spec;
  std::vector<std::string> joints, channels;
  std::vector<int> driven;  ///< degree of freedom of every driven joint
  MakePackWorld* make = nullptr;
  Model controller;
  ControllerOptions control;
  bool gains_at_start = false;  ///< derived ones depend on it
  long ball_row = 0;            ///< of x_B in what is seen
  std::unique_ptr<sim::PackWorld> world;
  Lanes seen;
  std::vector<std::string> failures;

  void make_world() {
    world = make(spec);
    seen.setZero(static_cast<long>(channels.size()), world->lanes());
    failures.assign(static_cast<std::size_t>(world->lanes()), "");
  }
  /// Rows of all joints; those of passive ones are 0, and not read but at the start.
  Lanes of_all(const Lanes& of_driven) const {
    Lanes out = Lanes::Zero(spec.joints, of_driven.cols());
    for (std::size_t k = 0; k < driven.size(); ++k)
      out.row(driven[k]) = of_driven.row(static_cast<long>(k));
    return out;
  }
  void take_gains(const VecX<double>& q0) {
    const JointGains gains = joint_gains(controller, control, q0);
    spec.kp.assign(gains.kp.begin(), gains.kp.end());
    spec.kd.assign(gains.kd.begin(), gains.kd.end());
  }
};

ModelSimulator::ModelSimulator(const std::vector<Model>& draws, const Model& controller,
                               const ModelSimulatorOptions& options)
    : parts_(std::make_unique<Parts>()) {
  Parts& p = *parts_;
  p.make = kernel(options.instruction_set);
  p.spec = spec_of(draws, controller, options);
  const std::vector<std::string> names = joint_names(draws.front());
  for (std::size_t j = 0; j < names.size(); ++j)
    if (!p.spec.passive[j]) {
      p.joints.push_back(names[j]);
      p.driven.push_back(static_cast<int>(j));
    }
  p.channels = channel_names(names, p.spec.has_ball, p.spec.shows_cup, p.spec.cup.has_value());
  p.ball_row = 2 * p.spec.joints;
  p.controller = controller;
  p.control = options.controller;
  p.gains_at_start = p.control.kp.size() == 0 || p.control.kd.size() == 0;
  p.take_gains(VecX<double>::Zero(p.spec.joints));
  p.make_world();
}

ModelSimulator::ModelSimulator(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
ModelSimulator::~ModelSimulator() = default;

const std::vector<std::string>& ModelSimulator::joints() const { return parts_->joints; }
const std::vector<std::string>& ModelSimulator::channels() const { return parts_->channels; }
double ModelSimulator::period() const { return parts_->spec.period; }
int ModelSimulator::lanes() const { return parts_->world->lanes(); }
const Lanes& ModelSimulator::observe() const { return parts_->seen; }
const std::vector<std::string>& ModelSimulator::failures() const { return parts_->failures; }

void ModelSimulator::reset(const Starts& starts) {
  Parts& p = *parts_;
  const long count = starts.q.cols();
  require_size("simulator: starts", starts.q.rows(), static_cast<long>(p.joints.size()), "joint");
  require_size("simulator: seeds", static_cast<long>(starts.seeds.size()), count, "world");
  if (count < 1 || count > lanes())
    throw ShapeError("simulator: got " + std::to_string(count) + " starts, expected 1 to " +
                     std::to_string(lanes()) + " (the lanes)");
  const Lanes q = p.of_all(starts.q);
  if (p.gains_at_start) {
    const std::vector<double> kp = p.spec.kp, kd = p.spec.kd;
    p.take_gains(q.col(0));
    if (p.spec.kp != kp || p.spec.kd != kd) p.make_world();
  }
  p.world->reset(q.data(), q.cols(), static_cast<int>(count), starts.seeds.data());
  std::ranges::fill(p.failures, "");
  p.world->observe(p.seen.data());
}

void ModelSimulator::step(const Lanes& q, const Lanes& qd) {
  Parts& p = *parts_;
  for (const Lanes* x : {&q, &qd}) {
    require_size("simulator: command", x->rows(), static_cast<long>(p.joints.size()), "joint");
    require_size("simulator: command", x->cols(), lanes(), "lane");
  }
  if (p.joints.size() == p.spec.passive.size())
    p.world->step(q.data(), qd.data());
  else
    p.world->step(p.of_all(q).data(), p.of_all(qd).data());
  p.world->observe(p.seen.data());
  for (int lane = 0; lane < lanes(); ++lane) {
    if (!p.failures[lane].empty()) continue;
    if (!std::isfinite(p.seen(0, lane))) p.failures[lane] = "the integration is unstable";
    if (p.spec.network && !(p.seen.block<3, 1>(p.ball_row, lane).norm() < sim::kFarthestBall))
      p.failures[lane] = "the network's ball flew away";
  }
}

std::unique_ptr<Simulator> ModelSimulator::clone() const {
  auto parts = std::make_unique<Parts>();
  parts->spec = parts_->spec;
  parts->joints = parts_->joints;
  parts->driven = parts_->driven;
  parts->channels = parts_->channels;
  parts->make = parts_->make;
  parts->controller = parts_->controller;
  parts->control = parts_->control;
  parts->gains_at_start = parts_->gains_at_start;
  parts->ball_row = parts_->ball_row;
  parts->make_world();
  return std::unique_ptr<Simulator>(new ModelSimulator(std::move(parts)));
}

}  // namespace diffnea
