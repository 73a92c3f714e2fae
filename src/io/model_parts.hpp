#pragma once
/// What the three formats share: names of the base model's effects, and the checks every model
/// passes.

#include <string>

#include <diffnea/model/model.hpp>

namespace diffnea::io {

/// The effects that URDF and MJCF can hold, as numbers of one joint; 0 where there is none.
struct JointTerms {
  double viscous = 0.0;    ///< [N·m·s/rad] or [N·s/m]
  double coulomb = 0.0;    ///< [N·m] or [N]
  double armature = 0.0;   ///< [kg·m²] or [kg]
  double stiffness = 0.0;  ///< [N·m/rad] or [N/m]
  double rest = 0.0;       ///< [rad] or [m]
};

/// Appends the terms of `link`'s joint that are not 0 to model.effects.
void add_joint_terms(Model& model, const ModelLink& link, const JointTerms& terms);
/// Terms of one joint out of model.effects (sums, if an effect is there twice).
JointTerms joint_terms(const Model& model, const std::string& joint);
/// Whether JointTerms holds all that the effect says.
bool is_joint_term(const Model& model, const EffectSpec& effect);

/// @throws ModelError if a description has more links than any robot: what follows walks from link
/// to link, and compares effects with joints
void require_few_links(std::size_t links, const std::string& where);

/// Finite numbers, unit axes, rotations that are rotations, names that are there and used once, a
/// ball with mass on a string with length, a cup that can hold one, obstacles that are solid.
/// @throws ModelError `where: …`
void validate(const Model& model, const std::string& where);

/// Shortest decimal that reads back as the same double.
std::string exact(double value);
std::string exact(const Vec3<double>& v);

/// Centre of mass [m] and inertia about it [kg·m²], axes of the link, of a body with mass.
struct ComInertia {
  Vec3<double> com;
  Sym3<double> I;
};
ComInertia com_inertia(const SpatialInertia<double>& inertia);
bool is_zero(const SpatialInertia<double>& inertia);
/// Equal to rounding: relative 1e-13 of the body's own scale, so that a value that only passed
/// through mass · centre of mass and back counts as unchanged.
bool same(const SpatialInertia<double>& a, const SpatialInertia<double>& b);
bool same(const Pose<double>& a, const Pose<double>& b);

}  // namespace diffnea::io
