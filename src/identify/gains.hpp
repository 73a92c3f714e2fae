#pragma once
/// Torque gains. They make the torque bilinear,
///
///     τ_j = (1 + ε_j) (Y π)_j + friction_j + …          π: links and payloads,
///
/// and what has one product of parameters is linear about any point (π₀, ε₀):
///
///     τ_j + ε₀ (Yπ₀)_j ≈ (1 + ε₀) (Y π)_j + ε (Yπ₀)_j + friction_j + …
///
/// Every column on the right is a combination of columns that are factored already, so a
/// Gauss–Newton step needs no pass over the data; and the gain's column is the model's torque,
/// never the measured one, whose noise would bias it. Internal to identify/.

#include <algorithm>

#include <diffnea/identify/linear_fit.hpp>

namespace diffnea {

class Gains {
 public:
  /// @param layout  must outlive this
  explicit Gains(const FitLayout& layout);

  /// The layout has gains, moving or held; gains that move.
  bool any() const { return !columns_.empty(); }
  bool any_free() const;
  bool owns(int column) const { return std::ranges::find(columns_, column) != columns_.end(); }

  /// Parameters whose product with the rows [Y | …] of joint j, whatever those have in a gain's
  /// column, is its torque: π times 1 + ε_j, gains 0.
  VecX<double> effective(int joint, const VecX<double>& x) const;

  /// T of [Y | τ] T, the rows of joint j linearised about x.
  /// @param columns  of the layout, those that the rows have
  MatX<double> linearisation(int joint, const std::vector<int>& columns,
                             const VecX<double>& x) const;
  std::vector<JointFactor> linearised(const std::vector<JointFactor>& factors,
                                      const VecX<double>& x) const;

  /// Free gains that no known mass pins down: all torque constants times s is the same as all
  /// masses over s.
  std::vector<int> undetermined(const std::vector<JointFactor>& linearised) const;

 private:
  double gain(int joint, const VecX<double>& x) const;
  bool transmitted(int column) const;

  const FitLayout* layout_;
  std::vector<int> columns_;  // of gains
};

}  // namespace diffnea
