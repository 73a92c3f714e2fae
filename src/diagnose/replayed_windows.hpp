#pragma once
/// Windows of a model whose effects have no derivatives in motion/: memory, delays, encoders, what
/// reads accelerations or the time. Internal to diagnose/.

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/joint_series.hpp>

#include "motion/window_simulator.hpp"

namespace diffnea {

/// Tells whether JointWindows cannot simulate and differentiate the model.
bool needs_replay(const ExtendedTree& model);

/// Simulates by replay() on an even grid. Derivatives by the first state are finite differences,
/// made once for each window: what they are later costs more than it gains.
class ReplayedWindows : public WindowSimulator {
 public:
  /// @param begin  time of the run's first row [s]
  ReplayedWindows(ExtendedTree model, double begin) : model_(std::move(model)), begin_(begin) {}

  int states() const override { return 2 * model_.tree.num_dofs(); }
  bool linearise(const MotionStretch& stretch, const MotionWindow& window,
                 const VecX<double>& sigma, TriangularFactor& rows) override;
  double cost(const MotionStretch& stretch, const MotionWindow& window,
              const VecX<double>& sigma) override;
  /// @throws ModelError if effects cannot act together
  RowMatX<double> positions(const MotionStretch& stretch, const MotionWindow& window) override;

 private:
  /// A window with what is around it, on an even grid.
  struct Grid {
    const MotionStretch* stretch = nullptr;
    long first = -1, rows = 0;  ///< first row and rows of the window
    JointSeries motion;
    RowMatX<double> torque;
    long begin = 0, end = 0;                ///< rows of the grid that are simulated
    double start = 0.0;                     ///< time of row `begin` [s]
    VecX<double> state;                     ///< first state that was simulated last
    RowMatX<double> simulated;              ///< (window's rows, n) positions from it
    std::vector<RowMatX<double>> by_state;  ///< (window's rows, n) ∂q/∂ each number of a state
  };
  const RowMatX<double>& simulated(const MotionStretch& stretch, const MotionWindow& window);
  void differentiate(const MotionStretch& stretch, const MotionWindow& window,
                     const VecX<double>& sigma);
  void set_grid(const MotionStretch& stretch, const MotionWindow& window);

  ExtendedTree model_;
  double begin_;
  Grid grid_;  ///< last window
};

}  // namespace diffnea
