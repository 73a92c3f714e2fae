#pragma once
/// Torque rows of a robot with constraints, whose forces are eliminated: rows of as many
/// coordinates as constraints leave motions,
///
///   D (Y π + effects) = D τ,   D = (N_cᵀ)⁻¹ Nᵀ   (dynamics/driven_torques.hpp)
///
/// N spans the motions, N_c are its rows at the coordinates c. These are the driven joints, as far
/// as their motions are independent; then others, whose row of D τ is zero: a joint without a
/// drive, a coordinate of a base that floats. Internal to identify/.

#include <string>
#include <vector>

#include <diffnea/dynamics/tree_constraints.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// Maps of one model's states. Rows are those of FitLayout::num_rows().
class ConstrainedRows {
 public:
  /// @param plan   with the positions' noise; null: all coordinates alike
  /// @param among  rows of which the coordinates are taken; empty: all
  explicit ConstrainedRows(const Model& model, const PreprocessPlan* plan = nullptr,
                           std::vector<int> among = {});

  /// Takes the coordinates of one run from its first row; they are kept from then on.
  /// @param q  (7 + n), of a fixed base (n): the first state of the block
  /// @throws DataError if the torque of a joint is neither recorded nor known to be zero
  void choose(const Preprocessed& block, const VecX<double>& q);

  /// Rows of the coordinates, driven ones first.
  const std::vector<int>& chosen() const { return chosen_; }
  /// Tells whether a row is one of the coordinates.
  bool has(int row) const;
  /// Tells whether the torque of such a row is zero whatever the drives do.
  bool is_zero(int row) const;

  /// Tells whether rows mix torques of several drives: there are more of them than motions.
  bool mixes() const { return mixes_; }

  /// Velocities and accelerations become the nearest that constraints allow, in units of the
  /// sensors' noise: encoders of wheels know a base's speed better than its pose does.
  /// @param q  of the state  @param v, vd  (n_v), overwritten
  void project(const VecX<double>& q, VecX<double>& v, VecX<double>& vd) const;

  /// Rows become D rows at the coordinates, and 0 elsewhere.
  /// @param tree  of the same links as the model
  /// @param q     the state  @param time  of it [s], for messages
  /// @param rows  (rows × columns)
  /// @throws DataError naming the time, where the coordinates do not hold all motions (a dead
  /// point)
  void eliminate(const Tree<double>& tree, const VecX<double>& q, double time,
                 Eigen::Ref<RowMatX<double>> rows) const;

  /// Acceleration of all coordinates, in the order of velocities, when that of one row is 1 and of
  /// the other chosen ones 0: a column of Dᵀ.
  VecX<double> unit_acceleration(int row, const VecX<double>& q) const;

 private:
  MatX<double> map(const Tree<double>& tree, const VecX<double>& q) const;
  int coordinate(int row) const;

  TreeConstraints<double> constraints_;
  std::vector<std::string> joints_;
  Tree<double> tree_;               ///< the model's
  VecX<double> weights_;            ///< (n_v) of the velocities
  std::vector<int> among_;          ///< rows that may be chosen; empty: all
  std::vector<int> chosen_, zero_;  ///< rows, and those of them without a torque
  bool mixes_ = false;
  std::string source_;
};

}  // namespace diffnea
