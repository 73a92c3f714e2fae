#include "diagnose/unsteady.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "core/constants.hpp"
#include "core/statistics.hpp"
#include "recording/spectrum.hpp"

namespace diffnea {
namespace {

// --- oscillations

/// Half of the main lobe of the window of detail::welch [bins].
constexpr long kLobe = 5;
/// Bins to each side that tell the spectrum about a line.
constexpr long kAbout = 24;
/// Steps of a bin in the search of its frequency.
constexpr int kSteps = 8;
/// Chance that noise of a smooth spectrum has such a line, in one joint of one recording.
constexpr double kChance = 1e-3;
/// Amplitude of the error's line over the torque's from which it is none of the motion's: a model
/// explains more of these than half.
constexpr double kOwn = 0.5;
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
  return (rest.used.empty() || rest.used[k * rest.evidence.times() + i]) &&
         !rest.evidence.rests(i, k);
}

/// Rows of one joint between gaps of the time.
struct Stretch {
  VecX<double> rows;     ///< 0 where they do not count
  VecX<double> counted;  ///< 1 where they count, else 0
};

std::vector<Stretch> stretches_of(const Rest& rest, long k, const VecX<double>& rows, bool all) {
  const Evidence& e = rest.evidence;
  std::vector<Stretch> out;
  const long m = e.times();
  for (long begin = 0, end = 0; begin < m; begin = end) {
    while (end < m && e.stretch()[end] == e.stretch()[begin]) ++end;
    Stretch s{rows.segment(k * m + begin, end - begin), VecX<double>::Ones(end - begin)};
    for (long i = begin; i < end && !all; ++i)
      if (!counts(rest, k, i)) s.rows[i - begin] = s.counted[i - begin] = 0.0;
    out.push_back(std::move(s));
  }
  return out;
}

double sum_of_squares(const std::vector<Stretch>& stretches) {
  double out = 0.0;
  for (const Stretch& s : stretches) out += s.rows.squaredNorm();
  return out;
}

/// Rows without what an oscillation explains of them, its amplitude and phase fitted stretch by
/// stretch. @param turn  2π times its frequency [rad/row]
std::vector<Stretch> without(const std::vector<Stretch>& stretches, double turn) {
  std::vector<Stretch> out = stretches;
  for (Stretch& s : out) {
    const auto phase =
        VecX<double>::LinSpaced(s.rows.size(), 0.0, turn * static_cast<double>(s.rows.size() - 1));
    MatX<double> wave(s.rows.size(), 2);
    wave << phase.array().sin().matrix().cwiseProduct(s.counted),
        phase.array().cos().matrix().cwiseProduct(s.counted);
    const Eigen::Matrix2d K = wave.transpose() * wave + 1e-12 * Eigen::Matrix2d::Identity();
    s.rows -= wave * K.ldlt().solve(wave.transpose() * s.rows).eval();
  }
  return out;
}

detail::Spectrum spectrum(const std::vector<Stretch>& stretches, double rate_hz, long length) {
  std::vector<Eigen::VectorXd> rows;
  for (const Stretch& s : stretches) rows.push_back(s.rows);
  return detail::welch(rows, rate_hz, length);
}

double sum(const std::vector<double>& power, long from, long to) {
  double out = 0.0;
  for (long b = std::max(from, 0L); b <= std::min(to, std::ssize(power) - 1); ++b) out += power[b];
  return out;
}

/// A peak of a spectrum.
struct Line {
  double frequency_hz = 0.0, width_hz = 0.0;
  double share = 0.0;   ///< explained part of the mean square
  double above = 0.0;   ///< power over the median of what its surroundings have without it
  double square = 0.0;  ///< explained sum of squares
};

/// Oscillation about a bin that explains most. Rows that do not count spread its line over its
/// surroundings, so that these are seen once it is taken out.
Line line_at(const std::vector<Stretch>& stretches, const detail::Spectrum& of, long bin) {
  const double whole = sum_of_squares(stretches), row = 2.0 * kPi / of.rate_hz;
  Line out;
  out.width_hz = of.frequency(kLobe);
  std::vector<Stretch> left;
  for (int step = -kSteps; step <= kSteps; ++step) {
    const double hz =
        (static_cast<double>(bin) + step / static_cast<double>(kSteps)) * of.frequency(1);
    std::vector<Stretch> rest = without(stretches, row * hz);
    const double square = whole - sum_of_squares(rest);
    if (square <= out.square) continue;
    out.square = square;
    out.frequency_hz = hz;
    left = std::move(rest);
  }
  if (left.empty()) return out;
  out.share = out.square / whole;
  const long bins = std::ssize(of.power);
  const detail::Spectrum rest = spectrum(left, of.rate_hz, 2 * (bins - 1));
  std::vector<double> beside;
  for (long b = std::max(1L, bin - kAbout); b <= std::min(bin + kAbout, bins - 1); ++b)
    if (std::abs(b - bin) > kLobe) beside.push_back(rest.power[b]);
  out.above = sum(of.power, bin - 1, bin + 1) / (3.0 * std::max(median(beside), 1e-300));
  return out;
}

std::vector<Line> lines(const Rest& rest, long k) {
  const std::vector<Stretch> left = stretches_of(rest, k, rest.left, false),
                             torque = stretches_of(rest, k, rest.evidence.torque(), true);
  long longest = 0, length = 1;
  for (const Stretch& s : left) longest = std::max<long>(longest, s.rows.size());
  while (2 * length <= longest) length *= 2;
  if (length < 4 * kAbout) return {};
  const double rate_hz = 1.0 / rest.evidence.step();
  const detail::Spectrum of = spectrum(left, rate_hz, length),
                         all = spectrum(torque, rate_hz, length);
  const long bins = std::ssize(of.power);
  const double whole = sum(of.power, 0, bins - 1);
  // Power of noise is distributed exponentially, with ln 2 of its mean as median.
  const double limit = std::log(static_cast<double>(bins) / kChance) / std::numbers::ln2;
  std::vector<Line> out;
  for (long b = kLobe; b + 1 < bins; ++b) {
    const double power = of.power[b];
    if (power < of.power[b - 1] || power < of.power[b + 1] ||
        sum(of.power, b - kLobe, b + kLobe) < kWorth * whole)
      continue;
    const Line line = line_at(left, of, b);
    if (line.share < kWorth || line.above < limit) continue;
    const Line driven = line_at(torque, all, b);
    if (line.square > kOwn * kOwn * driven.square || line.above > driven.above) out.push_back(line);
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
  const int joint = e.joints()[k];
  const VecX<double> q = e.q(k).col(joint), qd = e.qd(k).col(joint);
  std::vector<Block> out;
  for (long begin = 0; begin + length <= m; begin += length) {
    Block block;
    double rows = 0.0;
    for (long i = begin; i < begin + length; ++i) {
      if (!counts(rest, k, i) || e.stretch()[i] != e.stretch()[begin]) continue;
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
  double position = 0.0, speed = 0.0, torque = 0.0;  // mean squares
  for (const Block& b : all) {
    position += (b.position - middle) * (b.position - middle) / count;
    speed += b.speed * b.speed / count;
    torque += b.torque * b.torque / count;
  }
  std::vector<double> squares;
  for (const Block& b : all) squares.push_back(b.square);
  const double usual = median(std::move(squares));
  for (const Block& b : all) {
    // Few are that loud at all: of a long recording, only these look for their like.
    if (b.square < kBurst * usual || b.speed * b.speed < kSlow * kSlow * speed) continue;
    std::vector<std::pair<double, double>> others;  // how far their motion is, their mean square
    for (const Block& o : all)
      if (&o != &b)
        others.push_back({std::pow(o.position - b.position, 2) / position +
                              std::pow(o.speed - b.speed, 2) / speed +
                              std::pow(o.torque - b.torque, 2) / torque,
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
