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
/// and two lines in effects/catalogue.hpp. `joint` are the joints it acts on, `p` its parameters in
/// the order of info(), and it *adds* to tau, which is indexed by joint. The torque is homogeneous
/// in the parameters that are marked linear: identification and diagnosis take their columns from
/// it. Everything that other parts ask of an effect is in its EffectInfo: no other file needs its
/// name. Other ports have another function in add_torque's place, see Port; what all have in common
/// is in effects/series.hpp. The comment above its struct says what the effect is; members that
/// others have too need none.
///
/// Units are written in ASCII as in result files: "N*m", "N*m*s/rad", "kg*m^2"; "1" has none.

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <string>
#include <vector>

#include <diffnea/core/scalar.hpp>
#include <diffnea/effects/command.hpp>

namespace diffnea {

struct EffectSpec;
struct Model;

/// Which sign a parameter can have.
enum class Sign { kFree, kNonNegative, kPositive };

/// Number of a robot description (URDF, MJCF), or of MuJoCo alone, that a parameter is.
enum class NativeField {
  kNone,             ///< descriptions have no place for it
  kArmature,         ///< MJCF's and MuJoCo's `armature`
  kDamping,          ///< URDF's and MJCF's `damping`
  kFrictionLoss,     ///< URDF's `friction`, MJCF's `frictionloss`
  kStiffness,        ///< MJCF's `stiffness`
  kSpringReference,  ///< MJCF's `springref`
  kStiction,         ///< MuJoCo alone: `frictionloss` at rest, beyond that of a sliding rotor
  kStribeckVelocity  ///< MuJoCo alone: velocity over which kStiction fades
};

/// Property of the recordings that bounds the values of a shape a diagnosis starts from.
enum class SearchBound {
  kNone,        ///< bounds as `search` has them
  kTorque,      ///< a limit: quantiles of the logged torque
  kRipple,      ///< a frequency over the position: what the stroke and the rows resolve
  kPresliding,  ///< a distance: above the positions' noise, below a quarter of the stroke
  kGap,         ///< a distance: from the positions' noise to the largest of `search`
  kSmoothing    ///< a velocity: above the effect's `smoothing`
};

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
  SearchBound bound = SearchBound::kNone;   ///< how recordings bound `search`
  NativeField native = NativeField::kNone;  ///< field of robot descriptions that holds it
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
  kMemory,         ///< torque that depends on the past of the motion: a state at the joint, a motor
                   ///< that it hides or what a drive does (effects/memory.hpp), or torque_series
  kBallForce,      ///< accelerates the ball: add_acceleration (effects/ball_effect.hpp)
  kBallImpact,     ///< a plane that the ball bounces off: clearance, bounce
  kBallView,       ///< changes where the camera sees the ball: change_view
  kStringAnchor,   ///< changes where the string is tied: add_to_anchor
  kStringContact,  ///< what bars the string, and what it does as it becomes taut: route, rebound
};

/// Property of an effect that other parts ask for.
enum class Trait : std::uint32_t {
  kReadsCommand,       ///< it reads x.command: without it there is no torque
  kOfServo,            ///< part of the law of a drive that reads commands: no such drive, no torque
  kFedForward,         ///< it adds what was told beside positions: without a log of that, nothing
  kReadsSupply,        ///< it reads the supply that was logged, from its parameter `nominal` on
  kIntegrates,         ///< its joint's drive has an integrator, a state of simulated runs
  kReadsTime,          ///< the torque changes with x.time: without the rows' time there is none
  kReadsAcceleration,  ///< it reads x.qdd or x.tau: in simulation q̈ is the solution of an equation
  kFollowsLoad,        ///< it reads x.tau, and not in proportion: columns change with the fit
  kFriction,           ///< dry friction with a state: dissipates, and may stand for Coulomb's
  kOfDrive,            ///< only a drive, or the log of its torque, has it: no passive joint
  kAtMotor,       ///< acts wholly on the motor's side of a spring, whatever part of friction does
  kOfRobot,       ///< acts in every recording: `:run=` is refused
  kRotor,         ///< inertia of rotors, which make_tree puts into the tree
  kInertia,       ///< its ten parameters add to those of a link: columns of the regressor
  kGravity,       ///< its two parameters add to gravity's x and y
  kGain,          ///< 1 + its parameter is recorded over true torque
  kShared,        ///< a diagnosis tries it at `all` besides: one clock, one bus, one scale
  kIfAsked,       ///< no candidate of a diagnosis unless it is asked for
  kNoAmplitude,   ///< no single parameter switches it off
  kLogsVelocity,  ///< acts on the logged velocity, which a simulated recording then has
  kNeedsCup,      ///< acts where there is a cup on the string's link
  kNeedsSpin,     ///< acts on a ball whose spin is recorded
  kReadsAnchorJerk,  ///< reads the jerk of the string's anchor, which a simulation has not
  kWhenSlack,        ///< acts while the string is slack, not while it is taut
  kJumps             ///< changes the ball's velocity at an instant: no acceleration shows it
};

