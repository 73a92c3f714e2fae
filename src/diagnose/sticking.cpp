#include "diagnose/sticking.hpp"

#include <algorithm>
#include <cmath>
#include <deque>

namespace diffnea {
namespace {

/// Peak to peak, in standard deviations: what white noise of fifty rows does not leave (0.1 %).
constexpr double kPeakToPeak = 6.0;
/// Of the joint's RMS velocity: whoever crosses the band faster moves.
constexpr double kSlow = 0.1;
/// Of the time that a reversal at the RMS acceleration takes within the band: softer reversals show
/// what friction does at low speed (Stribeck).
constexpr double kLonger = 1.2;
/// Of the filter's cut-off: what is shorter, it smooths as it does any reversal.
constexpr double kOfCutOff = 0.25;

}  // namespace

Standstill standstill(double q_noise, double qd, double qdd, double filter_hz, double dt) {
  const double band = kPeakToPeak * q_noise;
  const double reversal = qdd > 0.0 ? 2.0 * std::sqrt(2.0 * band / qdd) : 0.0;
  const double crossing = qd > 0.0 ? band / (kSlow * qd) : 0.0;
  const double seconds = std::max({kOfCutOff / filter_hz, kLonger * reversal, crossing});
  return {band, std::max(2L, std::lround(seconds / dt) + 1)};
}

std::vector<bool> stands_still(const Eigen::Ref<const VecX<double>>& q, const Standstill& still) {
  std::vector<bool> out(static_cast<std::size_t>(q.size()), false);
  std::deque<long> low, high;  // rows of the window's smallest and largest positions, in order
  long marked = 0;
  for (long i = 0; i < q.size(); ++i) {
    while (!low.empty() && q[low.back()] >= q[i]) low.pop_back();
    while (!high.empty() && q[high.back()] <= q[i]) high.pop_back();
    low.push_back(i);
    high.push_back(i);
    const long first = i - still.rows + 1;
    if (low.front() < first) low.pop_front();
    if (high.front() < first) high.pop_front();
    if (first < 0 || q[high.front()] - q[low.front()] > still.band) continue;
    for (marked = std::max(marked, first); marked <= i; ++marked)
      out[static_cast<std::size_t>(marked)] = true;
  }
  return out;
}

}  // namespace diffnea
