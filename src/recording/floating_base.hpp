#pragma once
/// Logged poses of a base that floats: quaternions that can be true, without changes of sign, and
/// the pose as seven positions that filters take beside the joints', with the motion on the
/// manifold behind them. Internal.
///
///     flat = BasePositions().apply(recording);   // q: joints | x y z qx qy qz qw
///     … grid, smoothing spline, derivatives …
///     move_to_manifold(n, preprocessed);         // X_WB, V_WB_B, V̇_WB_B

#include <string>
#include <vector>

#include <diffnea/recording/preprocess.hpp>

namespace diffnea::detail {

/// Numbers of a pose, x y z qx qy qz qw, and of a twist or wrench.
inline constexpr int kPose = 7, kWrench = 6;
/// Largest |norm − 1| of a logged quaternion that can be one: numbers of two decimals have it.
inline constexpr double kCredibleNormTol = 0.02;

/// Tells why four logged numbers are no unit quaternion; empty if they are one, or hold a gap.
std::string reason_against_quaternion(double x, double y, double z, double w);

/// Makes gaps of poses whose quaternion is not unit, as a file's reader leaves such rows out.
/// @return one sentence per recording concerned
/// @throws DataError with row and norm if more than a hundredth of a recording's rows are such
std::vector<std::string> blank_impossible_poses(std::vector<Recording>& recordings);

/// Fits the recordings' base to the model's: taken out where the model's is fixed.
/// @param note  set where columns are left out; null: not wanted
/// @throws DataError if the model floats and a recording has no pose
void match_base(const std::string& floating_link, std::vector<Recording>& recordings,
                std::string* note = nullptr);

/// The quaternion of the last row, for signs across the blocks of one recording.
class SignKeeper {
 public:
  /// Turns quaternions round whose sign is not that of the row before: q and −q are one rotation.
  /// @param base  (N, 7)  @return how often the sign changed
  long keep(RowMatX<double>& base);

 private:
  Eigen::Vector4d last_ = Eigen::Vector4d::Zero();
  double sign_ = 1.0;
};

/// A recording whose base is seven more positions, one block after the other.
class BasePositions {
 public:
  /// The pose behind the joints' positions, the wrench and a zero behind their torques, and the
  /// rates ṗ_WB and dq/dt of the measured twist behind their velocities, where both are there.
  /// Nothing changes where no base was logged.
  Recording apply(const Recording& block);
  /// Changes of sign so far.
  long flips() const { return flips_; }

 private:
  SignKeeper signs_;
  long flips_ = 0;
};

/// Whole recordings, each with its base as positions.
std::vector<Recording> with_base_positions(const std::vector<Recording>& recordings);

/// Splits the seven smoothed positions off again: X_WB with a unit quaternion, V_WB_B and V̇_WB_B.
/// With u = [v; w] the smoothed quaternion, not yet unit, and N = uᵀu
///
///     ω = 2/N (w v̇ − ẇ v − v×v̇),   ω̇ = 2/N (w v̈ − ẅ v − v×v̈) − (Ṅ/N) ω
///     v_B = Rᵀ ṗ,                  v̇_B = Rᵀ p̈ − ω×v_B
/// @param joints  number of the positions that lead
void move_to_manifold(int joints, Preprocessed& rows);

}  // namespace diffnea::detail
