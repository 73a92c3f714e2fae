#pragma once
/// M = LᵀL of a mass matrix, L lower triangular with the tree's pattern: entry (i, j) can only be
/// nonzero if j carries i (Featherstone 2008, §6.5). Rows of branches that do not meet never mix.
/// Where joints follow others, every coordinate may mix with every one before it; so may the six of
/// a free base, which come first and carry all others.

#include <cmath>

#include <diffnea/model/tree.hpp>

namespace diffnea::detail {

/// The next coordinate, of tree.num_velocities(), that coordinate i may mix with, −1 after the
/// last.
inline int next_mixed(const Tree<double>& tree, int i) {
  if (!tree.coordinates.plain()) return i - 1;
  if (!tree.free_base) return tree.links[i].parent;
  constexpr int kShift = kBaseVelocities - 1;  // coordinate of a link's joint against its index
  return i < kBaseVelocities ? i - 1 : tree.links[i - kShift].parent + kShift;
}

/// Overwrites the lower triangle of M, (n × n) row-major, by L. The diagonal holds 1/L_ii.
inline void factor_ltl(const Tree<double>& tree, RowMatX<double>& M) {
  for (int k = tree.num_velocities() - 1; k >= 0; --k) {
    const double inverse = 1.0 / std::sqrt(M(k, k));
    M(k, k) = inverse;
    for (int i = next_mixed(tree, k); i >= 0; i = next_mixed(tree, i)) M(k, i) *= inverse;
    for (int i = next_mixed(tree, k); i >= 0; i = next_mixed(tree, i))
      for (int j = i; j >= 0; j = next_mixed(tree, j)) M(i, j) -= M(k, i) * M(k, j);
  }
}

/// B ← M⁻¹ B, B (n × columns) row-major.
inline void solve_ltl(const Tree<double>& tree, const RowMatX<double>& L, double* B, int columns) {
  const int n = tree.num_velocities();
  const auto scale = [&](int i, double factor) {
    double* row = B + static_cast<long>(i) * columns;
    for (int c = 0; c < columns; ++c) row[c] *= factor;
  };
  const auto subtract = [&](int to, int from, double factor) {  // two rows never overlap
    double* __restrict target = B + static_cast<long>(to) * columns;
    const double* __restrict source = B + static_cast<long>(from) * columns;
    for (int c = 0; c < columns; ++c) target[c] -= factor * source[c];
  };
  for (int i = n - 1; i >= 0; --i) {  // Lᵀ Y = B
    scale(i, L(i, i));
    for (int j = next_mixed(tree, i); j >= 0; j = next_mixed(tree, j)) subtract(j, i, L(i, j));
  }
  for (int i = 0; i < n; ++i) {  // L X = Y
    for (int j = next_mixed(tree, i); j >= 0; j = next_mixed(tree, j)) subtract(i, j, L(i, j));
    scale(i, L(i, i));
  }
}

}  // namespace diffnea::detail
