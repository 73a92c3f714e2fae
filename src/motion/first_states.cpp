#include "motion/first_states.hpp"

#include "core/decompositions.hpp"

namespace diffnea {

VecX<double> ReducedWindow::state_step(const VecX<double>& dx) const {
  const long f = dx.size();
  const VecX<double> rhs = -top.col(f) - top.leftCols(f) * dx;
  // Rank-revealing: rows may not see all of a state, and that stays where it is.
  return Eigen::CompleteOrthogonalDecomposition<MatX<double>>(R_state).solve(rhs);
}

ReducedWindow eliminate(const TriangularFactor& rows, int states, bool finite) {
  ReducedWindow out;
  const long f = rows.columns() - states;
  const MatX<double> R = rows.R();
  const VecX<double> d = rows.d();
  out.finite = finite && R.allFinite() && d.allFinite();
  if (!out.finite) return out;
  out.R_state = R.topLeftCorner(states, states);
  out.top.resize(states, f + 1);
  out.top.leftCols(f) = R.topRightCorner(states, f);
  out.top.col(f) = d.head(states);
  out.rows.resize(f, f + 1);
  out.rows.leftCols(f) = R.bottomRightCorner(f, f);
  out.rows.col(f) = d.tail(f);
  return out;
}

}  // namespace diffnea
