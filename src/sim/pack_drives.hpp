#pragma once
/// Effects with memory in a pack of worlds: what drives make of the commanded torque (limit, delay,
/// lag), states at joints, motors behind springs. Included by pack_world.cpp alone, once per
/// instruction set.
///
/// Over a step of h the joint's acceleration a is constant. What depends on velocities and
/// positions acts as at v = v₀ + σ h a after the time σ h: σ = ½ is the implicit midpoint,
/// undamped and of second order, σ → 1 implicit Euler. Half is taken where a period of the
/// vibration has six steps or more; stiffer ones fade instead of ringing from step to step.
/// - A state at a joint, after σ h at constant v (effects/memory.hpp): torque T₀ + c v with the
/// secant
///   c ≥ 0 at the velocity that the last acceleration predicts, as friction: c σ h joins the
///   armature.
/// - A spring between rotor J and link, wound up by δ = θ − q: τ = τ_p + G δ̈ with
///   τ_p = K δ + (K σ h + D) δ̇ and G = K σ² h² + D σ h. The rotor's J (q̈ + δ̈) = u − τ gives δ̈, so
///   that the link feels the torque τ_p + G (u − τ_p)/(J + G) and the armature G J/(J + G): u and J
///   where the spring is stiff.
/// - A delay and a lag give the mean torque of the step, exact for a command that is held.

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <diffnea/core/pack.hpp>
#include <diffnea/dynamics/aba.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/effects/hidden_motor.hpp>
#include <diffnea/effects/stepping.hpp>

#include "sim/drives.hpp"
#include "sim/pack_lanes.hpp"
#include "sim/pack_world.hpp"

namespace diffnea::sim {
namespace DIFFNEA_ISA {

class PackDrives {
 public:
  /// Everything that they remember.
  struct State {
    std::vector<double> commands;  ///< ring of periods, each (joints × lanes)
    long given = 0;                ///< commands so far; the first counts as held since ever
    std::vector<Pack> lagged;      ///< (joints)
    std::vector<Pack> wind_up, wind_rate, wind_acceleration;  ///< (motors) θ − q
    std::vector<Pack> states;   ///< one per effect, at joints and motors
    std::vector<Pack> inertia;  ///< (joints) that hangs on them without armature; 0: not yet known
  };

  explicit PackDrives(const PackSpec& spec) : spec_(spec), n_(spec.joints), motor_at_(n_, -1) {
    for (std::size_t e = 0; e < spec.drives.size(); ++e)
      for (const int j : spec.drives[e].joints)
        if (spec.drives[e].info().motor == HiddenMotor::kSpring) {
          motor_at_[j] = static_cast<int>(motors_.size());
          motors_.push_back({.effect = e, .joint = j});
        }
    for (std::size_t e = 0; e < spec.drives.size(); ++e)
      for (const int j : spec.drives[e].joints)
        if (has_state(spec.drives[e]))
          for (const bool at_motor : {true, false})
            if (!at_motor || motor_at_[j] >= 0) states_.push_back({e, j, at_motor});
    for (std::vector<Pack>* x :
         {&applied_, &q_, &qd_, &qdd_, &speed_, &total_, &at_rest_, &push_, &joined_, &zero_})
      x->assign(n_, Pack(0.0));
  }

  bool any() const { return !spec_.drives.empty(); }

  /// @param tree  motors behind springs leave their joints' armature
  void take_parameters(const LaneDraws& draws, Tree<Pack>& tree) {
    p_ = gather_parameters(draws, spec_.drives, &PackDraw::drives);
    motor_p_ = gather_parameters(draws, spec_.motor_effects, &PackDraw::motor_effects);
    for (Motor& m : motors_) {
      const MotorSpring<Pack> s = spring_of(m);
      // Without a rotor nothing moves behind the spring.
      m.stiffness = select(s.inertia > Pack(0.0), s.stiffness, Pack(kRigid));
      m.damping = s.damping;
      m.inertia = s.inertia;
      m.shared = tree.links[m.joint].armature - m.inertia;
      tree.links[m.joint].armature = Pack(0.0);
    }
    for (JointState& b : states_) {
      const int m = motor_at_[b.joint];
      const EffectInfo& info = spec_.drives[b.effect].info();
      const double least = motor_share(info, 0.0), more = motor_share(info, 1.0) - least;
      const Pack at_motor =
          m < 0 ? Pack(0.0) : Pack(least) + Pack(more) * spring_of(motors_[m]).friction_share;
      b.share = b.at_motor ? at_motor : Pack(1.0) - at_motor;
    }
    take_transfer();
  }

