#pragma once
/// Series of the leading joints of a robot with loops, as motions of all its joints: where the
/// loops close and are held, and how large they may be for the joints that follow. Internal to
/// excite/.

#include <optional>

#include "dynamics/loop_motion.hpp"
#include "excite/motion.hpp"

namespace diffnea {

class LoopRows {
 public:
  /// Leading joints: without limits of their own they move about the closed posture that is nearest
  /// to where the joints rest; ranges are narrowed to where the loops close, the leading joints
  /// hold the robot firmly, and the others are within their limits. Joints that follow get the
  /// ranges that their limits leave, infinite where there are none.
  /// @param ranges  of all joints, by joint_ranges(); overwritten
  /// @throws ModelError as LoopMotion; if no posture within the ranges closes, or nothing can move
  LoopRows(const Model& model, const FourierOptions& options, const LimitOverrides& limits,
           std::vector<JointRange>& ranges);

  const LoopMotion& loop() const { return loop_; }
  /// Narrowed ranges, one sentence each.
  const std::vector<std::string>& notes() const { return notes_; }

  /// Rows of all joints from those of the leading ones in them.
  /// @param centre  (n) posture that the motion shrinks to; leading joints alone are read
  /// @return 1, or the factor below 1 by which the motion about its centre has to shrink at least;
  ///         0 where the centre itself is out of reach. Rows are whole at 1 alone
  double complete(MotionRows& rows, const VecX<double>& centre) const;
  /// A state of all joints from that of the leading ones in it. @return whether it is in reach
  bool complete(VecX<double>& q, VecX<double>& qd, VecX<double>& qdd) const;
  /// The posture (n) with the leading joints where `q` has them; empty where it is out of reach.
  VecX<double> posture_at(const VecX<double>& q) const;

 private:
  void range_followers(const Model& model, const FourierOptions& options,
                       const LimitOverrides& limits);
  void narrow(const Model& model, const LimitOverrides& limits);
  /// Empty, or why a closed posture is not one to go to.
  std::string objection(const VecX<double>& q) const;
  /// Walks straight to `y`. @param q  from, closed; overwritten by the last without an objection
  bool reach(const VecX<double>& y, VecX<double>& q, std::string* why = nullptr) const;

  LoopMotion loop_;
  std::vector<std::string> joints_;
  std::vector<JointRange>& ranges_;
  VecX<double> base_;  ///< closed, leading joints in the middle of their ranges
  std::vector<std::string> notes_;
};

}  // namespace diffnea
