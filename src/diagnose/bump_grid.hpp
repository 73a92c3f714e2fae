#pragma once
/// Bumps of a residual on a grid over its variables, and the search for the grid's widths. Internal
/// to diagnose/.

#include <functional>
#include <vector>

#include <diffnea/core/scalar.hpp>
#include <diffnea/effects/residual.hpp>

namespace diffnea {

/// The variables of a table of bumps.
using Axes = std::vector<Residual::Axis>;

/// Every bump of a table at every row, (rows, bumps).
/// @param x  values of its variables, (rows, variables)
MatX<double> bumps(const BumpTable& table, const MatX<double>& x);

/// Coarser and finer, one axis at a time, as long as the marginal likelihood grows. Bumps are where
/// there is data.
/// @param cost_of  −2 ln of the marginal likelihood, of bumps at every row
/// @param x        values of the variables, (rows, variables)
/// @param used     of the rows
/// @param tried    how many grids were; overwritten
/// @return without weights (0); empty where no grid is possible
BumpTable best_grid(const std::function<double(const MatX<double>&)>& cost_of,
                    const MatX<double>& x, const Axes& axes, const std::vector<bool>& used,
                    int& tried);

}  // namespace diffnea
