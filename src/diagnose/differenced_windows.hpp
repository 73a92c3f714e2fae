#pragma once
/// First states of windows from simulated positions alone. Internal to diagnose/.

#include "motion/sensitivities.hpp"

namespace diffnea {

/// Derivatives by the first state are finite differences. They cost as much as all that follows,
/// and are made again only where those of an earlier state still promise much.
class DifferencedWindows : public WindowSimulator {
 public:
  bool linearise(const MotionStretch& stretch, const MotionWindow& window,
                 const VecX<double>& sigma, TriangularFactor& rows) override;
  double cost(const MotionStretch& stretch, const MotionWindow& window,
              const VecX<double>& sigma) override;

 private:
  const RowMatX<double>& simulated(const MotionStretch& stretch, const MotionWindow& window);
  void differentiate(const MotionStretch& stretch, const MotionWindow& window,
                     const VecX<double>& sigma);
  RowMatX<double> rows_of(const MotionStretch& stretch, const MotionWindow& window,
                          const VecX<double>& sigma) const;

  /// The last window.
  struct {
    const MotionStretch* stretch = nullptr;
    long first = -1, rows = 0;
    VecX<double> state;                     ///< first state that was simulated last
    RowMatX<double> simulated;              ///< (rows, n) positions from it
    std::vector<RowMatX<double>> by_state;  ///< (rows, n) ∂q/∂ each number of a state
    int differences = 0;                    ///< times that they were made
  } last_;
};

/// Effects of one instant: integrated from row to row.
class PathWindows : public DifferencedWindows {
 public:
  explicit PathWindows(ExtendedTree model) : windows_(std::move(model), {}, {}, {}) {}

  int states() const override { return windows_.states(); }
  RowMatX<double> positions(const MotionStretch& stretch, const MotionWindow& window) override {
    return windows_.positions(stretch, window);
  }

 private:
  JointWindows windows_;
};

}  // namespace diffnea
