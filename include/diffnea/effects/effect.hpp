#pragma once
/// The one vocabulary of causes. An effect is a small type with a name, named parameters with units
/// and physical signs, a formula templated on the scalar, and a place where it acts. The same type
/// extends the model in simulation and identification, is a candidate in diagnosis, and is written
/// to results.
///
/// A new effect is one header with
///
///     static const EffectInfo& info();
///     template <Scalar T>
///     void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const;
///
/// and one line in effects/catalogue.hpp. `joint` are the joints it acts on, `p` its parameters in
/// the order of info(), and it *adds* to tau, which is indexed by joint. The torque is homogeneous
/// in the parameters that are marked linear: identification and diagnosis take their columns from
/// it. A formula that reads x.qdd or x.tau says so, `static constexpr bool kReadsAcceleration =
/// true;`: in simulation q̈ is then the solution of an equation; one that reads x.time,
/// `kReadsTime`: without the rows' time there is no torque. Other ports have another function
/// in add_torque's place, see Port; what all have in common is in effects/series.hpp. The comment
/// above its struct says what the effect is; members that others have too need none.
///
/// Units are written in ASCII as in result files: "N*m", "N*m*s/rad", "kg*m^2"; "1" has none.

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Which sign a parameter can have.
enum class Sign { kFree, kNonNegative, kPositive };

/// One parameter of an effect.
struct ParameterInfo {
  std::string name;            ///< as in model and result files
  std::string unit;            ///< at a revolute joint
  std::string unit_prismatic;  ///< at a prismatic joint
  Sign sign = Sign::kFree;     ///< fits keep it; bind() refuses values of another
  bool linear = true;          ///< the torque is linear in it; otherwise a shape parameter
  double initial = 0.0;  ///< where a fit starts, and the value a shape keeps if it is not fitted
  /// The same at a prismatic joint; NaN: as `initial`.
  double initial_prismatic = std::numeric_limits<double>::quiet_NaN();
  double most = std::numeric_limits<double>::infinity();  ///< above it, no physics
  bool per_run = false;  ///< one value per recording, named `<name>_<run>` once it is bound
  /// Values at which a search over a nonlinear parameter starts; empty: at `initial` alone.
  std::vector<double> search = {};
  std::vector<double> search_prismatic = {};  ///< at a prismatic joint; empty: as `search`
  /// The values that a search tries, where it is one or the other; a fit does not move it.
  std::vector<double> choices = {};
};

/// On which scale a parameter moves, and what a derivative with respect to it means.
enum class Scale {
  kLinear,  ///< the torque is linear in it: ∂τ/∂p is the column of a regression
  kPlain,   ///< nonlinear, may be 0 or negative: ∂τ/∂p at the present value
  kLog      ///< nonlinear and positive, a shape: ∂τ/∂ln p
};
/// How a parameter is searched, from how it enters and its sign.
inline Scale scale(const ParameterInfo& p) {
  if (p.linear) return Scale::kLinear;
  return p.sign == Sign::kPositive ? Scale::kLog : Scale::kPlain;
}

/// `count` values from low to high, each the same factor above the one before.
inline std::vector<double> log_grid(double low, double high, int count) {
  std::vector<double> out;
  for (int i = 0; i < count; ++i)
    out.push_back(low * std::pow(high / low, double(i) / (count - 1)));
  return out;
}

/// Where an effect can act, and how many joints it names; in backticks: `where` of an EffectSpec.
enum class Place {
  kJoint,      ///< a joint's name, or `all`: every one with the same parameters
  kJointPair,  ///< two joints' names, `first,second`
  kTip,        ///< `tip`, the last moving link, or the name of the joint that moves a link
  kBase,       ///< `base`, the robot's
  kAllJoints,  ///< `all` and nothing else
  kBall,       ///< `ball`
  kString,     ///< `string`, the ball's
  kCamera      ///< `camera`, which sees the ball
};

/// What it acts on.
enum class Port {
  kJointTorque,     ///< adds to the right-hand side of the sign equation: add_torque
  kLinkForce,       ///< the same, but a force on a link, so that it needs the tree: add_torque
  kModelParameter,  ///< changes a parameter of the link tree: add_to_tree
  kMeasurement,     ///< changes what is logged of the motion: add_to_motion turns it into the truth
  kMemory,          ///< torque that depends on the past of the motion: torque_series, or a
                    ///< spring's deflection and the rotor_torque that comes with it
  kBallForce,       ///< accelerates the ball: add_acceleration (effects/ball_effect.hpp)
  kBallImpact,      ///< a plane that the ball bounces off: clearance, bounce
  kBallView,        ///< changes where the camera sees the ball: change_view
  kStringAnchor,    ///< changes where the string is tied: add_to_anchor
  kStringContact,   ///< what bars the string, and what it does as it becomes taut: route, rebound
};

/// What selection, results and files see of an effect.
struct EffectInfo {
  std::string name;                       ///< as in model and result files
  std::string formula;                    ///< for people, e.g. "F_c tanh(q̇/v₀)"
  std::string summary;                    ///< one line
  Place place = Place::kJoint;            ///< at which bind() accepts it
  Port port = Port::kJointTorque;         ///< says which function its type has
  std::vector<ParameterInfo> parameters;  ///< in the order of that function's `p`
  /// Left out of the sign equation on the link side (armature, motor friction).
  bool motor_side = false;
};

/// All joints at one instant; arrays of length n [rad, rad/s, rad/s², N·m] or [m, m/s, m/s², N].
/// Null: not there, for formulas that do not read it.
template <Scalar T>
struct JointSample {
  double time = 0.0;       ///< since the run began [s]
  int run = 0;             ///< which recording of several
  const T* q = nullptr;    ///< positions
  const T* qd = nullptr;   ///< velocities
  const T* qdd = nullptr;  ///< accelerations
  const T* tau = nullptr;  ///< torque that the links transmit, without effects and rotor inertia
};

/// The shape parameter v₀ of s = tanh(q̇/v₀), which stands for sign(q̇) in every dry friction. Its
/// default is a tenth of a slow motion (0.1 rad/s, 10 mm/s): there, s is 1 to eight digits.
inline ParameterInfo smoothing_parameter() {
  return {.name = "smoothing",
          .unit = "rad/s",
          .unit_prismatic = "m/s",
          .sign = Sign::kPositive,
          .linear = false,
          .initial = 0.01,
          .initial_prismatic = 0.001};
}

}  // namespace diffnea
