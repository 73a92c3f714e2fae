#include <algorithm>
#include <cmath>
#include <functional>

#include <diffnea/core/error.hpp>
#include <diffnea/motion/window.hpp>
#include <diffnea/recording/commands.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "core/number_text.hpp"
#include "core/statistics.hpp"

namespace diffnea {
namespace {

/// Time between two rows over the median one across which no held torque is believed.
constexpr double kPause = 5.0;
/// Degree of the polynomial of a local motion.
constexpr long kDegree = 3;

/// Column of the supply: of all drives, or with a joint's name.
constexpr const char* kVoltage = "voltage";

/// Volts in the unit of an extra channel, which keeps the brackets of its column; 0: it is no
/// supply of this joint.
double volts_of(const std::string& column, const std::string& joint) {
  const std::size_t bracket = column.find('[');
  const std::string unit = bracket == std::string::npos ? "[V]" : column.substr(bracket);
  std::string name = column.substr(0, bracket);
  while (name.ends_with(' ')) name.pop_back();
  if (!is_of_drive(name, kVoltage, joint)) return 0.0;
  return unit == "[V]" ? 1.0 : unit == "[mV]" ? 1e-3 : 0.0;
}

}  // namespace

RowMatX<double> supply_of(const Recording& r) {
  RowMatX<double> out;
  for (int j = 0; j < r.num_joints(); ++j)
    for (const ExtraChannel& channel : r.extra) {
      const double volts = volts_of(channel.name, r.joint_names[static_cast<std::size_t>(j)]);
      if (!(volts > 0.0) || !(channel.values.array() > 0.0).any()) continue;
      if (out.size() == 0) out = RowMatX<double>::Constant(r.rows(), r.num_joints(), std::nan(""));
      for (long k = 0; k < r.rows(); ++k)  // a drive that answers has a supply
        if (channel.values[k] > 0.0) out(k, j) = volts * channel.values[k];
    }
  return out;
}

CommandPath command_path(const Recording& r) {
  VecX<double> gain = VecX<double>::Ones(r.num_joints());
  for (long j = 0; j < r.num_joints(); ++j) {
    const std::string& joint = r.joint_names[static_cast<std::size_t>(j)];
    for (const JointValue& c : r.info.controller)
      if (c.joint == joint && c.name == "gain") {
        if (!(c.value > 0.0))
          throw DataError(r.source + ": controller." + joint + ".gain of its sidecar is " +
                          detail::number_text(c.value) +
                          ", expected above 0: a drive without gain follows no command; say that "
                          "it is off by a column torque_enable of 0");
        gain[j] = c.value;
      }
  }
  CommandPath out{std::vector<double>(r.time.begin(), r.time.end()), live_commands(r),
                  std::move(gain)};
  out.set_supply(supply_of(r));
  out.set_feed_forward(r.qdcmd, r.taucmd);
  return out;
}

double median_supply(const std::vector<Recording>& recordings, int joint) {
  std::vector<double> volts;
  for (const Recording& r : recordings)
    if (const RowMatX<double> supply = supply_of(r); supply.size() > 0)
      for (const double v : supply.col(joint))
        if (v > 0.0) volts.push_back(v);
  return volts.empty() ? 0.0 : median(std::move(volts));
}

std::vector<MotionStretch> motion_stretches(const Recording& recording, const SensorNoise& noise,
                                            const std::vector<bool>& passive,
                                            const std::vector<bool>& commanded) {
  const int n = recording.num_joints();
  const bool hold = recording.info.torque_sampling == TorqueSampling::kHold;
  const bool driven = std::ranges::any_of(passive, [](bool p) { return !p; });
  std::vector<double> periods;
  for (long k = 1; k < recording.rows(); ++k)
    periods.push_back(recording.time[k] - recording.time[k - 1]);
  const double pause = periods.empty() ? 0.0 : kPause * median(periods);
  RowMatX<double> u = recording.tau, q = recording.q;
  for (int j = 0; j < n; ++j) {
    if (!commanded.empty() && commanded[static_cast<std::size_t>(j)]) u.col(j).setZero();
    if (passive[static_cast<std::size_t>(j)])  // 0, or a ball's pull where that is known
      for (long k = 0; k < u.rows(); ++k)
        if (std::isnan(u(k, j))) u(k, j) = 0.0;
    const std::vector<bool> counts =
        refreshed(q.col(j), noise.refresh[static_cast<std::size_t>(j)]);
    for (long k = 0; k < q.rows(); ++k)
      if (!counts[static_cast<std::size_t>(k)]) q(k, j) = std::nan("");
  }
  std::shared_ptr<const CommandPath> command;
  if (std::ranges::any_of(commanded, std::identity()))
    command = std::make_shared<const CommandPath>(command_path(recording));
  std::vector<MotionStretch> out;
  for (long from = 0; from < recording.rows();) {
    if (!u.row(from).allFinite() || q.row(from).array().isNaN().all()) {
      ++from;
      continue;
    }
    long to = from + 1;
    while (to < recording.rows() && u.row(to).allFinite() &&
           !(driven && recording.time[to] - recording.time[to - 1] > pause))
      ++to;
    const long m = to - from;
    MotionStretch s;
    s.run = recording.run;
    s.command = command;
    s.time.assign(recording.time.data() + from, recording.time.data() + to);
    s.q = q.middleRows(from, m);
    s.u = u.middleRows(from, m);
    s.u_end = s.u;
    if (!hold) s.u_end.topRows(m - 1) = s.u.bottomRows(m - 1);
    // A state has two numbers a joint: what has no more rows says nothing of the model.
    if (m > 2) out.push_back(std::move(s));
    from = to;
  }
  return out;
}

std::vector<MotionWindow> cut_windows(const std::vector<MotionStretch>& stretches, double horizon,
                                      const std::vector<MotionWindow>& windows) {
  std::vector<MotionWindow> out;
  for (const MotionWindow& w : windows) {
    const std::vector<double>& t = stretches[w.stretch].time;
    const long last = w.first + w.rows;
    for (long from = w.first; from < last;) {
      const double end = t[static_cast<std::size_t>(from)] + horizon * (1.0 + 1e-9);
      const long to = std::upper_bound(t.begin() + from, t.begin() + last, end) - t.begin();
      if (to - from > 2) out.push_back({w.stretch, from, to - from, {}});
      from = to;
    }
  }
  return out;
}

std::vector<MotionWindow> cut_windows(const std::vector<MotionStretch>& stretches, double horizon) {
  std::vector<MotionWindow> whole;
  for (std::size_t s = 0; s < stretches.size(); ++s)
    whole.push_back({s, 0, static_cast<long>(stretches[s].time.size()), {}});
  return cut_windows(stretches, horizon, whole);
}

LocalMotion local_motion(const MotionStretch& stretch, double at, long from, long rows) {
  const long n = stretch.q.cols();
  LocalMotion out{VecX<double>::Zero(n), VecX<double>::Zero(n), VecX<double>::Zero(n)};
  const long m = static_cast<long>(stretch.time.size());
  for (long j = 0; j < n; ++j) {
    std::vector<double> t, y;
    const auto take = [&](long k) {
      if (std::isnan(stretch.q(k, j))) return false;
      t.push_back(stretch.time[static_cast<std::size_t>(k)] - at);
      y.push_back(stretch.q(k, j));
      return true;
    };
    for (long k = from; k < std::min(from + rows, m); ++k) take(k);
    // A sensor that is slow, or was covered, has said something before, and says something later.
    if (t.empty())
      for (long k = from; k-- > 0 && !take(k);) continue;
    for (long k = from + rows; k < m && t.size() < 2; ++k) take(k);
    if (t.empty()) continue;
    const long count = static_cast<long>(t.size());
    // Two rows an unknown: fewer would differentiate the noise.
    const long unknowns = std::clamp<long>(count / 2, std::min<long>(count, 2), kDegree + 1);
    const double unit = std::max(std::abs(t.front()), std::abs(t.back()));
    MatX<double> A(count, unknowns);
    for (long k = 0; k < count; ++k)
      for (long d = 0; d < unknowns; ++d)
        A(k, d) = std::pow(t[static_cast<std::size_t>(k)] / std::max(unit, 1e-12), d);
    const VecX<double> b = Eigen::Map<const VecX<double>>(y.data(), count);
    const VecX<double> c = Eigen::ColPivHouseholderQR<MatX<double>>(A).solve(b);
    out.q[j] = c[0];
    if (unknowns > 1) out.qd[j] = c[1] / unit;
    if (unknowns > 2) out.qdd[j] = 2.0 * c[2] / (unit * unit);
  }
  return out;
}

PositionRange position_range(const std::vector<MotionStretch>& stretches, long joints) {
  PositionRange out;
  out.low = VecX<double>::Constant(joints, kInfinity);
  out.high = -out.low;
  for (const MotionStretch& s : stretches)
    for (long j = 0; j < joints; ++j)
      for (const double q : s.q.col(j))
        if (!std::isnan(q)) {
          out.low[j] = std::min(out.low[j], q);
          out.high[j] = std::max(out.high[j], q);
        }
  return out;
}

VecX<double> motion_size(const std::vector<MotionStretch>& stretches) {
  const long n = stretches.empty() ? 0 : stretches.front().q.cols();
  VecX<double> squares = VecX<double>::Zero(n), count = squares;
  for (const MotionStretch& s : stretches)
    for (long j = 0; j < n; ++j) {
      double sum = 0.0, rows = 0.0;
      for (const double q : s.q.col(j))
        if (!std::isnan(q)) {
          sum += q;
          ++rows;
        }
      for (const double q : s.q.col(j))
        if (!std::isnan(q)) squares[j] += std::pow(q - sum / rows, 2);
      count[j] += rows;
    }
  return squares.cwiseQuotient(count.cwiseMax(1.0)).cwiseSqrt();
}

}  // namespace diffnea
