#include "recording/held_rows.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <diffnea/core/text.hpp>
#include <diffnea/recording/commands.hpp>

#include "core/statistics.hpp"
#include "recording/command_lag.hpp"

namespace diffnea::detail {
namespace {

/// Time that delays of drives do not reach: what lasts as long is no answer that is late [s].
constexpr double kLasts = 0.2;
/// Share of its range that a joint moves by meanwhile, at least, where it moves.
constexpr double kMoves = 0.01;
/// Share of rows that move whose error is below the usual one.
constexpr double kMost = 0.9;
/// Over that error, by how much the error at which a joint rests and the one at which it leaves
/// differ if it is held: friction and weight make the one twice the other.
constexpr double kFurther = 3.5;
/// The same of the error at which it leaves: a drive at its limit lets go at that.
constexpr double kBack = 2.0;
/// Share of the usual error within which a joint rests: a stop gives, too.
constexpr double kRests = 0.3;
/// Rows that move, from which the error at which a joint moves is known.
constexpr std::size_t kFewest = 100;

/// A joint of one recording; rows without position or command are left out.
struct Led {
  std::size_t recording = 0;
  std::vector<long> row;
  std::vector<double> t, q, error;  ///< command over position

  long size() const { return static_cast<long>(t.size()); }
  /// First row that is kLasts after that one; size(): none.
  long later(long k) const {
    return std::lower_bound(t.begin() + k, t.end(), t[static_cast<std::size_t>(k)] + kLasts) -
           t.begin();
  }
};

std::vector<Led> led(const std::vector<Recording>& recordings, int joint) {
  std::vector<Led> out;
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    const Recording& r = recordings[i];
    if (!is_logged(r.qcmd, joint)) continue;
    const VecX<double> command = live_commands(r).col(joint);
    Led of{i, {}, {}, {}, {}};
    for (long k = 0; k < r.rows(); ++k)
      if (const double q = r.q(k, joint); std::isfinite(q) && std::isfinite(command[k])) {
        of.row.push_back(k);
        of.t.push_back(r.time[k]);
        of.q.push_back(q);
        of.error.push_back(command[k] - q);
      }
    out.push_back(std::move(of));
  }
  return out;
}

/// Error that moves the joint nine times in ten, over the command that it answers to; +∞: it hardly
/// moves.
/// @param lag  of the position [s]
double usual_error(const std::vector<Led>& all, double range, double lag) {
  std::vector<double> moving;
  for (const Led& of : all)
    for (long k = 0, told = 0; k < of.size(); ++k) {
      while (told < k && of.t[told + 1] <= of.t[k] - lag) ++told;
      if (const long end = of.later(k);
          end < of.size() && std::abs(of.q[end] - of.q[k]) > kMoves * range)
        moving.push_back(std::abs(of.q[told] + of.error[told] - of.q[k]));
    }
  return moving.size() < kFewest ? std::numeric_limits<double>::infinity()
                                 : quantile(std::move(moving), kMost);
}

/// Largest error to that side that lasts, of rows from first to last.
double lasting(const Led& of, double side, long first, long last) {
  double out = -std::numeric_limits<double>::infinity();
  for (long k = first; k <= last; ++k) {
    const long end = std::min(of.later(k), last + 1);
    if (end > last && k > first) break;
    double least = side * of.error[k];
    for (long i = k; i < end; ++i) least = std::min(least, side * of.error[i]);
    out = std::max(out, least);
  }
  return out;
}

/// Rests of a joint to one side, at which it is held by the measure of find_held().
/// @return first and last row of each
std::vector<std::pair<long, long>> held_rests(const Led& of, double side, double usual) {
  std::vector<std::pair<long, long>> out;
  for (long first = 0; first < of.size();) {
    double low = of.q[first], high = low;
    long last = first;
    while (last + 1 < of.size()) {
      const double next = of.q[last + 1];
      if (std::max(high, next) - std::min(low, next) > kRests * usual) break;
      low = std::min(low, next);
      high = std::max(high, next);
      ++last;
    }
    if (of.later(first) > last) {
      ++first;
      continue;
    }
    const long end = last + 1;
    long before = first;
    while (before > 0 && of.t[first] - of.t[before] < kLasts) --before;
    const bool arrives = side * (of.q[first] - of.q[before]) > 0.0,
               comes_back = end < of.size() && side * of.error[last] < kBack * usual;
    const double leaves = std::max(side * of.error[last], 0.0);
    if (arrives && comes_back && lasting(of, side, first, last) > leaves + kFurther * usual) {
      // A stop gives before it holds.
      const double from = side * of.q[first] - usual;
      while (first > 0 && side * of.error[first - 1] > usual && side * of.q[first - 1] > from)
        --first;
      out.emplace_back(first, last);
    }
    first = end;
  }
  return out;
}

}  // namespace

