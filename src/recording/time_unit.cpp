#include "recording/time_unit.hpp"

#include <cmath>
#include <numbers>
#include <utility>

#include <diffnea/core/error.hpp>

#include "core/number_text.hpp"
#include "core/statistics.hpp"

namespace diffnea::detail {
namespace {

/// Interval from which rows may be in another unit, and the length that makes a recording [s].
constexpr double kSlowest = 0.2, kShortest = 1.0;

/// Median interval [s]; NaN of less than two rows.
double usual_interval(const Recording& r) {
  std::vector<double> steps;
  for (long i = 1; i < r.rows(); ++i) steps.push_back(r.time[i] - r.time[i - 1]);
  return median(std::move(steps));
}

}  // namespace

std::string time_unit_question(const VecX<double>& time, double dt) {
  const double seconds = time.size() > 1 ? time[time.size() - 1] - time[0] : 0.0;
  if (!(dt >= kSlowest) || 1e-3 * seconds < kShortest) return "";
  return "rows are " + number_text(dt, 4) + " s apart, which makes " +
         number_text(seconds / 3600.0, 4) +
         " h of this recording: is the time in milliseconds? Name the column time [ms]";
}

std::string time_unit_question(const std::vector<Recording>& recordings) {
  for (const Recording& r : recordings)
    if (std::string question = time_unit_question(r.time, usual_interval(r)); !question.empty())
      return question;
  return "";
}

std::string slow_rows(const std::vector<Recording>& recordings) {
  if (std::string question = time_unit_question(recordings); !question.empty()) return question;
  for (const Recording& r : recordings)
    if (const double dt = usual_interval(r); dt >= kSlowest)
      return "rows are " + number_text(dt, 4) +
             " s apart: a robot's dynamics pass between two of them; log at 50 Hz and more";
  return "";
}

void require_unit_of_time(const std::vector<Recording>& recordings, double fitted,
                          double held_out) {
  for (const auto& [times, unit] : {std::pair{1e3, "ms"}, {1e6, "us"}, {1e9, "ns"}})
    for (const bool here : {true, false}) {
      const double share = here ? held_out / (times * fitted) : fitted / (times * held_out);
      if (!(std::abs(std::log(share)) < std::numbers::ln2)) continue;
      throw DataError(recordings.front().source + ": its rows are " + number_text(held_out, 4) +
                      " s apart, those that were fitted " + number_text(fitted, 4) +
                      " s: is the time of " + (here ? "this one" : "the fitted recording") +
                      " in " + unit + "? Then name its column `time [" + unit + "]`");
    }
}

}  // namespace diffnea::detail
