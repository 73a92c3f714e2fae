#pragma once
/// The ball of a MuJoCo world, on the tendon or the chain of its document.

#include <vector>

#include <diffnea/model/model.hpp>

#include "sim/mujoco_model.hpp"

namespace diffnea::sim {

/// Names of a chain in a document, root first: bodies `string_0` …, each with the joints
/// `string_0_x`, `string_0_y` about its axes x and y, straight along −z; then the body `ball`.
inline constexpr const char* kChain = "string_";

class MujocoBall {
 public:
  MujocoBall() = default;
  /// Writes the ball's mass and, of a tendon, attachment and length over those of the document. A
  /// document without a body `ball`, or with one that is no ball, has none.
  /// @param truth  whose ball it is; without one the document's numbers stay
  MujocoBall(mjModel& m, const Model& truth);

  bool exists() const { return body_ >= 0; }
  /// At rest, straight below where the string is tied (a ball without string stays where it is).
  /// Positions of the robot's joints are set before.
  void hang(const mjModel& m, mjData& d) const;
  Vec3<double> position(const mjData& d) const;                    ///< of its centre, W [m]
  Vec3<double> velocity(const mjModel& m, const mjData& d) const;  ///< W [m/s]

 private:
  void tie(mjModel& m, const Model& truth, int tendon);

  int body_ = -1;
  int free_ = -1;               ///< joint of a free ball
  int anchor_ = -1, end_ = -1;  ///< sites of a tendon
  int tendon_ = -1;
  std::vector<int> chain_;  ///< joints, first to last
};

}  // namespace diffnea::sim
