#pragma once
/// What a reader of a fit by torque should know besides its numbers. Internal to identify/.

#include <diffnea/identify/torque_regression.hpp>

#include "identify/gains.hpp"
#include "identify/passes.hpp"

namespace diffnea {

/// Joints that rest in over 5 % of the rows, whose torque is then left out.
void note_rest(const Model& model, const TorqueRegression& rows, std::vector<std::string>& notes);

/// All torques off by one factor: a unit, a gear ratio or a torque constant. Of a fit in which no
/// gain is free.
void note_torque_scale(const Model& model, const FitLayout& layout, const TorqueRegression& rows,
                       std::vector<std::string>& notes);

/// A base whose wrench is left over by much of the robot's weight: it does not fly.
/// @param x  of the fit
void note_contact(const Model& model, const FitLayout& layout, const TorqueRegression& rows,
                  const VecX<double>& x, std::vector<std::string>& notes);

/// Held-out data that are sampled too slowly for the band of the fit.
void note_band(const PreprocessPlan& fitted, const PreprocessPlan& held_out,
               std::vector<std::string>& notes);

/// A payload's mass says as much of the torque constants as of the payload; one that is held
/// calibrates them.
void note_payloads(const FitLayout& layout, const Gains& gains, const LinearFit& fit,
                   std::vector<std::string>& notes);

/// Bodies on the boundary of what a body can be, and what consistency costs. Sets `boundary` and
/// `consistency_cost`.
void note_consistency(const FitLayout& layout, const LinearFit& fit, IdentifyResult& result);

/// K/(1 + ε) of the joints whose torque constant a sidecar of `train` gives.
std::vector<TorqueConstant> calibrated_constants(const Model& model, const FitLayout& layout,
                                                 const Gains& gains, const LinearFit& fit,
                                                 const RecordingSource& train);

}  // namespace diffnea
