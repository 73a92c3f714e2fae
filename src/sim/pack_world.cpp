/// One definition for every instruction set: see dynamics/batch_kernels.cpp.

#include "sim/pack_world.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/pack.hpp>
#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/cup_contact.hpp>
#include <diffnea/dynamics/string_step.hpp>
#include <diffnea/effects/ball_effect.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/sim/simulator.hpp>

#include "sim/network_ball.hpp"
#include "sim/pack_drives.hpp"

namespace diffnea {

/// What the recursions take for detail::joint_pose where links are of packs: libstdc++'s sine and
/// cosine are two range reductions where one does.
template <int K>
Pose<Pack> joint_pose(const Link<Pack>& link, RevoluteAxis<K>, const Pack& q) {
  constexpr int i = (K + 1) % 3, j = (K + 2) % 3;
  Pack s, c;
  sin_cos(q, s, c);
  const Mat3<Pack>& R0 = link.X_PJ.R;
  Pose<Pack> X;
  X.R.col[K] = R0.col[K];
  X.R.col[i] = R0.col[i] * c + R0.col[j] * s;
  X.R.col[j] = R0.col[j] * c - R0.col[i] * s;
  X.p = link.X_PJ.p;
  return X;
}

}  // namespace diffnea

namespace diffnea::sim {
namespace DIFFNEA_ISA {
namespace {

using Mask = Pack::mask_type;
using Tag = std::experimental::element_aligned_tag;

Pack load(const double* row) { return Pack(row, Tag{}); }
void store(const Pack& x, double* row) { x.copy_to(row, Tag{}); }
void store(const Vec3<Pack>& v, double*& row) {
  for (const Pack& x : {v.x, v.y, v.z}) {
    store(x, row);
    row += kPackWidth;
  }
}
Vec3<Pack> choose(const Mask& condition, const Vec3<Pack>& a, const Vec3<Pack>& b) {
  return {select(condition, a.x, b.x), select(condition, a.y, b.y), select(condition, a.z, b.z)};
}
Pack phase(BallPhase p) { return Pack(static_cast<double>(p)); }

/// Lane l's number is get(draw of lane l).
template <class Get>
Pack gather(const std::vector<const PackDraw*>& draws, const Get& get) {
  return Pack([&](auto lane) { return get(*draws[lane]); });
}

Vec3<Pack> gather_vector(const std::vector<const PackDraw*>& d,
                         Vec3<double> (*get)(const PackDraw&)) {
  return {gather(d, [&](const PackDraw& x) { return get(x).x; }),
          gather(d, [&](const PackDraw& x) { return get(x).y; }),
          gather(d, [&](const PackDraw& x) { return get(x).z; })};
}

Tree<Pack> gather_tree(const std::vector<const PackDraw*>& d) {
  Tree<Pack> out = d.front()->tree.cast<Pack>();
  for (std::size_t i = 0; i < out.links.size(); ++i) {
    Link<Pack>& link = out.links[i];
    const auto of = [&](auto get) {
      return gather(d, [&](const PackDraw& x) { return get(x.tree.links[i]); });
    };
    using L = const Link<double>&;
    link.armature = of([](L l) { return l.armature; });
    link.inertia.m = of([](L l) { return l.inertia.m; });
    link.inertia.h = {of([](L l) { return l.inertia.h.x; }), of([](L l) { return l.inertia.h.y; }),
                      of([](L l) { return l.inertia.h.z; })};
    link.inertia.I = {
        of([](L l) { return l.inertia.I.xx; }), of([](L l) { return l.inertia.I.xy; }),
        of([](L l) { return l.inertia.I.xz; }), of([](L l) { return l.inertia.I.yy; }),
        of([](L l) { return l.inertia.I.yz; }), of([](L l) { return l.inertia.I.zz; })};
    link.X_PJ.p = {of([](L l) { return l.X_PJ.p.x; }), of([](L l) { return l.X_PJ.p.y; }),
                   of([](L l) { return l.X_PJ.p.z; })};
    for (int c = 0; c < 3; ++c)
      link.X_PJ.R.col[c] = {of([c](L l) { return l.X_PJ.R.col[c].x; }),
                            of([c](L l) { return l.X_PJ.R.col[c].y; }),
                            of([c](L l) { return l.X_PJ.R.col[c].z; })};
  }
  const auto gravity = [](const PackDraw& x) { return x.tree.gravity; };
  out.gravity = gather_vector(d, gravity);
  return out;
}

/// Everything that moves.
struct State {
  std::vector<Pack> q, qd, qdd;  ///< (joints); q̈ of the last step
  std::vector<Pack> qd_desired;  ///< of the last step
  PackDrives::State drives;
  StringBall<Pack, Mask> string;
  AnchorMotion<Pack> anchor;  ///< at the ball's time
  FreeString<Pack> free;      ///< from where on the string is, where a cup may bar it
  Vec3<Pack> p_C, axis;       ///< the cup, at the ball's time
  CupPosition<Pack> in_cup;   ///< of the ball's last step, where it was near
  Mask near_cup = Mask(false);
  Vec3<Pack> pull;                 ///< of the string on the arm, W [N]
  NetworkBallState<Pack> network;  ///< where the ball is one's
  Pack phase = Pack(0.0);
  double time = 0.0;
};

class World : public PackWorld {
 public:
  explicit World(const PackSpec& spec)
      : spec_(spec),
        n_(spec.joints),
        nominal_(spec.nominal.cast<Pack>()),
        u_(spec.joints),
        qdd_(spec.joints),
        total_(spec.joints),
        at_rest_(spec.joints),
        zero_(spec.joints, Pack(0.0)),
        armature_(spec.joints),
        drives_(spec_) {
    // From beyond this, no ball gets into the cup in a step.
    constexpr double kStep = 0.02;  // [m]: 1 ms at 20 m/s
    if (spec.cup)
      reach_ = std::hypot(spec.cup->rim, spec.cup->inner_radius + spec.cup->wall) +
               spec.ball_radius + kStep;
    if (spec.network) network_.emplace(spec.network);
  }

