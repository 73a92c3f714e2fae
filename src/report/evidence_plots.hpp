#pragma once
/// Evidence: the torque error as curves that show what a cause looks like.

#include <diffnea/diagnose/finding.hpp>

namespace diffnea::report {

/// The plots that fit the causes (or the witness, or nothing in particular), from the series alone:
/// error over velocity for friction, over position with its spectrum for what goes around with the
/// joint, around reversals for play, over time for drift, against the torque's rate for lags.
/// @param finding  its series, causes, witness and joints are read
std::vector<EvidencePlot> evidence_plots(const Finding& finding);

}  // namespace diffnea::report
