#pragma once
/// One joint of a robot as a robot of its own, on a bench: the others move as they were measured,
/// and what that, gravity and their loads ask of the joint is a torque that is known. Its drive's
/// fit then has one degree of freedom, and steps as long as its own motion allows. Good for
/// beginnings: the accelerations are those of polynomials through the positions. Internal to
/// identify/.

#include "identify/motion_climb.hpp"

namespace diffnea {

/// A joint whose drive follows commands, with the effects of one instant that act there alone. What
/// follows the torque that the links transmit is left out: on a bench that is not theirs.
class JointBench {
 public:
  /// @param whole  the robot, plain (no loops, no followers), with the layout's values before a fit
  /// @param data   all joints have commands
  /// @param first  horizon over which positions are a polynomial [s]
  JointBench(const Model& whole, const MotionData& data, const FitLayout& layout, double first,
             int joint);

  const Model& model() const { return model_; }
  const MotionData& data() const { return data_; }
  const FitLayout& layout() const { return layout_; }
  /// Writes where the joint's fit begins into the robot's beginning, bounds that it leaves out
  /// included.
  void put(const MotionBeginning& own, MotionBeginning& whole) const;

 private:
  Model model_;
  MotionData data_;
  FitLayout layout_;
  std::vector<std::size_t> effects_, linear_, shape_;  ///< numbers of its own among the robot's
  std::size_t first_linear_ = 0;                       ///< its first effect's, behind the link's ten
};

/// The benches of all joints with something to fit; empty where motion of one joint alone tells
/// nothing of a robot: one joint, one without a command, loops, followers, a free base.
std::vector<JointBench> joint_benches(const Model& model, const MotionData& data,
                                      const FitLayout& layout, double first);

}  // namespace diffnea