  int lanes() const override { return kPackWidth; }

  void reset(const double* q, long stride, int count, const std::uint64_t* seeds) override {
    std::vector<const PackDraw*> draws(kPackWidth);
    std::vector<double> start(static_cast<std::size_t>(n_) * kPackWidth);
    for (int lane = 0; lane < kPackWidth; ++lane) {
      const int from = std::min(lane, count - 1);
      draws[lane] = &spec_.draws[seeds[from] % spec_.draws.size()];
      for (int j = 0; j < n_; ++j) start[j * kPackWidth + lane] = q[j * stride + from];
    }
    if (draws == draws_ && start == start_) {  // where it settles is known
      state_ = settled_;
      aba_outward();
      return;
    }
    draws_ = draws;
    start_ = start;
    take_parameters();
    settle();
    settled_ = state_;
  }

  void step(const double* q, const double* qd) override {
    for (int i = 0; i < spec_.arm_steps; ++i) {
      move_arm(q, qd, i);
      if (network_)
        imagine_ball();
      else if (spec_.has_ball)
        move_ball(spec_.period / spec_.arm_steps);
    }
    state_.time += spec_.period;
  }

  void observe(double* out) const override {
    for (const std::vector<Pack>* x : {&state_.q, &state_.qd})
      for (const Pack& value : *x) {
        store(value, out);
        out += kPackWidth;
      }
    if (spec_.has_ball) {
      store(state_.string.ball.x, out);
      store(state_.string.ball.v, out);
    }
    if (spec_.shows_cup) {
      store(state_.p_C, out);
      store(state_.axis, out);
    }
    if (spec_.cup) store(state_.phase, out);
  }

