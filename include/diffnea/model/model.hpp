#pragma once
/// A robot as its file describes it: named links (fixed ones too), limits, frames, and the effects
/// that act on it. Plain data. `make_tree` turns it into the numbers that the recursions run on.

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/model/ball.hpp>
#include <diffnea/model/constraint_spec.hpp>
#include <diffnea/model/tree.hpp>

namespace diffnea {

/// One parameter of an effect: `coulomb = 1.2 N*m`.
struct EffectParameter {
  std::string name;  ///< as `diffnea effects` lists it, with "_K" after it if of recording K alone
  double value = 0.0;  ///< in `unit`
  std::string unit;    ///< the effect's own, never converted, e.g. "N*m*s/rad"; empty: not checked
};

/// A torque that was learned, not derived: Σ_b w_b Π_k β((x_k − c_bk)/h_bk) over one or two
/// channels x_k of the motion, what the effect `residual` adds (effects/residual.hpp).
struct BumpTable {
  std::vector<std::string> variables;  ///< channels as in a recording: "q_elbow", "qd_elbow"
  std::vector<double> centres,  ///< c_bk, (bumps × variables), row-major, units of the channels
      widths;                   ///< h_bk, of the same shape and units
  std::vector<double> weights;  ///< (bumps) [N·m] or [N]
  double bound = 0.0;           ///< most that it ever gives [N·m] or [N]
};

/// An effect on the model, as plain data; effects/catalogue.hpp gives it its formula.
struct EffectSpec {
  std::string effect;  ///< name in the catalogue, e.g. "coulomb_friction"
  /// A joint's name, two with a comma between, or base, tip, all, ball, string, camera; with
  /// ":run=K+L" after it in these recordings alone.
  std::string where;
  std::vector<EffectParameter> parameters;  ///< in any order; those left out: as in the catalogue
  std::optional<BumpTable> table = {};      ///< of `residual` alone
};

/// Limits of a joint; infinite where the file gives none. [rad, rad/s, N·m] or [m, m/s, N].
struct JointLimits {
  double lower = -std::numeric_limits<double>::infinity();    ///< smallest q [rad, m]
  double upper = std::numeric_limits<double>::infinity();     ///< largest q [rad, m]
  double velocity = std::numeric_limits<double>::infinity();  ///< largest |q̇| [rad/s, m/s]
  double effort = std::numeric_limits<double>::infinity();    ///< largest |τ| of its drive [N·m, N]
};

/// A joint's drive that follows commanded positions, as the file has it:
/// τ = kp (command − q) − kd q̇, within JointLimits::effort. What the robot's own drive does is for
/// `identify` to find; this is where it begins.
struct ServoGains {
  double kp = 0.0;  ///< [N·m/rad, N/m]
  double kd = 0.0;  ///< [N·m·s/rad, N·s/m]
};

/// How a link hangs on its parent.
enum class ModelJoint { kFixed, kRevolute, kPrismatic };

/// A joint that follows another: q = ratio · q_leader + offset (URDF's `mimic`, a joint equality of
/// an MJCF).
struct Follow {
  std::string leader;   ///< joint that it follows, which may follow another
  double ratio = 1.0;   ///< [rad/rad, m/rad …]; 0: it never moves
  double offset = 0.0;  ///< [rad, m]
};

/// A link and the joint that carries it. Links[0] of a model with a free base is that base: its
/// joint is fixed as far as it has one, and X_PJ its pose where the file has it.
struct ModelLink {
  std::string name;   ///< no other link has it
  std::string joint;  ///< name of the joint to the parent; may be empty if that is fixed
  int parent = -1;    ///< index into Model::links, −1 for the world; always below the own index
  ModelJoint type = ModelJoint::kFixed;          ///< of that joint
  Vec3<double> axis{0, 0, 1};                    ///< unit vector, in the link's frame
  Pose<double> X_PJ = Pose<double>::identity();  ///< of the link in its parent at q = 0
  SpatialInertia<double>
      inertia;           ///< about the link's origin, in the link; zero if the file gives none
  JointLimits limits;    ///< of that joint
  bool passive = false;  ///< torque known to be zero
  std::optional<ServoGains> servo = {};  ///< none: the file has no position drive at that joint
  std::optional<Follow> follows = {};  ///< none: the joint is a degree of freedom of its own
};

/// A named frame F that is fixed to a link: X_LF. Sites of an MJCF, e.g. `cup`, `string`.
struct ModelFrame {
  std::string name;                              ///< no other frame has it
  int link = -1;                                 ///< index into Model::links, −1 for the world
  Pose<double> X_LF = Pose<double>::identity();  ///< of F in that link, or in the world
};

/// Gaussian posterior of named parameters as `identify` leaves it: what `--base prior` may move.
struct Posterior {
  std::vector<std::string>
      names;  ///< parameter names, e.g. "forearm.mass", "elbow.coulomb_friction.coulomb"
  std::vector<double> mean;  ///< SI units of the parameter
  std::vector<double>
      information;  ///< inverse covariance, row-major (n×n); rank = what the data identified
  std::vector<std::string> recordings;  ///< fingerprints of those it was made of; may be empty
};

/// A robot: links, effects, where relevant a ball; a value, with names and units, from which trees
/// are made.
struct Model {
  std::string name;                         ///< of the robot, for messages and reports
  std::vector<ModelLink> links;             ///< parents before their children
  bool free_base = false;                   ///< links[0] floats, and carries all others
  std::vector<ModelFrame> frames;           ///< found by name, e.g. `cup`, `tip`
  std::vector<ConstraintSpec> constraints;  ///< ties that close loops, wheels that roll
  std::vector<EffectSpec>
      effects;  ///< armature, friction, springs … of the base model and found later
  Vec3<double> gravity{0, 0, -9.81};   ///< acceleration of free fall, in W [m/s²]
  std::optional<BallSpec> ball;        ///< none: the robot alone
  std::optional<CupSpec> cup;          ///< in the frame `cup`, which it needs; none: no cup
  std::vector<CapsuleSpec> obstacles;  ///< of the ball
  std::vector<double> home;  ///< posture to start from, per degree of freedom [rad, m]; empty: none
  std::optional<Posterior> posterior;  ///< what `identify` left; none: no fit
  std::string source;                  ///< file the model was read from, for messages
  std::vector<std::string>
      notes;  ///< what that file says and this model leaves out, one sentence each
};

/// Indices of the links whose joint is a degree of freedom, in their order: of all that move,
/// unless joints follow others.
std::vector<int> moving_links(const Model& model);
/// Indices of all links that move, a free base first, in the order of the tree's links.
std::vector<int> tree_links(const Model& model);
/// Names of the joints that are degrees of freedom, in their order.
std::vector<std::string> joint_names(const Model& model);
/// Names of the joints that follow others.
std::vector<std::string> follower_names(const Model& model);
/// A joint of the tree: the link that it moves, and how it follows its coordinate.
struct TreeJoint {
  std::string name;      ///< as the model has it
  int link = -1;         ///< index of the tree link that it moves
  JointDrive drive;      ///< ratio 1 and offset 0 unless it follows another
  bool follows = false;  ///< the coordinate is another joint's
};
/// All joints that move, in the order of the tree's links (a free base has none); chains of
/// followers are resolved.
/// @throws ModelError if a joint follows one that is not there or is fixed, or follows itself
std::vector<TreeJoint> tree_joints(const Model& model);
/// @return index of the degree of freedom
/// @throws ModelError naming the joints there are
int find_joint(const Model& model, const std::string& joint);

/// Where every model link sits in the tree: links that are fixed to a moving one, or to a free
/// base, become part of it.
struct TreeMap {
  std::vector<int> dof;  ///< per model link: its tree link, −1 if it is fixed to the world
  std::vector<Pose<double>>
      X_LF;  ///< per model link F: its pose in that tree link L (or in the world)
};
/// Which links and joints of the model became which of its tree: fixed links are merged.
TreeMap map_to_tree(const Model& model);
/// The tree's link that a link of the model is part of, and its pose in it; −1: the world.
/// @param link  index into Model::links, −1 for the world
inline std::pair<int, Pose<double>> place_in_tree(const TreeMap& map, int link) {
  if (link < 0) return {-1, Pose<double>::identity()};
  return {map.dof[static_cast<std::size_t>(link)], map.X_LF[static_cast<std::size_t>(link)]};
}

/// The cup in the frame of the link that the string is tied to, where both move as one: none if the
/// model has no cup, no string, or the cup is elsewhere.
std::optional<Pose<double>> cup_at_string(const Model& model);

/// The numbers: fixed links lumped into the moving link, free base or world that carries them,
/// effects named `armature` as rotor inertia.
/// @throws ModelError if a parent does not precede its child, an axis is not a unit vector, a joint
///         follows none that moves, an armature effect names no joint, or not all links hang on a
///         free base
Tree<double> make_tree(const Model& model);

/// Lets a robot float on its first link, which must carry all others and be fixed to the world.
/// @param where  for messages  @throws ModelError if it does not, naming a link that stands
/// elsewhere
void let_base_float(Model& model, const std::string& where);
/// @param what  serves no free base yet, e.g. `identify`
/// @throws ModelError if the base floats, in a sentence that names --fix-base
void require_fixed_base(const char* what, const Model& model);
/// @param what  serves no constraints yet, e.g. `diagnose`
/// @throws ModelError naming the model's constraints, in a sentence that names --open-loops
void require_no_constraints(const char* what, const Model& model);
/// Both: a tree on a fixed base, and nothing else.
void require_plain_tree(const char* what, const Model& model);

/// Ten inertial parameters of every moving link with all that is fixed to it, in the order of the
/// tree's links: the π that torques are linear in, (10 links).
VecX<double> inertial_parameters(const Tree<double>& tree);

/// Writes identified parameters back. The moving link takes the whole of its lump; links fixed to
/// it keep their frames and lose their inertia (how a lump divides cannot be identified).
/// @param pi (10 links), see inertial_parameters  @throws ShapeError
void set_inertial_parameters(Model& model, const VecX<double>& pi);

/// Something about a model that looks wrong, in words for a person.
struct ModelIssue {
  std::string link;
  std::string text;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Issue", "Something about a model that looks wrong.");
    list.field("link", &ModelIssue::link, "Name of the link it is about.");
    list.field("text", &ModelIssue::text,
               "What is wrong with it, with the number, e.g. ``mass is 0 kg, expected > 0``");
  }
};
/// Masses that are not positive, inertias that no distribution of mass can have (smallest principal
/// second moment below zero: the triangle inequality, by how much), limits that are empty, moving
/// links that neither have inertia (an armature counts) nor carry a link that has.
std::vector<ModelIssue> check_model(const Model& model);

}  // namespace diffnea

#ifndef DIFFNEA_COMPILED
#include <diffnea/model/detail/model_impl.hpp>
#endif
