#pragma once
/// The joints' part of a diagnosis: which effects the torques lack. Internal to diagnose/.

#include "diagnose/unfolded_base.hpp"

namespace diffnea {

/// Diagnoses the torques alone.
/// @param test    null: rows of `train` are held out
/// @param floats  whose model and sources these are; null: the base is fixed
Finding diagnose_joints(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options,
                        const UnfoldedBase* floats = nullptr);

}  // namespace diffnea
