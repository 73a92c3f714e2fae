#pragma once
/// A WAM with a ball, in many lanes of a world, that swings up and comes back.

#include <cmath>
#include <string>
#include <vector>

#include <diffnea/sim/simulator.hpp>

namespace diffnea::test {

inline const std::string kWam = DIFFNEA_SOURCE_DIR "/models/wam4_ball.xml";
inline const VecX<double> kHome = (VecX<double>(4) << 0.0, 0.6, 0.0, 1.25).finished();

/// Joints 2 and 4 swing up and come back; `size` [rad] and `pace` [rad/s] differ from lane to lane.
struct Swing {
  double size, pace;
  double angle(double t) const {
    return t < 1.5 ? size * std::pow(std::sin(M_PI * t / 1.5), 2) * std::sin(pace * t) : 0.0;
  }
  double rate(double t) const { return (angle(t + 1e-6) - angle(t - 1e-6)) / 2e-6; }
};

inline void command(const Swing& swing, double t, long lane, Lanes& q, Lanes& qd) {
  q.col(lane) = kHome;
  qd.col(lane).setZero();
  for (const int j : {1, 3}) {
    q(j, lane) += swing.angle(t);
    qd(j, lane) += swing.rate(t);
  }
}

inline Starts starts(int lanes) {
  return {.q = kHome.replicate(1, lanes), .seeds = std::vector<std::uint64_t>(lanes, 0)};
}

/// What every lane showed after `seconds`: (channels × lanes) at every 10th step.
inline std::vector<Lanes> run(Simulator& world, const std::vector<Swing>& swings, double seconds) {
  world.reset(starts(static_cast<int>(swings.size())));
  Lanes q = Lanes::Zero(4, world.lanes()), qd = q;
  std::vector<Lanes> out;
  const long steps = std::lround(seconds / world.period());
  for (long k = 0; k < steps; ++k) {
    for (std::size_t l = 0; l < swings.size(); ++l)
      command(swings[l], double(k) * world.period(), static_cast<long>(l), q, qd);
    world.step(q, qd);
    if (k % 10 == 9) out.push_back(world.observe().leftCols(static_cast<long>(swings.size())));
  }
  return out;
}

}  // namespace diffnea::test
