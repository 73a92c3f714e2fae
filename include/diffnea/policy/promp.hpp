#pragma once
/// Probabilistic movement primitive (Paraschos et al. 2013): joint motions that are linear in
/// weights, and a Gaussian over the weights (policy/gaussian.hpp).
///
///   q(t) = q_0 + Σ_b w_b φ_b(t/T),   φ_b = n_b less the cubic with n_b's value and slope at the
///   ends
///
/// n_b are normalised radial bases of centres b/(B − 1), b = 0 … B − 1. Motions start exactly at
/// q_0 and at rest, and end at rest; velocities are divided by the duration. After T the posture of
/// T is held.

#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Basis functions and times of a movement primitive.
struct PrompSpec {
  std::vector<std::string> joints;
  int bases = 9;
  int held_first = 2;
  int held_last = 2;
  double width = 1.0;
  double duration = 1.5;
  double hold = 1.0;
  bool returns = true;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("PrompSpec", "A movement primitive.", {.exact = true});
    list.field("joints", &PrompSpec::joints, "That move; all others keep their start.");
    list.field("bases", &PrompSpec::bases, "B, a joint; at least 2.");
    list.field(
        "held_first", &PrompSpec::held_first,
        "Weights at the beginning that are 0 and not of the parameters: the motion leaves slowly.");
    list.field("held_last", &PrompSpec::held_last, "The same at the end: it comes home.");
    list.field("width", &PrompSpec::width, "Width of a basis, in spacings of the centres.");
    list.field("duration", &PrompSpec::duration, "T.", {.unit = "s"});
    list.field("hold", &PrompSpec::hold, "Time after T.", {.unit = "s"});
    list.field("returns", &PrompSpec::returns,
               "Comes back exactly to q_0 at T: φ(1) = 0. If not, φ(1) = n(1), still at rest.");
  }
};

/// A movement primitive: from weights to desired positions and velocities.
class Promp {
 public:
  /// @throws Error if there are no joints, fewer than two bases, no duration or width, or all
  /// weights are held
  explicit Promp(PrompSpec spec);

  /// As given.
  const PrompSpec& spec() const { return spec_; }
  /// Weights of one joint.
  int parameters_per_joint() const;
  int size() const;  ///< parameters θ: joint by joint
  /// φ, (parameters_per_joint), and dφ/dt [1/s] at `time` [s], 0 ≤ time; T and later: of T, at
  /// rest. @throws Error if time < 0
  void features(double time, VecX<double>& phi, VecX<double>& phi_d) const;
  /// Desired motion of the spec's joints at `times`, relative to the start.
  /// @param theta (size())  @param q, qd  (times × joints) [rad, rad/s], overwritten
  /// @throws ShapeError
  void motion(const VecX<double>& theta, const VecX<double>& times, RowMatX<double>& q,
              RowMatX<double>& qd) const;

 private:
  PrompSpec spec_;
};

}  // namespace diffnea
