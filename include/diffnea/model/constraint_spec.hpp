#pragma once
/// Constraints of a model as plain data: what closes its loops, and wheels that roll.
/// dynamics/tree_constraints.hpp gives them their equations.

#include <string>

#include <diffnea/lie/se3.hpp>

namespace diffnea {

/// Equations between frame J of the first link and frame K of the second.
enum class ConstraintKind {
  kConnect,  ///< origins coincide: a ball joint, and the closing pin of a planar loop
  kWeld,     ///< frames coincide
  kHinge,    ///< origins and z axes coincide: a revolute joint
  kRolling,  ///< a thin wheel about K's z axle rolls on the plane z = 0 of the world
};

/// A frame that a constraint acts at.
struct ConstraintEnd {
  int link = -1;                                 ///< index into Model::links, −1 for the world
  Pose<double> X_LF = Pose<double>::identity();  ///< in that link [m], or in the world
};

/// A constraint between two links, or a link and the world.
struct ConstraintSpec {
  std::string name;                                ///< no other constraint has it
  ConstraintKind kind = ConstraintKind::kConnect;  ///< its equations
  ConstraintEnd first;                             ///< J; of a wheel not read
  ConstraintEnd second;                            ///< K; of a wheel its centre, z along the axle
  double radius = 0.0;                             ///< wheel's [m]
};

}  // namespace diffnea