  /// @param hold  (joints) torque that holds the links at rest
  void start(const std::vector<Pack>& hold, State& s) const {
    s.given = 0;
    s.commands.assign(static_cast<std::size_t>(slots_) * n_ * kPackWidth, 0.0);
    s.lagged.assign(n_, Pack(0.0));
    s.wind_up.resize(motors_.size());
    for (std::size_t m = 0; m < motors_.size(); ++m)
      s.wind_up[m] = hold[motors_[m].joint] / motors_[m].stiffness;
    s.states.assign(states_.size(), Pack(0.0));
    s.inertia.assign(n_, Pack(0.0));
    rest(s);
  }
  void rest(State& s) const {
    s.wind_rate.assign(motors_.size(), Pack(0.0));
    s.wind_acceleration = s.wind_rate;
  }

  /// Takes the torque of the period's beginning, and gives what acts on the links in step `i` of
  /// it: nothing yet where a motor is in between.
  void act(int i, std::vector<Pack>& u, State& s) {
    if (i == 0) command(u, s);
    for (int j = 0; j < n_; ++j) {
      const Pack in = delayed(i, j, s);
      const Transfer& t = transfer_[j];
      applied_[j] = in + (s.lagged[j] - in) * t.mean;
      s.lagged[j] = in + (s.lagged[j] - in) * t.end;
      u[j] = motor_at_[j] < 0 ? applied_[j] : Pack(0.0);
    }
  }

  /// What states and motors do to the links over the next step.
  /// @param q, qd, qdd  (joints) before the step, of the last step
  /// @param u     (joints) torque at the links, added to
  /// @param tree  armature is added to
  void couple(double time, double h, const std::vector<Pack>& q, const std::vector<Pack>& qd,
              const std::vector<Pack>& qdd, const State& s, std::vector<Pack>& u,
              Tree<Pack>& tree) {
    q_ = q;
    qd_ = qd;
    qdd_ = qdd;
    for (std::size_t m = 0; m < motors_.size(); ++m) {
      const int j = motors_[m].joint;
      q_[j] += s.wind_up[m];
      qd_[j] += s.wind_rate[m];
      qdd_[j] += s.wind_acceleration[m];
    }
    for (int j = 0; j < n_; ++j) {
      push_[j] = motor_at_[j] < 0 ? Pack(0.0) : applied_[j];
      joined_[j] = Pack(0.0);
    }
    take_motor_effects(time, h);
    for (std::size_t b = 0; b < states_.size(); ++b) {
      const JointState& x = states_[b];
      const int j = x.joint;
      const bool to_link = !x.at_motor;
      const Pack inertia =
          to_link ? s.inertia[j] + tree.links[j].armature : motors_[motor_at_[j]].inertia;
      Pack torque, armature;
      bend(x, s.states[b], (to_link ? qd : qd_)[j], (to_link ? qdd : qdd_)[j], h, inertia, torque,
           armature);
      if (to_link) {
        u[j] -= torque;
        tree.links[j].armature += armature;
      } else {
        push_[j] -= torque;
        joined_[j] += armature;
      }
    }
    for (int j = 0; j < n_; ++j) {
      if (motor_at_[j] >= 0) continue;
      u[j] += push_[j];
      tree.links[j].armature += joined_[j];
    }
    for (std::size_t k = 0; k < motors_.size(); ++k) {
      Motor& m = motors_[k];
      const int j = m.joint;
      const Pack h1(h);
      const Pack known = select(s.inertia[j] > Pack(0.0), s.inertia[j], Pack(1.0 / kRigid));
      const Pack mobility = Pack(1.0) / known + Pack(1.0) / (m.inertia + Pack(1.0 / kRigid));
      m.sigma =
          select(s.inertia[j] > Pack(0.0), sigma(m.stiffness, m.damping, mobility, h), Pack(0.5));
      const Pack reach = m.sigma * h1;
      m.G = (m.stiffness * reach + m.damping) * reach;
      m.tau = m.stiffness * s.wind_up[k] + (m.stiffness * reach + m.damping) * s.wind_rate[k];
      m.J = m.inertia + joined_[j];
      const Pack part = m.G / (m.J + m.G);
      u[j] += m.tau + part * (push_[j] - m.tau);
      tree.links[j].armature += part * (m.J + m.shared);
    }
  }

  /// After the links' accelerations. @param qd  (joints) before the step
  void advance(double h, const std::vector<Pack>& qd, const std::vector<Pack>& qdd,
               const Tree<Pack>& tree, const AbaStates<Pack, Pack>& ws, State& s) {
    for (int j = 0; j < n_; ++j) {
      speed_[j] = qd[j] + qdd[j] * Pack(0.5 * h);  // mean, of the links
      total_[j] = speed_[j];                       // and where the motors are
      s.inertia[j] = Pack(1.0) / ws.articulated[j].psi - tree.links[j].armature;
    }
    for (std::size_t k = 0; k < motors_.size(); ++k) {
      const Motor& m = motors_[k];
      const int j = m.joint;
      const Pack a = (push_[j] - m.tau - (m.J + m.shared) * qdd[j]) / (m.J + m.G);
      const Pack rate = s.wind_rate[k] + m.sigma * a * Pack(h);
      s.wind_up[k] += rate * Pack(h);
      s.wind_rate[k] += a * Pack(h);
      s.wind_acceleration[k] = a;
      total_[j] += rate;
    }
    for (std::size_t b = 0; b < states_.size(); ++b) {
      const JointState& x = states_[b];
      const Pack v = (x.at_motor ? total_ : speed_)[x.joint];
      s.states[b] = advanced(x, s.states[b], v, Pack(h));
    }
  }

