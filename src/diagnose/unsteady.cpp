#include "diagnose/unsteady.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "core/statistics.hpp"
#include "recording/spectrum.hpp"

namespace diffnea {
namespace {

// --- oscillations

/// Half of the main lobe of the window of detail::welch [bins].
constexpr long kLobe = 5;
/// Bins to each side that tell the spectrum about a line.
constexpr long kAbout = 24;
/// Chance that noise of a smooth spectrum has such a line, in one joint of one recording.
constexpr double kChance = 1e-3;
/// Share of the mean square that is left from which an oscillation is worth a word.
constexpr double kWorth = 0.1;

// --- bursts

/// Length of a block [s]: a blow and what it sets in motion.
constexpr double kBlow = 0.2;
/// Blocks of the most similar motion that tell how much noise goes with it.
constexpr std::size_t kAlike = 6;
/// Mean square of a burst over all of theirs but one: less than 8 in seven arms that hide nothing,
/// up to 170 where something strikes.
constexpr double kBurst = 10.0;
/// Share of the mean square that is left which bursts hold.
constexpr double kMostOfIt = 0.3;
/// Share of the root mean square velocity: slower blocks may stick, and then have any torque.
constexpr double kSlow = 0.2;

bool counts(const Rest& rest, long k, long i) {
  return (rest.used.empty() ||
          rest.used[static_cast<std::size_t>(k * rest.evidence.times() + i)]) &&
         !rest.evidence.rests(i, k);
}

/// Rows of one joint, stretch by stretch; those that do not count are 0.
std::vector<VecX<double>> stretches_of(const Rest& rest, long k, const VecX<double>& rows) {
  const Evidence& e = rest.evidence;
  std::vector<VecX<double>> out;
  const long m = e.times();
  for (long begin = 0, end = 0; begin < m; begin = end) {
    while (end < m && e.stretch()[static_cast<std::size_t>(end)] ==
                          e.stretch()[static_cast<std::size_t>(begin)])
      ++end;
    out.push_back(rows.segment(k * m + begin, end - begin));
    for (long i = begin; i < end; ++i)
      if (!counts(rest, k, i)) out.back()[i - begin] = 0.0;
  }
  return out;
}

/// A peak of a spectrum.
struct Line {
  double frequency_hz = 0.0, width_hz = 0.0;
  double share = 0.0;  ///< in the whole spectrum
};

double sum(const std::vector<double>& power, long from, long to) {
  double out = 0.0;
  for (long b = std::max(from, 0L); b <= std::min(to, std::ssize(power) - 1); ++b)
    out += power[static_cast<std::size_t>(b)];
  return out;
}

/// Power about a bin over the median of its surroundings.
double stands_out(const std::vector<double>& power, long bin) {
  std::vector<double> beside;
  for (long b = std::max(1L, bin - kAbout); b <= std::min(bin + kAbout, std::ssize(power) - 1); ++b)
    if (std::abs(b - bin) > kLobe) beside.push_back(power[static_cast<std::size_t>(b)]);
  return sum(power, bin - 1, bin + 1) / (3.0 * std::max(median(beside), 1e-300));
}

/// Where a parabola through the logarithms about a peak has its top [bins].
double top(const std::vector<double>& power, long bin) {
  const auto level = [&](long b) {
    return std::log(std::max(power[static_cast<std::size_t>(b)], 1e-300));
  };
  const double before = level(bin - 1), at = level(bin), after = level(bin + 1);
  const double bend = before - 2.0 * at + after;
  return static_cast<double>(bin) + (bend < 0.0 ? 0.5 * (before - after) / bend : 0.0);
}

std::vector<Line> lines(const Rest& rest, long k) {
  const std::vector<VecX<double>> left = stretches_of(rest, k, rest.left),
                                  torque = stretches_of(rest, k, rest.evidence.torque());
  long longest = 0, length = 1;
  for (const VecX<double>& s : left) longest = std::max<long>(longest, s.size());
  while (2 * length <= longest) length *= 2;
  if (length < 4 * kAbout) return {};
  const double rate_hz = 1.0 / rest.evidence.step();
  const detail::Spectrum of = detail::welch(left, rate_hz, length),
                         all = detail::welch(torque, rate_hz, length);
  const long bins = std::ssize(of.power);
  const double whole = sum(of.power, 0, bins - 1);
  // Power of noise is distributed exponentially, with ln 2 of its mean as median.
  const double limit = std::log(static_cast<double>(bins) / kChance) / std::numbers::ln2;
  std::vector<Line> out;
  for (long b = kLobe; b + 1 < bins; ++b) {
    const double power = of.power[static_cast<std::size_t>(b)];
    if (power < of.power[static_cast<std::size_t>(b - 1)] ||
        power < of.power[static_cast<std::size_t>(b + 1)])
      continue;
    const double share = sum(of.power, b - kLobe, b + kLobe) / whole,
                 out_of = stands_out(of.power, b);
    if (share > kWorth && out_of > limit && out_of > stands_out(all.power, b))
      out.push_back({top(of.power, b) * of.frequency(1), of.frequency(kLobe), share});
  }
  return out;
}

std::optional<Unsteady> oscillation(const Rest& fitted, const Rest& held_out, long k) {
  std::optional<Unsteady> best;
  const std::vector<Line> there = lines(held_out, k);
  for (const Line& line : lines(fitted, k))
    for (const Line& again : there)
      if (std::abs(line.frequency_hz - again.frequency_hz) <
              std::max(line.width_hz, again.width_hz) &&
          (!best || line.share > best->share))
        best = Unsteady{k, line.frequency_hz, line.share};
  return best;
}

/// Means over the rows of a block that count.
struct Block {
  double position = 0.0, speed = 0.0, torque = 0.0, square = 0.0;
};

std::vector<Block> blocks(const Rest& rest, long k) {
  const Evidence& e = rest.evidence;
  const long m = e.times(), length = std::max(4L, std::lround(kBlow / e.step()));
  const int joint = e.joints()[static_cast<std::size_t>(k)];
  const VecX<double> q = e.q(k).col(joint), qd = e.qd(k).col(joint);
  std::vector<Block> out;
  for (long begin = 0; begin + length <= m; begin += length) {
    Block block;
    double rows = 0.0;
    for (long i = begin; i < begin + length; ++i) {
      if (!counts(rest, k, i) ||
          e.stretch()[static_cast<std::size_t>(i)] != e.stretch()[static_cast<std::size_t>(begin)])
        continue;
      ++rows;
      block.position += q[i];
      block.speed += qd[i];
      block.torque += e.torque()[k * m + i];
      block.square += rest.left[k * m + i] * rest.left[k * m + i];
    }
    if (2.0 * rows < static_cast<double>(length)) continue;
    for (double* x : {&block.position, &block.speed, &block.torque, &block.square}) *x /= rows;
    out.push_back(block);
  }
  return out;
}

/// Share of the mean square that bursts hold.
double of_bursts(const Rest& rest, long k) {
  const std::vector<Block> all = blocks(rest, k);
  if (all.size() < 4 * kAlike) return 0.0;
  const double count = static_cast<double>(all.size());
  double middle = 0.0, whole = 0.0, held = 0.0;
  for (const Block& b : all) middle += b.position / count, whole += b.square;
  double position = 0.0, speed = 0.0, torque = 0.0;
  for (const Block& b : all) {
    position += (b.position - middle) * (b.position - middle) / count;
    speed += b.speed * b.speed / count;
    torque += b.torque * b.torque / count;
  }
  position = std::sqrt(position), speed = std::sqrt(speed), torque = std::sqrt(torque);
  for (const Block& b : all) {
    if (std::abs(b.speed) < kSlow * speed) continue;
    std::vector<std::pair<double, double>> others;  // how far their motion is, their mean square
    for (const Block& o : all)
      if (&o != &b)
        others.push_back({std::hypot((o.position - b.position) / position,
                                     (o.speed - b.speed) / speed, (o.torque - b.torque) / torque),
                          o.square});
    std::ranges::nth_element(others, others.begin() + kAlike);
    std::vector<double> alike;
    for (std::size_t i = 0; i < kAlike; ++i) alike.push_back(others[i].second);
    std::ranges::nth_element(alike, alike.begin() + 1, std::greater<>{});  // one may be its own end
    if (b.square > kBurst * alike[1]) held += b.square;
  }
  return whole > 0.0 ? held / whole : 0.0;
}

}  // namespace

std::vector<Unsteady> find_unsteady(const Rest& fitted, const Rest& held_out) {
  std::vector<Unsteady> out;
  for (long k = 0; k < std::ssize(fitted.evidence.joints()); ++k) {
    if (fitted.evidence.passive(k)) continue;
    if (const std::optional<Unsteady> line = oscillation(fitted, held_out, k))
      out.push_back(*line);
    else if (const double share = of_bursts(fitted, k);
             share > kMostOfIt && of_bursts(held_out, k) > kMostOfIt)
      out.push_back({k, 0.0, share});
  }
  return out;
}

}  // namespace diffnea
