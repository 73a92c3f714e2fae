#pragma once
/// A path known twice, by samples whose noise is independent: what one shows is an instrument for
/// what the other leaves (Durbin 1954). Where it is not, the instrument is smoother. Internal to
/// diagnose/.

#include <vector>

#include <diffnea/effects/joint_series.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// Highest cut-off of a path for which every other sample of the positions is enough [Hz]; 0: none.
double cutoff_of_halves(const PreprocessPlan& plan);

/// Tells whether every other sample of the positions is enough for the plan's path.
bool halves_suffice(const PreprocessPlan& plan);

/// Positions of which every other new one is known, the others between them by polynomials: those
/// that are even, or odd, by their number.
/// @param logged  (N, n) positions; of slow sensors on lines between new ones
RowMatX<double> half_of(const RowMatX<double>& logged, const PreprocessPlan& plan, bool even);

/// Joints of which another half would have like errors: all, where halves do not suffice; and where
/// some joint moves so evenly that what rounding leaves is no noise (Widrow, Kollár 2008, ch. 19),
/// all whose encoder's step is more than twice the noise that dithers it, for each joint's torque
/// hangs on the accelerations of the others, too. A torque that a controller makes of these
/// positions has the errors as well.
/// @param positions  of each stretch, (N, n); one or more
std::vector<int> joints_alike(const PreprocessPlan& plan,
                              const std::vector<RowMatX<double>>& positions);

/// Smooths the paths of `joints` to half of the plan's cut-off: errors of positions that are alike
/// at all frequencies have there a 32nd of their power as accelerations, a 128th as a torque's
/// rate.
void smooth_more(const RowMatX<double>& positions, const PreprocessPlan& plan,
                 const std::vector<int>& joints, JointSeries& path);

}  // namespace diffnea