 private:
  /// [N·m/rad]: beyond what any spring has, and what lets a spring's formulas keep four digits.
  static constexpr double kRigid = 1e12;

  struct Motor {
    std::size_t effect;
    int joint;
    Pack stiffness{}, damping{}, inertia{};
    Pack shared{};  ///< of the joint's armature, what turns with the link's acceleration
    Pack sigma{}, G{}, tau{}, J{};  ///< of the step; J with what friction joins
  };
  struct JointState {
    std::size_t effect;
    int joint;
    bool at_motor;
    Pack share{};  ///< share of the effect's torque
  };
  /// Of a lag in one step: part of the old torque's distance in the mean, and at the end.
  struct Transfer {
    Pack mean, end;
  };

  MotorSpring<Pack> spring_of(const Motor& m) const {
    MotorSpring<Pack> out{};
    visit_formula(spec_.drives[m.effect], [&]<class E>(const E&) {
      const Pack* p = p_[m.effect].data();
      if constexpr (requires { out = E::motor_spring(p); }) out = E::motor_spring(p);
    });
    return out;
  }

  static Pack sigma(const Pack& stiffness, const Pack& damping, const Pack& mobility, double h) {
    const Pack d = damping * mobility * Pack(h);
    const Pack rate = stiffness * mobility * Pack(h * h) + d * d;  // (ω h)²
    return select(rate > Pack(1.0), Pack(Pack(1.0) - Pack(0.5) / rate), Pack(0.5));
  }

  /// The state after t seconds at constant velocity.
  Pack advanced(const JointState& s, const Pack& z, const Pack& v, const Pack& t) const {
    Pack out = z;
    visit_formula(spec_.drives[s.effect], [&]<class E>(const E&) {
      if constexpr (JointStateEffect<E>) out = diffnea::advanced<E>(z, v, t, p_[s.effect].data());
    });
    return out;
  }

  /// Torque of a state over a step, without its acceleration, and what joins the inertia.
  void bend(const JointState& s, const Pack& z, const Pack& v0, const Pack& a, double h,
            const Pack& inertia, Pack& torque, Pack& armature) const {
    visit_formula(spec_.drives[s.effect], [&]<class E>(const E&) {
      if constexpr (JointStateEffect<E>)
        bend<E>(s.share, z, v0, a, h, inertia, p_[s.effect].data(), torque, armature);
    });
  }
  template <class E>
  static void bend(const Pack& share, const Pack& z, const Pack& v0, const Pack& a, double h,
                   const Pack& inertia, const Pack* p, Pack& torque, Pack& armature) {
    const AtRest<Pack> rest = E::at_rest(p);
    const Pack known = select(inertia > Pack(0.0), inertia, Pack(kRigid));
    const Pack reach =
        sigma(rest.stiffness * share, rest.damping * share, Pack(1.0) / known, h) * Pack(h);
    const Pack v = v0 + reach * a;
    const StateRate<Pack> at = E::derivative(z, v, p);
    const Pack time = fading(at.forgetting * reach);
    const Pack way = at.per_velocity * reach * time;  // per velocity
    const Pack left = z + at.drift * reach * time;    // at rest
    const StateRate<Pack> then = E::derivative(left + v * way, v, p);
    const Pack slope = E::torque(way, then.per_velocity, p);
    const Pack secant = select(slope > Pack(0.0), slope, Pack(0.0));
    torque = share * (E::torque(left, then.drift, p) + slope * v + secant * (v0 - v));
    armature = share * secant * reach;
  }

  /// Friction and all else that turns with motors: as World::take_effects.
  void take_motor_effects(double time, double h) {
    if (spec_.motor_effects.empty()) return;
    constexpr double kLeast = 1e-9;  // [rad/s]
    for (int j = 0; j < n_; ++j) {
      const Pack v = qd_[j] + qdd_[j] * Pack(0.5 * h);
      speed_[j] = select(abs(v) < Pack(kLeast), Pack(kLeast), v);
      total_[j] = at_rest_[j] = Pack(0.0);
    }
    JointSample<Pack> x;
    x.time = time;
    x.q = q_.data();
    x.qdd = x.tau = zero_.data();  // unread: such effects were refused
    for (std::size_t e = 0; e < spec_.motor_effects.size(); ++e)
      for (const bool moving : {true, false}) {
        x.qd = (moving ? speed_ : zero_).data();
        add_torque<Pack>(spec_.motor_effects[e], spec_.draws.front().tree, x, motor_p_[e].data(),
                         (moving ? total_ : at_rest_).data());
      }
    for (int j = 0; j < n_; ++j) {
      const Pack slope = (total_[j] - at_rest_[j]) / speed_[j];
      const Pack secant = select(slope > Pack(0.0), slope, Pack(0.0));
      push_[j] -= total_[j] + secant * (qd_[j] - speed_[j]);
      joined_[j] += secant * Pack(0.5 * h);
    }
  }

