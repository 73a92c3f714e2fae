#pragma once
/// Which rows a diagnosis looks at. Internal to diagnose/.

#include "diagnose/evidence.hpp"

namespace diffnea {

/// Path and rate: as many rows as tell something, and that divide a period.
/// @param links    what the joints carry
/// @param period   of the motion [s]; 0: none
/// @param options  what the user fixed
PreprocessPlan plan_rows(const Model& links, const std::vector<Recording>& sample, double period,
                         const PreprocessOptions& options);
/// The same rows for held-out data.
PreprocessPlan plan_held_out(const std::vector<Recording>& sample, const PreprocessPlan& fitted,
                             const PreprocessOptions& options);

/// @param sample  what the rows are of
/// @throws DataError if no joint whose torque is known moves by more than its position's noise
void require_motion(const Evidence& evidence, const PreprocessPlan& plan,
                    const std::vector<Recording>& sample);

/// Every other stretch is held out; of few stretches, every other tenth of the time, a second apart
/// from what is fitted.
/// @throws DataError if there is too little of it
void split_in_time(const Evidence& evidence, std::vector<bool>& fitted, std::vector<bool>& held);

}  // namespace diffnea
