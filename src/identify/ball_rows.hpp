#pragma once
/// What the rows of a camera tell before any dynamics: which cannot be true, and where the ball was
/// hit. Internal to identify/.

#include <vector>

#include <diffnea/lie/vec3.hpp>

namespace diffnea {

/// x + v (t − t₀) + a (t − t₀)²/2 through rows [first, end), least squares. [m, s]
struct Parabola {
  Vec3<double> x{0, 0, 0}, v{0, 0, 0}, a{0, 0, 0};
};
Parabola parabola(const std::vector<double>& time, const std::vector<Vec3<double>>& seen,
                  long first, long end, double t0, long skip = -1);

/// By how much each row is off [m], 0 where it may be true: one that neither the rows before, nor
/// those after, nor both together lead to (parabolas; beyond 8 of what is usual, and 5 mm), so that
/// a ball that is hit stays.
std::vector<double> find_outliers(const std::vector<double>& time,
                                  const std::vector<Vec3<double>>& seen, double longest_gap);

/// Rows next to a bounce: lowest of their neighbourhood, with a velocity that jumps upward.
std::vector<bool> find_kinks(const std::vector<double>& time, const std::vector<Vec3<double>>& seen,
                             double longest_gap);

/// Standard deviation of the noise of one position along one axis [m], from what cubics through
/// 0.16 s leave; blocks in which the ball was hit do not count.
/// @return NaN if there are too few rows
double camera_noise(const std::vector<double>& time, const std::vector<Vec3<double>>& seen,
                    double longest_gap);

}  // namespace diffnea
