#include "identify/bounce_guess.hpp"

#include <algorithm>
#include <cmath>

#include "core/statistics.hpp"
#include "identify/ball_rows.hpp"

namespace diffnea {
namespace {

constexpr std::size_t kSideRows = 5;       ///< rows on either side of a bounce
constexpr std::size_t kEnoughBounces = 3;  ///< bounces

/// x + v t of least squares through rows [first, first + kSideRows), gravity's ½ g t² taken off.
ParticleState<double> free_flight(const BallWindow& w, std::size_t first, double t0,
                                  const Vec3<double>& gravity) {
  double sum_t = 0.0, sum_tt = 0.0;
  Vec3<double> sum{0, 0, 0}, sum_times{0, 0, 0};
  for (std::size_t k = first; k < first + kSideRows; ++k) {
    const double t = w.time[k] - t0;
    const Vec3<double> x = w.seen[k] - gravity * (0.5 * t * t);
    sum_t += t;
    sum_tt += t * t;
    sum = sum + x;
    sum_times = sum_times + x * t;
  }
  constexpr auto n = static_cast<double>(kSideRows);
  const Vec3<double> v = (sum_times * n - sum * sum_t) * (1.0 / (n * sum_tt - sum_t * sum_t));
  return {(sum - v * sum_t) * (1.0 / n), v};
}

}  // namespace

std::optional<BounceGuess> guess_bounce(const BallData& data, const BallSpec& ball,
                                        const Vec3<double>& gravity, double longest_gap) {
  std::vector<double> restitution, friction, height;
  for (const BallWindow& w : data.windows) {
    const std::vector<bool> kinks = find_kinks(w.time, w.seen, longest_gap);
    for (std::size_t k = kSideRows; k + kSideRows < kinks.size(); ++k) {
      if (!kinks[k]) continue;
      const auto at = kinks.begin() + static_cast<std::ptrdiff_t>(k);
      constexpr auto side = static_cast<std::ptrdiff_t>(kSideRows);
      if (std::find(at - side, at, true) != at ||
          std::find(at + 1, at + side + 1, true) != at + side + 1)
        continue;
      if (w.time[k + kSideRows] - w.time[k - kSideRows] > 2.0 * longest_gap) continue;
      const double t0 = w.time[k];
      const ParticleState<double> before = free_flight(w, k - kSideRows, t0, gravity),
                                  after = free_flight(w, k + 1, t0, gravity);
      // x_b + v_b t = x_a + v_a t of the heights
      const double t = (after.x.z - before.x.z) / (before.v.z - after.v.z);
      const double down = -(before.v.z + gravity.z * t), up = after.v.z + gravity.z * t;
      if (!(down > 0.0 && up > 0.0)) continue;
      restitution.push_back(std::min(1.0, up / down));
      height.push_back(before.x.z + before.v.z * t + 0.5 * gravity.z * t * t - ball.radius);
      // Friction acts against the slip of the point of contact, v_t + ω × (−r n).
      const double x = before.v.x - w.spin.y * ball.radius, y = before.v.y + w.spin.x * ball.radius;
      const double lost = x * (before.v.x - after.v.x) + y * (before.v.y - after.v.y);
      friction.push_back(std::max(0.0, lost / (std::hypot(x, y) * (down + up))));
    }
  }
  if (restitution.size() < kEnoughBounces) return std::nullopt;
  return BounceGuess{median(restitution), median(friction), median(height)};
}

}  // namespace diffnea
