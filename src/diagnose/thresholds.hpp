#pragma once
/// Numbers that several parts of a diagnosis decide by.

#include <cstddef>

namespace diffnea {

inline constexpr double kToldApart = 10.0;   ///< ΔBIC from which two effects are told apart
inline constexpr double kExplained = 0.8;    ///< explained share below which a cause is unknown
inline constexpr double kExperiment = 40.0;  ///< length of the next experiment [s]
inline constexpr int kResamples = 1000;      ///< draws of a bootstrap interval
inline constexpr double kNormal95 = 1.96;    ///< half of a 95 % interval [standard deviations]
/// χ² over its degrees of freedom beyond which more than noise is left: 0.47 to 1.07 in 139
/// recordings that hide nothing, where repeats tell the noise.
inline constexpr double kLeft = 1.3;
/// Share of a joint's torque, or of its motion, to which no model is exact.
inline constexpr double kInexact = 0.01;
/// Share of an effect's torque or motion that the base leaves: where it takes over more, the error
/// of the columns is what shows.
inline constexpr double kAbsorbed = 0.01;
/// Which windows are held out where there is no test recording: every fourth.
inline constexpr std::size_t kHeldOutWindow = 4;
/// Length of a block that is drawn as one [s]: errors hang together for as long as a motion takes.
inline constexpr double kBlockSeconds = 1.0;
/// Fewest rows for each column that acts on a joint: with fewer, smooth functions explain noise.
inline constexpr long kRowsAColumn = 4;

}  // namespace diffnea
