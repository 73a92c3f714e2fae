#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "case.hpp"

namespace rigs {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// RMS of a command over that of its means over 20 ms, beyond which its controller is unstable:
/// 1.0 to 1.1 in the others.
constexpr double kChatter = 1.4;

/// Part of the first recording, or its first runs, that an effect is scaled along.
Recording excerpt(const Case& c) {
  Case part = c;
  part.rig.motor_noise.setZero(c.rig.arm.size());
  Recording out;
  double left = 8.0;
  for (std::size_t r = 0; r < c.runs.size() && left > 0.0; ++r) {
    const double seconds = std::min(left, c.runs[r]);
    left -= seconds;
    const Motion motion(c.rig.arm, c.plan, c.runs[r],
                        Draw(c.seed, c.stream + kTrain + kStreams * r));
    out.samplings.emplace_back();
    out.tracks.push_back(simulate(with_effects(part), motion, static_cast<int>(r),
                                  0.5 * (c.runs[r] - seconds), seconds, out.samplings.back(),
                                  Draw(c.seed, c.stream)));
  }
  return out;
}

double size_of(const Case& c, const Effect& e) {
  const VectorXd share = effect_share(c, excerpt(c));
  double out = 0.0;
  for (const int j : e.joints) out = std::max(out, share[j]);
  return out;
}

/// True where drives swing from tick to tick.
bool chatters(const Case& c, const Recording& recording) {
  VectorXd squares = VectorXd::Zero(c.rig.arm.size());
  double rows = 0.0;
  for (const Track& track : recording.tracks) {
    squares += track.tau.colwise().squaredNorm();
    rows += static_cast<double>(track.tau.rows());
  }
  const VectorXd slow = root_mean_square(at_50_hz(recording, &Track::mean_tau));
  return ((squares / rows).cwiseSqrt().array() > kChatter * slow.array() + 1e-9).any();
}

}  // namespace

void scale_effect(Case& c, std::size_t which, double target) {
  Case alone = c;
  alone.effects = {c.effects[which]};
  Effect& e = alone.effects[0];
  e.strength = std::min(e.start, e.limit);
  double limit = e.limit;
  for (int i = 0; i < 7; ++i) {
    double size = 0.0;
    try {
      size = size_of(alone, e);
    } catch (const std::runtime_error&) {
      limit = 0.7 * e.strength;
      e.strength *= 0.4;
      continue;
    }
    if (std::abs(size / target - 1.0) < 0.08) break;
    const double next = e.strength * std::clamp(target / std::max(size, 1e-12), 0.1, 10.0);
    if (next >= limit && e.strength == limit) break;
    e.strength = std::min(next, limit);
  }
  c.effects[which].strength = e.strength;
  c.effects[which].limit = limit;
}

Rig with_effects(const Case& c) {
  Rig out = c.rig;
  for (const Effect& e : c.effects) e.act(e.strength, out);
  return out;
}

MatrixXd at_50_hz(const Recording& recording, MatrixXd Track::* series) {
  const Index every = std::lround(0.02 / kBin);
  Index rows = 0;
  for (const Track& t : recording.tracks) rows += (t.*series).rows() / every;
  MatrixXd out(rows, (recording.tracks[0].*series).cols());
  Index at = 0;
  for (const Track& t : recording.tracks)
    for (Index k = 0; k + every <= (t.*series).rows(); k += every)
      out.row(at++) = (t.*series).middleRows(k, every).colwise().mean();
  return out;
}

VectorXd root_mean_square(const MatrixXd& x) {
  return (x.colwise().squaredNorm() / static_cast<double>(x.rows())).cwiseSqrt();
}

VectorXd effect_share(const Case& c, const Recording& recording) {
  const VectorXd effect = root_mean_square(at_50_hz(recording, &Track::hidden));
  VectorXd torque = root_mean_square(at_50_hz(recording, &Track::mean_tau));
  for (Index j = 0; j < torque.size(); ++j)
    if (c.rig.arm.joints[static_cast<std::size_t>(j)].passive) torque[j] = c.usual.torque[j];
  return effect.cwiseQuotient(torque);
}

Recording record(const Case& c, bool is_test) {
  const Rig rig = with_effects(c);
  const std::uint64_t own = c.stream + (is_test ? kTest : kTrain);
  Recording out;
  for (std::size_t r = 0; r < c.runs.size(); ++r) {
    const Motion motion(c.rig.arm, c.plan, c.runs[r], Draw(c.seed, own + kStreams * r));
    Draw instants(c.seed, c.stream + kInstants + kStreams * (2 * r + (is_test ? 1 : 0)));
    Sampling s;
    s.period = 1.0 / c.rate;
    s.middle = c.sensors.middle;
    s.centred = c.sensors.centred;
    const auto rows = std::lround(c.runs[r] * c.rate);
    for (long k = 0; k < rows; ++k) {
      const double late = std::clamp(c.sensors.jitter * instants.normal(), -0.3, 0.3);
      s.times.push_back(s.period * std::max(0.0, static_cast<double>(k) + late));
    }
    // Another recording has other offsets of its sessions.
    const std::size_t session = is_test ? (r + 1) % c.runs.size() : r;
    out.tracks.push_back(simulate(rig, motion, static_cast<int>(session), 0.0, c.runs[r], s,
                                  Draw(c.seed, own + 8 + kStreams * r)));
    out.samplings.push_back(s);
  }
  if (chatters(c, out)) throw std::runtime_error("the drives chatter");
  return out;
}

}  // namespace rigs
