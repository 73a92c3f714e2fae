#include "recording/row_block.hpp"

#include <limits>

#include "recording/axis_columns.hpp"

namespace diffnea::detail {

Recording recording_of_rows(std::span<const double> values, const Columns& header) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const long n = static_cast<long>(header.joint_names.size());
  const long num_columns = static_cast<long>(header.columns.size());
  const long rows = static_cast<long>(values.size()) / num_columns;
  Recording r;
  r.joint_names = header.joint_names;
  r.has_tau.assign(n, false);
  r.time.resize(rows);
  r.q.resize(rows, n);
  r.tau.setConstant(rows, n, kNaN);
  for (long j = 0; j < n; ++j) {
    r.has_tau[j] = header.has_tau[j] && !header.passive[j];
    if (header.passive[j]) r.tau.col(j).setZero();
  }
  for (const std::string& extra : header.extra_names)
    r.extra.push_back({extra, VecX<double>(rows)});
  const auto target = [&](RowMatX<double>& m, long columns) -> RowMatX<double>& {
    if (m.cols() != columns) m.setConstant(rows, columns, kNaN);
    return m;
  };
  for (long k = 0; k < num_columns; ++k) {
    const Column& c = header.columns[k];
    const Eigen::Map<const VecX<double>, 0, Eigen::InnerStride<>> x(
        values.data() + k, rows, Eigen::InnerStride<>(num_columns));
    switch (c.channel) {
      case Channel::kTime:
        r.time = x;
        break;
      case Channel::kRun:
      case Channel::kLeftOut:
        break;
      case Channel::kQ:
        r.q.col(c.index) = x;
        break;
      case Channel::kQd:
        target(r.qd, n).col(c.index) = x;
        break;
      case Channel::kQdd:
        target(r.qdd, n).col(c.index) = x;
        break;
      case Channel::kQcmd:
        target(r.qcmd, n).col(c.index) = x;
        break;
      case Channel::kQdcmd:
        target(r.qdcmd, n).col(c.index) = x;
        break;
      case Channel::kTaucmd:
        target(r.taucmd, n).col(c.index) = x;
        break;
      case Channel::kTau:
        if (r.has_tau[c.index]) r.tau.col(c.index) = x;
        break;
      case Channel::kBall:
      case Channel::kSpin:
      case Channel::kBasePosition:
      case Channel::kBaseQuaternion:
      case Channel::kBaseTurning:
      case Channel::kBaseVelocity:
      case Channel::kBaseTorque:
      case Channel::kBaseForce: {
        const AxisColumns& of = *axis_columns(c.channel);
        target(r.*of.series, of.width).col(c.index) = x;
        break;
      }
      case Channel::kExtra:
        r.extra[c.index].values = x;
        break;
    }
  }
  return r;
}

}  // namespace diffnea::detail
