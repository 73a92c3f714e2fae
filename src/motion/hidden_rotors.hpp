#pragma once
/// Rotors behind springs and gaps as degrees of freedom of their own, so that what stands between
/// rotor and link is a torque of one instant. Internal to the library.

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/hidden_motor.hpp>

namespace diffnea {

/// Tells whether fits of simulated runs move a parameter of a gear: its stiffness or gap, and the
/// damping. The rotor is the joint's armature; sides and the shares of friction are choices.
bool fits_of_gear(const ParameterInfo& p);

/// A rotor that has left its joint.
struct HiddenRotor {
  int joint = 0;                ///< degree of freedom that is the link's now
  int rotor = 0;                ///< its own, behind those of all joints
  int link = 0;                 ///< link of the tree, without mass but for the armature
  bool read = false;            ///< the joint's encoder is at the rotor
  double friction_share = 1.0;  ///< part of the joint's friction that turns with the rotor
  BoundEffect gear;             ///< between the two

  /// Degree of freedom that the joint's encoder reads.
  int encoder() const { return read ? rotor : joint; }
  /// The other one.
  int hidden() const { return read ? joint : rotor; }
};

/// Integrator of a drive: its velocity is the integral of the drive's error, its inertia 1.
struct DriveIntegrator {
  int joint = 0;  ///< degree of freedom of the joint
  int dof = 0;    ///< its own, behind those of all joints and rotors
  int link = 0;   ///< link of the tree, without mass but for the inertia of 1
};

/// Share of an effect's torque, at degrees of freedom of the unfolded tree.
struct EffectPart {
  BoundEffect effect;
  double share = 1.0;
  bool shapes_alone = false;  ///< it is linear in no parameter
};

/// Joints, n of them, and the rotors and integrators that have been unfolded behind them.
class HiddenRotors {
 public:
  /// Gives each motor that an effect of the model hides a degree of freedom, with all of the
  /// joint's armature; the effects of one instant act where they belong, and the gear between the
  /// two. A drive with an integrator gets a degree of freedom for that.
  /// @param model  without effects that hide a motor afterwards
  /// @throws ModelError for a second motor at a joint, an effect that reads accelerations or the
  /// transmitted torque on the motor's side, one that acts in some runs alone
  explicit HiddenRotors(ExtendedTree& model);

  /// Number n of joints.
  int joints() const { return joints_; }
  /// Number of degrees of freedom, those of rotors and integrators included.
  int dofs() const { return joints_ + static_cast<int>(rotors_.size() + integrators_.size()); }
  const std::vector<HiddenRotor>& rotors() const { return rotors_; }
  const std::vector<DriveIntegrator>& integrators() const { return integrators_; }
  /// Degree of freedom that a joint's encoder reads.
  int encoder(int joint) const;
  /// Joint that a degree of freedom belongs to.
  int joint_of(int dof) const;
  /// Joints of the rotors, then of the integrators, in the order of their degrees of freedom.
  std::vector<int> joints_behind() const;
  /// Degree of freedom of a joint's drive: its rotor's, where it has left the joint.
  int drive(int joint) const;

  /// Joint torques where drives act. @param u  (n)  @param out  (dofs), written
  void at_drives(const Eigen::Ref<const VecX<double>>& u, VecX<double>& out) const;
  /// Where an effect acts, in parts.
  /// @throws ModelError as the constructor
  std::vector<EffectPart> parts(const BoundEffect& whole) const;

 private:
  const HiddenRotor* at(int joint) const;
  void add(const BoundEffect& gear, std::size_t k, double link, Tree<double>& tree);
  const DriveIntegrator* integrator(int joint) const;
  std::vector<EffectPart> parts_at_sides(const BoundEffect& whole) const;

  int joints_ = 0;
  std::vector<HiddenRotor> rotors_;  ///< in the order of their joints
  std::vector<DriveIntegrator> integrators_;  ///< in the order of the model's effects
  MotorShares shares_;
};

}  // namespace diffnea
