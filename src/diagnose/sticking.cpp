#include "diagnose/sticking.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "core/statistics.hpp"
#include "diagnose/thresholds.hpp"
#include "recording/path_smoother.hpp"

namespace diffnea {
namespace {

/// Peak to peak, in standard deviations: what white noise of a thousand rows does not leave (5 %).
constexpr double kPeakToPeak = 8.0;
constexpr double kWider = 4.0;  ///< bands
/// What passes at a constant velocity has a rest of 1/6, noise at a standstill less than 1.
constexpr double kTurns = 0.5;
/// Rests: of one turn, and in the median of many. Joints that do not stick have medians of 0.9
/// to 1.06, those of the mast (docs/diagnosis.md) 1.17 and more.
constexpr double kRests = 1.3, kSticks = 1.1;
/// Of the time that a reversal at the RMS acceleration takes; of the RMS velocity. Softer reversals
/// show what friction does at low speed (Stribeck), whoever crosses the band faster moves.
constexpr double kLonger = 1.2, kSlow = 0.1;
/// Rows of a turn, and turns, below which rests tell nothing.
constexpr long kShortest = 5, kFewest = 4;
/// Share of a stretch's rows within the band about their median: what moves a joint that stands
/// beside them is a shock, and its own velocity noise.
constexpr double kStands = 0.95;
/// Of a joint's rows: one that turns back more often keeps its turns.
constexpr double kMostLeftOut = 0.5;
/// Of the filter's cut-off.
constexpr double kOfCutOff = 0.25;
/// Of what the filter makes of a disturbance at its middle: nearer than that, friction that sets in
/// at another instant than the filtered velocity's passes for a lag, or for other friction.
constexpr double kMixed = 0.2;

/// Means over `width` rows around each, of what there is.
VecX<double> averaged(const Eigen::Ref<const VecX<double>>& q, long width) {
  VecX<double> out(q.size());
  for (long i = 0; i < q.size(); ++i) {
    const long reach = std::min({(width - 1) / 2, i, q.size() - 1 - i});
    out[i] = q.segment(i - reach, 2 * reach + 1).mean();
  }
  return out;
}

bool stands(const Turn& turn, const Standstill& still) {
  return turn.rows() >= still.lasting || (turn.rows() >= still.rows && turn.rest > kRests);
}

/// Rows [first, last], between `low` and `high`.
Turn turn_of(const VecX<double>& q, long first, long last, double low, double high, double band) {
  const double top = low + kWider * band, bottom = high - kWider * band;
  const auto within = [&](long i) { return q[i] >= bottom && q[i] <= top; };
  const double length = static_cast<double>(last - first + 1);
  const long most = static_cast<long>(length / kTurns) + 1;
  long gained = 0;
  for (long i = first - 1; i >= 0 && gained <= most && within(i); --i) ++gained;
  for (long i = last + 1; i < q.size() && gained <= most && within(i); ++i) ++gained;
  return {first, last, length / static_cast<double>(std::max(gained, 1L))};
}

}  // namespace

Standstill standstill(double q_noise, double qd, double qdd, const PreprocessPlan& plan) {
  const auto rows = [&](double seconds) {
    return std::max(2L, std::lround(seconds / plan.dt) + 1);
  };
  const double band = kPeakToPeak * q_noise;
  const double reversal = qdd > 0.0 ? 2.0 * std::sqrt(2.0 * band / qdd) : 0.0;
  const double crossing = qd > 0.0 ? band / (kSlow * qd) : 0.0;
  const double shortest = kOfCutOff / plan.filter_hz;
  return {band, rows(shortest), rows(std::max({shortest, kLonger * reversal, crossing})),
          detail::PathSmoother(plan.filter_hz, 1.0 / plan.dt).memory(kMixed), rows(kBlockSeconds)};
}

bool stands_all_along(std::vector<double> q, double noise) {
  if (std::ranges::min(q) == std::ranges::max(q)) return false;  // an encoder that is dead
  const double middle = median(q);
  const auto within = std::ranges::count_if(
      q, [&](double at) { return std::abs(at - middle) <= 0.5 * kPeakToPeak * noise; });
  return static_cast<double>(within) >= kStands * static_cast<double>(q.size());
}

std::vector<Turn> find_turns(const Eigen::Ref<const VecX<double>>& logged,
                             const Standstill& still) {
  const VecX<double> q = averaged(logged, still.rows / 2);
  std::vector<Turn> out;
  std::deque<long> low, high;  // rows of the window's smallest and largest positions, in order
  long first = 0;
  // The window that ends before row i is the longest there if row i does not fit into it.
  const auto end_before = [&](long i) {
    if (i - first < kShortest) return;
    const Turn turn = turn_of(q, first, i - 1, q[low.front()], q[high.front()], still.band);
    if (turn.rest < kTurns && i - first < still.lasting) return;
    if (out.empty() || out.back().last < turn.first)
      out.push_back(turn);
    else if (out.back().last - out.back().first < turn.last - turn.first)
      out.back() = turn;
  };
  for (long i = 0; i < q.size(); ++i) {
    if (i > first && std::max(q[high.front()], q[i]) - std::min(q[low.front()], q[i]) > still.band)
      end_before(i);
    while (!low.empty() && q[low.back()] >= q[i]) low.pop_back();
    while (!high.empty() && q[high.back()] <= q[i]) high.pop_back();
    low.push_back(i);
    high.push_back(i);
    while (q[high.front()] - q[low.front()] > still.band) {
      ++first;
      if (low.front() < first) low.pop_front();
      if (high.front() < first) high.pop_front();
    }
  }
  if (q.size() > 0) end_before(q.size());
  return out;
}

bool sticks_at_turns(const std::vector<Turn>& turns) {
  std::vector<double> rests;
  for (const Turn& t : turns)
    if (t.rest >= kTurns) rests.push_back(t.rest);
  return std::ssize(rests) >= kFewest && median(rests) > kSticks;
}

std::vector<bool> stands_still(const std::vector<Turn>& turns, const Standstill& still, long rows,
                               bool everywhere) {
  std::vector<bool> out(rows, false);
  for (const Turn& t : turns) {
    if (!everywhere && !stands(t, still)) continue;
    const long last = std::min(t.last + still.margin, rows - 1);
    for (long i = std::max(t.first - still.margin, 0L); i <= last; ++i) out[i] = true;
  }
  return out;
}

StuckRows stuck_rows(const std::vector<VecX<double>>& positions, const Standstill& still,
                     Turns what) {
  std::vector<std::vector<Turn>> turns;
  std::vector<Turn> all;
  for (const VecX<double>& q : positions) {
    turns.push_back(find_turns(q, still));
    all.insert(all.end(), turns.back().begin(), turns.back().end());
  }
  Standstill told = still;
  if (what == Turns::kWholeStretches) told.rows = told.lasting = std::numeric_limits<long>::max();
  std::vector<bool> stands;  // all along a stretch
  for (const VecX<double>& q : positions)
    stands.push_back(stands_all_along({q.begin(), q.end()}, still.band / kPeakToPeak));
  const bool never_moves = std::ranges::find(stands, false) == stands.end();
  const auto leave_out = [&](bool everywhere) {
    StuckRows out{{}, everywhere};
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const long rows = positions[i].size();
      out.rows.push_back(never_moves || (stands[i] && rows >= still.pause)
                             ? std::vector<bool>(rows, true)
                             : stands_still(turns[i], told, rows, everywhere));
    }
    return out;
  };
  if (what == Turns::kAllLeftOut) return leave_out(true);
  if (what != Turns::kLeftOut || !sticks_at_turns(all)) return leave_out(false);
  StuckRows out = leave_out(true);
  long left_out = 0, rows = 0;
  for (const std::vector<bool>& stretch : out.rows) {
    left_out += std::ranges::count(stretch, true);
    rows += std::ssize(stretch);
  }
  return static_cast<double>(left_out) > kMostLeftOut * static_cast<double>(rows) ? leave_out(false)
                                                                                  : out;
}

double turn_rate(const std::vector<JointSeries>& series, int joint, double rest) {
  long turns = 0;
  double seconds = 0.0;
  for (const JointSeries& s : series) {
    seconds += s.dt * static_cast<double>(s.qd.rows());
    double before = 0.0;
    for (const double qd : s.qd.col(joint)) {
      if (std::abs(qd) < rest) continue;
      turns += qd * before < 0.0;
      before = qd;
    }
  }
  return static_cast<double>(turns) / seconds;
}

}  // namespace diffnea
