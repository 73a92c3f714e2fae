#pragma once
/// The joints' part of a diagnosis: which effects the torques lack. Internal to diagnose/.

#include <diffnea/diagnose/diagnose.hpp>

namespace diffnea {

/// As diagnose(), of the torques alone; where nothing or nothing known explains them, with a second
/// look at higher frequencies.
Finding diagnose_joints(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options);

}  // namespace diffnea
