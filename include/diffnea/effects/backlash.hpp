#pragma once

#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/effect.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// backlash: a gap β in the gear. Inside it nothing is transmitted and the rotor runs free,
/// J_m θ̈ = u − friction; at its ends the teeth push, and throw each other back with the restitution
/// e. The encoder reads the link's angle q, the motor's, θ, is hidden; the log has J_m(θ̈ − q̈) more
/// than the base model, whose armature J_m turns with q: inside the gap that is the whole torque
/// that it takes for transmitted, and an impulse where the teeth meet (Nordin and Gutman 2002). The
/// rotor leaves a flank where the torque on it, seen from the motor, changes its sign. With
/// `encoder_side` 1 the log has θ, and the link is hidden: both fly, the rotor under the logged
/// torque and the link under its own weight, and the log has M(θ̈ − q̈) less.
struct Backlash {
  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "backlash",
        .formula = "J_m (thdd - qdd), th - q within +-beta/2",
        .summary = "gap between the teeth of a gear; the motor's angle is hidden",
        .port = Port::kMemory,
        .parameters = {{.name = "gap",
                        .unit = "rad",
                        .unit_prismatic = "m",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 0.01,
                        .initial_prismatic = 1e-3,
                        .search = log_grid(0.003, 0.1, 6),
                        .search_prismatic = log_grid(3e-4, 1e-2, 6),
                        .bound = SearchBound::kGap},
                       {.name = "stiffness",
                        .unit = "N*m/rad",
                        .unit_prismatic = "N/m",
                        .sign = Sign::kPositive,
                        .linear = false,
                        .initial = 1e4,
                        .initial_prismatic = 1e6},
                       {.name = "motor_inertia",
                        .unit = "kg*m^2",
                        .unit_prismatic = "kg",
                        .sign = Sign::kNonNegative,
                        .linear = false},
                       {.name = "restitution",
                        .unit = "1",
                        .unit_prismatic = "1",
                        .sign = Sign::kNonNegative,
                        .linear = false,
                        .initial = 0.5,
                        .most = 0.99},
                       {.name = "encoder_side",
                        .unit = "1",
                        .unit_prismatic = "1",
                        .sign = Sign::kNonNegative,
                        .linear = false,
                        .most = 1.0,
                        .choices = {0.0, 1.0}}},
        .motor_side = true,
        .traits = {Trait::kOfDrive},
        .motor = HiddenMotor::kOther,
        .shown_over = {ShownOver::kTorqueReversals, ShownOver::kReversals}};
    return kInfo;
  }

  /// Its flanks; all friction turns with the rotor.
  static MotorSpring<double> motor_spring(const double* p) { return {p[1], 0.0, p[2], 1.0}; }

  /// Tells whether the log's positions are the motor's. @param p  parameters
  static bool encoder_at_motor(const double* p) { return p[4] > 0.5; }

  /// θ − q [rad] that holds the torque τ [N·m] at rest.
  template <class T>
  static T deflection_at(const T& tau, const T* p) {
    const double side = value(tau) > 0.0 ? 0.5 : value(tau) < 0.0 ? -0.5 : 0.0;
    return tau / p[1] + T(side) * p[0];
  }

  /// τ [N·m] at θ − q [rad] and θ̇ − q̇ [rad/s], in simulation: the flanks are springs whose damping
  /// lets a rotor that is light beside its load bounce with the restitution. They push only.
  static double transmitted(double deflection, double velocity, const double* p) {
    const double wind_up = deflection - std::clamp(deflection, -0.5 * p[0], 0.5 * p[0]);
    if (wind_up == 0.0) return 0.0;
    const double loss = -std::log(std::max(p[3], 1e-6));
    const double ratio = loss / std::hypot(loss, 3.14159265358979323846);
    const double tau = p[1] * wind_up + 2.0 * ratio * std::sqrt(p[1] * p[2]) * velocity;
    return tau * wind_up > 0.0 ? tau : 0.0;
  }

  /// The same along simulated runs that are differentiated. `transmitted` jumps where the teeth
  /// meet, and a run has no derivative across a jump: here the damping grows with the wind-up, up
  /// to its own size at a small share of the gap (as Hunt and Crossley 1975 have it near 0).
  template <class T>
  static T gear_torque(const T& deflection, const T& velocity, const T* p) {
    using std::sqrt;
    constexpr double kSoft = 0.05;  // share of the gap; a step's flight at the loop's own speed
    const T half = T(0.5) * p[0];
    const double side = value(deflection) < 0.0 ? -1.0 : 1.0;
    const T depth = T(side) * deflection - half;
    if (!(value(depth) > 0.0)) return T(0.0);
    T push = p[1] * depth;
    if (value(p[2]) > 0.0) {
      const double loss = -std::log(std::max(value(p[3]), 1e-6)),
                   ratio = loss / std::hypot(loss, 3.14159265358979323846);
      const T share = depth / (T(kSoft) * p[0]);
      const T damping = T(2.0 * ratio) * sqrt(p[1] * p[2]);
      push = push + select(value(share) < 1.0, share, T(1.0)) * damping * T(side) * velocity;
    }
    return select(value(push) > 0.0, T(side) * push, T(0.0));
  }

  /// (N) torque in addition at `joint` where the log has the link's angle, between flanks that do
  /// not yield: the rotor's flight under the logged torque less friction.
  /// @throws DataError without x.logged
  VecX<double> torque_series(const JointSeries& x, int joint, const double* p) const {
    if (x.logged.rows() != x.rows())
      throw DataError("backlash: got no logged torque, by which the rotor flies; set x.logged");
    const double J = p[2];
    if (!(J > 0.0)) return VecX<double>::Zero(x.rows());
    // What the motor has for its load, as the log says and the model.
    const VecX<double> push = x.logged.col(joint) - x.drive().col(joint) + x.tau.col(joint);
    const VecX<double> seen = (x.logged - x.drive()).col(joint) / J;
    return J * flight(push, VecX<double>::Constant(x.rows(), J), seen, x.dt, p).acceleration;
  }

  /// θ − q between flanks that do not yield, row by row. An impact's impulse is shared by the two
  /// rows about it.
  struct Flight {
    VecX<double> at;            ///< (N) θ − q [rad or m]
    VecX<double> speed;         ///< (N) [rad/s or m/s]
    VecX<double> acceleration;  ///< (N) [rad/s² or m/s²]
  };

  /// How two sides fly beside each other.
  /// @param push     (N) torque that the teeth would transmit [N·m] or [N]
  /// @param inertia  (N) that turns it into θ̈ − q̈: the rotor's beside a link whose motion is known,
  ///                 else both sides' reduced one, J M/(J + M) [kg·m²] or [kg], above 0
  /// @param seen     (N) θ̈ − q̈ as the log has it, with its noise. At rest without a load either
  ///                 flank may hold when a log begins: it is the one whose first flight is seen.
  static Flight flight(const VecX<double>& push, const VecX<double>& inertia,
                       const VecX<double>& seen, double dt, const double* p) {
    Flight plus = flight_from(1.0, push, inertia, dt, p),
           minus = flight_from(-1.0, push, inertia, dt, p);
    double speed = 0.0, of_plus = 0.0, of_minus = 0.0, misfit = 0.0;
    for (long k = 0; k < push.size() && (k == 0 || plus.at[k] != minus.at[k]); ++k) {
      speed += seen[k] * dt;
      of_plus += plus.acceleration[k] * dt;
      of_minus += minus.acceleration[k] * dt;
      misfit += std::pow(of_plus - speed, 2) - std::pow(of_minus - speed, 2);
    }
    return misfit > 0.0 ? minus : plus;
  }

 private:
  /// @param side  the flank that holds at first
  static Flight flight_from(double side, const VecX<double>& push, const VecX<double>& inertia,
                            double dt, const double* p) {
    const long n = push.size();
    const double half = 0.5 * p[0];
    double at = side * half, v = 0.0;
    Flight out{VecX<double>::Constant(n, at), VecX<double>::Zero(n), VecX<double>::Zero(n)};
    bool free = false;
    for (long k = 0; k + 1 < n; ++k) {
      double left = dt;
      const double force = 0.5 * (push[k] + push[k + 1]), M = 0.5 * (inertia[k] + inertia[k + 1]);
      for (int events = 0; events < 8 && left > 0.0; ++events) {
        if (!free) {
          if (side * force >= 0.0) break;
          free = true;
          v = 0.0;
        }
        const double a = force / M, hit = first_hit(at, v, a, half, left);
        const double flown = std::min(hit, left), middle = (dt - left + 0.5 * flown) / dt;
        out.acceleration[k] += a * flown / dt * (1.0 - middle);
        out.acceleration[k + 1] += a * flown / dt * middle;
        at += (v + 0.5 * a * flown) * flown;
        v += a * flown;
        left -= flown;
        if (hit > flown || left <= 0.0) continue;
        side = at > 0.0 ? 1.0 : -1.0;
        at = side * half;
        double rebound = -p[3] * v;
        // A bounce that is over within a row is none.
        if (side * force > 0.0 && 2.0 * M * std::abs(rebound) < std::abs(force) * dt)
          rebound = 0.0, free = false;
        const double change = (rebound - v) / dt, moment = (dt - left) / dt;
        out.acceleration[k] += change * (1.0 - moment);
        out.acceleration[k + 1] += change * moment;
        v = rebound;
      }
      out.at[k + 1] = at;
      out.speed[k + 1] = free ? v : 0.0;
    }
    return out;
  }

  /// When a flight reaches ±half [s]; infinity if not within `most`.
  static double first_hit(double at, double v, double a, double half, double most) {
    if (std::abs(at) >= half && (v * at > 0.0 || (v == 0.0 && a * at > 0.0))) return 0.0;
    double first = std::numeric_limits<double>::infinity();
    for (const double wall : {half, -half}) {
      const double c = at - wall, root = v * v - 2.0 * a * c;
      if (root < 0.0) continue;
      const double s = std::sqrt(root);
      for (const double t : {a != 0.0 ? (-v - s) / a : -c / v, a != 0.0 ? (-v + s) / a : -c / v})
        // Towards the wall, not away from it at the start.
        if (t >= 0.0 && t <= most && (v + a * t) * wall > 0.0) first = std::min(first, t);
    }
    return first;
  }
};

}  // namespace diffnea
