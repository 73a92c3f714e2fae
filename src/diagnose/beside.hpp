#pragma once
/// Columns beside the base, without writing out what the base leaves of them: a column of one joint
/// has the rows of that joint alone, while what the base leaves of it has those of all. Internal to
/// diagnose/.

#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Columns [W G] in the rows of the joints that they reach, and their products with the base's
/// orthonormal basis Q: G⊥ = W G − Q (Qᵀ W G), so that G⊥ᵀ H⊥ = (W G)ᵀ W H − (Qᵀ W G)ᵀ Qᵀ W H.
struct Beside {
  std::vector<long> joints;  ///< indices into the evidence's joints, ascending
  MatX<double> whitened;     ///< (joints · times, columns)
  MatX<double> onto;         ///< (rank of the base, columns)

  /// Number of columns.
  long cols() const { return whitened.cols(); }
  /// Rows of the i-th of `joints`.
  auto of(std::size_t i) const {
    const long m = whitened.rows() / std::ssize(joints);
    return whitened.middleRows(i * m, m);
  }
};

/// Products of what the base leaves of both, (a.cols(), b.cols()).
MatX<double> product(const Beside& a, const Beside& b);

/// A · weights, one column.
Beside combined(const Beside& a, const VecX<double>& weights);

/// Square of what columns with these products leave of one with the products `with` and `square`;
/// columns that depend on others, to 1e-10, count once.
double left_beside(const MatX<double>& products, const VecX<double>& with, double square);

}  // namespace diffnea
