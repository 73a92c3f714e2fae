#pragma once
/// The weights of bumps at one joint, from what the base and the named effects leave: a sparse
/// Gaussian process that takes nothing from them (diagnose/grey_box.hpp). Internal to diagnose/.

#include <limits>
#include <vector>

#include "diagnose/search.hpp"

namespace diffnea {

struct BumpWeights {
  double cost = std::numeric_limits<double>::infinity();  ///< −2 ln of the marginal likelihood
  double gain = 0.0;                                      ///< of χ²
  double parameters = 0.0;                                ///< that were spent
  VecX<double> weights;
  MatX<double> root;  ///< of the weights' covariance
};

/// The rows that bumps are fitted to, at one joint.
class BumpRows {
 public:
  /// @param beside  torque beside the terms, (rows)
  BumpRows(const Search& search, const std::vector<Term>& terms, const VecX<double>& beside,
           long joint);

  /// @param columns  of every bump in this joint's torque, (times(), bumps)
  BumpWeights fit(const MatX<double>& columns) const;

  double chi2() const { return left_.squaredNorm(); }

 private:
  const Search& search_;
  long joint_, begin_, m_;
  VecX<double> left_;
  MatX<double> protected_, base_;
};

}  // namespace diffnea
