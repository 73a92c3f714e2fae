#pragma once
/// Minimises a function of some dozens of numbers by samples alone. Internal to excite/.

#include <functional>

#include <diffnea/core/random.hpp>
#include <diffnea/core/scalar.hpp>

namespace diffnea {

struct CmaOptions {
  double step = 0.3;  ///< first standard deviation of every number
  int generations = 300;
  /// Stops when the standard deviation along every axis is below it.
  double least_step = 1e-4;
};

struct CmaResult {
  VecX<double> x;  ///< the best sample of all
  double value = 0.0;
  int generations = 0;
  bool interrupted = false;
};

/// Covariance matrix adaptation with 4 + 3 ln d samples a generation, the better half of them
/// weighted, cumulated paths, rank-one and rank-µ updates (Hansen 2016, "The CMA evolution
/// strategy: a tutorial", fig. 6).
/// @param start  where the samples are centred first; it counts as a sample
/// @param go_on  after every generation: number and best value so far; false stops
CmaResult minimise_by_samples(const std::function<double(const VecX<double>&)>& function,
                              const VecX<double>& start, const CmaOptions& options, Rng& rng,
                              const std::function<bool(int, double)>& go_on);

}  // namespace diffnea
