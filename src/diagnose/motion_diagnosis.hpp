#pragma once
/// Diagnosis of robots whose logs have commands and no torque: drives make the torque, and what a
/// simulation of whole runs gets wrong is the evidence. Internal to diagnose/.

#include <diffnea/diagnose/diagnose.hpp>

namespace diffnea {

/// Tells whether the recordings have commands that drives of the model could follow, and no torque.
bool has_commands_alone(const Model& model, const RecordingSource& train);

/// Identifies the drives first, then looks for what they and the joints lack.
/// @param test  held-out recordings; null: every fourth window is held out
/// @throws DataError, ModelError
Finding diagnose_drives(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options);

}  // namespace diffnea
