#pragma once
/// Simulated windows of all joints of a robot. Limbs, which do not feel each other, are simulated
/// one by one, each with steps and columns of its own. Internal to the library.

#include "motion/limb_windows.hpp"
#include "motion/window_simulator.hpp"

namespace diffnea {

/// The model at given parameters. Not thread-safe; no allocation after the first window but for
/// what is handed on.
class JointWindows : public WindowSimulator {
 public:
  JointWindows(ExtendedTree model, const std::vector<BoundEffect>& effects,
               const std::vector<MotionParameter>& parameters, const SteppingOptions& options)
      : JointWindows(std::vector<ModelOfRuns>{{{}, std::move(model)}}, effects, parameters,
                     options) {}
  /// @param models   at these parameters, one at least, of as many joints
  /// @param effects  with these values; those that `parameters` name
  /// @throws ModelError if an effect has no forward form, or a parameter no derivative
  JointWindows(const std::vector<ModelOfRuns>& models, const std::vector<BoundEffect>& effects,
               const std::vector<MotionParameter>& parameters, const SteppingOptions& options);

  int states() const override { return 2 * joints_; }
  bool linearise(const MotionStretch& stretch, const MotionWindow& window,
                 const VecX<double>& sigma, TriangularFactor& rows) override {
    return linearise(stretch, window, sigma, std::span(&rows, 1));
  }
  /// The same, with a factor for each part of the window; parts follow one another and are as long.
  bool linearise(const MotionStretch& stretch, const MotionWindow& window,
                 const VecX<double>& sigma, std::span<TriangularFactor> rows);
  double cost(const MotionStretch& stretch, const MotionWindow& window,
              const VecX<double>& sigma) override;
  RowMatX<double> positions(const MotionStretch& stretch, const MotionWindow& window) override;

  /// State at a row of the window, (2n); false if the simulation blew up before.
  bool state_at(const MotionStretch& stretch, const MotionWindow& window, long row,
                VecX<double>& out);

  /// Standard deviation of the positions at the window's end that noise of the torque alone makes,
  /// (n). @param density  (n) of the torque's noise
  VecX<double> torque_noise_reach(const MotionStretch& stretch, const MotionWindow& window,
                                  const VecX<double>& density);

 private:
  struct Part {
    LimbWindows windows;
    std::vector<int> to;  ///< for each of its columns, which one it is of the robot's
  };
  int joints_, f_;  ///< n; free parameters
  std::vector<Part> parts_;
};

}  // namespace diffnea
