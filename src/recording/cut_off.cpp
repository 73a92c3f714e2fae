#include "recording/cut_off.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "core/statistics.hpp"
#include "recording/path_smoother.hpp"
#include "recording/spectrum.hpp"

namespace diffnea::detail {
namespace {

/// Root mean square over that of quiet windows, above which one holds an event: windows of Gaussian
/// noise stay below twice.
constexpr double kEvent = 5.0;
/// Share of the windows with events that a path may pass over: a start from rest is one in some
/// ten seconds.
constexpr double kFew = 0.05;
/// Step between cut-offs that are tried.
constexpr double kHigher = 1.5;
/// Share of the usual speed from which a window moves: at rest a coarse encoder has no noise.
constexpr double kMoves = 0.05;
constexpr long kFewestWindows = 20;
/// Means of rows in a window: an event of one period of the cut-off has no more to tell, and noise
/// is that much less.
constexpr long kMeans = 16;

/// Positions less a path of them, window by window of one period of its cut-off.
struct Windows {
  long rows = 0;                     ///< a window
  std::vector<std::size_t> segment;  ///< whose
  std::vector<long> first;           ///< row of that segment
  std::vector<double> left;          ///< root mean square of means of its rows
  std::vector<bool> events;          ///< holds one
  double share = 0.0;                ///< moving windows with events, of all of these
};

/// Root mean square of means of `mean` rows.
double of_means(const VecX<double>& x, long mean) {
  double squares = 0.0;
  const long count = x.size() / mean;
  for (long i = 0; i < count; ++i) squares += std::pow(x.segment(i * mean, mean).mean(), 2);
  return std::sqrt(squares / static_cast<double>(count));
}

/// @param noise  of the positions, where it is white: no window is quieter
Windows windows_of(const std::vector<Eigen::VectorXd>& segments, double rate_hz, double cutoff_hz,
                   double noise) {
  const PathSmoother smoother(cutoff_hz, rate_hz);
  Windows out;
  out.rows = std::max(4L, std::lround(rate_hz / cutoff_hz));
  const long mean = std::max(1L, out.rows / kMeans);
  std::vector<double> speed;
  RowMatX<double> q, qd, qdd;
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Eigen::VectorXd& y = segments[i];
    if (y.size() < std::max(out.rows, kFewestPathRows)) continue;
    smoother.smooth(y, q, qd, qdd);
    for (long at = 0; at + out.rows <= y.size(); at += out.rows) {
      out.segment.push_back(i);
      out.first.push_back(at);
      out.left.push_back(of_means(y.segment(at, out.rows) - q.col(0).segment(at, out.rows), mean));
      speed.push_back(qd.col(0).segment(at, out.rows).norm());
    }
  }
  out.events.assign(out.left.size(), false);
  const double usual_speed = median(speed);
  std::vector<double> moving;
  for (std::size_t i = 0; i < out.left.size(); ++i)
    if (speed[i] > kMoves * usual_speed) moving.push_back(out.left[i]);
  if (std::ssize(moving) < kFewestWindows) return out;
  // The quieter half's middle: where events are as many as windows, a motion's usual is no noise.
  const double most =
      kEvent * std::max(quantile(moving, 0.25), noise / std::sqrt(static_cast<double>(mean)));
  for (std::size_t i = 0; i < out.left.size(); ++i) out.events[i] = out.left[i] > most;
  out.share =
      static_cast<double>(std::ranges::count_if(moving, [&](double x) { return x > most; })) /
      static_cast<double>(moving.size());
  return out;
}

}  // namespace

long window_length(const std::vector<Eigen::VectorXd>& segments, double dt) {
  long longest = 0;
  for (const Eigen::VectorXd& s : segments) longest = std::max<long>(longest, s.size());
  long length = 16;
  while (2.0 * static_cast<double>(length) * dt <= 10.0 && 6 * length <= longest) length *= 2;
  return length <= longest ? length : 0;
}

