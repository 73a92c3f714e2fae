#pragma once
/// First states of windows from simulated positions alone. Internal to diagnose/.

#include "motion/joint_windows.hpp"

namespace diffnea {

/// Derivatives by the first state are those of the effects of one instant along the simulated path,
/// row by row; where these lead nowhere, finite differences, which cost as many simulations as a
/// state has numbers.
class DifferencedWindows : public WindowSimulator {
 public:
  explicit DifferencedWindows(const ExtendedTree& model);

  bool linearise(const MotionStretch& stretch, const MotionWindow& window,
                 const VecX<double>& sigma, TriangularFactor& rows) override;
  double cost(const MotionStretch& stretch, const MotionWindow& window,
              const VecX<double>& sigma) override;
  bool sharpen() override;

 private:
  const RowMatX<double>& simulated(const MotionStretch& stretch, const MotionWindow& window);
  void differentiate(const MotionStretch& stretch, const MotionWindow& window,
                     const VecX<double>& sigma);
  void follow(const MotionStretch& stretch, const MotionWindow& window);
  RowMatX<double> rows_of(const MotionStretch& stretch, const MotionWindow& window,
                          const VecX<double>& sigma) const;

  /// The last window.
  struct {
    const MotionStretch* stretch = nullptr;
    long first = -1, rows = 0;
    VecX<double> state;                     ///< first state that was simulated last
    RowMatX<double> simulated;              ///< (rows, n) positions from it
    std::vector<RowMatX<double>> by_state;  ///< (rows, n) ∂q/∂ each number of a state
    bool differences = false;               ///< makes them by differences from now on
  } last_;
  ForwardDynamics dynamics_;  ///< with the effects that it has derivatives of
};

/// Effects of one instant: integrated from row to row.
class PathWindows : public DifferencedWindows {
 public:
  explicit PathWindows(ExtendedTree model)
      : DifferencedWindows(model), windows_(std::move(model), {}, {}, {}) {}

  int states() const override { return windows_.states(); }
  RowMatX<double> positions(const MotionStretch& stretch, const MotionWindow& window) override {
    return windows_.positions(stretch, window);
  }

 private:
  JointWindows windows_;
};

}  // namespace diffnea
