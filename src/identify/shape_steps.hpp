#pragma once
/// Gauss–Newton steps of shapes (a Stribeck velocity, a rest position, a fixed transform): a
/// shape's step is one more linear parameter of the fit. Internal to identify/.

#include <diffnea/identify/layout.hpp>

namespace diffnea {

/// The layout with one more linear parameter for each free shape: the step of ln η, or of η.
FitLayout with_shape_steps(const FitLayout& layout);

/// A plain shape's column is its effect's amplitude a times what does not depend on a: k (q − q₀)
/// gives −k. Where the same step moves a too, from a₀ to a₁, the shape has to go a₀/a₁ of its own.
/// @param at  linear parameters that the columns are of  @param x  those of the step
void use_amplitudes(const FitLayout& layout, const VecX<double>& at, const VecX<double>& x,
                    VecX<double>& step);

/// A shape after a step of the regression, no longer than the linearisation may be trusted.
double stepped(const FitParameter& shape, double value, double step);

}  // namespace diffnea
