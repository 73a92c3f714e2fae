#pragma once
/// Robots whose log has commanded positions and no torque: drives with a loop of their own make the
/// torque, and their laws are fitted with the rest. Internal to identify/.

#include <diffnea/identify/identify.hpp>

#include "identify/drive_bounds.hpp"
#include "identify/local_factors.hpp"

namespace diffnea {

/// Joints that a drive of the layout leads by commanded positions, (n).
std::vector<bool> commanded_joints(const FitLayout& layout);

/// Tells whether a parameter is a rotor's inertia.
bool is_rotor(const FitLayout& layout, const FitParameter& p);

/// Inertias that the links alone have about their joints in the middle of the motion, (n).
VecX<double> link_inertias(Model model, const PositionRange& range);

/// All that a joint's drive does times a factor, and the inertia that it moves with it: what links
/// that weigh little hardly tell, and a step from where the fit is does not show.
/// @param inertia  (n) of the links, which stay
/// @param x        (p) linear parameters; those that are held stay
void scale_drive(const FitLayout& layout, const BoundEffect& drive, const VecX<double>& inertia,
                 double by, VecX<double>& x);

/// Fits the laws of drives where a recording has commands and no torque: by the motion that they
/// make, links' inertias as the model has them, for without a torque only ratios to these are told.
/// @param model  gains the drives that its file has, which are where a fit begins
/// @param notes  what was chosen, and why
/// @return whether anything was changed
/// @throws DataError for commands that can be of no drive (require_commands)
bool fit_drives(Model& model, const RecordingSource& train, IdentifyOptions& options,
                std::vector<std::string>& notes);

/// @throws ModelError if neither drives' gains nor what is carried are known in any recording:
///         positions tell their ratio alone
void require_a_scale(const std::vector<MotionStretch>& stretches, const FitLayout& layout);

/// Lets no drive act before it is told, but for what the rows of a log leave open: one of them.
/// @param period  (n) between rows [s]
void bound_delays(const VecX<double>& period, FitLayout& layout);

/// Holds delay and speed of drives whose command never changes within a run, which no motion tells,
/// and what follows a supply that was not logged.
/// @param notes  gets a line for each
void hold_without_commands(const std::vector<MotionStretch>& stretches,
                           const std::vector<std::string>& joints, FitLayout& layout,
                           std::vector<std::string>& notes);

/// Windows of robots whose drives close a loop [s]: many times what it remembers, and many of them
/// in a long run, so that they are fitted side by side.
inline constexpr double kForgets = 10.0;

/// Lets dry friction hold joints: where smoothed, they creep at up to its speed. It becomes that at
/// which a window shows the creep no more than noise. Values of the model's own stay.
/// @param noise  (n) of the positions [rad] or [m]
void sharpen(const VecX<double>& noise, BoundEffect& effect);
/// The same of all effects, where drives lead joints.
/// @param shape  (s) written
void sharpen(const VecX<double>& noise, FitLayout& layout, VecX<double>& shape);

/// Speeds of a setpoint from which fits are begun, over the largest one of the commands; 1: none.
/// Torques of one instant do not tell which is right, and a fit that begins without a bound never
/// finds one: the best of them after a short horizon goes on.
inline constexpr double kSpeedShares[] = {1.0, 0.6, 0.3};

/// Errors at which drives saturate where fits begin, over the largest one of the recording: seldom;
/// in many rows, and in all but moments.
inline constexpr double kSeldom = 0.9, kReachShares[] = {0.1, 0.01};

/// Windows over which a joint's drive pulls one way, so that a torque of one instant is that of all
/// of it. Without a drive, all count.
/// @param shape  (s) with the delays of the drives
CountsFor steady_windows(const std::vector<MotionStretch>& stretches, const FitLayout& layout,
                         const VecX<double>& shape);

/// Where a fit of drives may begin: the delay at which the torques of one instant balance best, and
/// an error at which drives saturate that the recording reaches.
/// @param windows      short ones
/// @param speed_share  one of kSpeedShares
/// @param reach_share  kSeldom, or one of kReachShares
/// @param shape        (s) values to begin at, written
void guess_drives(const Model& model, const std::vector<MotionStretch>& stretches,
                  const std::vector<MotionWindow>& windows, double speed_share, double reach_share,
                  FitLayout& layout, VecX<double>& shape);

}  // namespace diffnea