std::vector<HeldRows> find_held(const std::vector<Recording>& recordings, int joint) {
  const std::vector<Led> all = led(recordings, joint);
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Led& of : all)
    for (const double q : of.q) low = std::min(low, q), high = std::max(high, q);
  const std::optional<CommandLag> lag = find_command_lag(recordings, joint);
  const double usual = usual_error(all, high - low, lag ? lag->seconds : 0.0);
  std::vector<HeldRows> out;
  if (!std::isfinite(usual) || !(usual > 0.0)) return out;
  for (const double side : {1.0, -1.0}) {
    double begins = std::numeric_limits<double>::infinity(), ends = -begins;
    std::vector<std::vector<bool>> is_held;
    for (const Led& of : all) {
      std::vector<bool> rows(static_cast<std::size_t>(of.size()), false);
      for (const auto& [first, last] : held_rests(of, side, usual)) {
        for (long k = first; k <= last; ++k) rows[static_cast<std::size_t>(k)] = true;
        begins = std::min(begins, side * of.q[first]);
        ends = std::max(ends, side * of.q[last]);
      }
      is_held.push_back(std::move(rows));
    }
    if (!std::isfinite(begins)) continue;
    // Where nothing is seen beyond, it is a stop, and holds whenever the joint leans on it.
    const bool stop = (side > 0.0 ? high : -low) < ends + kRests * usual;
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Led& of = all[i];
      const auto holds = [&](long k) {
        return is_held[i][static_cast<std::size_t>(k)] ||
               (stop && side * of.q[k] >= begins && side * of.error[k] > usual);
      };
      for (long k = 0; k < of.size(); ++k) {
        if (!holds(k)) continue;
        long last = k;
        while (last + 1 < of.size() && holds(last + 1)) ++last;
        const auto [least, most] = std::minmax_element(of.q.begin() + k, of.q.begin() + last + 1);
        const double at = side > 0.0 ? *most : *least, beyond = side * lasting(of, side, k, last);
        // Once it is let go it has to catch up.
        while (last + 1 < of.size() && std::abs(of.q[last + 1] - at) < kRests * usual) ++last;
        last = std::min(of.later(last), of.size() - 1);
        out.push_back({of.recording, of.row[k], of.row[last] - of.row[k] + 1, at, beyond});
        k = last;
      }
    }
  }
  return out;
}

std::string held_text(const std::vector<Recording>& recordings, const std::vector<HeldRows>& held,
                      const std::string& unit) {
  double seconds = 0.0;
  for (const HeldRows& h : held) {
    const VecX<double>& t = recordings[h.recording].time;
    seconds += t[h.first + h.rows - 1] - t[h.first];
  }
  const auto far = [](const HeldRows& h) { return std::abs(h.beyond); };
  const HeldRows& most = *std::ranges::max_element(held, {}, far);
  const Recording& r = recordings[most.recording];
  return "is held near " + number_text(most.at) + " " + unit +
         " (at t = " + number_text(r.time[most.first]) + " s of " + r.source + "; " +
         number_text(seconds) + " s in all), while its command is " + number_text(far(most)) + " " +
         unit +
         " further on: an end stop or that of its sensor, a limit of its drive, or "
         "something in its way";
}

}  // namespace diffnea::detail
