#pragma once
/// Windows of a model whose effects have no derivatives in motion/: memory, delays, encoders, what
/// reads accelerations or the time. Internal to diagnose/.

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/joint_series.hpp>

#include "diagnose/differenced_windows.hpp"

namespace diffnea {

/// Tells whether JointWindows cannot simulate and differentiate the model.
bool needs_replay(const ExtendedTree& model);

/// Simulates by replay() on an even grid.
class ReplayedWindows : public DifferencedWindows {
 public:
  /// @param begin  time of the run's first row [s]
  ReplayedWindows(ExtendedTree model, double begin)
      : DifferencedWindows(model), model_(std::move(model)), begin_(begin) {}

  int states() const override { return 2 * model_.tree.num_dofs(); }
  /// @throws ModelError if effects cannot act together
  RowMatX<double> positions(const MotionStretch& stretch, const MotionWindow& window) override;

 private:
  /// A window with what is around it, on an even grid.
  struct Grid {
    const MotionStretch* stretch = nullptr;
    long first = -1, rows = 0;  ///< first row and rows of the window
    JointSeries motion;
    RowMatX<double> torque;
    long begin = 0, end = 0;  ///< rows of the grid that are simulated
    double start = 0.0;       ///< time of row `begin` [s]
  };
  void set_grid(const MotionStretch& stretch, const MotionWindow& window);

  ExtendedTree model_;
  double begin_;
  Grid grid_;  ///< last window
};

}  // namespace diffnea
