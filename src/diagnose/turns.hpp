#pragma once
/// How dry friction of the base turns where the velocity changes its sign. Internal to diagnose/.
///
/// No model knows it well: F tanh(q̇/v₀) stands for whatever it does within a few milliseconds. What
/// that leaves at every reversal looks like a time shift, a spring or a ripple, so that the base
/// takes it over before anything is named.

#include <array>
#include <set>

#include <diffnea/effects/series.hpp>
#include <diffnea/identify/layout.hpp>

namespace diffnea {

/// Whether a shape parameter is the v₀ of a smoothed friction.
bool is_smoothing(const FitParameter& shape);

/// Degrees of freedom that the layout's dry friction acts on.
std::set<int> dry_joints(const FitLayout& layout);

/// Columns for each v₀ beside that of ln v₀.
constexpr int kTurnColumns = 2;
/// By how much earlier friction turns in the first of them [s].
constexpr double kEarlier = 1e-3;

/// A friction of the layout at the layout's values.
BoundEffect friction_of(const FitLayout& layout, const FitParameter& smoothing);

/// How the torque of `friction` changes if it turns earlier by kEarlier, and if it does so by
/// another curve: ½ ∂²τ/∂(ln v₀)². Each (N, n) [N·m] or [N].
std::array<RowMatX<double>, kTurnColumns> turn_columns(const BoundEffect& friction, int smoothing,
                                                       const ExtendedTree& base,
                                                       const JointSeries& x);

}  // namespace diffnea
