#pragma once
/// Limbs of a robot as robots of their own: no motion of the others has a part in theirs, so each
/// is fitted alone, by its own recordings. Internal to the library.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <diffnea/identify/identify.hpp>

#include "identify/motion_data.hpp"
#include "motion/limbs.hpp"

namespace diffnea {

/// One limb. The other joints are locked, and what acts there is gone; effects of the whole robot
/// stay.
class LimbRobot {
 public:
  /// @param layout  of a fit of the whole robot
  LimbRobot(const Model& whole, const FitLayout& layout, const Limb& limb);

  const Model& model() const { return model_; }
  /// Its joints, among the robot's.
  const Limb& limb() const { return part_.limb(); }
  /// Tells whether a parameter of the whole robot's layout is one of it.
  bool has(const FitLayout& layout, const FitParameter& p) const;
  /// Tells whether an effect of the whole robot acts there.
  bool has(const BoundEffect& effect) const { return part_.has(effect); }
  /// The same choice of the limb's parameters.
  FitChoice choice(const FitLayout& layout, const FitChoice& whole) const;
  /// Its columns of recordings, which outlive it; of what the robot held, what hangs on the limb.
  std::unique_ptr<RecordingSource> recordings(const RecordingSource& whole) const;
  /// Writes what a fit of the limb has found into the whole robot.
  void put(const Model& fitted, Model& whole) const;

 private:
  LimbPart part_;
  bool has_tip_;            ///< the robot's last moving link is its
  std::vector<int> links_;  ///< of the model's, those that the limb moves
  Model model_;
};

/// The limbs of a robot, in the order of its joints; one, where no motion is simulated without all
/// others.
/// @param layout  of a fit of the whole robot
/// @param data    a limb that none of the fitted, or none of the held-out recordings moves has
///                nothing to be fitted or judged by, and goes with its neighbour
/// @param more    effects that may be asked about
std::vector<LimbRobot> limb_robots(const Model& model, const FitLayout& layout,
                                   const MotionData& data, std::vector<BoundEffect> more = {});

/// A callback for work in several threads: it is called by one at a time, and once it said stop,
/// all are told so. @param progress  outlives it; may be empty
std::function<bool(const FitProgress&)> shared_progress(
    const std::function<bool(const FitProgress&)>& progress);

}  // namespace diffnea
