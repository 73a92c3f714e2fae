#pragma once
/// Measured series of one robot in SI units: what a recording file holds, as arrays.

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Which torque was recorded: the drive's, or the joint sensor's.
enum class TorqueSide { kMotor, kLink };
/// When a row's torque acts: until the next row, or at the row's time.
enum class TorqueSampling { kHold, kInstant };

/// A number that belongs to a joint: a gain or limit of its controller.
struct JointValue {
  std::string joint;   ///< of the recording
  std::string name;    ///< e.g. "kp", "kd", "limit"
  double value = 0.0;  ///< [N·m/rad, N·m·s/rad, N·m] or [N/m, N·s/m, N]
};

/// A rigid body that the robot held. What is not given is unknown; equal bodies are one body.
struct HeldBody {
  std::string name;            ///< tells bodies apart of which nothing is known; may be empty
  std::string where = "tip";   ///< the last moving link; or the joint that moves what holds it
  std::optional<double> mass;  ///< [kg]
  std::optional<std::array<double, 3>> com;  ///< [m] in the link's frame; needs the mass
  /// Ixx Ixy Ixz Iyy Iyz Izz about its center of mass, in the link's axes [kg·m²]; needs the com
  std::optional<std::array<double, 6>> about_com;

  /// Whether all entries are equal, the name included: then both are one body.
  bool operator==(const HeldBody&) const = default;
};

/// What columns cannot hold: the optional `<data>.json` beside the file (contract).
struct RecordingInfo {
  TorqueSide torque_side = TorqueSide::kMotor;  ///< where all torques were measured
  /// hold: row k's torque acts from row k to k+1; instant: sampled with the positions.
  TorqueSampling torque_sampling = TorqueSampling::kHold;
  double period = 0.0;               ///< of a periodic motion [s]; 0: not periodic
  std::vector<std::string> passive;  ///< joints whose torque is known to be zero
  /// Torque constant per joint [N·m/A], [N/A]: lets a column `tau_<joint> [A]` be read.
  std::vector<std::pair<std::string, double>> torque_constant;
  std::vector<JointValue> controller;  ///< gains and limits, SI
  std::optional<HeldBody> payload;     ///< held in this recording
};

/// A channel that the contract does not know, kept by name.
struct ExtraChannel {
  std::string name;     ///< header of the column, a unit in brackets included
  VecX<double> values;  ///< (N) as written, no unit converted; NaN: a gap, or no number
};

/// One uninterrupted recording of N rows and n joints. A gap is NaN. Empty matrices: not measured.
struct Recording {
  std::string source;  ///< file and run, for messages
  int run = 0;         ///< of the column `run`, 0 without one; of several files 0, 1, 2 … in order
  std::vector<std::string> joint_names;  ///< (n) in the order of the columns below
  VecX<double> time;                     ///< (N) [s], strictly increasing
  RowMatX<double> q;                     ///< (N, n) [rad] or [m]
  RowMatX<double> qd;                    ///< (N, n), measured; empty if not
  RowMatX<double> qdd;                   ///< (N, n), measured; empty if not
  RowMatX<double> qcmd;                  ///< (N, n), desired position; empty if not
  RowMatX<double> qdcmd;                 ///< (N, n), desired velocity beside it; empty if not
  RowMatX<double> taucmd;  ///< (N, n) [N·m] or [N], torque asked for beside both; empty if not
  /// (N, n) [N·m] or [N]. Where has_tau is false: NaN (unknown) at a prescribed joint, 0 (known) at
  /// a passive one; simulations leave NaN there, too, until match_joints().
  RowMatX<double> tau;
  std::vector<bool> has_tau;  ///< per joint: measured torque; false: prescribed motion or passive
  RowMatX<double> ball;       ///< (N, 3) [m], W; empty if not measured
  RowMatX<double> spin;       ///< (N, 3) [rad/s], W; empty if not measured
  /// (N, 7) pose X_WB of a robot that floats, x y z of p_WB [m] and qx qy qz qw of R_WB, as a model
  /// has it in q; norm and sign of the quaternion as logged. Empty: the base is fixed.
  RowMatX<double> base;
  /// (N, 6) measured twist V_WB_B = [ω; v] of the base against the world, in the base's axes, about
  /// its origin [rad/s, m/s]; empty if not.
  RowMatX<double> base_twist;
  /// (N, 6) known wrench [τ; f] on the base from outside, in the base's axes, about its origin
  /// [N·m, N]: thrust, a load cell. Empty: none acts, the robot flies.
  RowMatX<double> base_wrench;
  std::vector<ExtraChannel> extra;  ///< in the file's order
  RecordingInfo info;               ///< what columns cannot hold

  /// Number of rows.
  long rows() const { return time.size(); }
  /// Number of joints.
  int num_joints() const { return static_cast<int>(joint_names.size()); }
};

/// Members with a row an instant, of one column a joint or axis; empty where not measured.
inline constexpr std::array kSeries{
    &Recording::q,     &Recording::qd,     &Recording::qdd,        &Recording::qcmd,
    &Recording::qdcmd, &Recording::taucmd, &Recording::tau,        &Recording::ball,
    &Recording::spin,  &Recording::base,   &Recording::base_twist, &Recording::base_wrench};
/// Members of one column a joint.
inline constexpr std::array kJointSeries{&Recording::q,    &Recording::qd,    &Recording::qdd,
                                         &Recording::qcmd, &Recording::qdcmd, &Recording::taucmd,
                                         &Recording::tau};

}  // namespace diffnea