 private:
  void take_parameters() {
    tree_ = gather_tree(draws_);
    if (drives_.any()) drives_.take_parameters(draws_, tree_);
    length_ = gather(draws_, [](const PackDraw& d) { return d.length; });
    p_LS_ = gather_vector(draws_, [](const PackDraw& d) { return d.p_LS; });
    const auto values = [&](const std::vector<BoundEffect>& effects,
                            std::vector<std::vector<double>> PackDraw::* of,
                            std::vector<std::vector<Pack>>& out) {
      out.resize(effects.size());
      for (std::size_t e = 0; e < effects.size(); ++e) {
        out[e].resize(effects[e].parameters.size());
        for (std::size_t k = 0; k < out[e].size(); ++k)
          out[e][k] = gather(draws_, [&](const PackDraw& d) { return (d.*of)[e][k]; });
      }
    };
    values(spec_.effects, &PackDraw::effects, parameters_);
    constant_.assign(n_, Pack(0.0));
    viscous_.assign(n_, Pack(0.0));
    const std::vector<Pack> one(n_, Pack(1.0));
    for (std::size_t e = 0; e < spec_.effects.size(); ++e) {
      if (spec_.kinds[e] == EffectKind::kConstant) add_effect(e, zero_, constant_);
      if (spec_.kinds[e] == EffectKind::kLinear) add_effect(e, one, viscous_);
    }
    values(spec_.ball_effects, &PackDraw::ball_effects, ball_parameters_);
    for (std::size_t e = 0; e < spec_.ball_effects.size(); ++e) {
      const AnyEffect& type = spec_.ball_effects[e].type;
      if (std::holds_alternative<StringWrap>(type)) wrap_ = ball_parameters_[e].data();
      if (std::holds_alternative<StringRebound>(type)) rebound_ = ball_parameters_[e].data();
    }
    gravity_ = spec_.draws.front().tree.gravity;
  }

  /// The arm holds its start, the ball hangs below it.
  void settle() {
    state_ = {};
    state_.q.resize(n_);
    state_.qd.assign(n_, Pack(0.0));
    state_.qdd.assign(n_, Pack(0.0));
    state_.qd_desired.assign(n_, Pack(0.0));
    for (int j = 0; j < n_; ++j) state_.q[j] = load(&start_[j * kPackWidth]);
    const std::vector<double> rest(start_.size(), 0.0);
    state_.pull = Vec3<Pack>{gravity_.x, gravity_.y, gravity_.z} * Pack(spec_.ball_mass);
    aba_outward();
    if (drives_.any()) {
      call_inlined<Pack>([&] { diffnea::detail::gravity_torques(tree_, ws_, u_.data()); });
      drives_.start(u_, state_.drives);
    }
    const long steps = std::lround(spec_.settle_time / spec_.period) * spec_.arm_steps;
    for (long i = 0; i < steps; ++i)
      move_arm(start_.data(), rest.data(), static_cast<int>(i % spec_.arm_steps));
    if (drives_.any()) drives_.rest(state_.drives);
    state_.qd.assign(n_, Pack(0.0));
    state_.qdd.assign(n_, Pack(0.0));
    state_.time = 0.0;
    aba_outward();
    take_frames();
    const Vec3<double> down = gravity_ * (1.0 / std::sqrt(dot(gravity_, gravity_)));
    StringBall<Pack, Mask>& s = state_.string;
    s.u = down.cast<Pack>();
    s.ball = {state_.anchor.x + s.u * length_, {Pack(0.0), Pack(0.0), Pack(0.0)}};
    s.taut = Mask(true);
    state_.free = {state_.anchor, length_};
    s.a = acceleration(s.ball, s.u, s.taut, state_.anchor.a);
    if (network_) network_->rest(state_.network, string_link(), s.ball);
  }

  /// Poses and twists of the arm as it is: wherever it was moved, this follows.
  void aba_outward() {
    X_WL_.resize(n_);
    call_inlined<Pack>([&] {
      diffnea::detail::aba_outward(tree_, state_.q.data(), state_.qd.data(), ws_);
      for (int i = 0; i < n_; ++i) {
        const int parent = tree_.links[i].parent;
        X_WL_[i] = parent < 0 ? ws_.links[i].X_PL : X_WL_[parent] * ws_.links[i].X_PL;
      }
    });
  }

