#define DIFFNEA_INSTANCE template
#include "core/decompositions.hpp"

namespace diffnea {

MatX<double> columns_of_q(const Eigen::HouseholderSequence<MatX<double>, VecX<double>>& Q,
                          long rows, long columns) {
  return Q * MatX<double>::Identity(rows, columns);
}

MatX<double> pseudo_inverse(const Eigen::CompleteOrthogonalDecomposition<MatX<double>>& of) {
  return of.pseudoInverse();
}

}  // namespace diffnea
