#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/ball_fit.hpp>

#include "core/decompositions.hpp"
#include "identify/ball_path.hpp"
#include "identify/ball_rows.hpp"

namespace diffnea {
namespace {

/// A distance is the string's length within this share of it.
constexpr double kNear = 0.02;
/// Acceleration across the string beside gravity's that a hanging ball may have, in g: drag, and
/// the parabolas' own error.
constexpr double kAcross = 0.3;
constexpr double kSigmas = 3.0;
constexpr long kMostSide = 5;          ///< rows on either side that an acceleration is read from
constexpr double kSideSeconds = 0.12;  ///< and how far they may be

struct Sighting {
  const HandMotion* hand;
  double time;
  Vec3<double> seen;
  bool moves = false;         ///< its acceleration is known
  Vec3<double> acceleration;  ///< [m/s²]
  double gain = 0.0;          ///< noise of the acceleration over the camera's [1/s²]
};

std::vector<Sighting> sightings(const BallData& data) {
  std::vector<Sighting> out;
  for (const BallWindow& w : data.windows) {
    const auto n = static_cast<long>(w.time.size());
    for (long k = 0; k < n; ++k) {
      Sighting s{&data.hands[static_cast<std::size_t>(w.hand)], w.time[k], w.seen[k], false, {}};
      long side = 0;
      while (side < kMostSide && k - side > 0 && k + side + 1 < n &&
             w.time[k + side + 1] - w.time[k - side - 1] <= 2.0 * kSideSeconds)
        ++side;
      if (side >= 2) {
        const double rows = 2.0 * static_cast<double>(side) + 1.0, squares = rows * rows,
                     step = (w.time[k + side] - w.time[k - side]) / (rows - 1.0);
        s.moves = true;
        s.acceleration = parabola(w.time, w.seen, k - side, k + side + 1, w.time[k]).a;
        s.gain = std::sqrt(720.0 / (rows * (squares - 1.0) * (squares - 4.0))) / (step * step);
      }
      out.push_back(s);
    }
  }
  return out;
}

/// Of the camera [m]; 0 where there are too few rows to tell.
double noise_of(const std::vector<Sighting>& all) {
  std::vector<double> time;
  std::vector<Vec3<double>> seen;
  for (const Sighting& s : all) {
    time.push_back(s.time);
    seen.push_back(s.seen);
  }
  const double out = camera_noise(time, seen, kSideSeconds);
  return std::isfinite(out) ? out : 0.0;
}

}  // namespace

void guess_string(const BallData& data, Vec3<double>& p_LS, double& length,
                  const Vec3<double>& gravity) {
  const std::vector<Sighting> all = sightings(data);
  const auto distance = [&](const Sighting& s) {
    return norm(s.seen - s.hand->anchor(s.time, p_LS).x);
  };
  std::vector<double> distances;
  const auto quantile = [&](double share) {
    distances.clear();
    for (const Sighting& s : all) distances.push_back(distance(s));
    auto at = distances.begin() +
              static_cast<std::ptrdiff_t>(share * static_cast<double>(distances.size() - 1));
    std::nth_element(distances.begin(), at, distances.end());
    return *at;
  };
  double r = quantile(0.8);
  // What the hand's rotations do not show of the attachment stays: 1 mm of a row counts as 10 cm.
  const Vec3<double> start = p_LS;
  for (int round = 0; round < 30; ++round) {
    Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
    Eigen::Vector4d g = Eigen::Vector4d::Zero();
    for (const Sighting& s : all) {
      const Vec3<double> delta = s.seen - s.hand->anchor(s.time, p_LS).x;
      const double d = norm(delta), e = d - r;
      if (d < 0.95 * r) continue;
      const Vec3<double> zero{0, 0, 0}, unit[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
      Eigen::Vector4d J;  // of r − d
      J[0] = 1.0;
      const Vec3<double> origin = s.hand->anchor(s.time, zero).x;
      for (int k = 0; k < 3; ++k)
        J[k + 1] = dot(delta, s.hand->anchor(s.time, unit[k]).x - origin) / d;
      const double w = std::min(1.0, 0.01 / std::max(1e-9, std::abs(e)));
      H += w * J * J.transpose();
      g += w * J * e;
    }
    const double ridge = 1e-4;
    const Vec3<double> moved = p_LS - start;
    H.diagonal().tail<3>().array() += ridge;
    g.tail<3>() -= ridge * to_eigen(moved);
    const Eigen::Vector4d step = H.ldlt().solve(g);
    r += step[0];
    p_LS = p_LS + Vec3<double>{step[1], step[2], step[3]};
    if (step.norm() < 1e-9) break;
  }
  const double noise = noise_of(all);
  std::ptrdiff_t near = 0, told = 0, hangs = 0;
  for (const Sighting& s : all) {
    const Vec3<double> delta = s.seen - s.hand->anchor(s.time, p_LS).x;
    const double d = norm(delta);
    if (std::abs(d - r) >= kNear * r) continue;
    ++near;
    if (!s.moves) continue;
    ++told;
    const Vec3<double> force = s.acceleration - gravity, u = delta * (1.0 / d);
    const double limit = std::max(kAcross * norm(gravity), kSigmas * s.gain * noise);
    hangs += dot(u, force) < limit && norm(force - u * dot(u, force)) < limit ? 1 : 0;
  }
  const double largest = quantile(1.0);
  const auto enough = std::max<std::ptrdiff_t>(20, static_cast<std::ptrdiff_t>(all.size() / 20));
  const bool stays = r > 0.0 && near >= enough;
  if (!stays || 2 * hangs < told)
    throw DataError(
        data.source + (data.source.empty() ? "" : ": ") +
        std::string("the string is nowhere taut: the ball's distance from where it is tied ") +
        (stays ? "stays at one value, but the ball does not move as one that hangs there"
               : "never stays at one value") +
        " (the largest is " + std::to_string(largest) +
        " m); length and attachment cannot be identified from this recording; expected the joints' "
        "motion and the ball's in one world frame [m], the ball swinging on its string");
  length = r;
}

namespace {

/// Whether the ball is as far from where the string is tied as it is long, now and then.
bool is_often_taut(const StringSpec& string, const BallData& data) {
  constexpr double kAsLong = 0.05, kOften = 0.1;
  long near = 0, all = 0;
  for (const BallWindow& w : data.windows) {
    const HandMotion& hand = data.hands[static_cast<std::size_t>(w.hand)];
    for (std::size_t k = 0; k < w.time.size(); ++k, ++all) {
      const double d = norm(w.seen[k] - hand.anchor(w.time[k], string.p_LS).x);
      near += std::abs(d - string.length) < kAsLong * string.length;
    }
  }
  return static_cast<double>(near) > kOften * static_cast<double>(all);
}

}  // namespace

void guess_unknown_string(StringSpec& string, const BallData& data, const Vec3<double>& gravity) {
  if (string.length_std > 0.0) return;
  Vec3<double> p_LS = string.p_LS;
  double length = string.length;
  try {
    guess_string(data, p_LS, length, gravity);
  } catch (const DataError&) {
    if (is_often_taut(string, data)) return;
    throw;
  }
  string.p_LS = p_LS;
  string.length = length;
}

}  // namespace diffnea
