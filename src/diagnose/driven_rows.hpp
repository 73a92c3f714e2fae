#pragma once
/// Which joints have rows of evidence, and which torques reach them: of an open chain each joint
/// whose torque is known, by its own torque. Where constraints close loops, as many joints as these
/// leave motions, driven ones first, by D(q) τ: all that moves with them
/// (effects/loop_torques.hpp). Internal to diagnose/.

#include <functional>
#include <memory>
#include <vector>

#include <diffnea/recording/preprocess.hpp>

#include "diagnose/torque_filter.hpp"
#include "effects/loop_torques.hpp"

namespace diffnea {

/// A leading joint's equation along a stretch, and what encoders show of it.
struct LoopEquation {
  JointEquation equation;
  RowMatX<double> shown;  ///< (N, n) weight of each joint's position in the one that is filtered
};

class DrivenRows {
 public:
  /// Rows of an open chain.
  DrivenRows() = default;
  /// @param first   first row of a stretch, where the joints are chosen
  /// @param among   joints of which they are taken; empty: all
  /// @throws DataError if a torque is neither recorded nor known to be zero
  DrivenRows(const Model& model, const Preprocessed& first, const std::vector<int>& among);

  /// Tells whether constraints tie the joints.
  bool closed() const { return loops_ != nullptr; }
  /// Where they do: joints with rows, ascending.
  const std::vector<int>& joints() const { return loops_->leads(); }
  /// Tells whether more joints are driven than constraints leave motions: none has a torque that
  /// the motion tells.
  bool shared() const { return shared_; }
  /// Torques by which extended trees predict; null of an open chain.
  std::shared_ptr<const LoopTorques> loops() const { return loops_; }

  /// Takes the postures of every stretch, at which torques act.
  void set_paths(const std::vector<JointSeries>& series);

  /// Tells whether torques of some of `joints` reach rows of `row`.
  bool reaches(const std::vector<int>& joints, int row) const;
  /// Torques of some joints as rows of `row` have them, (N, C).
  /// @param stretch  number of the path
  /// @param joints   those that have torques
  /// @param of       theirs, (N, C)
  RowMatX<double> at(std::size_t stretch, int row, const std::vector<int>& joints,
                     const std::function<RowMatX<double>(int joint)>& of) const;

  /// Inertia that each joint moves: of those with rows, all that moves with them, (n).
  VecX<double> inertias(const Tree<double>& tree, const VecX<double>& q) const;
  /// The equations of `leads`, of joints(), along a stretch of a closed chain. The noise of every
  /// encoder counts, for all that is tied moves together.
  /// @param every  samples between two at which the links are looked at
  std::vector<LoopEquation> equations(const Tree<double>& tree, const JointSeries& path,
                                      const std::vector<int>& leads, const SignalNoise& noise,
                                      int every) const;

 private:
  long index_of(int row) const;

  std::shared_ptr<const LoopTorques> loops_;
  Tree<double> tree_;  ///< its geometry alone
  bool shared_ = false;
  std::vector<std::vector<RowMatX<double>>> maps_;  ///< by stretch and lead: a row of D, (N, n)
};

}  // namespace diffnea
