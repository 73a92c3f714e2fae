/// Oscillations and bursts beside noise of a known autoregression.

#include "diagnose/unsteady.hpp"

#include <cmath>
#include <functional>
#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

namespace unsteady_test {

using namespace diffnea;
using Catch::Matchers::WithinAbs;

namespace {

/// Torque of an instant at one joint, beside the noise [N·m].
using Torque = std::function<double(double time, double speed)>;

constexpr long kJoint = 1;

/// Coloured noise, 1 N·m RMS, at both joints, and a torque at one.
Rest rest(const test::SwingingEvidence& evidence, unsigned seed, const Torque& torque = {}) {
  Rng rng(seed);
  Rest out{*evidence, VecX<double>(evidence->rows()), {}};
  double state = 0.0;
  for (double& x : out.left) x = state = 0.6 * state + 0.8 * rng.normal();
  const VecX<double> qd = evidence->qd(kJoint).col(evidence->joints()[kJoint]);
  for (long i = 0; torque && i < evidence->times(); ++i)
    out.left[kJoint * evidence->times() + i] +=
        torque(evidence->time()[static_cast<std::size_t>(i)], qd[i]);
  return out;
}

/// Three strokes, each where the joint is fast, a quarter of a second long, or else slow, a tenth.
Torque strokes(const test::SwingingEvidence& evidence, bool fast) {
  const VecX<double> qd = evidence->qd(kJoint).col(evidence->joints()[kJoint]);
  const double rms = std::sqrt(qd.squaredNorm() / static_cast<double>(qd.size()));
  std::vector<double> at;
  for (long i = 0; i < qd.size(); ++i) {
    const double time = evidence->time()[static_cast<std::size_t>(i)];
    const bool is_here = fast ? std::abs(qd[i]) > 1.2 * rms : std::abs(qd[i]) < 0.02 * rms;
    if (is_here && (at.empty() || time > at.back() + 5.0) && at.size() < 3) at.push_back(time);
  }
  REQUIRE(at.size() == 3);
  return [at, width = fast ? 0.1 : 0.03](double time, double) {
    double out = 0.0;
    for (const double t : at) out += 12.0 * std::exp(-0.5 * std::pow((time - t) / width, 2));
    return out;
  };
}

}  // namespace

TEST_CASE("find_unsteady: noise has no lines and no bursts", "[diagnose]") {
  const test::SwingingEvidence fitted(60.0), held_out(40.0, false, 2);
  for (unsigned seed = 1; seed <= 40; ++seed)
    CHECK(find_unsteady(rest(fitted, seed), rest(held_out, seed + 1000)).empty());
}

TEST_CASE("find_unsteady: an oscillation, whatever its phase", "[diagnose]") {
  const test::SwingingEvidence fitted(60.0), held_out(40.0, false, 2);
  const auto sine = [](double amplitude, double hz, double phase) -> Torque {
    return [=](double t, double) { return amplitude * std::sin(2.0 * M_PI * hz * t + phase); };
  };
  const std::vector<Unsteady> unsteady =
      find_unsteady(rest(fitted, 1, sine(1.0, 3.3, 0.4)), rest(held_out, 2, sine(0.7, 3.3, 2.0)));
  REQUIRE(unsteady.size() == 1);
  CHECK(unsteady[0].joint == kJoint);
  // A step: an eighth of a bin of a window of 1024 rows of 0.04 s.
  CHECK_THAT(unsteady[0].frequency_hz, WithinAbs(3.3, 1.0 / (8.0 * 1024.0 * 0.04)));
  CHECK_THAT(unsteady[0].share, WithinAbs(0.5 / 1.5, 0.1));
  // In one recording alone, or at another frequency in each, it is none that comes back.
  CHECK(find_unsteady(rest(fitted, 1, sine(1.0, 3.3, 0.0)), rest(held_out, 2)).empty());
  CHECK(find_unsteady(rest(fitted, 1, sine(1.0, 3.3, 0.0)), rest(held_out, 2, sine(1.0, 5.1, 0.0)))
            .empty());
}

TEST_CASE("find_unsteady: a line of the motion's own is the model's", "[diagnose]") {
  // Torque and error both have a line at 1.25 Hz, and the torque has more of it.
  const auto alter = [](Recording& r) {
    for (long i = 0; i < r.rows(); ++i)
      r.tau(i, kJoint) += 30.0 * std::sin(7.8539816339744831 * r.time[i]);
  };
  const test::SwingingEvidence fitted(60.0, false, 1, "viscous_friction", alter),
      held_out(40.0, false, 2, "viscous_friction", alter);
  const Torque left = [](double t, double) { return std::sin(7.8539816339744831 * t); };
  CHECK(find_unsteady(rest(fitted, 1, left), rest(held_out, 2, left)).empty());
}

TEST_CASE("find_unsteady: an oscillation through gaps, and in the torque that answers it",
          "[diagnose]") {
  const auto answering = [](Recording& r) {
    for (long i = 0; i < r.rows(); ++i)
      r.tau(i, kJoint) = r.q(i, kJoint) + std::sin(2.0 * M_PI * 3.3 * r.time[i]);
  };
  const test::SwingingEvidence fitted(60.0, false, 1, "viscous_friction", answering),
      held_out(40.0, false, 2, "viscous_friction", answering);
  const Torque loud = [](double t, double) { return 20.0 * std::sin(2.0 * M_PI * 3.3 * t); };
  const auto in_parts = [&](const test::SwingingEvidence& evidence, unsigned seed) {
    Rest out = rest(evidence, seed, loud);
    const VecX<double> qd = evidence->qd(kJoint).col(evidence->joints()[kJoint]);
    out.used.assign(static_cast<std::size_t>(evidence->rows()), true);
    for (long i = 0; i < evidence->times(); ++i)
      out.used[static_cast<std::size_t>(kJoint * evidence->times() + i)] = std::abs(qd[i]) > 0.5;
    return out;
  };
  const std::vector<Unsteady> unsteady = find_unsteady(in_parts(fitted, 1), in_parts(held_out, 2));
  REQUIRE(unsteady.size() == 1);
  CHECK_THAT(unsteady[0].frequency_hz, WithinAbs(3.3, 1.0 / (8.0 * 1024.0 * 0.04)));
}

TEST_CASE("find_unsteady: bursts where the same motion is quiet elsewhere", "[diagnose]") {
  const test::SwingingEvidence fitted(60.0), held_out(40.0, false, 2);
  const Torque here = strokes(fitted, true), there = strokes(held_out, true);
  const std::vector<Unsteady> unsteady =
      find_unsteady(rest(fitted, 1, here), rest(held_out, 2, there));
  REQUIRE(unsteady.size() == 1);
  CHECK(unsteady[0].joint == kJoint);
  CHECK(unsteady[0].frequency_hz == 0.0);
  CHECK(unsteady[0].share > 0.3);
  CHECK(find_unsteady(rest(fitted, 1, here), rest(held_out, 2)).empty());
  // Where joints turn, friction may have any torque.
  CHECK(find_unsteady(rest(fitted, 1, strokes(fitted, false)),
                      rest(held_out, 2, strokes(held_out, false)))
            .empty());
}

TEST_CASE("find_unsteady: drag comes with every fast motion", "[diagnose]") {
  const auto damped = [](Recording& r) {
    for (long i = 1; i < r.rows(); ++i)
      r.tau(i, kJoint) +=
          60.0 * (r.q(i, kJoint) - r.q(i - 1, kJoint)) / (r.time[i] - r.time[i - 1]);
  };
  const test::SwingingEvidence fitted(60.0, false, 1, "viscous_friction", damped),
      held_out(40.0, false, 2, "viscous_friction", damped);
  const Torque drag = [](double, double speed) { return 6.0 * speed; };
  CHECK(find_unsteady(rest(fitted, 1, drag), rest(held_out, 2, drag)).empty());
}

}  // namespace unsteady_test
