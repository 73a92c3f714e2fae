#include "sim/desired_motion.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>

namespace diffnea::sim {
namespace {

/// Rows that are looked at; what a motion takes does not depend on more.
constexpr long kRows = 2000;
/// Largest way between a desired position and the one that the loop gives [rad, m]: drives that are
/// asked for more work against each other.
constexpr double kAgree = 1e-3;
/// Least length at the driven joints of a motion of unit length (LoopMotion::follow).
constexpr double kLeastHold = 1e-3;

std::string name_of(const Trajectory& t) { return t.source.empty() ? "trajectory" : t.source; }

/// Column of every joint in the trajectory; −1: none.
std::vector<long> columns_of(const Trajectory& t, const std::vector<std::string>& joints) {
  std::vector<long> out;
  for (const std::string& joint : joints) {
    const auto at = std::ranges::find(t.joint_names, joint);
    out.push_back(at == t.joint_names.end() ? -1 : at - t.joint_names.begin());
  }
  return out;
}

/// The posture from which the loop is followed: on the way from its home, or where the trajectory
/// itself has the joints that follow.
VecX<double> start_of(const Trajectory& t, const std::vector<long>& column, const LoopMotion& loop,
                      const DesiredMotion& m) {
  const VecX<double> first = m.q.row(0).transpose();
  const VecX<double> y = loop.positions_of_leads(first);
  VecX<double> q = loop.home();
  if (std::ranges::none_of(column, [](long c) { return c < 0; })) {
    q = first;
    if (loop.close(y, q)) return q;
    throw DataError(name_of(t) + ": at its first row constraint " + loop.gap_text(first) + " (" +
                    loop.leads_text(first) +
                    "); expected positions of all joints at which the loop closes, or those of "
                    "the driven joints alone");
  }
  if (loop.move(y, q)) return q;
  throw DataError(name_of(t) + ": its first row (" + loop.leads_text(first) +
                  ") is out of reach: on the way there from " + loop.leads_text(loop.home()) +
                  " the loop opens after " + loop.leads_text(q) +
                  ", or the driven joints do not hold it there (a dead point); expected a start "
                  "nearer to where it closes");
}

void follow_loop(const Trajectory& t, const std::vector<std::string>& joints,
                 const std::vector<long>& column, const LoopMotion& loop, DesiredMotion& m) {
  const RowMatX<double> asked = m.q;
  VecX<double> posture = start_of(t, column, loop, m);
  const long held = loop.follow(m.q, m.qd, m.qdd, posture, kLeastHold);
  if (held < m.q.rows()) {
    const VecX<double> wanted = asked.row(held).transpose();
    throw DataError(name_of(t) + ": at " + detail::number_text(t.time[0] + m.time[held]) +
                    " s the loop does not close, or the driven joints do not hold it (a dead "
                    "point): " +
                    loop.leads_text(wanted) + "; keep the motion nearer to " +
                    loop.leads_text(loop.home()));
  }
  for (const int j : loop.drives()) {
    const auto at = static_cast<std::size_t>(j);
    if (loop.leads(j) || column[at] < 0) continue;
    long row = 0;
    const double off = (asked.col(j) - m.q.col(j)).cwiseAbs().maxCoeff(&row);
    if (off > kAgree)
      throw DataError(name_of(t) + ": at " + detail::number_text(t.time[0] + m.time[row]) +
                      " s joint '" + joints[at] + "' is to be at " +
                      detail::number_text(asked(row, j), 4) + ", and the loop has it at " +
                      detail::number_text(m.q(row, j), 4) + " with " +
                      loop.leads_text(m.q.row(row).transpose()) +
                      "; expected positions that agree to 0.001 (rad, m)");
  }
}

}  // namespace

DesiredMotion desired_motion(const Trajectory& t, const std::vector<std::string>& joints,
                             const LoopMotion* loop) {
  const long step = std::max(1L, t.rows() / kRows), rows = (t.rows() + step - 1) / step;
  const std::vector<long> column = columns_of(t, joints);
  DesiredMotion out;
  out.time.resize(rows);
  out.q = RowMatX<double>::Zero(rows, static_cast<long>(joints.size()));
  out.qd = out.qdd = out.q;
  for (long k = 0; k < rows; ++k) out.time[k] = t.time[k * step] - t.time[0];
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const long c = column[j];
    for (long k = 0; k < rows && c >= 0; ++k) {
      out.q(k, static_cast<long>(j)) = t.q(k * step, c);
      if (t.qd.size() > 0) out.qd(k, static_cast<long>(j)) = t.qd(k * step, c);
      if (t.qdd.size() > 0) out.qdd(k, static_cast<long>(j)) = t.qdd(k * step, c);
    }
  }
  if (loop) follow_loop(t, joints, column, *loop, out);
  return out;
}

}  // namespace diffnea::sim
