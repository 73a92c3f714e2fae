#pragma once
/// Bounds of drives: speed of the setpoint, reach and dead band. A bound that the recording reaches
/// is found only from where it acts; one that it does not reach is a corner at which every step of
/// a fit stumbles, and would hold back motion that was not seen. Internal to identify/.

#include <diffnea/identify/identify.hpp>

#include "identify/motion_climb.hpp"

namespace diffnea {

/// No bound, as the effect has it.
inline constexpr double kNoBound = 1e3;

/// Largest delay of a position loop that is looked at [s]: radio and bus included, no operator.
inline constexpr double kMostDelay = 0.2;

/// ΔBIC that is very strong evidence (Kass, Raftery 1995).
inline constexpr double kVeryStrong = 10.0;

/// BIC of fits to the same positions.
/// @param objective    χ²/2
/// @param free         parameters
/// @param independent  errors among the positions
double bic(double objective, double free, double independent);
/// Tells whether another fit's parameters do as well in the windows of this one, each from its best
/// state: not worse beyond doubt. @param fewer  parameters than this one has
bool does_as_well(const MotionFitter& other, const MotionClimb& climb, double fewer);

/// Tells whether a shape bounds what a drive of the layout does: it is no delay.
bool is_bound_of_drive(const FitLayout& layout, const FitParameter& shape);
/// Value of the shape where it bounds nothing.
double no_bound(const FitLayout& layout, const FitParameter& shape);

/// Errors of a joint's command that its drive sees, its gain included [rad] or [m], in the rows in
/// which it is on and a position was measured.
std::vector<double> command_errors(const MotionStretch& stretch, int joint, double delay,
                                   double speed);
/// Largest error of a joint's command that its drive sees, its gain included [rad] or [m].
/// @param speed  of its setpoint at most
double largest_error(const MotionStretch& stretch, int joint, double delay, double speed);
/// Share of the rows with the drive on in which its error is at its reach or beyond.
/// @param delay, speed, reach  of the drive [s], [rad/s], [rad]; of a sliding joint in m
double saturated_share(const std::vector<MotionStretch>& stretches, int joint, double delay,
                       double speed, double reach);
/// Largest rate of a joint's command, over the delays that a drive may have: a step is no rate.
double largest_rate(const MotionStretch& stretch, int joint);

/// Holds all bounds that are free where they bound nothing.
/// @param shape  (s) written
void hold_bounds_off(FitLayout& layout, VecX<double>& shape);

/// Leaves out bounds of drives that the recordings do not need: all of them, or those that are idle
/// or may be none.
/// @param all  whether all of them are tried
/// @return their names
std::vector<std::string> release_bounds(const Model& model, const MotionData& data,
                                        const MotionOptions& options, bool all, MotionClimb& climb);

/// Holds the derivative times that are free at the model's values: only a drive at its reach tells
/// them, and a fit does not get from one to another through runs that saturate elsewhere.
FitLayout with_held_derivatives(FitLayout layout);

/// Frees those of drives that have a reach, if windows tell beyond doubt how much of the braking
/// ends there: from all of it. The climb's windows are then to be finished.
/// @param asked  the layout before with_held_derivatives()
void free_derivatives(const FitLayout& asked, const Model& model, const MotionData& data,
                      const MotionOptions& options, MotionClimb& climb);

/// Gives drives whose reach no run tells the largest torque of the description, unless windows
/// speak against it beyond doubt: it is held. A note names both kinds.
/// @param described  the model before the fit
/// @param fitted     written: model, parameters and notes
void keep_described_torques(const Model& described, const MotionData& data,
                            const MotionOptions& options, const MotionClimb& climb,
                            IdentifyResult& fitted);

}  // namespace diffnea
