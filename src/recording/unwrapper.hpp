#pragma once
/// Continuous joints whose encoders begin again at a whole turn. Internal.

#include <string>
#include <vector>

#include <diffnea/recording/joints.hpp>

namespace diffnea::detail {

/// Adds the whole turns that encoders dropped, block by block: a joint without limits is the same
/// after a turn, so that nothing is guessed. A step of more than half a turn is a wrap, at joints
/// whose positions all lie within a turn of 0: others were never wrapped, or are in degrees.
class Unwrapper {
 public:
  /// @param sample  tells which joints stay within a turn; columns in the order of the joints
  Unwrapper(const std::vector<JointDescription>& joints, const std::vector<Recording>& sample);

  /// Unwraps q and qcmd. @param block  the next rows; columns in the order of the joints
  void apply(Recording& block);
  /// One sentence; empty if nothing wrapped.
  std::string note() const;

 private:
  struct Column {
    double last = 0.0;   ///< value as measured [rad]
    double turns = 0.0;  ///< added [rad]
    bool any = false;    ///< true after the first row
  };
  void unwrap(RowMatX<double>& values, std::vector<Column>& columns, std::vector<long>* wraps);

  std::vector<JointDescription> joints_;
  std::vector<bool> wraps_at_a_turn_;  ///< per joint
  std::vector<Column> q_, qcmd_;
  std::vector<long> wraps_;  ///< per joint, of its position
  std::string source_;       ///< file of the run at hand
  int run_ = -1;
};

}  // namespace diffnea::detail
