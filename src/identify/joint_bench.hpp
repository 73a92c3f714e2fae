#pragma once
/// One joint of a robot as a robot of its own, on a bench: the others move as they were measured,
/// or simulated, and what that, gravity and their loads ask of the joint is a torque that is known.
/// Its drive's fit then has one degree of freedom, and steps as long as its own motion allows. Good
/// for beginnings: accelerations are those of polynomials through measured positions. Internal to
/// the library.

#include "identify/motion_climb.hpp"

namespace diffnea {

/// Gears of a joint, which races do without.
enum class BenchGears { kLeftOut, kTaken };

/// A joint whose drive follows commands, with the effects of one instant that act there alone. What
/// follows the torque that the links transmit is left out: on a bench that is not theirs.
class JointBench {
 public:
  /// @param whole  a robot that has_benches(), with the layout's values before a fit
  /// @param first  horizon over which positions are a polynomial [s]
  JointBench(const Model& whole, const MotionData& data, const FitLayout& layout, double first,
             int joint);
  /// @param moves  stretches as they were simulated, without noise, where windows are
  JointBench(const Model& whole, const MotionData& data, const std::vector<MotionStretch>& moves,
             const FitLayout& layout, int joint, BenchGears gears);

  const Model& model() const { return model_; }
  const MotionData& data() const { return data_; }
  const FitLayout& layout() const { return layout_; }
  /// Tells whether all effects of the joint are there.
  bool is_whole() const { return whole_; }
  /// Writes where the joint's fit begins into the robot's beginning, bounds that it leaves out
  /// included.
  void put(const MotionBeginning& own, MotionBeginning& whole) const;

 private:
  struct Load;
  void make(const Model& whole, const MotionData& data, const FitLayout& layout,
            const std::vector<Load>& loads, int joint, BenchGears gears);

  Model model_;
  MotionData data_;
  FitLayout layout_;
  std::vector<std::size_t> effects_, linear_, shape_;  ///< numbers of its own among the robot's
  std::size_t first_linear_ = 0;                       ///< its first effect's, behind the link's ten
  bool whole_ = true;
};

/// Tells whether motion of one joint alone tells of a robot, and is not all of it: more joints than
/// one, each with a command; no loops, no followers, no free base.
bool has_benches(const Model& model, const FitLayout& layout);

/// The benches of all joints with something to fit; empty where the robot has none.
std::vector<JointBench> joint_benches(const Model& model, const MotionData& data,
                                      const FitLayout& layout, double first);

}  // namespace diffnea
