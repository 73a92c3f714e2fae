#include <algorithm>

#include <diffnea/motion/horizon.hpp>

namespace diffnea {

std::vector<double> horizons(const std::vector<MotionStretch>& stretches, const SensorNoise& noise,
                             const MotionOptions& options) {
  constexpr double kShortest = 0.1;  // [s] arms hardly move within less
  constexpr double kRows = 12.0;     // positions of the slowest sensor: a state is two numbers
  double longest = 0.0;
  for (const MotionStretch& s : stretches) longest = std::max(longest, s.length());
  if (options.horizon > 0.0) longest = std::min(longest, options.horizon);
  const double slowest = noise.period.size() > 0 ? noise.period.maxCoeff() : 0.0;
  double at =
      options.first_horizon > 0.0 ? options.first_horizon : std::max(kShortest, kRows * slowest);
  std::vector<double> out;
  // The last doubling ends at the longest itself: a horizon a little shorter would teach nothing.
  for (; at < longest / 1.4; at *= 2.0) out.push_back(at);
  out.push_back(longest);
  return out;
}

}  // namespace diffnea
