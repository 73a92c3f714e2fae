#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/ball_fit.hpp>

namespace diffnea {
namespace {

double norm(const Vec3<double>& v) { return std::sqrt(dot(v, v)); }

}  // namespace

void guess_string(const BallData& data, Vec3<double>& p_LS, double& length) {
  struct Sighting {
    AnchorMotion<double> at0;
    const HandMotion* hand;
    double time;
    Vec3<double> seen;
  };
  std::vector<Sighting> all;
  for (const BallWindow& w : data.windows)
    for (std::size_t k = 0; k < w.time.size(); ++k)
      all.push_back({{}, &data.hands[static_cast<std::size_t>(w.hand)], w.time[k], w.seen[k]});
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
  const auto taut = std::ranges::count_if(
      all, [&](const Sighting& s) { return std::abs(distance(s) - r) < 0.02 * r; });
  const double largest = quantile(1.0);
  if (!(r > 0.0) ||
      taut < std::max<std::ptrdiff_t>(20, static_cast<std::ptrdiff_t>(all.size() / 20)))
    throw DataError(
        "the string is nowhere taut: the ball's distance from where it is tied never "
        "stays at one value (the largest is " +
        std::to_string(largest) +
        " m); length and attachment cannot be identified from this recording");
  length = r;
}

}  // namespace diffnea
