#pragma once
/// What a motion may use of every joint's limits, and what stands in for limits that are not known.
/// Internal to excite/ and diagnose/.

#include <diffnea/excite/design.hpp>

namespace diffnea {

/// Of one degree of freedom. [rad …] or [m …]
struct JointRange {
  double middle = 0.0, half = 0.0;  ///< of the positions
  double velocity = 0.0, acceleration = 0.0;
  double effort = 0.0;  ///< infinite: not known
  bool driven = false;  ///< it has a motor
  bool follows = false;  ///< a loop moves it, by other joints; its `half` may be infinite
  bool moves() const { return driven && !follows && half > 0.0; }
};

/// A velocity or effort limit; descriptions write 0 where they know none.
bool is_given(double limit);
/// Four significant digits.
std::string short_number(double x);

/// @throws ModelError if its limits are inverted
JointRange range_of(const ModelLink& link, const FourierOptions& options);

/// All degrees of freedom, with the limits that were asked for in place of the model's.
/// @throws ModelError if limits are inverted or leave nothing to move, or a joint does not exist
std::vector<JointRange> joint_ranges(const Model& model, const FourierOptions& options,
                                     const LimitOverrides& limits);

}  // namespace diffnea
