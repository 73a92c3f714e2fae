#pragma once
/// Which rows a diagnosis looks at. Internal to diagnose/.

#include "diagnose/evidence.hpp"

namespace diffnea {

/// Up to which frequency rows are compared.
enum class Band {
  kInformative,  ///< where positions move, and their noise is not yet four times the torque's
  kWide          ///< beyond: torques may show what a loop keeps out of the positions
};

struct RowsPlan {
  PreprocessPlan plan;
  bool wider = false;  ///< whether kWide would hold clearly more
};

/// Filter and rate: a steep filter, no higher than tells something, and rows that divide a period.
/// @param period   of the motion [s]; 0: none
/// @param options  what the user fixed
RowsPlan plan_rows(const Model& model, const std::vector<Recording>& sample, double period,
                   Band band, const PreprocessOptions& options);
/// The same rows for held-out data.
PreprocessPlan plan_held_out(const std::vector<Recording>& sample, const PreprocessPlan& fitted,
                             const PreprocessOptions& options);

/// @throws DataError if no joint whose torque is known moves by more than its position's noise
void require_motion(const Evidence& evidence, const PreprocessPlan& plan,
                    const std::string& source);

/// Every other tenth of the time is held out, a second apart from what is fitted.
/// @throws DataError if there is too little of it
void split_in_time(const Evidence& evidence, std::vector<bool>& fitted, std::vector<bool>& held);

}  // namespace diffnea