PositionSpectrum look_at_position(const std::vector<Eigen::VectorXd>& segments, double rate_hz,
                                  double step) {
  // Positions are a few slow lines 100 dB above their noise, which side lobes would hide: their
  // second difference goes into the window.
  std::vector<Eigen::VectorXd> second;
  for (const Eigen::VectorXd& s : segments)
    if (s.size() > 2)
      second.emplace_back(s.tail(s.size() - 2) - 2.0 * s.segment(1, s.size() - 2) +
                          s.head(s.size() - 2));
  PositionSpectrum out;
  const long length = window_length(second, 1.0 / rate_hz);
  if (length == 0) return out;
  const Spectrum spectrum = welch(second, rate_hz, length);
  const long num_bins = static_cast<long>(spectrum.power.size());
  const long end = num_bins - num_bins / 10;  // the last tenth is folded

  // Mean over an eighth of the frequency either way, at least over the window's main lobe.
  std::vector<double> acceleration(num_bins, 0.0), position(num_bins, 0.0), integrated(num_bins);
  for (long i = 1; i < num_bins; ++i) {
    const double w = 2.0 * std::sin(std::numbers::pi * spectrum.frequency(i) / rate_hz);
    integrated[i] = spectrum.power[i] / (w * w * w * w);
  }
  for (long k = 1; k < num_bins; ++k) {
    const long reach = std::max(3L, k / 8);
    const long first = std::max(1L, k - reach), last = std::min(num_bins - 1, k + reach);
    const double bins = static_cast<double>(last - first + 1);
    for (long i = first; i <= last; ++i) {
      acceleration[k] += spectrum.power[i] / bins;
      position[k] += integrated[i] / bins;
    }
  }

  // From the motion's peak: of the positions, because that of the accelerations may be noise.
  constexpr double kMotionAgain = 10.0;
  const auto peak = [&](long from) {
    return std::max_element(position.begin() + from, position.begin() + end) - position.begin();
  };
  long from = peak(1), lowest = from;
  while (true) {
    lowest = std::min_element(acceleration.begin() + from, acceleration.begin() + end) -
             acceleration.begin();
    const long again = peak(lowest);
    if (again <= from || position[again] < kMotionAgain * position[lowest]) break;
    const double variance =
        std::accumulate(integrated.begin() + lowest, integrated.begin() + end, 0.0) *
        spectrum.frequency(1);
    if (variance < 0.25 * step * step) break;
    from = again;
  }
  // The path's gain is flat to 4 % up to two thirds of its cut-off.
  out.cutoff_hz = 1.5 * spectrum.frequency(lowest);
  const long noise_from = std::min(lowest, end - end / 4);
  out.noise =
      std::sqrt(median({position.begin() + noise_from, position.begin() + end}) * 0.5 * rate_hz);

  double total = 0.0, sum = 0.0;
  for (long k = 1; k <= lowest; ++k) total += spectrum.power[k];
  out.acceleration = total * spectrum.frequency(1) * std::pow(rate_hz, 4);
  for (long k = 1; k <= lowest && sum < 0.99 * total; ++k) {
    sum += spectrum.power[k];
    out.busy_hz = spectrum.frequency(k);
  }
  return out;
}

double cutoff_of_events(const std::vector<Eigen::VectorXd>& segments, double rate_hz,
                        double cutoff_hz, double highest, double noise) {
  for (double hz = cutoff_hz; hz < highest; hz *= kHigher)
    if (windows_of(segments, rate_hz, hz, noise).share <= kFew) return hz;
  return cutoff_hz;
}

std::vector<std::vector<bool>> jerky_ends(const std::vector<Eigen::VectorXd>& segments,
                                          double rate_hz, double cutoff_hz, double noise) {
  std::vector<std::vector<bool>> out;
  for (const Eigen::VectorXd& y : segments)
    out.emplace_back(static_cast<std::size_t>(y.size()), false);
  const Windows windows = windows_of(segments, rate_hz, cutoff_hz, noise);
  const long count = std::ssize(windows.events);
  for (const bool backward : {false, true})
    for (long i = 0; i < count; ++i) {
      const std::size_t at = static_cast<std::size_t>(backward ? count - 1 - i : i);
      if (!windows.events[at]) continue;
      std::vector<bool>& rows = out[windows.segment[at]];
      const long first = windows.first[at], last = first + windows.rows, size = std::ssize(rows);
      const bool outermost = backward ? last + windows.rows > size : first == 0;
      if (!outermost && !rows[static_cast<std::size_t>(backward ? last : first - 1)]) continue;
      std::fill(rows.begin() + std::max(first - windows.rows, 0L),
                rows.begin() + std::min(last + windows.rows, size), true);
    }
  return out;
}

}  // namespace diffnea::detail
