#pragma once
/// Fixed transforms of joints from a model's constraints: where the log has the robot, loops close
/// and wheels touch and roll. Internal to identify/.
///
///     min over x   Σ_k Σ_c g_c(X(q_k; x), V(q_k, v_k; x))² / σ_c² + xᵀ Λ x
///
/// g and ġ of the paper's constrained loss (eq. 11), with one weight a row c in place of λ_g and
/// λ_ġ: the residuals' own size. No torque takes part.

#include <diffnea/identify/identify.hpp>
#include <diffnea/identify/layout.hpp>
#include <diffnea/identify/source.hpp>

namespace diffnea {

/// Transforms that fit the constraints best.
struct GeometryFit {
  Model model;                                ///< the transforms moved
  std::vector<ParameterEstimate> parameters;  ///< six steps of every transform in question
  std::vector<std::string> notes;             ///< rows before and after
};

/// Tells whether a choice fits transforms.
bool fits_kinematics(const FitChoice& choice);

/// @param model   has constraints
/// @param choice  its `kinematics@JOINT` and `fix` say what may move
/// @throws DataError, ModelError as identify()
GeometryFit fit_geometry(const Model& model, const RecordingSource& train, const FitChoice& choice,
                         const IdentifyOptions& options);

}  // namespace diffnea
