#pragma once
/// The balls of a pack of worlds: each on its arm's string, against cup and obstacles, or as a
/// network has it. Included by pack_world.cpp alone, once per instruction set.

#include <cmath>
#include <optional>
#include <vector>

#include <diffnea/core/pack.hpp>
#include <diffnea/dynamics/cup_contact.hpp>
#include <diffnea/dynamics/string_step.hpp>
#include <diffnea/effects/ball_effect.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/sim/simulator.hpp>

#include "sim/network_ball.hpp"
#include "sim/pack_arm.hpp"
#include "sim/pack_lanes.hpp"
#include "sim/pack_world.hpp"

namespace diffnea::sim {
namespace DIFFNEA_ISA {

inline Pack phase(BallPhase p) { return Pack(static_cast<double>(p)); }

class PackBall {
 public:
  /// Everything of it that moves.
  struct State {
    StringBall<Pack, Mask> string;
    AnchorMotion<Pack> anchor;  ///< at the ball's time
    FreeString<Pack> free;      ///< from where on the string is, where a cup may bar it
    Vec3<Pack> p_C, axis;       ///< the cup, at the ball's time
    CupPosition<Pack> in_cup;   ///< of the ball's last step, where it was near
    Mask near_cup = Mask(false);
    Vec3<Pack> pull;                 ///< of the string on the arm, W [N]
    NetworkBallState<Pack> network;  ///< where the ball is one's
    Pack phase = Pack(0.0);
  };

  explicit PackBall(const PackSpec& spec) : spec_(spec) {
    // From beyond this, no ball gets into the cup in a step.
    constexpr double kStep = 0.02;  // [m]: 1 ms at 20 m/s
    if (spec.cup)
      reach_ = std::hypot(spec.cup->rim, spec.cup->inner_radius + spec.cup->wall) +
               spec.ball_radius + kStep;
    if (spec.network) network_.emplace(spec.network);
  }

  void take_parameters(const LaneDraws& draws) {
    length_ = gather(draws, [](const PackDraw& d) { return d.length; });
    p_LS_ = gather_vector(draws, [](const PackDraw& d) { return d.p_LS; });
    parameters_ = gather_parameters(draws, spec_.ball_effects, &PackDraw::ball_effects);
    acts_.clear();
    bars_.clear();
    rebounds_ = false;
    rebound_ = Pack(0.0);
    for (std::size_t e = 0; e < spec_.ball_effects.size(); ++e) {
      const Pack* p = parameters_[e].data();
      const EffectInfo& info = spec_.ball_effects[e].info();
      acts_.push_back(info.place != Place::kString  ? Acts::kAlways
                      : info.has(Trait::kWhenSlack) ? Acts::kWhenSlack
                                                    : Acts::kWhenTaut);
      visit_formula(spec_.ball_effects[e], [&](const auto& formula) {
        if constexpr (requires { rebound_ = formula.rebound(p); }) {
          rebound_ = formula.rebound(p);
          rebounds_ = true;
        }
        if constexpr (requires(CupPosition<Pack> at) { formula.route(at, at, *spec_.cup, p); })
          bars_.push_back(e);
      });
    }
    gravity_ = spec_.draws.front().tree.gravity;
  }

  /// Its weight pulls, wherever the arm will let it hang.
  void start(State& s) const {
    s.pull = Vec3<Pack>{gravity_.x, gravity_.y, gravity_.z} * Pack(spec_.ball_mass);
  }

  /// At rest below the arm, at time 0.
  void hang(const PackArm& arm, State& state) {
    take_frames(arm, state);
    const Vec3<double> down = gravity_ * (1.0 / std::sqrt(dot(gravity_, gravity_)));
    StringBall<Pack, Mask>& s = state.string;
    s.u = down.cast<Pack>();
    s.ball = {state.anchor.x + s.u * length_, {Pack(0.0), Pack(0.0), Pack(0.0)}};
    s.taut = Mask(true);
    state.free = {state.anchor, length_};
    s.a = acceleration(arm, 0.0, s.ball, s.u, s.taut, state.anchor.a, state);
    if (network_) network_->rest(state.network, string_link(arm), s.ball);
  }

