#pragma once
/// Linear structure, factored once. ‖Yπ − τ‖² = ‖Rπ − d‖² + ‖e‖² after one QR of [Y τ]; factors of
/// blocks combine (TSQR, Demmel et al. 2012), so rows of any number stream through a fixed memory.

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Upper-triangular factor of all rows [Y τ] seen so far.
class TriangularFactor {
 public:
  /// @param columns  number p of columns of Y
  explicit TriangularFactor(int columns = 0);

  /// Adds rows [Y τ], (m, p+1), each already divided by what it is to be weighted with.
  /// @throws ShapeError if the block has not p+1 columns
  void add(const Eigen::Ref<const RowMatX<double>>& rows);
  /// Adds all rows another factor has seen.
  void add(const TriangularFactor& other);

  /// The factor of all rows times T, [Y τ] T, (p+1, p+1): columns combined, no row read again.
  /// @throws ShapeError
  TriangularFactor mapped(const MatX<double>& T) const;

  /// p + 1: those of Y, and τ.
  int columns() const { return columns_; }
  /// Rows that went in.
  long rows() const { return rows_; }
  /// R (p, p) and d (p) of ‖Rπ − d‖², and the residual sum of squares ‖e‖² no π can remove.
  MatX<double> R() const;
  /// (p), of ‖Rπ − d‖².
  VecX<double> d() const;
  /// ‖e‖²: what no π can remove.
  double residual_sum_of_squares() const;
  /// Σ (Yπ − τ)² over all rows, for any π. Exact, without the rows.
  double sum_of_squares(const VecX<double>& pi) const;

 private:
  void reduce();

  int columns_;
  long rows_ = 0;
  long filled_ = 0;  // rows of buffer_ in use; the first min(filled_, p+1) may be triangular
  RowMatX<double> buffer_;
};

}  // namespace diffnea
