#pragma once
/// An effect in the model under test, and several of them side by side. Internal to diagnose/.

#include <algorithm>

#include "diagnose/candidates.hpp"
#include "diagnose/beside.hpp"
#include "diagnose/evidence.hpp"

namespace diffnea {

/// A column of which the base leaves less than this share tells nothing: it is filter error and
/// rounding.
constexpr double kInvisible = 1e-4;

/// Damping ratio of what swings behind its encoder, where a search starts: its resonance is then as
/// wide as the grid's steps (a factor of 3.2 of the stiffness), and what swings freely is found
/// from there. Without damping a column off the resonance swings where the robot does not.
constexpr double kSwing = 0.3;

/// An effect in the model under test: its shapes are set, its other parameters follow from a fit.
/// About the present values its torque is offset + columns · p.
struct Term {
  int candidate = -1;
  TriedEffect effect;
  std::vector<int> linear,
      shapes;  ///< as the candidate's; without shapes that the linear parameters stand in for
  MatX<double> columns;  ///< (rows(), linear) ∂τ/∂p
  VecX<double> offset;   ///< (rows()); empty where the torque is linear in p
  Beside beside;         ///< [columns | offset] beside the base

  std::vector<double> shares;  ///< of each of `columns`, whitened, what the base leaves

  /// Whether this recording shows a linear parameter beside the base.
  bool told(long k) const { return shares[k] > kInvisible; }
  /// What this recording tells: linear parameters that show, and shapes.
  int num_parameters() const {
    return static_cast<int>(
        std::ranges::count_if(shares, [](double share) { return share > kInvisible; }) +
        std::ssize(shapes));
  }
  long width() const { return columns.cols(); }
  bool has_offset() const { return offset.size() > 0; }
  VecX<double> values() const;
  VecX<double> torque() const;
  /// The torque beside the base.
  Beside torque_beside() const;
  /// Of the torque's whitened norm, what the base leaves.
  double visible_share() const;
};

/// Torque of several terms, (rows).
VecX<double> torque_of(const std::vector<Term>& terms, long rows);

/// The candidate at a point of its grid, without columns yet.
/// @param index  of the candidate
Term term_at(const Candidate& candidate, int index, const std::vector<double>& point);
/// Sets the columns, and the offset where the torque is not linear in the parameters.
void set_torque(const Evidence& evidence, const Candidate& candidate, Term& term);

/// Normal equations of the linear parameters of several terms, the base eliminated.
struct NormalEquations {
  MatX<double> K;          ///< (k, k)
  VecX<double> b;          ///< (k)
  double left = 0.0;       ///< χ² at p = 0: what the base and the terms' offsets leave
  std::vector<bool> sign;  ///< parameters that may not be negative
};

/// Whether each linear parameter may not be negative.
std::vector<bool> signs(const BoundEffect& effect, const std::vector<int>& linear);

/// How a parameter is searched.
Scale scale_of(const Term& term, int parameter);
/// A torque that follows from position and velocity alone, or friction before it slides.
bool is_like_friction(const TriedEffect& effect);
/// Tells whether its torque reaches no rows but those of its own joints.
bool acts_at_its_joints(const TriedEffect& effect);
/// Tells whether it has a size in each run, which tells nothing of another run.
bool is_of_runs(const TriedEffect& effect);
/// Dry friction, or a spring that its jumps wind up.
bool is_dry(const TriedEffect& effect);

}  // namespace diffnea