  /// Anchor and cup at the arm's state.
  void take_frames() {
    const int at = spec_.string_link;
    if (at >= 0) {
      const Pose<Pack>& X = X_WL_[at];
      const Twist<Pack>& V = ws_.links[at].V;
      state_.anchor.x = X.R * p_LS_ + X.p;
      state_.anchor.v = X.R * (V.linear + cross(V.angular, p_LS_));
    } else {
      state_.anchor.x = p_LS_;
      state_.anchor.v = {Pack(0.0), Pack(0.0), Pack(0.0)};
    }
    state_.anchor.a = {Pack(0.0), Pack(0.0), Pack(0.0)};
    if (!spec_.shows_cup) return;
    const Vec3<Pack> p = spec_.X_LC.p.cast<Pack>(), axis = spec_.X_LC.R.col[2].cast<Pack>();
    state_.p_C = spec_.cup_link < 0 ? p : X_WL_[spec_.cup_link].R * p + X_WL_[spec_.cup_link].p;
    state_.axis = spec_.cup_link < 0 ? axis : X_WL_[spec_.cup_link].R * axis;
  }

  /// Torque of the controller, once a period.
  void control(const double* q, const double* qd) {
    const bool computed = spec_.law == ControlLaw::kComputedTorque;
    std::fill(u_.begin(), u_.end(), Pack(0.0));
    if (!computed && spec_.gravity_compensation) {
      if (spec_.same_kinematics) {  // A and F of `ws_` are scratch until the accelerations
        call_inlined<Pack>([&] { diffnea::detail::gravity_torques(nominal_, ws_, u_.data()); });
      } else {
        diffnea::detail::joint_poses(nominal_, state_.q.data(), nominal_ws_);
        call_inlined<Pack>(
            [&] { diffnea::detail::gravity_torques(nominal_, nominal_ws_, u_.data()); });
      }
    }
    for (int j = 0; j < n_; ++j) {
      const Pack desired = load(q + j * kPackWidth), rate = load(qd + j * kPackWidth);
      const Pack feedback =
          spec_.kp[j] * (desired - state_.q[j]) + spec_.kd[j] * (rate - state_.qd[j]);
      if (computed)
        qdd_[j] = spec_.passive[j]
                      ? Pack(0.0)
                      : feedback + (rate - state_.qd_desired[j]) * Pack(1.0 / spec_.period);
      else
        u_[j] += feedback;
      state_.qd_desired[j] = rate;
    }
    if (computed)
      call_inlined<Pack>([&] {
        diffnea::detail::rnea(nominal_, state_.q.data(), state_.qd.data(), qdd_.data(), nominal_ws_,
                              u_.data());
      });
    for (int j = 0; j < n_; ++j) {
      const Pack most(spec_.limit[j]);
      u_[j] = select(u_[j] > most, most, select(u_[j] < -most, Pack(-most), u_[j]));
      if (spec_.passive[j]) u_[j] = Pack(0.0);
    }
  }

  void add_effect(std::size_t e, const std::vector<Pack>& qd, std::vector<Pack>& tau) const {
    JointSample<Pack> x;
    x.time = state_.time;
    x.q = state_.q.data();
    x.qd = qd.data();
    x.qdd = x.tau = zero_.data();  // unread: such effects were refused
    add_torque<Pack>(spec_.effects[e], spec_.draws.front().tree, x, parameters_[e].data(),
                     tau.data());
  }

  /// Speeds at which what it acts on is at rest. A residual's joint alone: a torque over another
  /// joint's speed is no friction of its own, however large it is while this one hardly moves.
  const std::vector<Pack>& resting(std::size_t e) {
    if (!std::holds_alternative<Residual>(spec_.effects[e].type)) return zero_;
    still_ = speed_;
    still_[spec_.effects[e].joints.front()] = Pack(0.0);
    return still_;
  }

  /// Friction and all else at joints. With τ_e(q, q̇) = τ_e(q, 0) + c(q̇) q̇, the second part is
  /// taken at the middle of the step, c ≥ 0 held at what
  /// the last acceleration makes of the velocity there: h c/2 joins the armature. So no friction,
  /// however steep at rest, makes a step unstable.
  void take_effects(double h) {
    for (int j = 0; j < n_; ++j) armature_[j] = tree_.links[j].armature;
    if (spec_.effects.empty()) return;
    constexpr double kLeast = 1e-9;  // [rad/s]: below, the secant is that of this speed
    for (int j = 0; j < n_; ++j) {
      const Pack v = state_.qd[j] + state_.qdd[j] * Pack(0.5 * h);
      speed_[j] = select(abs(v) < Pack(kLeast), Pack(kLeast), v);
      total_[j] = constant_[j] + viscous_[j] * speed_[j];
      at_rest_[j] = constant_[j];
    }
    for (std::size_t e = 0; e < spec_.effects.size(); ++e) {
      if (spec_.kinds[e] < EffectKind::kDissipative) continue;
      add_effect(e, speed_, total_);
      if (spec_.kinds[e] == EffectKind::kGeneral) add_effect(e, resting(e), at_rest_);
    }
    for (int j = 0; j < n_; ++j) {
      const Pack slope = (total_[j] - at_rest_[j]) / speed_[j];
      const Pack secant = select(slope > Pack(0.0), slope, Pack(0.0));
      u_step_[j] -= total_[j] + secant * (state_.qd[j] - speed_[j]);
      tree_.links[j].armature = armature_[j] + secant * Pack(0.5 * h);
    }
  }