/// Set of traits.
class Traits {
 public:
  constexpr Traits() = default;
  /// Holds these.
  constexpr Traits(std::initializer_list<Trait> traits) {
    for (const Trait t : traits) bits_ |= bit(t);
  }
  /// Tells whether the set has it.
  constexpr bool has(Trait t) const { return (bits_ & bit(t)) != 0; }

 private:
  static constexpr std::uint32_t bit(Trait t) { return 1U << static_cast<std::uint32_t>(t); }
  std::uint32_t bits_ = 0;
};

/// Quantities that the torque of one instant depends on; simulations of many worlds skip what does
/// not change.
enum class Reads {
  kNothing,        ///< constant within a recording
  kSpeedLinearly,  ///< proportional to velocities of its own joints
  kSpeed,          ///< velocities of its own joints, no torque at rest
  kMotion          ///< anything
};

/// Motor that an effect hides behind its joint.
enum class HiddenMotor {
  kNone,
  kSpring,  ///< behind a linear spring and damper: parameters stiffness, damping, motor_inertia
  kOther    ///< behind what pushes in another way, which the simulation of one robot alone has
};

/// Place in the camera's view of a ball, from the ball to the camera.
enum class ViewStage { kString, kScale, kRotation, kOffset };
/// All of them, in their order.
inline constexpr ViewStage kViewStages[] = {ViewStage::kString, ViewStage::kScale,
                                            ViewStage::kRotation, ViewStage::kOffset};

/// Plot of a joint's error in which an effect shows.
enum class ShownOver {
  kPosition,
  kVelocity,
  kAcceleration,
  kTorque,
  kTorqueRate,
  kLoad,  ///< along the motion, over the size of the torque
  kTime,
  kTimeAlongMotion,
  kSpectrum,         ///< amplitudes over cycles of the position; marks the parameter `cycles`
  kReversals,        ///< about the instants at which the velocity changes its sign
  kTorqueReversals,  ///< about those at which the torque does
  kCorrelation       ///< with the rate of the torque, over the lag between them
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
  Traits traits = {};                      ///< properties that other parts ask for
  Reads reads = Reads::kMotion;            ///< inputs of kJointTorque; kMotion is always right
  HiddenMotor motor = HiddenMotor::kNone;  ///< motor that kMemory hides
  ViewStage view = ViewStage::kString;     ///< turn of change_view, where there is one
  /// Plots of evidence, the first one first.
  std::vector<ShownOver> shown_over = {ShownOver::kVelocity, ShownOver::kPosition};

  /// Tells whether it has the trait.
  bool has(Trait t) const { return traits.has(t); }
};

/// Where an effect is bound. A formula that takes more from it than its parameters keeps that as
/// data members, which `void complete(const BoundSetting&)` fills.
struct BoundSetting {
  const EffectSpec& spec;          ///< plain data of the effect
  const Model& model;              ///< robot that it acts on
  const std::vector<int>& joints;  ///< degrees of freedom that it acts on
  const std::vector<int>& links;   ///< links of the tree that those joints move
  const std::vector<int>& runs;    ///< runs of per-run parameters, ascending
  const std::string& here;         ///< begins messages
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
  const CommandPath* command = nullptr;  ///< of the run
  SimulationStep step = {};              ///< stretch that commands are taken over
  int encoder = -1;  ///< degree of freedom that a drive is fed back from; −1: its own
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
