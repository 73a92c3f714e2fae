#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/sim/ball_in_cup.hpp>

#include "core/c_numbers.hpp"

namespace diffnea {
namespace {

std::string seconds(double t) {
  char buffer[32];
  detail::print(buffer, sizeof buffer, "%.2f s", t);
  return buffer;
}

std::string millimetres(double x) {
  char buffer[32];
  detail::print(buffer, sizeof buffer, "%.0f mm", 1e3 * x);
  return buffer;
}

/// The ball in the cup's frame: along its axis, and off it.
struct CupPlace {
  double height, radius;
};
std::vector<CupPlace> places(const RowMatX<double>& ball, const RowMatX<double>& cup,
                             const RowMatX<double>& axis) {
  std::vector<CupPlace> out;
  for (long k = 0; k < ball.rows(); ++k) {
    const Eigen::Vector3d off = ball.row(k) - cup.row(k), m = axis.row(k);
    const double h = off.dot(m);
    out.push_back({h, (off - h * m).norm()});
  }
  return out;
}

void check(const VecX<double>& time, const RowMatX<double>& ball, const RowMatX<double>& cup,
           const RowMatX<double>& axis, const SuccessOptions& o) {
  for (const RowMatX<double>* x : {&ball, &cup, &axis}) {
    require_size("ball_in_cup: rows", x->rows(), time.size(), "time");
    require_size("ball_in_cup: columns", x->cols(), 3, "axis of W");
  }
  const double length = time.size() > 0 ? time[time.size() - 1] - time[0] : 0.0;
  if (!(length >= o.window) || !(o.window > 0.0))
    throw DataError("ball_in_cup: the series lasts " + seconds(length) +
                    ", expected at least the window of " + seconds(o.window));
}

/// How near to a catch a ball came that never was in the cup.
std::string missed(const std::vector<CupPlace>& all, const CupSpec& cup) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  double highest = -kInfinity, closest = kInfinity;  // where it comes down past the rim
  for (std::size_t k = 0; k < all.size(); ++k) {
    highest = std::max(highest, all[k].height);
    if (k > 0 && all[k - 1].height >= cup.rim && all[k].height < cup.rim)
      closest = std::min(closest, all[k].radius);
  }
  if (highest < cup.rim) return "never above the rim: " + millimetres(cup.rim - highest) + " short";
  if (closest == kInfinity) return "never in the cup: it did not come down past the rim";
  return "never in the cup: it came down " + millimetres(closest) + " off the axis";
}

}  // namespace

BallVerdict judge_ball(const VecX<double>& time, const RowMatX<double>& ball,
                       const RowMatX<double>& cup, const RowMatX<double>& axis, const CupSpec& spec,
                       const SuccessOptions& o) {
  check(time, ball, cup, axis, o);
  const std::vector<CupPlace> all = places(ball, cup, axis);
  const auto inside = [&](const CupPlace& p) {
    return p.height > spec.floor && p.height < spec.rim && p.radius < spec.inner_radius + o.slack;
  };
  const long last = time.size() - 1;
  long since = last + 1;  // the ball is in the cup from this row to the end
  while (since > 0 && inside(all[since - 1])) --since;
  constexpr double kRounding = 1e-9;  // of sampled times [s]
  if (since <= last && time[since] <= time[last] - o.window + kRounding)
    return {Outcome::kInCup, "in the cup since " + seconds(time[since])};
  if (since <= last)
    return {Outcome::kLate, "in the cup for the last " + seconds(time[last] - time[since]) +
                                " only, expected " + seconds(o.window)};

  long window = last;
  while (window > 0 && time[window - 1] >= time[last] - o.window - kRounding) --window;
  // How far a ball that touches the cup can be; balls are smaller than cups.
  const double reach = spec.inner_radius, outer = spec.inner_radius + spec.wall + reach;
  const auto stays = [&](double low, double high) {
    return std::all_of(all.begin() + window, all.end(), [&](const CupPlace& p) {
      return p.height >= low && p.height < high && p.radius < outer;
    });
  };
  const std::string where = millimetres(all[last].height) + " high and " +
                            millimetres(all[last].radius) + " off the axis";
  if (stays(spec.rim, spec.rim + reach)) return {Outcome::kRim, "on the rim: " + where};
  const auto was_inside = std::find_if(all.rbegin(), all.rend(), inside);
  if (was_inside != all.rend())
    return {Outcome::kFellOut, "fell out at " + seconds(time[all.rend() - was_inside - 1])};
  if (stays(spec.floor - reach, spec.rim)) return {Outcome::kBeside, "beside the cup: " + where};
  return {Outcome::kMissed, missed(all, spec)};
}

bool ball_in_cup(const VecX<double>& time, const RowMatX<double>& ball, const RowMatX<double>& cup,
                 const RowMatX<double>& axis, const CupSpec& spec, const SuccessOptions& options) {
  return judge_ball(time, ball, cup, axis, spec, options).outcome == Outcome::kInCup;
}

}  // namespace diffnea
