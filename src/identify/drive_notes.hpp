#pragma once
/// Sentences on drives that a recording does not tell: their gain, where links weigh too little,
/// where the drive saturates, and where nothing follows the command. Internal to identify/.

#include "identify/motion_climb.hpp"

namespace diffnea {

/// Standard errors of a fit, as they are reported.
struct ReportedErrors {
  VecX<double>& linear;             ///< (p) NaN: not identifiable
  VecX<double>& shape;              ///< (s) NaN: not identifiable
  std::vector<bool>& identifiable;  ///< (p)
};

/// Hides what the fit does not tell of its drives, and says so.
/// @param climb   fitted, with its covariance
/// @param notes   added to
void note_drives(const MotionData& data, const MotionClimb& climb, const Model& model,
                 const MotionOptions& options, ReportedErrors errors,
                 std::vector<std::string>& notes);

}  // namespace diffnea
