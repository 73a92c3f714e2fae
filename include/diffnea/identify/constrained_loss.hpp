#pragma once
/// The paper's constrained loss (section IV, eq. 10–11), for bodies in maximal coordinates under
/// any constraints:
///
///   Σ ‖V̇ − V̇(X, V; p)‖² + λ_g g² + λ_ġ ġ² + λ_g̈ g̈²
///
/// every residual over what the sensors' noise makes of it. V̇(X, V; p) has the constraints' forces
/// in closed form, and all derivatives by parameters are those of Jets. Of a constraint of
/// velocities, g takes the weight of ġ, and its derivative that of g̈.
///
/// An inequality g ≤ 0 is an equality where the measured motion shows its force. Elsewhere it has
/// none, and softplus(g) stands in for max(0, g). Samples whose smoothing reaches across a change
/// are left out: they are of neither motion.
///
///     struct Pendulum {  // a rod of unknown length, and what it carries
///       template <class T>
///       void operator()(const BodySample&, const VecX<T>& p, ConstrainedSystem<T>& world) const {
///         world.bodies = {particle(T(0.2))};
///         append_rows(Rod<T>{{}, {}, p[0]}, "rod", {kWorld, 0}, world.states, world.rows);
///       }
///     };
///     const ConstrainedFit fit = fit_constrained(ConstrainedModel(Pendulum{}),
///                                                {{"length", "m", 1.0, Sign::kPositive}},
///                                                smooth_bodies(rows));

#include <functional>
#include <string>

#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/effects/effect.hpp>
#include <diffnea/identify/body_motion.hpp>

namespace diffnea {

/// Bodies, forces and constraints at one instant.
template <Scalar T>
struct ConstrainedSystem {
  std::vector<FreeBody<T>> bodies;        ///< to be filled, one per state
  std::vector<BodyState<T>> states;       ///< the sample's; prescribed ones may move with p
  std::vector<Twist<T>> accelerations;    ///< V̇ of the sample; likewise
  std::vector<Wrench<T>> applied;         ///< without weight, in B [N·m, N]; zero as it comes
  std::vector<ConstraintRow<T>> rows;     ///< to be appended (append_rows), as many at each sample
  Vec3<T> gravity{T(0), T(0), T(-9.81)};  ///< in W [m/s²]
};

/// Numbers of a body's motion that derivatives are taken of, kJetWidth of them: place,
/// velocity, acceleration, turn, ω, ω̇ as they were smoothed, three each, in the body's axes.
struct MotionVariables {
  int body = -1;  ///< −1: none
  int first = 0;  ///< number, below 18
};

/// A function of sample and parameters that fills a system, for double and for Jets.
class ConstrainedModel {
 public:
  /// Takes the function.
  /// @param fill  callable with (const BodySample&, const VecX<T>& p, ConstrainedSystem<T>&)
  template <class Fill>
  explicit ConstrainedModel(Fill fill) : plain_(fill), jets_(std::move(fill)) {}

  /// The system at a sample and parameters p. @throws ShapeError if bodies are not one per state
  ConstrainedSystem<double> at(const BodySample& sample, const VecX<double>& p) const;
  /// The same with derivatives, by p, or by the motion of a body.
  ConstrainedSystem<JetD> at(const BodySample& sample, const VecX<JetD>& p,
                             const MotionVariables& variables = {}) const;

 private:
  template <class T>
  using Fill = std::function<void(const BodySample&, const VecX<T>&, ConstrainedSystem<T>&)>;
  Fill<double> plain_;
  Fill<JetD> jets_;
};

/// A number that is fitted.
struct ConstrainedParameter {
  std::string name;         ///< for messages
  std::string unit;         ///< likewise
  double value = 0.0;       ///< where the fit begins
  Sign sign = Sign::kFree;  ///< positive ones shrink tenfold in a step at most
};

/// Weights and stop rules.
struct ConstrainedFitOptions {
  std::array<double, 3> lambda{1.0, 1.0, 1.0};  ///< λ_g, λ_ġ, λ_g̈
  bool robust = true;        ///< Huber's loss at 3 of the root mean square of a sample's residuals
  int max_iterations = 100;  ///< Levenberg–Marquardt steps, refused ones included
  double tolerance = 1e-8;   ///< stop when a step gains a smaller share of the cost
};

/// How well the motion keeps a constraint after the fit.
struct ConstraintError {
  std::string name;         ///< of the constraint
  double g = 0.0;           ///< root mean square of g where it acts, in its unit
  double over_noise = 0.0;  ///< the same over what the sensors' noise makes of it
};

/// Estimates, errors, and how the fit ended.
struct ConstrainedFit {
  VecX<double> p;           ///< (P)
  MatX<double> covariance;  ///< (P, P), of the sensors' noise through smoothing and loss; infinite
                            ///< on the diagonal of what the motion does not tell
  double chi2 = 0.0;        ///< cost at p
  long samples = 0;         ///< number that counts
  int iterations = 0;       ///< steps, refused ones included
  bool converged = false;   ///< the last step gained less than the tolerance, or no step gains
  std::string termination;  ///< why it ended, in words
  std::vector<ConstraintError> constraints;  ///< in the order of their first rows
};

/// Parameters by the constrained loss: Levenberg–Marquardt from their values.
/// @throws DataError if samples are too few, if a body's noise is zero that its equations need, if
///         a constraint is no number at a sample, or if a constraint without a free parameter is
///         off by more than noise: its name, by how much, and the constraints that leave it no room
/// @throws ModelError as held_acceleration
ConstrainedFit fit_constrained(const ConstrainedModel& model,
                               const std::vector<ConstrainedParameter>& parameters,
                               const BodyMotion& motion, const ConstrainedFitOptions& options = {});

}  // namespace diffnea
