/// One definition for every instruction set: see dynamics/batch_kernels.cpp.

#include "sim/pack_world.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/pack.hpp>
#include <diffnea/dynamics/aba.hpp>

#include "sim/pack_arm.hpp"
#include "sim/pack_ball.hpp"
#include "sim/pack_drives.hpp"
#include "sim/pack_effects.hpp"
#include "sim/pack_lanes.hpp"

namespace diffnea::sim {
namespace DIFFNEA_ISA {
namespace {

/// Everything that moves.
struct State {
  std::vector<Pack> q, qd, qdd;  ///< (joints); q̈ of the last step
  std::vector<Pack> qd_desired;  ///< of the last step
  PackDrives::State drives;
  PackBall::State ball;
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
        armature_(spec.joints),
        effects_(spec_),
        drives_(spec_),
        ball_(spec_) {}

  int lanes() const override { return kPackWidth; }

  void reset(const double* q, const double* kp, const double* kd, int count,
             const std::uint64_t* seeds) override {
    LaneDraws draws(kPackWidth);
    for (int lane = 0; lane < kPackWidth; ++lane)
      draws[lane] = &spec_.draws[seeds[std::min(lane, count - 1)] % spec_.draws.size()];
    const std::vector<double> start = in_lanes(q, count), proportional = in_lanes(kp, count),
                              derivative = in_lanes(kd, count);
    if (draws == draws_ && start == start_ && proportional == kp_ &&
        derivative == kd_) {  // where it settles is known
      state_ = settled_;
      arm_.outward(state_.q, state_.qd);
      return;
    }
    draws_ = draws;
    start_ = start;
    kp_ = proportional;
    kd_ = derivative;
    take_parameters();
    settle();
    settled_ = state_;
  }

  void step(const double* q, const double* qd) override {
    for (int i = 0; i < spec_.arm_steps; ++i) {
      move_arm(q, qd, i);
      ball_.follow(arm_, state_.time, spec_.period / spec_.arm_steps, state_.ball);
    }
    state_.time += spec_.period;
  }

  void observe(double* out) const override {
    for (const std::vector<Pack>* x : {&state_.q, &state_.qd})
      for (const Pack& value : *x) {
        store(value, out);
        out += kPackWidth;
      }
    ball_.observe(state_.ball, out);
  }

 private:
  /// @param rows  (joints × count)  @return (joints × lanes)
  std::vector<double> in_lanes(const double* rows, int count) const {
    std::vector<double> out(static_cast<std::size_t>(n_) * kPackWidth);
    for (int j = 0; j < n_; ++j)
      for (int lane = 0; lane < kPackWidth; ++lane)
        out[j * kPackWidth + lane] = rows[j * count + std::min(lane, count - 1)];
    return out;
  }
  void take_parameters() {
    arm_.tree = gather_tree(draws_);
    if (drives_.any()) drives_.take_parameters(draws_, arm_.tree);
    effects_.take_parameters(draws_);
    ball_.take_parameters(draws_);
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
    ball_.start(state_.ball);
    arm_.outward(state_.q, state_.qd);
    if (drives_.any()) {
      call_inlined<Pack>([&] { diffnea::detail::gravity_torques(arm_.tree, arm_.ws, u_.data()); });
      drives_.start(u_, state_.drives);
    }
    const long steps = std::lround(spec_.settle_time / spec_.period) * spec_.arm_steps;
    for (long i = 0; i < steps; ++i)
      move_arm(start_.data(), rest.data(), static_cast<int>(i % spec_.arm_steps));
    if (drives_.any()) drives_.rest(state_.drives);
    state_.qd.assign(n_, Pack(0.0));
    state_.qdd.assign(n_, Pack(0.0));
    state_.time = 0.0;
    arm_.outward(state_.q, state_.qd);
    ball_.hang(arm_, state_.ball);
  }

  /// Torque of the controller, once a period.
  void control(const double* q, const double* qd) {
    const bool computed = spec_.law == ControlLaw::kComputedTorque;
    std::fill(u_.begin(), u_.end(), Pack(0.0));
    if (!computed && spec_.gravity_compensation) {
      if (spec_.same_kinematics) {  // A and F of `ws_` are scratch until the accelerations
        call_inlined<Pack>([&] { diffnea::detail::gravity_torques(nominal_, arm_.ws, u_.data()); });
      } else {
        diffnea::detail::joint_poses(nominal_, state_.q.data(), nominal_ws_);
        call_inlined<Pack>(
            [&] { diffnea::detail::gravity_torques(nominal_, nominal_ws_, u_.data()); });
      }
    }
    for (int j = 0; j < n_; ++j) {
      const Pack desired = load(q + j * kPackWidth), rate = load(qd + j * kPackWidth);
      const Pack kp = load(&kp_[j * kPackWidth]), kd = load(&kd_[j * kPackWidth]);
      const Pack feedback = kp * (desired - state_.q[j]) + kd * (rate - state_.qd[j]);
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

  /// Step `i` of a period.
  void move_arm(const double* q, const double* qd, int i) {
    const double h = spec_.period / spec_.arm_steps;
    if (i == 0) control(q, qd);
    u_step_ = u_;
    if (drives_.any()) drives_.act(i, u_step_, state_.drives);
    for (int j = 0; j < n_; ++j) armature_[j] = arm_.tree.links[j].armature;
    effects_.act(state_.time, h, state_.q, state_.qd, state_.qdd, u_step_, arm_.tree);
    if (drives_.any())
      drives_.couple(state_.time, h, state_.q, state_.qd, state_.qdd, state_.drives, u_step_,
                     arm_.tree);
    ball_.pull_at(arm_, state_.ball);
    call_inlined<Pack>([&] {
      diffnea::detail::aba_accelerations(std::false_type{}, arm_.tree, state_.qd.data(),
                                         u_step_.data(), arm_.ws, state_.qdd.data());
    });
    if (drives_.any()) drives_.advance(h, state_.qd, state_.qdd, arm_.tree, arm_.ws, state_.drives);
    for (int j = 0; j < n_; ++j) {
      arm_.tree.links[j].armature = armature_[j];
      // The acceleration is that of the whole step: positions to second order.
      state_.q[j] += (state_.qd[j] + state_.qdd[j] * Pack(0.5 * h)) * Pack(h);
      state_.qd[j] += state_.qdd[j] * Pack(h);
    }
    arm_.outward(state_.q, state_.qd);
  }

  PackSpec spec_;
  int n_;
  LaneDraws draws_;
  std::vector<double> start_, kp_, kd_;  ///< (joints × lanes)
  PackArm arm_;
  Tree<Pack> nominal_;
  LinkStates<Pack, Pack> nominal_ws_;
  std::vector<Pack> u_, u_step_, qdd_, armature_;
  PackEffects effects_;
  PackDrives drives_;
  PackBall ball_;
  State state_, settled_;
};

}  // namespace

std::unique_ptr<PackWorld> make_pack_world(const PackSpec& spec) {
  return std::make_unique<World>(spec);
}

}  // namespace DIFFNEA_ISA
}  // namespace diffnea::sim
