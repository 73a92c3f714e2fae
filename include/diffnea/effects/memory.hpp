#pragma once
/// Members that effects with memory (Port::kMemory) and of a measurement (Port::kMeasurement) bring
/// for simulation, where time goes on step by step. One of
///
///  - a state z at each of its joints, which is 0 at first (JointStateEffect):
///    @code
///        template <Scalar T> static StateRate<T> derivative(const T& z, const T& qd, const T* p);
///        template <Scalar T> static T torque(const T& z, const T& zd, const T* p);
///        template <Scalar T> static AtRest<T> at_rest(const T* p);
///    @endcode
///    The torque is linear in z and ż. With them it is simulated, alone, in packs and in MuJoCo,
///    and has its torque over a stretch, which a diagnosis fits. A closed form that is better than
///    one step of `advanced` is optional: `static double advance(double z, const Move&, const
///    double*)`.
///  - a motor that it hides (EffectInfo::motor):
///    @code
///        static MotorSpring<T> motor_spring(const T* p);                    T: double or a pack
///        static double transmitted(double deflection, double velocity, const double* p);
///        template <class T> static T deflection_at(const T& load, const T* p);
///        template <class T>                              along runs with derivatives: continuous
///        static T gear_torque(const T& deflection, const T& velocity, const T* p);
///        static bool encoder_at_motor(const double* p);                     optional
///    @endcode
///  - what a drive makes of its command:
///    @code
///        template <class T> static void add_to_drive(const T* p, DrivePath<T>& path);
///    @endcode
///  - what an encoder reads, a clock that is late, or a filter in the logged velocity:
///    @code
///        static void add_to_encoder(const double* p, Encoder& encoder);
///        static double clock_shift(const double* p);                        [s]
///        static VecX<double> logged_velocity(const VecX<double>& qd, double dt, const double* p);
///    @endcode

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// ż = per_velocity q̇ + drift.
template <class T>
struct StateRate {
  T per_velocity;  ///< ∂ż/∂q̇ along the line through 0
  T drift;         ///< ż of a joint at rest
  T forgetting;    ///< −∂ż/∂z ≥ 0 [1/s]
};

/// The spring and damper that a state is at rest: what a step of integration has to follow.
template <class T>
struct AtRest {
  T stiffness;  ///< ∂τ/∂q [N·m/rad] or [N/m]
  T damping;    ///< ∂τ/∂q̇ [N·m·s/rad] or [N·s/m]
};

/// Move of a joint at constant velocity.
struct Move {
  double way;       ///< [rad] or [m]
  double velocity;  ///< way/time [rad/s] or [m/s]
  double time;      ///< [s]
};

/// Effect with a state at each of its joints.
template <class E>
concept JointStateEffect = requires(double z, const double* p) {
  E::derivative(z, z, p);
  E::torque(z, z, p);
  E::at_rest(p);
};

/// (1 − e^{−x})/x for x ≥ 0.
inline double fading(double x) { return x > 1e-12 ? -std::expm1(-x) / x : 1.0; }

/// z after the time t at constant velocity: exact where ż is linear in z, and stable however fast
/// it forgets. `fading` is found by ADL for a pack.
template <class E, class T>
T advanced(const T& z, const T& qd, const T& t, const T* p) {
  const StateRate<T> at = E::derivative(z, qd, p);
  return z + (qd * at.per_velocity + at.drift) * t * fading(at.forgetting * t);
}

/// The same after a move, by the effect's own closed form where it has one.
template <class E>
double advanced_over(double z, const Move& move, const double* p) {
  if constexpr (requires { E::advance(z, move, p); })
    return E::advance(z, move, p);
  else
    return advanced<E>(z, move.velocity, move.time, p);
}

/// The torque at state and velocity.
template <class E, class T>
T state_torque(const T& z, const T& qd, const T* p) {
  const StateRate<T> at = E::derivative(z, qd, p);
  return E::torque(z, T(qd * at.per_velocity + at.drift), p);
}

/// A hidden motor and what holds it to its link.
template <class T>
struct MotorSpring {
  T stiffness;       ///< [N·m/rad] or [N/m]
  T damping;         ///< [N·m·s/rad] or [N·s/m]
  T inertia;         ///< inertia of the motor [kg·m²] or [kg]
  T friction_share;  ///< of the joint's friction, what turns with the motor: 0 … 1
};

/// Path from a command to the torque that acts: limit, delay, first-order lag, in this
/// order.
template <class T>
struct DrivePath {
  T limit;  ///< [N·m] or [N]
  T delay;  ///< [s]
  T lag;    ///< time constant [s]
};

/// Reading of an encoder, (1 + scale) q + offset.
struct Encoder {
  double scale = 0.0;   ///< error of its scale
  double offset = 0.0;  ///< [rad] or [m]
};

}  // namespace diffnea
