#pragma once
/// Eigen's decompositions and products of double matrices, compiled once (decompositions.cpp) for
/// the whole library: a file that solves a system would compile them again, for seconds. Files of
/// src/ take them from here, never from Eigen/Cholesky, Eigen/QR and their like.
///
/// It serves decompositions of a matrix; of an expression, the matrix has to be written:
/// `LDLT<MatX<double>>(MatX<double>(a + b))`.

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#include <diffnea/core/scalar.hpp>

#ifndef DIFFNEA_INSTANCE
#define DIFFNEA_INSTANCE extern template
#endif

namespace Eigen {

DIFFNEA_INSTANCE void ColPivHouseholderQR<MatrixXd>::computeInPlace();
DIFFNEA_INSTANCE void CompleteOrthogonalDecomposition<MatrixXd>::computeInPlace();
DIFFNEA_INSTANCE void HouseholderQR<MatrixXd>::computeInPlace();
DIFFNEA_INSTANCE void PartialPivLU<MatrixXd>::compute();

// Constructors and compute() are templates over their argument.
DIFFNEA_INSTANCE ColPivHouseholderQR<MatrixXd>::ColPivHouseholderQR(const EigenBase<MatrixXd>&);
DIFFNEA_INSTANCE CompleteOrthogonalDecomposition<MatrixXd>::CompleteOrthogonalDecomposition(
    const EigenBase<MatrixXd>&);
DIFFNEA_INSTANCE HouseholderQR<MatrixXd>::HouseholderQR(const EigenBase<MatrixXd>&);
DIFFNEA_INSTANCE LDLT<MatrixXd>::LDLT(const EigenBase<MatrixXd>&);
DIFFNEA_INSTANCE LDLT<MatrixXd>& LDLT<MatrixXd>::compute(const EigenBase<MatrixXd>&);
DIFFNEA_INSTANCE LLT<MatrixXd>::LLT(const EigenBase<MatrixXd>&);
DIFFNEA_INSTANCE LLT<MatrixXd>& LLT<MatrixXd>::compute(const EigenBase<MatrixXd>&);
DIFFNEA_INSTANCE PartialPivLU<MatrixXd>::PartialPivLU(const EigenBase<MatrixXd>&);
DIFFNEA_INSTANCE SelfAdjointEigenSolver<MatrixXd>::SelfAdjointEigenSolver(
    const EigenBase<MatrixXd>&, int);
DIFFNEA_INSTANCE SelfAdjointEigenSolver<MatrixXd>& SelfAdjointEigenSolver<MatrixXd>::compute(
    const EigenBase<MatrixXd>&, int);

// Solutions for one right-hand side and for several.
DIFFNEA_INSTANCE void ColPivHouseholderQR<MatrixXd>::_solve_impl(const VectorXd&, VectorXd&) const;
DIFFNEA_INSTANCE void ColPivHouseholderQR<MatrixXd>::_solve_impl(const MatrixXd&, MatrixXd&) const;
DIFFNEA_INSTANCE void CompleteOrthogonalDecomposition<MatrixXd>::_solve_impl(const VectorXd&,
                                                                             VectorXd&) const;
DIFFNEA_INSTANCE void LDLT<MatrixXd>::_solve_impl_transposed<true>(const VectorXd&,
                                                                   VectorXd&) const;
DIFFNEA_INSTANCE void LDLT<MatrixXd>::_solve_impl_transposed<true>(const MatrixXd&,
                                                                   MatrixXd&) const;
DIFFNEA_INSTANCE void LLT<MatrixXd>::_solve_impl_transposed<true>(const VectorXd&, VectorXd&) const;
DIFFNEA_INSTANCE void LLT<MatrixXd>::_solve_impl_transposed<true>(const MatrixXd&, MatrixXd&) const;
DIFFNEA_INSTANCE void HouseholderSequence<MatrixXd, VectorXd>::evalTo(MatrixXd&, VectorXd&) const;

namespace internal {

using ColumnMajor = const_blas_data_mapper<double, Index, ColMajor>;
using RowsMajor = const_blas_data_mapper<double, Index, RowMajor>;
using Columns = blas_data_mapper<double, Index, ColMajor, 0, 1>;
using Gebp = gebp_traits<double, double>;

DIFFNEA_INSTANCE struct gebp_kernel<double, double, Index, Columns, Gebp::mr, Gebp::nr, false,
                                    false>;
DIFFNEA_INSTANCE struct gemm_pack_lhs<double, Index, ColumnMajor, Gebp::mr, Gebp::LhsProgress,
                                      Gebp::LhsPacket4Packing, ColMajor>;
DIFFNEA_INSTANCE struct gemm_pack_lhs<double, Index, RowsMajor, Gebp::mr, Gebp::LhsProgress,
                                      Gebp::LhsPacket4Packing, RowMajor>;
DIFFNEA_INSTANCE struct gemm_pack_rhs<double, Index, ColumnMajor, Gebp::nr, ColMajor>;
DIFFNEA_INSTANCE struct gemm_pack_rhs<double, Index, RowsMajor, Gebp::nr, RowMajor>;
DIFFNEA_INSTANCE struct gemm_pack_rhs<double, Index, Columns, Gebp::nr, ColMajor, false, true>;

DIFFNEA_INSTANCE struct general_matrix_vector_product<Index, double, RowsMajor, RowMajor, false,
                                                      double, ColumnMajor, false, 0>;
DIFFNEA_INSTANCE struct general_matrix_vector_product<Index, double, RowsMajor, RowMajor, false,
                                                      double, RowsMajor, false, 1>;
DIFFNEA_INSTANCE struct general_matrix_vector_product<Index, double, ColumnMajor, ColMajor, false,
                                                      double, RowsMajor, false, 0>;
DIFFNEA_INSTANCE struct general_matrix_vector_product<Index, double, ColumnMajor, ColMajor, false,
                                                      double, ColumnMajor, false, 0>;

DIFFNEA_INSTANCE struct general_matrix_matrix_product<Index, double, ColMajor, false, double,
                                                      ColMajor, false, ColMajor, 1>;
DIFFNEA_INSTANCE struct general_matrix_matrix_product<Index, double, RowMajor, false, double,
                                                      ColMajor, false, ColMajor, 1>;
DIFFNEA_INSTANCE struct general_matrix_matrix_product<Index, double, ColMajor, false, double,
                                                      RowMajor, false, ColMajor, 1>;
DIFFNEA_INSTANCE struct general_matrix_matrix_product<Index, double, RowMajor, false, double,
                                                      RowMajor, false, ColMajor, 1>;

}  // namespace internal
}  // namespace Eigen

namespace diffnea {

/// The first columns of Q, (rows, columns), of a QR decomposition.
MatX<double> columns_of_q(const Eigen::HouseholderSequence<MatX<double>, VecX<double>>& Q,
                          long rows, long columns);

/// Moore–Penrose inverse of the decomposed matrix.
MatX<double> pseudo_inverse(const Eigen::CompleteOrthogonalDecomposition<MatX<double>>& of);

}  // namespace diffnea
