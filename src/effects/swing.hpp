#pragma once
/// A link on its spring that a motor with an encoder swings: M δ̈ + D δ̇ + K δ = f, δ = θ − q. Internal
/// to effects/.
///
/// f is what the link would ask for if it followed the motor, M its inertia, each (N), at rows dt
/// apart [N·m, kg·m², s] or [N, kg, s].

#include <diffnea/core/scalar.hpp>
#include <diffnea/effects/memory.hpp>

namespace diffnea {

/// δ and how fast it changes.
struct Swing {
  double at = 0.0;     ///< [rad] or [m]
  double speed = 0.0;  ///< [rad/s] or [m/s]
};

/// δ (N), f and M straight between the rows. By backward differences of order two, which follow what
/// a step resolves and damp the rest.
VecX<double> swung(const VecX<double>& f, const VecX<double>& inertia, double dt,
                   const MotorSpring<double>& spring, const Swing& start);

/// How a link begins where f would hold it if it went on so.
Swing led(const VecX<double>& f, const VecX<double>& inertia, double dt,
          const MotorSpring<double>& spring);

/// How a link begins by the spring's torque while that lasts: what swings when a log begins may
/// swing on for long, and no motion of its motor tells it.
/// @param torque  (N) of the spring: the logged one less what the motor's side takes
Swing started(const VecX<double>& f, const VecX<double>& torque, const VecX<double>& inertia,
              double dt, const MotorSpring<double>& spring);

}  // namespace diffnea
