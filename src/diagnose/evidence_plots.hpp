#pragma once
/// What each cause looks like in the torque error, as curves to draw. Internal to diagnose/.

#include <diffnea/diagnose/finding.hpp>

namespace diffnea {

/// The plots that fit the causes (or the witness, or nothing in particular), from the series alone:
/// error over velocity for friction, over position with its spectrum for what goes around with the
/// joint, around reversals for play, over time for drift, against the torque's rate for lags.
/// @param finding  its series, causes, witness and joints are read
std::vector<EvidencePlot> evidence_plots(const Finding& finding);

}  // namespace diffnea