  /// Limits, delays and lags of the joints, and what they come to in each step of a period.
  void take_transfer() {
    const double h = spec_.period / spec_.arm_steps;
    limit_.resize(n_);
    transfer_.assign(n_, {});
    std::vector<DrivePath<Pack>> paths(
        n_, {Pack(std::numeric_limits<double>::infinity()), Pack(0.0), Pack(0.0)});
    for (std::size_t e = 0; e < p_.size(); ++e)
      for (const int j : spec_.drives[e].joints)
        visit_formula(spec_.drives[e], [&]<class E>(const E&) {
          const Pack* p = p_[e].data();
          if constexpr (requires { E::add_to_drive(p, paths[j]); }) E::add_to_drive(p, paths[j]);
        });
    for (int j = 0; j < n_; ++j) limit_[j] = paths[j].limit;
    oldest_ = 0;
    cells_.assign(static_cast<std::size_t>(spec_.arm_steps) * n_, {});
    for (int i = 0; i < spec_.arm_steps; ++i)
      for (int j = 0; j < n_; ++j)
        for (int lane = 0; lane < kPackWidth; ++lane) {
          const double begin = (i * h - value(paths[j].delay, lane)) / spec_.period;  // in periods
          const double cell = std::floor(begin);
          Cell& c = cells_[static_cast<std::size_t>(i * n_ + j)];
          c.age[lane] = static_cast<int>(-cell);
          c.part[lane] = std::min(1.0, (cell + 1.0 - begin) * spec_.period / h);
          oldest_ = std::max(oldest_, c.age[lane]);
        }
    slots_ = oldest_ + 1;
    for (int j = 0; j < n_; ++j)
      for (int lane = 0; lane < kPackWidth; ++lane) {
        const double T = value(paths[j].lag, lane);
        transfer_[j].end[lane] = T > 0.0 ? std::exp(-h / T) : 0.0;
        transfer_[j].mean[lane] = T > 0.0 ? -std::expm1(-h / T) * T / h : 0.0;
      }
  }

  double* slot(State& s, long k) const {
    return s.commands.data() + (k % slots_) * n_ * kPackWidth;
  }
  void command(const std::vector<Pack>& u, State& s) const {
    using Tag = std::experimental::element_aligned_tag;
    const long first = s.given, last = s.given == 0 ? slots_ - 1 : s.given;
    for (int j = 0; j < n_; ++j) {
      const Pack most = limit_[j];
      const Pack bounded = select(u[j] > most, most, select(u[j] < -most, Pack(-most), u[j]));
      for (long k = first; k <= last; ++k) bounded.copy_to(slot(s, k) + j * kPackWidth, Tag{});
      if (s.given == 0) s.lagged[j] = bounded;
    }
    s.given = last + 1;
  }
  /// Mean over step `i` of what was commanded a delay ago.
  Pack delayed(int i, int j, State& s) const {
    const Cell& c = cells_[static_cast<std::size_t>(i * n_ + j)];
    return Pack([&](auto lane) {
      const long k = s.given - 1 - c.age[lane];
      const auto at = [&](long period) { return slot(s, period)[j * kPackWidth + int(lane)]; };
      return c.part[lane] < 1.0 ? c.part[lane] * at(k) + (1.0 - c.part[lane]) * at(k + 1) : at(k);
    });
  }

  /// Of a step: how many periods ago the command was given that it begins with, and its part.
  struct Cell {
    int age[kPackWidth];
    double part[kPackWidth];
  };

  const PackSpec& spec_;
  int n_, oldest_ = 0, slots_ = 1;
  std::vector<int> motor_at_;  ///< (joints) −1: none
  std::vector<Motor> motors_;
  std::vector<JointState> states_;
  std::vector<std::vector<Pack>> p_, motor_p_;
  std::vector<Pack> limit_;
  std::vector<Transfer> transfer_;
  std::vector<Cell> cells_;  ///< (steps of a period × joints)
  std::vector<Pack> applied_, q_, qd_, qdd_, speed_, total_, at_rest_, push_, joined_, zero_;
};

}  // namespace DIFFNEA_ISA
}  // namespace diffnea::sim
