#pragma once
/// The joints' part of a diagnosis: which effects the torques lack. Internal to diagnose/.

#include <diffnea/diagnose/diagnose.hpp>

namespace diffnea {

/// As diagnose(), of the torques alone; with a second look at the turns of joints that stick.
Finding diagnose_joints(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options);

}  // namespace diffnea