  /// What the string does to the arm over its next step.
  void pull_at(PackArm& arm, const State& s) const {
    if (!spec_.has_ball || spec_.string_link < 0 || network_) return;
    const Pose<Pack>& X = arm.X_WL[spec_.string_link];
    const Vec3<Pack> f = transpose_times(X.R, s.pull),
                     p = !bars_.empty() ? transpose_times(X.R, s.free.anchor.x - X.p) : p_LS_;
    auto& f_b = arm.ws.articulated[spec_.string_link].f_b;
    f_b = f_b - Wrench<Pack>{cross(p, f), f};
  }

  /// Follows the arm's step of h [s].
  void follow(const PackArm& arm, double time, double h, State& s) {
    if (network_)
      imagine(arm, s);
    else if (spec_.has_ball)
      move(arm, time, h, s);
    else if (spec_.shows_cup)
      take_frames(arm, s);
  }

  /// @param out  moved behind what was stored
  void observe(const State& s, double*& out) const {
    if (spec_.has_ball) {
      store(s.string.ball.x, out);
      store(s.string.ball.v, out);
    }
    if (spec_.shows_cup) {
      store(s.p_C, out);
      store(s.axis, out);
    }
    if (spec_.cup) store(s.phase, out);
  }

 private:
  /// Anchor and cup at the arm's state.
  void take_frames(const PackArm& arm, State& s) const {
    const int at = spec_.string_link;
    if (at >= 0) {
      const Pose<Pack>& X = arm.X_WL[at];
      const Twist<Pack>& V = arm.ws.links[at].V;
      s.anchor.x = X.R * p_LS_ + X.p;
      s.anchor.v = X.R * (V.linear + cross(V.angular, p_LS_));
    } else {
      s.anchor.x = p_LS_;
      s.anchor.v = {Pack(0.0), Pack(0.0), Pack(0.0)};
    }
    s.anchor.a = {Pack(0.0), Pack(0.0), Pack(0.0)};
    if (!spec_.shows_cup) return;
    const Vec3<Pack> p = spec_.X_LC.p.cast<Pack>(), axis = spec_.X_LC.R.col[2].cast<Pack>();
    s.p_C = spec_.cup_link < 0 ? p : arm.X_WL[spec_.cup_link].R * p + arm.X_WL[spec_.cup_link].p;
    s.axis = spec_.cup_link < 0 ? axis : arm.X_WL[spec_.cup_link].R * axis;
  }

  Vec3<Pack> acceleration(const PackArm& arm, double time, const ParticleState<Pack>& ball,
                          const Vec3<Pack>& u, const Mask& taut, const Vec3<Pack>& anchor_a,
                          const State& state) const {
    Vec3<Pack> a = arm.tree.gravity;
    if (spec_.ball_effects.empty()) return a;
    BallInstant<Pack> x;
    x.time = Pack(time);
    x.ball = ball;
    x.anchor = state.free.anchor;
    x.anchor.a = anchor_a;
    x.length = state.free.length;
    x.u = u;
    x.spin = x.anchor_jerk = {Pack(0.0), Pack(0.0), Pack(0.0)};
    x.gravity = gravity_;
    x.mass = spec_.ball_mass;
    x.radius = spec_.ball_radius;
    for (std::size_t e = 0; e < spec_.ball_effects.size(); ++e) {
      const BoundEffect& effect = spec_.ball_effects[e];
      const auto add = [&](bool is_taut, Vec3<Pack>& sum) {
        x.taut = is_taut;
        visit_formula(effect, [&](const auto& formula) {
          if constexpr (requires { formula.add_acceleration(x, parameters_[e].data(), sum); })
            formula.add_acceleration(x, parameters_[e].data(), sum);
        });
      };
      if (acts_[e] == Acts::kAlways) {
        add(true, a);
        continue;
      }
      const bool when_slack = acts_[e] == Acts::kWhenSlack;
      Vec3<Pack> with = a;
      add(!when_slack, with);
      a = choose(when_slack ? !taut : taut, with, a);
    }
    return a;
  }

  LinkMotion<Pack> string_link(const PackArm& arm) const {
    const Pose<Pack>& X = arm.X_WL[spec_.string_link];
    const Twist<Pack>& V = arm.ws.links[spec_.string_link].V;
    return {X, X.R * V.linear, X.R * V.angular};
  }

