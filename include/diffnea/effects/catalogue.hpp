#pragma once
/// All effects there are, and the step from the plain data of a model file (`EffectSpec`) to
/// something that computes (`BoundEffect`): names, places and units are checked here, once.
///
///     const BoundEffect friction = bind({"coulomb_friction", "elbow", {}}, model);
///     add_torque(friction, sample, friction.parameters.data(), tau);

#include <variant>

#include <diffnea/effects/actuator_delay.hpp>
#include <diffnea/effects/actuator_lag.hpp>
#include <diffnea/effects/armature.hpp>
#include <diffnea/effects/asymmetric_coulomb.hpp>
#include <diffnea/effects/asymmetric_viscous.hpp>
#include <diffnea/effects/attachment_offset.hpp>
#include <diffnea/effects/backlash.hpp>
#include <diffnea/effects/base_tilt.hpp>
#include <diffnea/effects/bounce.hpp>
#include <diffnea/effects/cable_differential_friction.hpp>
#include <diffnea/effects/camera_delay.hpp>
#include <diffnea/effects/camera_offset.hpp>
#include <diffnea/effects/camera_rotation.hpp>
#include <diffnea/effects/camera_scale.hpp>
#include <diffnea/effects/cogging.hpp>
#include <diffnea/effects/coulomb_friction.hpp>
#include <diffnea/effects/dry_drag.hpp>
#include <diffnea/effects/encoder_offset.hpp>
#include <diffnea/effects/encoder_scale.hpp>
#include <diffnea/effects/gravity_scale.hpp>
#include <diffnea/effects/joint_elasticity.hpp>
#include <diffnea/effects/joint_spring.hpp>
#include <diffnea/effects/linear_drag.hpp>
#include <diffnea/effects/load_friction.hpp>
#include <diffnea/effects/magnus.hpp>
#include <diffnea/effects/payload.hpp>
#include <diffnea/effects/presliding_dahl.hpp>
#include <diffnea/effects/presliding_lugre.hpp>
#include <diffnea/effects/quadratic_drag.hpp>
#include <diffnea/effects/quadratic_friction.hpp>
#include <diffnea/effects/residual.hpp>
#include <diffnea/effects/saturation.hpp>
#include <diffnea/effects/session_offset.hpp>
#include <diffnea/effects/stribeck_friction.hpp>
#include <diffnea/effects/string_bending.hpp>
#include <diffnea/effects/string_damping.hpp>
#include <diffnea/effects/string_extension.hpp>
#include <diffnea/effects/string_folding.hpp>
#include <diffnea/effects/string_mass.hpp>
#include <diffnea/effects/string_rebound.hpp>
#include <diffnea/effects/string_wrap.hpp>
#include <diffnea/effects/sublinear_friction.hpp>
#include <diffnea/effects/time_shift.hpp>
#include <diffnea/effects/tip_force.hpp>
#include <diffnea/effects/torque_gain.hpp>
#include <diffnea/effects/torque_offset.hpp>
#include <diffnea/effects/transmission_coupling.hpp>
#include <diffnea/effects/velocity_filter_lag.hpp>
#include <diffnea/effects/viscous_friction.hpp>
#include <diffnea/effects/warm_up.hpp>
#include <diffnea/effects/wind.hpp>
#include <diffnea/model/model.hpp>

namespace diffnea {

/// One line per effect, sorted. This list is the catalogue.
using AnyEffect = std::variant<  //
    ActuatorDelay,               //
    ActuatorLag,                 //
    Armature,                    //
    AsymmetricCoulomb,           //
    AsymmetricViscous,           //
    AttachmentOffset,            //
    Backlash,                    //
    BaseTilt,                    //
    Bounce,                      //
    CableDifferentialFriction,   //
    CameraDelay,                 //
    CameraOffset,                //
    CameraRotation,              //
    CameraScale,                 //
    Cogging,                     //
    CoulombFriction,             //
    DryDrag,                     //
    EncoderOffset,               //
    EncoderScale,                //
    GravityScale,                //
    JointElasticity,             //
    JointSpring,                 //
    LinearDrag,                  //
    LoadFriction,                //
    Magnus,                      //
    Payload,                     //
    PreslidingDahl,              //
    PreslidingLugre,             //
    QuadraticDrag,               //
    QuadraticFriction,           //
    Residual,                    //
    Saturation,                  //
    SessionOffset,               //
    StribeckFriction,            //
    StringBending,               //
    StringDamping,               //
    StringExtension,             //
    StringFolding,               //
    StringMass,                  //
    StringRebound,               //
    StringWrap,                  //
    SublinearFriction,           //
    TimeShift,                   //
    TipForce,                    //
    TorqueGain,                  //
    TorqueOffset,                //
    TransmissionCoupling,        //
    VelocityFilterLag,           //
    ViscousFriction,             //
    WarmUp,                      //
    Wind>;

/// Metadata of every effect, in the order of AnyEffect.
const std::vector<EffectInfo>& catalogue();

/// @throws ModelError that lists the effects there are, the nearest name first
AnyEffect find_effect(const std::string& name);

/// Name, parameters and place of an effect.
const EffectInfo& info(const AnyEffect& effect);

/// Whether it acts on a ball, its string or the camera that sees it, and never on joints.
bool acts_on_ball(const EffectInfo& info);

/// An effect at its joints, with values.
struct BoundEffect {
  AnyEffect type;     ///< with what it has of the model or the spec: runs, a point, a table
  std::string where;  ///< as in the EffectSpec
  /// Degrees of freedom it acts on; at `all` and `base`: every one; of ball, string, camera: none.
  std::vector<int> joints;
  std::vector<int> runs;                      ///< recordings it acts in; empty: all of them
  int num_joints = 0;                         ///< of the model
  std::vector<ParameterInfo> parameter_info;  ///< unit and initial are those of this joint's type
  std::vector<double> parameters;             ///< same order

