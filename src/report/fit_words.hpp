#pragma once
/// What both the terminal's text and the page say of a fit's errors.

#include <string>
#include <utility>
#include <vector>

#include <diffnea/runs/result.hpp>

namespace diffnea::report {

/// Whether errors on held-out recordings are known.
bool has_test(const IdentifyResult& fit);
/// Of the ball's position [m], not of a joint.
bool is_ball(const JointError& error);
/// What a number of this error is multiplied by, and its unit then: a ball's errors are in mm.
std::pair<double, std::string> shown_unit(const JointError& error);
/// "torque", or "position" for the motion loss and for a ball alone.
std::string quantity(const IdentifyResult& fit);
/// Error of the model before the fit and after it: held out, or of the training data without a test
/// set.
double before(const IdentifyResult& fit, const JointError& error);
double after(const IdentifyResult& fit, const JointError& error);
/// "5000 recorded rows (2 quarantined), 1200 torque samples fitted"
std::string rows_text(const IdentifyResult& fit);
/// Notes on the fit and on its data; those that differ by the file's name alone are one.
std::vector<std::string> notes(const IdentifyResult& fit);

}  // namespace diffnea::report
