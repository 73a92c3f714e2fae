#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/core/triangular_factor.hpp>

#include "core/decompositions.hpp"

namespace diffnea {
namespace {

/// Rows gathered before each reduction: enough that a reduction's cost is that of the new rows.
constexpr long kFactorRows = 512;

}  // namespace

TriangularFactor::TriangularFactor(int columns)
    : columns_(columns), buffer_(RowMatX<double>::Zero(columns + 1 + kFactorRows, columns + 1)) {}

void TriangularFactor::add(const Eigen::Ref<const RowMatX<double>>& rows) {
  require_size("TriangularFactor::add", rows.cols(), columns_ + 1, "column of [Y tau]");
  for (long done = 0; done < rows.rows();) {
    const long take = std::min<long>(rows.rows() - done, buffer_.rows() - filled_);
    buffer_.middleRows(filled_, take) = rows.middleRows(done, take);
    filled_ += take;
    done += take;
    if (filled_ == buffer_.rows()) reduce();
  }
  rows_ += rows.rows();
}

void TriangularFactor::add(const TriangularFactor& other) {
  const long own = rows_;
  add(other.buffer_.topRows(other.filled_));
  rows_ = own + other.rows_;
}

TriangularFactor TriangularFactor::mapped(const MatX<double>& T) const {
  require_size("TriangularFactor::mapped: rows of T", T.rows(), columns_ + 1, "column of [Y tau]");
  require_size("TriangularFactor::mapped: columns of T", T.cols(), columns_ + 1,
               "column of [Y tau]");
  TriangularFactor out(columns_);
  out.rows_ = rows_;
  out.filled_ = filled_;
  out.buffer_.topRows(filled_).noalias() = buffer_.topRows(filled_) * T;
  return out;
}

void TriangularFactor::reduce() {
  const long p = columns_ + 1;
  const MatX<double> block = buffer_.topRows(filled_);
  const Eigen::HouseholderQR<MatX<double>> qr(block);
  const long kept = std::min(p, filled_);
  buffer_.topRows(kept) = qr.matrixQR().topRows(kept).template triangularView<Eigen::Upper>();
  filled_ = kept;
}

namespace {

MatX<double> factor_of(const Eigen::Ref<const RowMatX<double>>& rows) {
  const long p = rows.cols();
  MatX<double> out = MatX<double>::Zero(p, p);
  if (rows.rows() == 0) return out;
  const Eigen::HouseholderQR<MatX<double>> qr(rows);
  const long kept = std::min<long>(p, rows.rows());
  out.topRows(kept) = qr.matrixQR().topRows(kept).template triangularView<Eigen::Upper>();
  return out;
}

}  // namespace

MatX<double> TriangularFactor::R() const {
  return factor_of(buffer_.topRows(filled_)).topLeftCorner(columns_, columns_);
}
VecX<double> TriangularFactor::d() const {
  return factor_of(buffer_.topRows(filled_)).col(columns_).head(columns_);
}
double TriangularFactor::residual_sum_of_squares() const {
  const double e = factor_of(buffer_.topRows(filled_))(columns_, columns_);
  return e * e;
}

double TriangularFactor::sum_of_squares(const VecX<double>& pi) const {
  require_size("TriangularFactor::sum_of_squares: pi", pi.size(), columns_, "column of Y");
  const auto rows = buffer_.topRows(filled_);
  return (rows.leftCols(columns_) * pi - rows.col(columns_)).squaredNorm();
}

}  // namespace diffnea
