#include "recording/floating_base.hpp"

#include <cmath>

#include <Eigen/Geometry>

#include <diffnea/core/error.hpp>

#include "core/constants.hpp"
#include "core/number_text.hpp"
#include "recording/axis_columns.hpp"

namespace diffnea::detail {
namespace {

using Vec3d = Eigen::Vector3d;

/// Largest share of a recording's poses that may be impossible, as of a file's rows.
constexpr double kMostImpossible = 0.01;

Eigen::Matrix3d rotation(const Eigen::Vector4d& xyzw) {
  return Eigen::Quaterniond(xyzw).normalized().toRotationMatrix();
}

/// `extra` behind the columns of `m`, in as many columns as wanted.
RowMatX<double> beside(const RowMatX<double>& m, const RowMatX<double>& extra) {
  RowMatX<double> out(extra.rows(), m.cols() + extra.cols());
  if (m.cols() > 0) out.leftCols(m.cols()) = m;
  out.rightCols(extra.cols()) = extra;
  return out;
}

/// [ṗ_WB | dq/dt] of a twist in B: ṗ = R v, dq/dt = ½ q ⊗ [ω; 0].
RowMatX<double> rates(const RowMatX<double>& base, const RowMatX<double>& twist) {
  RowMatX<double> out(base.rows(), kPose);
  for (long k = 0; k < base.rows(); ++k) {
    const Eigen::Vector4d q = base.row(k).tail<4>().transpose().normalized();
    const Vec3d u = q.head<3>(), omega = twist.row(k).head<3>(), v = twist.row(k).tail<3>();
    out.row(k).head<3>() = rotation(q) * v;
    out.row(k).segment<3>(3) = 0.5 * (q[3] * omega + u.cross(omega));
    out(k, 6) = -0.5 * u.dot(omega);
  }
  return out;
}

}  // namespace

std::string reason_against_quaternion(double x, double y, double z, double w) {
  const double norm = std::sqrt(x * x + y * y + z * z + w * w);
  if (std::isnan(norm) || std::abs(norm - 1.0) < kCredibleNormTol) return {};
  return "the quaternion base_qx base_qy base_qz base_qw has norm " + number_text(norm, 6) +
         ", expected 1";
}

std::vector<std::string> blank_impossible_poses(std::vector<Recording>& recordings) {
  std::vector<std::string> out;
  for (Recording& r : recordings) {
    long blanked = 0, first = 0;
    std::string reason;
    for (long k = 0; r.base.size() > 0 && k < r.rows(); ++k) {
      const std::string why =
          reason_against_quaternion(r.base(k, 3), r.base(k, 4), r.base(k, 5), r.base(k, 6));
      if (why.empty()) continue;
      if (blanked++ == 0) {
        first = k;
        reason = why;
      }
      r.base.row(k).setConstant(kNaN);
    }
    if (blanked == 0) continue;
    const std::string text = (r.source.empty() ? "" : r.source + ": ") + "at " +
                             number_text(r.time[first], 6) + " s " + reason + "; ";
    if (static_cast<double>(blanked) > kMostImpossible * static_cast<double>(r.rows()))
      throw DataError(text + std::to_string(blanked) + " of " + std::to_string(r.rows()) +
                      " rows are so, expected at most 1 %: is the order x y z w, and are they of "
                      "one rotation?");
    out.push_back(text + std::to_string(blanked) +
                  (blanked == 1 ? " such row is a gap" : " such rows are gaps"));
  }
  return out;
}

void match_base(const std::string& floating_link, std::vector<Recording>& recordings,
                std::string* note) {
  for (Recording& r : recordings) {
    if (!floating_link.empty() && r.base.size() == 0)
      throw DataError(r.source + ": the model floats on '" + floating_link +
                      "', and its pose is not recorded; expected columns base_x base_y base_z "
                      "base_qx base_qy base_qz base_qw (docs/recordings.md), or --fix-base "
                      "(fix_base=True) if it was held");
    if (!floating_link.empty() || r.base.size() == 0) continue;
    for (const auto member : {&Recording::base, &Recording::base_twist, &Recording::base_wrench})
      (r.*member).resize(0, 0);
    if (note != nullptr)
      *note =
          "columns of a base that floats (base_…) are left out: the model's base is fixed; "
          "--free-base (free_base=True) lets a URDF's or JSON's float";
  }
}

long SignKeeper::keep(RowMatX<double>& base) {
  long flips = 0;
  for (long k = 0; k < base.rows(); ++k) {
    const Eigen::Vector4d logged = base.row(k).tail<4>().transpose();
    if (logged.hasNaN()) continue;
    const double sign = last_.dot(logged) < 0.0 ? -1.0 : 1.0;
    flips += sign == sign_ ? 0 : 1;
    sign_ = sign;
    last_ = sign * logged;
    base.row(k).tail<4>() = last_.transpose();
  }
  return flips;
}

Recording BasePositions::apply(const Recording& block) {
  if (block.base.size() == 0) return block;
  Recording out = block;
  RowMatX<double> pose = block.base;
  flips_ += signs_.keep(pose);
  pose.rightCols<4>().rowwise().normalize();
  for (const AxisColumns& of : kAxisColumns)
    for (std::size_t axis = 0; of.series == &Recording::base && axis < of.axes.size(); ++axis)
      out.joint_names.push_back(of.column(axis));
  out.q = beside(block.q, pose);
  const bool measured = block.base_wrench.size() > 0;
  RowMatX<double> wrench = RowMatX<double>::Zero(block.rows(), kPose);
  if (measured) wrench.leftCols(kWrench) = block.base_wrench;
  out.tau = beside(block.tau, wrench);
  for (int k = 0; k < kPose; ++k) out.has_tau.push_back(measured && k < kWrench);
  const bool moves =
      block.base_twist.size() > 0 && (block.qd.size() > 0 || block.num_joints() == 0);
  out.qd = moves ? beside(block.qd, rates(pose, block.base_twist)) : RowMatX<double>();
  return out;
}

std::vector<Recording> with_base_positions(const std::vector<Recording>& recordings) {
  std::vector<Recording> out;
  for (const Recording& r : recordings) out.push_back(BasePositions().apply(r));
  return out;
}

void move_to_manifold(int joints, Preprocessed& rows) {
  const long n = joints, count = rows.rows();
  RowMatX<double> p = rows.q.rightCols(kPose), pd = rows.qd.rightCols(kPose),
                  pdd = rows.qdd.rightCols(kPose);
  rows.base_twist.resize(count, kWrench);
  rows.base_acceleration.resize(count, kWrench);
  for (long k = 0; k < count; ++k) {
    const Eigen::Vector4d q = p.row(k).tail<4>(), qd = pd.row(k).tail<4>(),
                          qdd = pdd.row(k).tail<4>();
    const Vec3d v = q.head<3>(), vd = qd.head<3>(), vdd = qdd.head<3>();
    const double N = q.squaredNorm();
    const Vec3d omega = 2.0 / N * (q[3] * vd - qd[3] * v - v.cross(vd));
    const Vec3d turning =
        2.0 / N * (q[3] * vdd - qdd[3] * v - v.cross(vdd)) - 2.0 * q.dot(qd) / N * omega;
    const Eigen::Matrix3d R = rotation(q);
    const Vec3d speed = R.transpose() * pd.row(k).head<3>().transpose();
    const Vec3d rate = R.transpose() * pdd.row(k).head<3>().transpose() - omega.cross(speed);
    rows.base_twist.row(k) << omega.transpose(), speed.transpose();
    rows.base_acceleration.row(k) << turning.transpose(), rate.transpose();
    p.row(k).tail<4>() /= std::sqrt(N);
  }
  rows.base = p;
  rows.base_wrench = rows.tau.middleCols(n, kWrench);
  rows.has_base_wrench = rows.has_tau[static_cast<std::size_t>(n)];
  rows.has_tau.resize(static_cast<std::size_t>(n));
  rows.joint_names.resize(static_cast<std::size_t>(n));
  for (RowMatX<double>* m : {&rows.q, &rows.qd, &rows.qdd, &rows.q_logged, &rows.tau})
    *m = RowMatX<double>(m->leftCols(n));
}

}  // namespace diffnea::detail
