#pragma once
/// Positions of joints without an encoder, from those of the joints that hold their closed loop.
/// Internal to identify/.

#include <optional>
#include <string>
#include <vector>

#include <diffnea/recording/recording.hpp>

#include "dynamics/loop_motion.hpp"

namespace diffnea {

/// Passive joints that a log may lack: constraints of positions may hold them. Empty where the
/// model has none of these.
std::vector<std::string> joints_of_loops(const Model& model);

/// Completes recordings of one model, block by block.
class LoopPositions {
 public:
  explicit LoopPositions(const Model& model);

  /// Adds columns of the passive joints that are not logged, before match_joints(). Where a logged
  /// position is missing, so are they.
  /// @throws DataError naming the time, where the logged joints do not close the loops
  /// @throws ModelError if the logged joints do not hold all motions that the constraints leave
  void complete(Recording& recording);

  /// Sentence on the joints that were added; empty: none.
  std::string note() const;

 private:
  Model model_;  ///< its loops alone, on a fixed base
  std::vector<std::string> joints_, added_;
  std::optional<LoopMotion> loops_;  ///< logged joints are its drives
  std::string source_;               ///< the last recording
  VecX<double> posture_;             ///< where its last row is closed
};

}  // namespace diffnea
