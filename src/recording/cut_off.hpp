#pragma once
/// Which frequencies of a measured position are motion, and which noise.

#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea::detail {

/// The difference stencils are true up to this share of the rate: the highest cut-off that is
/// chosen.
inline constexpr double kTrueTo = 0.25;

/// Window of 5 to 10 s, which tells the slow lines of a motion apart; the longest segment holds
/// three of them. A power of two.
long window_length(const std::vector<Eigen::VectorXd>& segments, double dt);

/// Noise and motion in the spectrum of a position.
struct PositionSpectrum {
  double cutoff_hz = 0.0;     ///< signal below, noise above; 0: too short to tell
  double busy_hz = 0.0;       ///< below it: 99 % of the accelerations' power
  double noise = 0.0;         ///< standard deviation of the noise of q, if it is white
  double acceleration = 0.0;  ///< variance of q̈ below the cut-off, its mean left out
};

/// The accelerations' power falls with the motion and rises again with the noise, as f⁴: its
/// minimum parts them. The noise of positions does not grow with frequency, so a position spectrum
/// that rises tenfold above the minimum is motion again, and the search goes on from there; but for
/// the lines of rounding (an even motion over an encoder's steps): a position that jumps between
/// two steps has a variance of a quarter of a step squared, and no rounding has more.
/// @param step  of the encoder [rad] or [m]; 0: none
PositionSpectrum look_at_position(const std::vector<Eigen::VectorXd>& segments, double rate_hz,
                                  double step);

/// Noise is the same all the time; what a path of too low a cut-off leaves of a motion comes with
/// its events: teeth that meet, friction that lets go. In a spectrum over all time such events may
/// be a slope that falls too slowly for its accelerations to have a minimum above it.
/// @param segments   of one joint
/// @param cutoff_hz  that the spectrum tells
/// @param highest    cut-off [Hz]
/// @param noise      standard deviation of the positions, where it is white
/// @return the lowest cut-off from there on whose path leaves the positions by much more than in
///         quiet windows in few of the moving ones; `cutoff_hz` if there is none, for then it is
///         noise that comes and goes
double cutoff_of_events(const std::vector<Eigen::VectorXd>& segments, double rate_hz,
                        double cutoff_hz, double highest, double noise);

/// Rows at either end of a segment with events which a path of the cut-off does not follow: a start
/// from rest under a controller, whose past no filter has. In between, events are evidence.
std::vector<std::vector<bool>> jerky_ends(const std::vector<Eigen::VectorXd>& segments,
                                          double rate_hz, double cutoff_hz, double noise);

}  // namespace diffnea::detail