  /// Step `i` of a period.
  void move_arm(const double* q, const double* qd, int i) {
    const double h = spec_.period / spec_.arm_steps;
    if (i == 0) control(q, qd);
    u_step_ = u_;
    if (drives_.any()) drives_.act(i, u_step_, state_.drives);
    take_effects(h);
    if (drives_.any())
      drives_.couple(state_.time, h, state_.q, state_.qd, state_.qdd, state_.drives, u_step_,
                     tree_);
    if (spec_.has_ball && spec_.string_link >= 0 && !network_) {
      const Pose<Pack>& X = X_WL_[spec_.string_link];
      const Vec3<Pack> f = transpose_times(X.R, state_.pull),
                       p = wrap_ ? transpose_times(X.R, state_.free.anchor.x - X.p) : p_LS_;
      auto& f_b = ws_.articulated[spec_.string_link].f_b;
      f_b = f_b - Wrench<Pack>{cross(p, f), f};
    }
    call_inlined<Pack>([&] {
      diffnea::detail::aba_accelerations(tree_, state_.qd.data(), u_step_.data(), ws_,
                                         state_.qdd.data());
    });
    if (drives_.any()) drives_.advance(h, state_.qd, state_.qdd, tree_, ws_, state_.drives);
    for (int j = 0; j < n_; ++j) {
      tree_.links[j].armature = armature_[j];
      // The acceleration is that of the whole step: positions to second order.
      state_.q[j] += (state_.qd[j] + state_.qdd[j] * Pack(0.5 * h)) * Pack(h);
      state_.qd[j] += state_.qdd[j] * Pack(h);
    }
    aba_outward();
  }

  Vec3<Pack> acceleration(const ParticleState<Pack>& ball, const Vec3<Pack>& u, const Mask& taut,
                          const Vec3<Pack>& anchor_a) const {
    Vec3<Pack> a = tree_.gravity;
    if (spec_.ball_effects.empty()) return a;
    BallInstant<Pack> x;
    x.time = Pack(state_.time);
    x.ball = ball;
    x.anchor = state_.free.anchor;
    x.anchor.a = anchor_a;
    x.length = state_.free.length;
    x.u = u;
    x.spin = x.anchor_jerk = {Pack(0.0), Pack(0.0), Pack(0.0)};
    x.gravity = gravity_;
    x.mass = spec_.ball_mass;
    x.radius = spec_.ball_radius;
    for (std::size_t e = 0; e < spec_.ball_effects.size(); ++e) {
      const BoundEffect& effect = spec_.ball_effects[e];
      const auto add = [&](bool is_taut, Vec3<Pack>& sum) {
        x.taut = is_taut;
        std::visit(
            [&](const auto& formula) {
              if constexpr (requires {
                              formula.add_acceleration(x, ball_parameters_[e].data(), sum);
                            })
                formula.add_acceleration(x, ball_parameters_[e].data(), sum);
            },
            effect.type);
      };
      if (effect.info().place != Place::kString) {
        add(true, a);
        continue;
      }
      const bool when_slack =
          std::visit([]<class E>(const E&) { return requires { E::kWhenSlack; }; }, effect.type);
      Vec3<Pack> with = a;
      add(!when_slack, with);
      a = choose(when_slack ? !taut : taut, with, a);
    }
    return a;
  }

