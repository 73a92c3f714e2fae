#pragma once
/// The one vocabulary of causes. An effect is a small type with a name, named parameters with units and
/// physical signs, a formula templated on the scalar, and a place where it acts. The same type extends
/// the model in simulation and identification, is a candidate in diagnosis, and is written to results.
///
/// A new effect is one header with
///     static const EffectInfo& info();
///     template <Scalar T> void add_torque(const JointSample<T>& x, const int* joint, const T* p, T* tau) const;
/// and one line in effects/catalogue.hpp.

#include <diffnea/core/scalar.hpp>
#include <string>
#include <vector>

namespace diffnea {

enum class Sign { kFree, kNonNegative, kPositive };

/// One parameter of an effect.
struct ParameterInfo {
  std::string name;
  std::string unit;            ///< at a revolute joint
  std::string unit_prismatic;  ///< at a prismatic joint
  Sign sign = Sign::kFree;
  bool linear = true;      ///< the torque is linear in it; otherwise a shape parameter
  double initial = 0.0;    ///< where a fit starts, and the value a shape keeps if it is not fitted
};

/// Where an effect can act; also how many joints it names.
enum class Place { kJoint, kJointPair, kTip, kBase, kAllJoints };

/// What it acts on.
enum class Port {
  kJointTorque,     ///< adds to the right-hand side of the sign equation: add_torque
  kMeasurement,     ///< changes a measured channel
  kModelParameter,  ///< changes a parameter of the link tree
};

/// What selection, results and files see of an effect.
struct EffectInfo {
  std::string name;     ///< as in model and result files
  std::string formula;  ///< for people, e.g. "F_c tanh(q̇/v₀)"
  std::string summary;  ///< one line
  Place place = Place::kJoint;
  Port port = Port::kJointTorque;
  std::vector<ParameterInfo> parameters;
  bool motor_side = false;  ///< left out of the sign equation on the link side (armature, motor friction)
};

/// All joints at one instant; arrays of length n [rad, rad/s, rad/s², N·m] or [m, m/s, m/s², N].
template <Scalar T>
struct JointSample {
  double time = 0.0;  ///< [s]
  int run = 0;        ///< which recording of several
  const T* q = nullptr;
  const T* qd = nullptr;
  const T* qdd = nullptr;
  const T* tau = nullptr;  ///< torque that the links transmit, without effects
};

}  // namespace diffnea