  /// The network's ball follows the arm's step.
  void imagine(const PackArm& arm, State& state) {
    take_frames(arm, state);
    network_->step(state.network, string_link(arm), kFarthestBall, state.string.ball);
    if (!spec_.cup) return;
    const Mask upside_down =
        state.phase == phase(BallPhase::kUpsideDown) || state.axis.z < Pack(spec_.least_upright);
    const CupPosition<Pack> at = cup_position(state.string.ball.x, state.p_C, state.axis);
    state.phase = select(
        upside_down, phase(BallPhase::kUpsideDown),
        select(is_inside(at, *spec_.cup), phase(BallPhase::kInside), phase(BallPhase::kImagined)));
  }

  /// The ball follows the arm's step of h [s].
  void move(const PackArm& arm, double time, double h, State& state) {
    const AnchorMotion<Pack> begin = state.anchor;
    const Vec3<Pack> p_C0 = state.p_C, axis0 = state.axis;
    take_frames(arm, state);
    const AnchorMotion<Pack> end = state.anchor;
    const Vec3<Pack> anchor_a = (end.v - begin.v) * Pack(1.0 / h);
    const double dt = h / spec_.ball_steps;
    const Mask free = state.phase == phase(BallPhase::kFree);
    Vec3<Pack> pulled{Pack(0.0), Pack(0.0), Pack(0.0)};
    StringBall<Pack, Mask>& s = state.string;
    for (int k = 1; k <= spec_.ball_steps; ++k) {
      // Hermite's cubic between the arm's steps.
      const double t = double(k) / spec_.ball_steps, t2 = t * t, t3 = t2 * t;
      AnchorMotion<Pack> at = end;
      if (k < spec_.ball_steps) {
        at.x = begin.x * Pack(2 * t3 - 3 * t2 + 1) + end.x * Pack(3 * t2 - 2 * t3) +
               begin.v * Pack((t3 - 2 * t2 + t) * h) + end.v * Pack((t3 - t2) * h);
        at.v = (begin.x - end.x) * Pack((6 * t2 - 6 * t) / h) + begin.v * Pack(3 * t2 - 4 * t + 1) +
               end.v * Pack(3 * t2 - 2 * t);
      }
      state.anchor = at;
      const Vec3<Pack> p_C = p_C0 + (state.p_C - p_C0) * Pack(t),
                       axis = axis0 + (state.axis - axis0) * Pack(t);
      state.free = !bars_.empty()
                       ? around_cup(arm, s.ball.x + s.ball.v * Pack(dt), p_C, axis, state.anchor)
                       : FreeString<Pack>{at, length_};
      step_string_ball(
          s, state.free.anchor, state.free.length, dt,
          [&](const ParticleState<Pack>& ball, const Vec3<Pack>& u, const Mask& taut) {
            return acceleration(arm, time, ball, u, taut, anchor_a, state);
          },
          rebounds_ ? &rebound_ : nullptr);
      pulled = pulled + s.u * s.pull;
      if (spec_.cup) meet(s.ball.x, p_C, axis, state);
    }
    state.pull = pulled * Pack(spec_.ball_mass / h);
    if (!spec_.cup) return;
    touch_obstacles(arm, state);
    const Mask caught = state.phase == phase(BallPhase::kCaptured);
    const Pack rest(spec_.cup->floor + spec_.ball_radius);
    s.ball.x = choose(caught, state.p_C + state.axis * rest, s.ball.x);
    s.ball.v = choose(caught, end.v, s.ball.v);
    const Vec3<Pack> weight = arm.tree.gravity * Pack(spec_.ball_mass);
    state.pull = choose(caught, weight, choose(free, state.pull, weight));
  }