  LinkMotion<Pack> string_link() const {
    const Pose<Pack>& X = X_WL_[spec_.string_link];
    const Twist<Pack>& V = ws_.links[spec_.string_link].V;
    return {X, X.R * V.linear, X.R * V.angular};
  }

  /// The network's ball follows the arm's step.
  void imagine_ball() {
    take_frames();
    network_->step(state_.network, string_link(), kFarthestBall, state_.string.ball);
    if (!spec_.cup) return;
    const Mask upside_down =
        state_.phase == phase(BallPhase::kUpsideDown) || state_.axis.z < Pack(spec_.least_upright);
    const CupPosition<Pack> at = cup_position(state_.string.ball.x, state_.p_C, state_.axis);
    state_.phase = select(
        upside_down, phase(BallPhase::kUpsideDown),
        select(is_inside(at, *spec_.cup), phase(BallPhase::kInside), phase(BallPhase::kImagined)));
  }

  /// The ball follows the arm's step of h [s].
  void move_ball(double h) {
    const AnchorMotion<Pack> begin = state_.anchor;
    const Vec3<Pack> p_C0 = state_.p_C, axis0 = state_.axis;
    take_frames();
    const AnchorMotion<Pack> end = state_.anchor;
    const Vec3<Pack> anchor_a = (end.v - begin.v) * Pack(1.0 / h);
    const double dt = h / spec_.ball_steps;
    const Mask free = state_.phase == phase(BallPhase::kFree);
    Pack taken(0.0);
    Vec3<Pack> pulled{Pack(0.0), Pack(0.0), Pack(0.0)};
    StringBall<Pack, Mask>& s = state_.string;
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
      state_.anchor = at;
      const Vec3<Pack> p_C = p_C0 + (state_.p_C - p_C0) * Pack(t),
                       axis = axis0 + (state_.axis - axis0) * Pack(t);
      state_.free = wrap_ ? around_cup(s.ball.x + s.ball.v * Pack(dt), p_C, axis)
                          : FreeString<Pack>{at, length_};
      step_string_ball(
          s, state_.free.anchor, state_.free.length, dt,
          [&](const ParticleState<Pack>& ball, const Vec3<Pack>& u, const Mask& taut) {
            return acceleration(ball, u, taut, anchor_a);
          },
          rebound_);
      pulled = pulled + s.u * s.pull;
      if (spec_.cup) meet(s.ball.x, p_C, axis);
    }
    state_.pull = pulled * Pack(spec_.ball_mass / h);
    if (!spec_.cup) return;
    touch_obstacles();
    const Mask caught = state_.phase == phase(BallPhase::kCaptured);
    const Pack rest(spec_.cup->floor + spec_.ball_radius);
    s.ball.x = choose(caught, state_.p_C + state_.axis * rest, s.ball.x);
    s.ball.v = choose(caught, end.v, s.ball.v);
    const Vec3<Pack> weight = tree_.gravity * Pack(spec_.ball_mass);
    state_.pull = choose(caught, weight, choose(free, state_.pull, weight));
  }

  /// From where on the string of a ball at x is free.
  FreeString<Pack> around_cup(const Vec3<Pack>& x, const Vec3<Pack>& p_C,
                              const Vec3<Pack>& axis) const {
    constexpr double kOnAxis = 1e-12;  // [m²]: there, any half plane is one
    const AnchorMotion<Pack>& knot = state_.anchor;
    const Vec3<Pack> d = x - p_C, k = knot.x - p_C;
    const Pack height = dot(d, axis);
    const Vec3<Pack> beside = d - axis * height;
    const Pack radius = sqrt(dot(beside, beside) + Pack(kOnAxis));
    const Vec3<Pack> outward = beside * (Pack(1.0) / radius);
    const StringRoute<Pack> route = route_around_cup<Pack>(
        {height, radius}, {dot(k, axis), dot(k, outward)}, *spec_.cup, *wrap_);
    const Mask bent = route.used > Pack(0.0);
    FreeString<Pack> out{knot, length_ - route.used};
    const Vec3<Pack> edge = p_C + outward * route.edge.radius + axis * route.edge.height;
    Vec3<Pack> v = knot.v;
    if (spec_.string_link >= 0) {
      const Vec3<Pack> w = X_WL_[spec_.string_link].R * ws_.links[spec_.string_link].V.angular;
      v = v + cross(w, edge - knot.x);
    }
    out.anchor.x = choose(bent, edge, knot.x);
    out.anchor.v = choose(bent, v, knot.v);
    return out;
  }

