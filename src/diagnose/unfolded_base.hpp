#pragma once
/// A base that floats as six joints that nothing drives: three slides along the world's axes, then
/// three hinges through the base's origin,
///
///   X_WB = slide(x y z) · R_0 R_z(yaw) R_y(pitch) R_x(roll) R_1.
///
/// The robot is then a tree of joints as any other, with the same motions and the same inertias,
/// and what is known of passive joints holds for its base: rows, effects, simulated windows. The
/// outer hinge turns about a line w of the world, the inner one about a line u of the base; where
/// both are parallel the three hold one turn less. So w and u are chosen to stay apart in all that
/// was recorded. Internal to diagnose/.

#include <memory>

#include <diffnea/diagnose/diagnose.hpp>

namespace diffnea {

/// Degrees of freedom of a base.
inline constexpr int kBaseJoints = 6;

class UnfoldedBase {
 public:
  /// @param model  of a base that floats  @param test  null: none
  /// @throws DataError naming the recording if it turns through all directions, or does not fall
  ///   though no wrench was recorded: something touches the robot
  /// @throws ModelError if constraints tie the robot
  UnfoldedBase(const Model& model, const RecordingSource& train, const RecordingSource* test);
  ~UnfoldedBase();
  UnfoldedBase(const UnfoldedBase&) = delete;
  UnfoldedBase& operator=(const UnfoldedBase&) = delete;

  /// The robot with its base on six joints, which lead its degrees of freedom: base_x, base_y,
  /// base_z [N], base_yaw, base_pitch, base_roll [N·m], with underscores behind where the robot has
  /// such names.
  const Model& model() const { return unfolded_; }
  /// Recordings whose poses are positions of these joints, and wrenches their torques.
  const RecordingSource& train() const;
  const RecordingSource* test() const;
  /// Recordings as they are.
  const RecordingSource& logged_train() const { return logged_train_; }
  const RecordingSource* logged_test() const { return logged_test_; }

  /// Options of the robot that floats as those of model(): effects at `base` act at the joint that
  /// carries it, and the caller's own candidates see the joints alone.
  DiagnoseOptions unfold(const DiagnoseOptions& options) const;
  /// A finding on model() in terms of the robot that floats.
  void fold(Finding& finding) const;

 private:
  class Source;
  struct Hinges;

  const Model& folded_;
  const RecordingSource& logged_train_;
  const RecordingSource* logged_test_;
  Model unfolded_;
  std::vector<std::string> names_;  ///< six joints
  std::string note_;                ///< on lines that are not the usual ones; may be empty
  std::unique_ptr<Hinges> hinges_;
  std::unique_ptr<Source> train_, test_;
};

}  // namespace diffnea