  /// Of its type: as the catalogue has it, before units and values of this joint.
  const EffectInfo& info() const { return diffnea::info(type); }
  /// Whether the effect acts in the run of this number.
  bool acts_in(int run) const;
  /// Indices of the parameters that the torque is linear in.
  std::vector<int> linear_parameters() const;
  /// Indices of the parameters that do not enter linearly.
  std::vector<int> shape_parameters() const;
  /// Parameters that switch the effect on, 0: it is absent. The linear ones; those of Scale::kPlain
  /// where none is linear (an encoder's offset); empty for saturation, which an infinite limit
  /// switches off, and LuGre.
  std::vector<int> amplitude_parameters() const;
  /// Whether its torque at one instant follows from that instant: ports kJointTorque and
  /// kLinkForce.
  bool is_local() const {
    return info().port == Port::kJointTorque || info().port == Port::kLinkForce;
  }
};

/// Every place of a model at which the effect can act, as `where` of an EffectSpec; pairs of joints
/// are neighbours in the tree.
std::vector<std::string> places(const EffectInfo& info, const Model& model);

/// "tip:run=1+4" is the place "tip" in recordings 1 and 4 alone; without the ending: in all.
struct RunPlace {
  std::string place;      ///< what stands before the colon
  std::vector<int> runs;  ///< ascending; empty: all
};
/// @throws ModelError if what follows the colon is not `run=` and numbers of recordings
RunPlace split_where(const std::string& where);
/// The inverse of `split_where`: "tip:run=1+4".
std::string join_where(const RunPlace& where);

/// Resolves `spec` on `model`. `where` is a joint's name, two of them for a pair ("elbow,wrist"),
/// `tip` (the last moving link), `base`, `ball`, `string`, `camera` or `all`; an effect of one
/// joint bound at `all` acts on every joint with the same parameters. A place that ends in
/// `:run=K`, or `:run=K+L`, stands for those recordings alone (not of armature and torque_gain,
/// which belong to the robot). Parameters that are not given take their initial values; a unit that
/// is given must be the effect's. `runs`: recordings that a per-run effect gets a parameter for
/// (those named in the spec come on top).
/// @throws ModelError naming the choices if the effect, place, parameter or unit is unknown, a sign
/// is wrong, or `all` would mix revolute and prismatic joints
BoundEffect bind(const EffectSpec& spec, const Model& model, const std::vector<int>& runs = {});

/// Back to plain data, with all parameters.
EffectSpec to_spec(const BoundEffect& effect);

/// Adds the effect's torque at one instant to the right-hand side of the sign equation.
/// @param x    joints at that instant; the arrays that its formula names must be there
/// @param p    parameters in the order of effect.parameter_info
/// @param tau  (num_joints) [N·m] or [N], added to; untouched if the port is not kJointTorque
template <Scalar T>
void add_torque(const BoundEffect& effect, const JointSample<T>& x, const T* p, T* tau);

/// The same, of the port kLinkForce too: forces on links reach the joints by way of the tree.
template <Scalar T>
void add_torque(const BoundEffect& effect, const Tree<double>& tree, const JointSample<T>& x,
                const T* p, T* tau);

/// Adds an effect of the port kModelParameter to the link tree; others leave it.
/// @param p  parameters in the order of effect.parameter_info
template <Scalar P>
void add_to_tree(const BoundEffect& effect, const P* p, Tree<P>& tree);

/// ∂τ/∂p of the linear parameters at the current values of the shape parameters.
/// @param columns  (number of linear parameters × num_joints), row-major, overwritten:
///                 columns[k·num_joints + j] is the torque of joint j for one unit of parameter
///                 linear_parameters()[k]
/// @throws ModelError if the port is not kJointTorque: series_columns (effects/series.hpp) has them
/// for any port; a payload's are those that the torque regressor has for the link effect.joints[0]
void linear_columns(const BoundEffect& effect, const JointSample<double>& x, double* columns);

}  // namespace diffnea

#include <diffnea/effects/detail/catalogue_impl.hpp>