  /// The ball at one of its steps against the cup. Where all balls are far, which is most of the
  /// time, nothing is asked; what is asked of a lane does not depend on the others.
  void meet(const Vec3<Pack>& x, const Vec3<Pack>& p_C, const Vec3<Pack>& axis) {
    const CupSpec& cup = *spec_.cup;
    const Mask free = state_.phase == phase(BallPhase::kFree);
    state_.phase = select(free && axis.z < Pack(spec_.least_upright), phase(BallPhase::kUpsideDown),
                          state_.phase);
    const Vec3<Pack> d = x - p_C;
    const Mask was_near = state_.near_cup;
    state_.near_cup = dot(d, d) < Pack(reach_ * reach_);
    if (none_of(state_.near_cup)) return;
    const CupPosition<Pack> now = cup_position(x, p_C, axis);
    const CupPosition<Pack> before{select(was_near, state_.in_cup.height, now.height),
                                   select(was_near, state_.in_cup.radius, now.radius)};
    state_.in_cup = now;
    const Mask asked = state_.near_cup && state_.phase == phase(BallPhase::kFree);
    const Mask touched = distance_to_cup(now, cup) < Pack(spec_.ball_radius);
    const Mask caught = is_caught(before, now, cup, spec_.ball_radius);
    state_.phase = select(asked && touched, phase(BallPhase::kTouched), state_.phase);
    state_.phase = select(asked && caught, phase(BallPhase::kCaptured), state_.phase);
  }

  void touch_obstacles() {
    for (const CapsuleSpec& o : spec_.obstacles) {
      Vec3<Pack> a = o.p_LA.cast<Pack>(), b = o.p_LB.cast<Pack>();
      if (o.link >= 0) {
        a = X_WL_[o.link].R * a + X_WL_[o.link].p;
        b = X_WL_[o.link].R * b + X_WL_[o.link].p;
      }
      const Vec3<Pack> from_middle = state_.string.ball.x - (a + b) * Pack(0.5);
      const Vec3<double> along = o.p_LB - o.p_LA;
      const double most = 0.5 * std::sqrt(dot(along, along)) + o.radius + spec_.ball_radius;
      if (none_of(dot(from_middle, from_middle) < Pack(most * most))) continue;
      const Mask touched =
          distance_to_segment(state_.string.ball.x, a, b) < Pack(o.radius + spec_.ball_radius);
      const Mask free = state_.phase == phase(BallPhase::kFree);
      state_.phase = select(free && touched, phase(BallPhase::kTouched), state_.phase);
    }
  }

  PackSpec spec_;
  int n_;
  std::vector<const PackDraw*> draws_;
  std::vector<double> start_;  ///< (joints × lanes)
  Tree<Pack> tree_, nominal_;
  Vec3<double> gravity_;
  Pack length_{};
  double reach_ = 0.0;  ///< of the cup [m]
  Vec3<Pack> p_LS_;
  std::vector<std::vector<Pack>> parameters_, ball_parameters_;
  const Pack* wrap_ = nullptr;     ///< size of what bars the string; null: nothing does
  const Pack* rebound_ = nullptr;  ///< restitution of a string that becomes taut; null: none
  AbaStates<Pack, Pack> ws_;
  LinkStates<Pack, Pack> nominal_ws_;
  std::vector<Pose<Pack>> X_WL_;
  std::vector<Pack> u_, u_step_, qdd_, total_, at_rest_, zero_, armature_, speed_ = zero_;
  std::vector<Pack> still_ = zero_;       ///< scratch of resting()
  std::vector<Pack> constant_, viscous_;  ///< of effects that need not be asked again
  PackDrives drives_;
  State state_, settled_;
  std::optional<NetworkBall<Pack>> network_;
};

}  // namespace

std::unique_ptr<PackWorld> make_pack_world(const PackSpec& spec) {
  return std::make_unique<World>(spec);
}

}  // namespace DIFFNEA_ISA
}  // namespace diffnea::sim
