#include "diagnose/bounds.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "core/constants.hpp"
#include "diagnose/sessions.hpp"
#include "diagnose/term.hpp"

namespace diffnea {
namespace {

/// Stribeck's velocity over v₀, at least.
constexpr double kStribeckTurns = 3.0;

/// Of the rows' Nyquist frequency: at half the RMS velocity, where most rows are.
constexpr double kRippleShare = 2.0;

/// Standard deviations of the positions' noise, of which hardly any sample is beyond.
constexpr double kPreslidingNoises = 3.0;
/// Of the range of the motion: bristles that bend by more hardly slide, and are a spring.
constexpr double kPreslidingRange = 0.25;

/// The same, below which no gap of a gear is told from none: a step of the link's position that is
/// seen.
constexpr double kGapNoises = 2.0;
/// From one gap of the grid to the next: midway the pulses are 1.25 times too large, and so long.
constexpr double kGapStep = 1.6;

/// How far a ripple midway between two of the grid is out of phase at the ends of the motion.
constexpr double kRippleMiss = std::numbers::pi / 3.0;
constexpr int kMostRipples = 250;

/// χ² that noise in a limit's column may explain by itself, of 10 that a cause needs.
constexpr double kMostShared = 1.0;

/// A limit is met now and then: one below most of the torque would explain any torque by itself.
void bound_saturation(const Evidence& evidence, Candidate& c) {
  std::vector<double> size;
  for (const JointSeries& s : evidence.series())
    for (long i = 0; i < s.rows(); ++i) size.push_back(std::abs(s.logged(i, c.effect.joints[0])));
  std::ranges::sort(size);
  const auto quantile = [&](double q) {
    return size[static_cast<std::size_t>(q * static_cast<double>(size.size() - 1))];
  };
  c.grid.clear();
  for (const double q : {0.999, 0.99, 0.97, 0.94, 0.9, 0.85, 0.8}) c.grid.push_back({quantile(q)});
  c.shape_low = {quantile(0.75)};
}

/// Drops limits of which the column's own noise, that of the torque beyond them, would be taken for
/// as much as the effect is: it is that of the torque beside it. No search goes below the others.
void drop_noisy_limits(const Evidence& evidence, double tau_noise, Candidate& c) {
  const auto shared = [&](double limit) {
    double beyond = 0.0, squares = 0.0;
    for (const JointSeries& s : evidence.series()) {
      const VecX<double> u = s.logged.col(c.effect.joints[0]);
      const VecX<double> more = (u.cwiseAbs().array() - limit).max(0.0);
      beyond += static_cast<double>((more.array() > 0.0).count()) * s.dt / evidence.step();
      squares += more.squaredNorm() * s.dt / evidence.step();
    }
    return beyond * beyond * tau_noise * tau_noise / squares;
  };
  if (std::erase_if(c.grid, [&](const auto& g) { return !(shared(g[0]) < kMostShared); }) > 0 &&
      !c.grid.empty())
    c.shape_low = std::ranges::min(c.grid);
}

/// Below a few v₀, Stribeck's curve only mends how friction turns.
void bound_stribeck(const FitLayout& layout, Candidate& c) {
  double v0 = c.effect.parameters[c.effect.index_of("smoothing")];
  for (const FitParameter& shape : layout.shape)
    if (is_smoothing(shape) && shape.name.starts_with(c.effect.where + "."))
      v0 = std::max(v0, shape.prior);
  const double least = kStribeckTurns * v0;
  std::erase_if(c.grid, [&](const std::vector<double>& g) { return g[0] < least; });
  c.shape_low = {least};
  if (c.grid.empty()) c.grid = {{least}};
}

/// Positions that a joint's lie between.
std::pair<double, double> range_of(const Evidence& evidence, int joint) {
  std::pair<double, double> out{kInfinity, -kInfinity};
  for (const JointSeries& s : evidence.series()) {
    out.first = std::min(out.first, s.q.col(joint).minCoeff());
    out.second = std::max(out.second, s.q.col(joint).maxCoeff());
  }
  return out;
}

/// A ripple is one if the motion runs through it twice; below, it is any smooth function of the
/// position. And at the joint's RMS velocity the rows must follow it; beyond, it is left of it
/// what happens at reversals alone. Between, the grid is even (Evidence::ripples()).
void bound_cogging(const Evidence& evidence, Candidate& c) {
  const int j = c.effect.joints[0];
  const auto [low, high] = range_of(evidence, j);
  const double range = high - low, pi = std::numbers::pi;
  double squares = 0.0, samples = 0.0;
  for (const JointSeries& s : evidence.series()) {
    squares += s.qd.col(j).squaredNorm();
    samples += static_cast<double>(s.rows());
  }
  const double speed = std::sqrt(squares / samples);
  c.grid.clear();
  if (!(range > 0.0) || !(speed > 0.0)) return;
  const double lowest = 4.0 * pi / range, step = 4.0 * kRippleMiss / range;
  const double highest = std::min(kRippleShare * pi / (evidence.step() * speed),
                                  lowest + step * static_cast<double>(kMostRipples));
  for (int k = 0; lowest + step * k <= highest; ++k) c.grid.push_back({lowest + step * k});
  c.shape_low = {lowest};
  c.shape_high = {std::max(highest, lowest)};
}

/// Bristles that bend by less than the positions' noise do not show: what is left is Coulomb's.
void bound_presliding(const Evidence& evidence, const std::vector<double>& q_noise, Candidate& c) {
  const auto [low, high] = range_of(evidence, c.effect.joints[0]);
  const double least = kPreslidingNoises * q_noise[c.effect.joints[0]];
  const double most = kPreslidingRange * (high - low);
  std::erase_if(c.grid, [&](const std::vector<double>& g) { return g[0] < least || g[0] > most; });
  c.shape_low = {least};
  c.shape_high = {std::max(most, least)};
}

/// Gaps from those that the positions' noise hides to the largest of the catalogue; none if it
/// hides them all.
void bound_backlash(const std::vector<double>& q_noise, Candidate& c) {
  double least = c.grid.front()[0];
  const double most = c.grid.back()[0];
  if (const double noise = q_noise[c.effect.joints[0]]; noise > 0.0) least = kGapNoises * noise;
  c.shape_low = {least};
  std::set<std::vector<double>> sides;  // sides of the encoder follow the gap in a point
  for (const std::vector<double>& point : c.grid) sides.emplace(point.begin() + 1, point.end());
  c.grid.clear();
  if (!(least < most)) return;
  const int steps = static_cast<int>(std::ceil(std::log(most / least) / std::log(kGapStep)));
  for (int k = 0; k <= steps; ++k)
    for (const std::vector<double>& side : sides) {
      c.grid.push_back({least * std::pow(most / least, static_cast<double>(k) / steps)});
      c.grid.back().insert(c.grid.back().end(), side.begin(), side.end());
    }
}

/// Whether all joints of an effect are known to have no torque.
bool is_passive(const Evidence& evidence, const BoundEffect& effect) {
  return std::ranges::all_of(effect.joints, [&](int j) { return evidence.is_passive(j); });
}

/// Tells whether an effect needs motors at joints that loops alone move: a rotor, a gear that two
/// joints share.
bool lacks_motor(const Evidence& evidence, const BoundEffect& effect) {
  const EffectInfo& info = effect.info();
  if (!evidence.driven_rows().closed()) return false;
  if (info.place == Place::kJointPair)
    return std::ranges::any_of(effect.joints, [&](int j) { return evidence.is_passive(j); });
  return (info.has(Trait::kRotor) || info.has(Trait::kAtMotor)) && is_passive(evidence, effect);
}

/// Why an effect is not tried in closed loops; empty: it is.
std::string not_in_loops(const Evidence& evidence, const Candidate& c) {
  const EffectInfo& info = c.effect.info();
  if (!evidence.driven_rows().closed()) return "";
  if (info.port == Port::kMeasurement && std::ssize(c.effect.joints) < evidence.num_dofs())
    return "not tried: what is wrong with one joint's log, the loop's other joints tell better "
           "than torques";
  if (info.motor != HiddenMotor::kNone)
    return "not tried: a motor that turns beside its joint is not served in closed loops";
  if (info.has(Trait::kFollowsLoad))
    return "not tried: what a joint of a closed loop carries hangs on the constraints' forces";
  if (evidence.driven_rows().shared() && c.of_reference &&
      (info.has(Trait::kOfDrive) || info.port == Port::kMeasurement))
    return "not tried: more drives than motions share the torque in ways that no motion tells";
  return "";
}

/// Tells whether an effect is one of joints of which one stands still: beside that, what couples
/// two is friction of the other, and an offset of its encoder another posture.
bool is_of_resting(const Evidence& evidence, const BoundEffect& effect) {
  const Place place = effect.info().place;
  if (place != Place::kJoint && place != Place::kJointPair) return false;
  return std::ranges::any_of(effect.joints,
                             [&](int j) { return std::ranges::count(evidence.resting(), j) > 0; });
}

}  // namespace

std::vector<Refusal> bound_shapes(const Evidence& evidence, const FitLayout& layout,
                                  const PreprocessPlan& plan, bool halves,
                                  std::vector<Candidate>& candidates) {
  const std::vector<double>& q_noise = plan.q_noise;
  std::vector<Refusal> refused;
  std::vector<Candidate> kept;
  for (Candidate& c : candidates) {
    const EffectInfo& info = c.effect.info();
    const auto refuse = [&](const std::string& where, const std::string& why) {  // once
      if (std::ranges::none_of(
              refused, [&](const Refusal& r) { return r.effect == info.name && r.where == where; }))
        refused.push_back({info.name, where, why, 0.0});
    };
    if (info.has(Trait::kOfDrive) && is_passive(evidence, c.effect)) continue;
    if (lacks_motor(evidence, c.effect)) continue;
    if (std::string why = not_in_loops(evidence, c); !why.empty()) {
      const auto same = std::ranges::find_if(
          refused, [&](const Refusal& r) { return r.effect == info.name && r.reason == why; });
      if (same == refused.end())
        refused.push_back({info.name, c.effect.where, std::move(why), 0.0});
      else
        same->where += ", " + c.effect.where;
      continue;
    }
    if (is_of_resting(evidence, c.effect)) continue;
    if (is_of_runs(c.effect) && !tells_sessions(evidence)) {
      refuse("all", "not tried: no run is longer than the second in which errors go together");
      continue;
    }
    // Bristles are why it sticks there, and show in the turns that are left out.
    if (c.bound() == SearchBound::kPresliding && std::ranges::any_of(c.effect.joints, [&](int j) {
          return std::ranges::count(evidence.sticking(), j) > 0;
        })) {
      refuse(c.effect.where,
             "not tried: the joint sticks wherever it turns back, which is left out");
      continue;
    }
    // Columns of fourth derivatives share the noise of what they are to explain, unless they come
    // from other samples.
    if (!halves && info.motor != HiddenMotor::kNone) {
      refuse("all",
             "not tried: needs a log of five times the path's cut-off, and so of held-out data");
      continue;
    }
    std::string none;
    switch (c.bound()) {
      case SearchBound::kNone:
        break;
      case SearchBound::kTorque:
        bound_saturation(evidence, c);
        drop_noisy_limits(evidence, plan.tau_noise[c.effect.joints[0]], c);
        none = "not tried: the torque's noise is too large";
        break;
      case SearchBound::kRipple:
        bound_cogging(evidence, c);
        break;
      case SearchBound::kPresliding:
        bound_presliding(evidence, q_noise, c);
        break;
      case SearchBound::kGap:
        bound_backlash(q_noise, c);
        none = "not tried: the positions' noise is too large for any gap that gears have";
        break;
      case SearchBound::kSmoothing:
        bound_stribeck(layout, c);
        break;
    }
    if (c.grid.empty() && !none.empty()) refuse(c.effect.where, none);
    if (!c.grid.empty()) kept.push_back(std::move(c));
  }
  candidates = std::move(kept);
  return refused;
}

}  // namespace diffnea
