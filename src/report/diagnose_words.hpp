#pragma once
/// What the terminal's text and the page of a diagnosis say alike.

#include <string>
#include <vector>

#include <diffnea/diagnose/finding.hpp>

namespace diffnea::report {

/// Faults of channels, which bias all that follows; with kWarning.
std::vector<std::string> fault_warnings(const Finding& f);

/// "coulomb friction" for "coulomb_friction".
std::string plain(std::string name);
/// "coulomb friction at elbow", "linear drag on the ball", "string mass"
std::string at(const std::string& effect, const std::string& where);
/// Candidates refused for one reason.
struct RefusedTogether {
  std::string what, reason;
  double delta_bic = 0.0;
};
/// Refusals in their order, those without evidence, as what was not tried, one for each reason: a
/// robot has many joints. "actuator lag at hip and 11 more, saturation at hip and 11 more"
std::vector<RefusedTogether> refused_together(const std::vector<Refusal>& refused);
/// Whether a place is the ball, its string or the camera, not of the robot.
bool at_ball(const std::string& where);
/// With a capital letter (ASCII).
std::string capital(std::string text);
/// A parameter as people say it: a camera's delay in ms, a string's mass in % of the ball's.
CauseParameter as_read(const std::string& effect, CauseParameter parameter);
/// Share of the held-out error² that all causes remove, or, where that was not asked, of all: "12 %"
std::string removes(const Cause& cause);
/// Tells whether an effect is a kind of dry friction.
bool is_dry_friction(const std::string& effect);
/// "stribeck friction (worse by 3.2)": in the place of a cause at `where`, by ΔBIC.
std::string rival_words(const Rival& rival, const std::string& where);
/// Whether an error is the ball's [m], not a joint's.
bool is_ball(const JointGain& joint);
/// Tells whether errors are of positions, in rad or m: those of a ball, or of joints that commands lead.
bool is_of_positions(const JointGain& joint);
/// Tells whether all errors of joints are of positions, and there are some.
bool follows_commands(const Finding& finding);
/// "torque error", "position error", "error of the ball's position", or "error" where both were measured.
std::string error_of(const Finding& finding);
/// What was gained on held-out data, in one line.
std::string gained(const Finding& finding);
/// What the verdict means, in a few words.
std::string meaning(Verdict verdict);
/// Value and half of its 95 % interval to two digits, or the interval where it is not symmetric.
std::string value_and_interval(const CauseParameter& parameter);
/// "12 mm", "3.4 mrad". @param value  [m] or [rad], as `unit` says
std::string in_thousandths(double value, const std::string& unit);
/// What ended early, or is weaker than it should be.
std::vector<std::string> reservations(const Finding& finding);

}  // namespace diffnea::report
