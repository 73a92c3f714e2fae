#pragma once
/// The step from the plain data of a model file (`EffectSpec`) to something that computes
/// (`BoundEffect`): names, places and units are checked here, once. This header names no effect:
/// whoever includes it is not compiled again when one is added. Formulas are those of
/// effects/catalogue.hpp.
///
///     const BoundEffect friction = bind({"coulomb_friction", "elbow", {}}, model);
///     add_torque(friction, sample, friction.parameters.data(), tau);

#include <memory>

#include <diffnea/effects/effect.hpp>
#include <diffnea/model/model.hpp>
#include <diffnea/model/tree.hpp>

namespace diffnea {

/// One of the effects there are; complete in effects/catalogue.hpp.
struct AnyEffect;

/// Metadata of every effect, sorted by name.
const std::vector<EffectInfo>& catalogue();

/// @throws ModelError that lists the effects there are, the nearest name first
const EffectInfo& find_effect(const std::string& name);

/// The same, but null if the catalogue has no such effect.
const EffectInfo* known_effect(const std::string& name);

/// Name of the effect that has a parameter of this native field.
const std::string& effect_of(NativeField field);

/// Tells whether it acts on a ball, its string or the camera that sees it, and never on joints.
bool acts_on_ball(const EffectInfo& info);

/// Formula of a BoundEffect that bind() has not filled: the first of the catalogue.
std::shared_ptr<const AnyEffect> any_effect();

/// An effect at its joints, with values. Copies share the formula, which is never changed.
struct BoundEffect {
  /// Formula, with what it has of the model or the spec: runs, a point, a table.
  std::shared_ptr<const AnyEffect> type = any_effect();
  std::string where;  ///< as in the EffectSpec
  /// Degrees of freedom it acts on; at `all` and `base`: every one; of ball, string, camera: none.
  std::vector<int> joints;
  std::vector<int> links;  ///< tree links, one a joint: the one it moves
  /// How the joints follow these degrees of freedom, for an effect bound at joints that follow
  /// others; empty: they are the degrees of freedom.
  std::vector<JointDrive> follows;
  /// Degrees of freedom that drives are fed back from, one a joint, then those of their
  /// integrators; empty: their own.
  std::vector<int> encoders;
  /// Tells whether it acts between the two sides of a gear: `joints` are pairs of a link's degree
  /// of freedom and that of the rotor which it hides.
  bool is_gear = false;
  std::vector<int> runs;                      ///< recordings it acts in; empty: all of them
  int num_joints = 0;                         ///< of the model
  std::vector<ParameterInfo> parameter_info;  ///< unit and initial are those of this joint's type
  std::vector<double> parameters;             ///< same order

  /// Metadata of its type, as the catalogue has them, before units and values of this joint.
  const EffectInfo& info() const;
  /// Tells whether the effect acts in the run of this number.
  bool acts_in(int run) const;
  /// Indices of the parameters that the torque is linear in.
  std::vector<int> linear_parameters() const;
  /// Indices of the parameters that do not enter linearly.
  std::vector<int> shape_parameters() const;
  /// Parameters that switch the effect on, 0: it is absent. The linear ones; those of Scale::kPlain
  /// where none is linear (an encoder's offset); empty where none does (Trait::kNoAmplitude), and
  /// for saturation, which an infinite limit switches off.
  std::vector<int> amplitude_parameters() const;
  /// Tells whether its torque at one instant follows from that instant: ports kJointTorque and
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
/// `:run=K`, or `:run=K+L`, stands for those recordings alone (not where Trait::kOfRobot is).
/// Parameters that are not given take their initial values; a unit that
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

/// Leads the commands of one run as a drive of Trait::kReadsCommand does, at its parameters; other
/// effects leave them.
void lead_command(const BoundEffect& effect, CommandPath& path);

/// Largest slope of a drive's torque over what its encoder reads, in a run of these commands
/// [N·m/rad] or [N/m]: where it saturates or rests in its dead band, the slope there is none. 0 for
/// other effects.
double drive_slope(const BoundEffect& effect, const CommandPath& path);

/// Adds an effect of the port kModelParameter to the link tree; others leave it.
/// @param p  parameters in the order of effect.parameter_info
template <Scalar P>
void add_to_tree(const BoundEffect& effect, const P* p, Tree<P>& tree);

/// ∂τ/∂p of the linear parameters at the current values of the shape parameters.
/// @param columns  (number of linear parameters × num_joints), row-major, overwritten:
///                 columns[k·num_joints + j] is the torque of joint j for one unit of parameter
///                 linear_parameters()[k]
/// @throws ModelError if the port is not kJointTorque: series_columns (effects/series.hpp) has them
/// for any port; a payload's are those that the torque regressor has for effect.links[0]
void linear_columns(const BoundEffect& effect, const JointSample<double>& x, double* columns);

/// Scalars compiled into the library; for another scalar include effects/catalogue.hpp.
///@{
#ifdef DIFFNEA_COMPILED
extern template void add_torque<double>(const BoundEffect&, const JointSample<double>&,
                                        const double*, double*);
extern template void add_torque<JetD>(const BoundEffect&, const JointSample<JetD>&, const JetD*,
                                      JetD*);
extern template void add_torque<double>(const BoundEffect&, const Tree<double>&,
                                        const JointSample<double>&, const double*, double*);
extern template void add_torque<JetD>(const BoundEffect&, const Tree<double>&,
                                      const JointSample<JetD>&, const JetD*, JetD*);
extern template void add_to_tree<double>(const BoundEffect&, const double*, Tree<double>&);
extern template void add_to_tree<JetD>(const BoundEffect&, const JetD*, Tree<JetD>&);
#endif
///@}

}  // namespace diffnea
