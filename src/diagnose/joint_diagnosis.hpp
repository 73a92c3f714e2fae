#pragma once
/// The joints' part of a diagnosis: which effects the torques lack. Internal to diagnose/.

#include <diffnea/diagnose/diagnose.hpp>

namespace diffnea {

/// Diagnoses the torques alone.
/// @param test  null: rows of `train` are held out
Finding diagnose_joints(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options);

}  // namespace diffnea
