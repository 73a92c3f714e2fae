#include "sim/pack_spec.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/ball_network.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/stepping.hpp>

#include "core/number_text.hpp"
#include "sim/drawn_effects.hpp"

namespace diffnea::sim {
namespace {

struct BallEffects {
  std::vector<BoundEffect> forces;
  Vec3<double> p_LS;
};

/// The ball's own effects: forces as they are, what moves the string's knot in the knot.
BallEffects ball_effects(const Model& model) {
  BallEffects out;
  if (model.ball && model.ball->string) out.p_LS = model.ball->string->p_LS;
  for (const EffectSpec& spec : model.effects) {
    const EffectInfo& known = find_effect(spec.effect);
    if (!acts_on_ball(known)) continue;
    const BoundEffect e = bind(spec, model);
    if (is_of_log(e)) continue;
    if (known.port == Port::kStringAnchor) {
      add_to_anchor(e, out.p_LS);
    } else if ((known.port == Port::kBallForce && !known.has(Trait::kReadsAnchorJerk)) ||
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
  return diffnea::detail::number_text(1e3 * seconds) + " ms";
}

void take_ball(const Model& model, PackSpec& spec) {
  const TreeMap map = map_to_tree(model);
  if (model.ball && model.ball->string) {
    spec.has_ball = true;
    spec.string_link = place_in_tree(map, model.ball->string->link).first;
    spec.ball_mass = model.ball->mass;
    spec.ball_radius = model.ball->radius;
  } else if (model.ball) {
    throw ModelError(model.source + ": its ball hangs on no string; expected one on a string");
  }
  const auto frame = std::ranges::find(model.frames, "cup", &ModelFrame::name);
  if (frame != model.frames.end()) {
    const auto [link, X_LF] = place_in_tree(map, frame->link);
    spec.shows_cup = true;
    spec.cup_link = link;
    spec.X_LC = X_LF * frame->X_LF;
  }
  if (!spec.has_ball) return;
  if (spec.shows_cup) spec.cup = model.cup;
  for (CapsuleSpec o : model.obstacles) {
    const auto [link, X_LF] = place_in_tree(map, o.link);
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

}  // namespace

PackSpec pack_spec(const std::vector<Model>& draws, const Model& controller,
                   const ModelSimulatorOptions& o) {
  if (draws.empty()) throw ModelError("simulator: got no model, expected one or more");
  const Model& first = draws.front();
  if (!(o.arm_step > 0.0) || !(o.ball_step > 0.0) || !(o.controller.control_rate > 0.0))
    throw Error("simulator: control_rate, arm_step and ball_step must be positive");
  if (joint_names(first) != joint_names(controller))
    throw ModelError(controller.source + ": its joints are not those of the robot, " +
                     first.source);
  if (const std::vector<std::string> followers = follower_names(first); !followers.empty())
    throw ModelError(first.source + ": joint '" + followers.front() +
                     "' follows another; many robots are simulated at once only where every joint "
                     "moves by itself: make it fixed");
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
  require_plain_tree("simulator", controller);
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
  const std::vector<DrawnEffects> drawn = drawn_effects(draws);
  const BallEffects first_ball = ball_effects(first);
  out.effects = drawn.front().links;
  out.drives = drawn.front().drives;
  out.motor_effects = drawn.front().motors;
  out.ball_effects = first_ball.forces;
  for (const DrawnEffects& d : drawn) {
    const BallEffects ball = ball_effects(d.model);
    if (names_and_places(ball.forces) != names_and_places(out.ball_effects))
      throw ModelError(d.model.source + ": draws must have the joints and effects of the first");
    out.draws.push_back(draw_of(d, ball, map_to_tree(d.model)));
    out.same_kinematics = out.same_kinematics && same_poses(out.nominal, d.tree.tree);
  }
  return out;
}

}  // namespace diffnea::sim
