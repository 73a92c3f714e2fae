#include "identify/passes.hpp"

namespace diffnea {

IdentifyResult identify(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const IdentifyOptions& options) {
  return options.loss == Loss::kTrajectory ? identify_by_trajectory(model, train, test, options)
                                           : identify_by_torque(model, train, test, options);
}

IdentifyResult identify(const Model& model, const std::vector<Recording>& train,
                        const std::vector<Recording>& test, const IdentifyOptions& options) {
  const auto source = recordings_in_memory(model, train);
  std::unique_ptr<RecordingSource> held_out;
  if (!test.empty()) held_out = recordings_in_memory(model, test);
  return identify(model, *source, held_out.get(), options);
}

}  // namespace diffnea
