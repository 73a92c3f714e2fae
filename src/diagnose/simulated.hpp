#pragma once
/// Held-out motion simulated again by the base and by the extended model. Internal to diagnose/.

#include <diffnea/diagnose/finding.hpp>

#include "diagnose/evidence.hpp"

namespace diffnea {

/// A few windows spread over the held-out rows: a second of computing is too much.
/// @param evidence  of the held-out recordings, which `source` holds
/// @param held      (evidence.rows()) rows that are held out; empty: all
/// @param plan      that the evidence was filtered by
SimulatedMotion simulate_held_out(const Model& base, const Model& extended,
                                  const RecordingSource& source, const Evidence& evidence,
                                  const std::vector<bool>& held, const PreprocessPlan& plan,
                                  const IdentifyOptions& reading);

}  // namespace diffnea