  /// From where on the string of a ball at x is free.
  FreeString<Pack> around_cup(const PackArm& arm, const Vec3<Pack>& x, const Vec3<Pack>& p_C,
                              const Vec3<Pack>& axis, const AnchorMotion<Pack>& knot) const {
    constexpr double kOnAxis = 1e-12;  // [m²]: there, any half plane is one
    const Vec3<Pack> d = x - p_C, k = knot.x - p_C;
    const Pack height = dot(d, axis);
    const Vec3<Pack> beside = d - axis * height;
    const Pack radius = sqrt(dot(beside, beside) + Pack(kOnAxis));
    const Vec3<Pack> outward = beside * (Pack(1.0) / radius);
    StringRoute<Pack> route{};
    const CupPosition<Pack> ball{height, radius}, at{dot(k, axis), dot(k, outward)};
    for (const std::size_t e : bars_)
      visit_formula(spec_.ball_effects[e], [&](const auto& formula) {
        const Pack* p = parameters_[e].data();
        if constexpr (requires { route = formula.route(ball, at, *spec_.cup, p); })
          route = formula.route(ball, at, *spec_.cup, p);
      });
    const Mask bent = route.used > Pack(0.0);
    FreeString<Pack> out{knot, length_ - route.used};
    const Vec3<Pack> edge = p_C + outward * route.edge.radius + axis * route.edge.height;
    Vec3<Pack> v = knot.v;
    if (spec_.string_link >= 0) {
      const Vec3<Pack> w =
          arm.X_WL[spec_.string_link].R * arm.ws.links[spec_.string_link].V.angular;
      v = v + cross(w, edge - knot.x);
    }
    out.anchor.x = choose(bent, edge, knot.x);
    out.anchor.v = choose(bent, v, knot.v);
    return out;
  }

  /// The ball at one of its steps against the cup. Where all balls are far, which is most of the
  /// time, nothing is asked; what is asked of a lane does not depend on the others.
  void meet(const Vec3<Pack>& x, const Vec3<Pack>& p_C, const Vec3<Pack>& axis,
            State& state) const {
    const CupSpec& cup = *spec_.cup;
    const Mask free = state.phase == phase(BallPhase::kFree);
    state.phase = select(free && axis.z < Pack(spec_.least_upright), phase(BallPhase::kUpsideDown),
                         state.phase);
    const Vec3<Pack> d = x - p_C;
    const Mask was_near = state.near_cup;
    state.near_cup = dot(d, d) < Pack(reach_ * reach_);
    if (none_of(state.near_cup)) return;
    const CupPosition<Pack> now = cup_position(x, p_C, axis);
    const CupPosition<Pack> before{select(was_near, state.in_cup.height, now.height),
                                   select(was_near, state.in_cup.radius, now.radius)};
    state.in_cup = now;
    const Mask asked = state.near_cup && state.phase == phase(BallPhase::kFree);
    const Mask touched = distance_to_cup(now, cup) < Pack(spec_.ball_radius);
    const Mask caught = is_caught(before, now, cup, spec_.ball_radius);
    state.phase = select(asked && touched, phase(BallPhase::kTouched), state.phase);
    state.phase = select(asked && caught, phase(BallPhase::kCaptured), state.phase);
  }

  void touch_obstacles(const PackArm& arm, State& state) const {
    for (const CapsuleSpec& o : spec_.obstacles) {
      Vec3<Pack> a = o.p_LA.cast<Pack>(), b = o.p_LB.cast<Pack>();
      if (o.link >= 0) {
        a = arm.X_WL[o.link].R * a + arm.X_WL[o.link].p;
        b = arm.X_WL[o.link].R * b + arm.X_WL[o.link].p;
      }
      const Vec3<Pack> from_middle = state.string.ball.x - (a + b) * Pack(0.5);
      const Vec3<double> along = o.p_LB - o.p_LA;
      const double most = 0.5 * std::sqrt(dot(along, along)) + o.radius + spec_.ball_radius;
      if (none_of(dot(from_middle, from_middle) < Pack(most * most))) continue;
      const Mask touched =
          distance_to_segment(state.string.ball.x, a, b) < Pack(o.radius + spec_.ball_radius);
      const Mask free = state.phase == phase(BallPhase::kFree);
      state.phase = select(free && touched, phase(BallPhase::kTouched), state.phase);
    }
  }

  const PackSpec& spec_;
  Vec3<double> gravity_;
  Pack length_{};
  double reach_ = 0.0;  ///< of the cup [m]
  Vec3<Pack> p_LS_;
  std::vector<std::vector<Pack>> parameters_;
  /// When an effect accelerates the ball.
  enum class Acts { kAlways, kWhenTaut, kWhenSlack };
  std::vector<Acts> acts_;         ///< (effects)
  std::vector<std::size_t> bars_;  ///< effects that bar the string's way
  bool rebounds_ = false;          ///< an effect says how
  Pack rebound_{};                 ///< restitution of a string that becomes taut
  std::optional<NetworkBall<Pack>> network_;
};

}  // namespace DIFFNEA_ISA
}  // namespace diffnea::sim
