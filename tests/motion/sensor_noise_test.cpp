/// Noise of sensors is found from their signals, whatever the clock, and no motion is taken for it.

#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/motion/sensor_noise.hpp>
#include <diffnea/motion/window.hpp>

namespace sensor_noise_test {

using namespace diffnea;
using Catch::Approx;

namespace {

/// A joint that swings by 1 rad at 0.7 Hz under a torque of the same rate.
struct Signals {
  double rate = 200.0;  ///< [Hz]
  double noise = 0.0;   ///< of the positions [rad]
  double torque = 0.0;  ///< noise of the torque [N·m]
  double step = 0.0;    ///< quantisation [rad]
  int refresh = 1;      ///< rows that a position is held
  double jitter = 0.0;  ///< jitter of the clock, share of a period
  long rows = 4000;
};

Recording recorded(const Signals& s) {
  Rng rng(3);
  Recording out;
  out.source = "signals";
  out.joint_names = {"hinge"};
  out.has_tau = {true};
  out.time.resize(s.rows);
  out.q.resize(s.rows, 1);
  out.tau.resize(s.rows, 1);
  for (long k = 0; k < s.rows; ++k) {
    const double t = (static_cast<double>(k) + s.jitter * (rng.uniform() - 0.5)) / s.rate;
    const double phase = 2.0 * 3.14159265358979 * 0.7 * t;
    out.time[k] = t;
    out.tau(k, 0) = 3.0 * std::cos(phase) + s.torque * rng.normal();
    double q = std::sin(phase) + s.noise * rng.normal();
    if (s.step > 0.0) q = s.step * std::round(q / s.step);
    out.q(k, 0) = k % s.refresh == 0 ? q : out.q(k - 1, 0);
  }
  return out;
}

}  // namespace

TEST_CASE("sensor noise: a joint that never moves is as noisy as the others", "[motion]") {
  const Recording swings = recorded({.noise = 3e-4});
  Recording both = swings;
  both.joint_names = {"hinge", "still"};
  both.has_tau = {true, true};
  both.q.resize(swings.rows(), 2);
  both.q << swings.q, VecX<double>::Constant(swings.rows(), 0.2);
  both.tau.resize(swings.rows(), 2);
  both.tau << swings.tau, swings.tau;
  const SensorNoise noise = sensor_noise({both}, {false, false});
  CHECK(noise.position[0] == Approx(3e-4).epsilon(0.05));
  CHECK(noise.position[1] == noise.position[0]);
}

TEST_CASE("sensor noise: white noise of positions and torques, at even and uneven times",
          "[motion]") {
  const double jitter = GENERATE(0.0, 0.6);
  CAPTURE(jitter);
  const SensorNoise noise =
      sensor_noise({recorded({.noise = 3e-4, .torque = 0.2, .jitter = jitter})}, {false});
  CHECK(noise.position[0] == Approx(3e-4).epsilon(0.05));  // 4000 rows tell it to 2 %
  CHECK(noise.torque[0] == Approx(0.2).epsilon(0.05));
  CHECK(noise.density[0] == Approx(0.04 / 200.0).epsilon(0.12));
  CHECK(noise.refresh[0] == 1);
}

TEST_CASE("sensor noise: a passive joint's torque is known", "[motion]") {
  CHECK(sensor_noise({recorded({.torque = 0.2})}, {true}).density[0] == 0.0);
}

TEST_CASE("sensor noise: motion alone leaves less than an encoder can show", "[motion]") {
  const double rate = GENERATE(20.0, 100.0, 1000.0);
  CAPTURE(rate);
  // Sixth differences of 0.7 Hz at 20 Hz: (2π 0.7/20)⁶/√924 = 3.7e-6 rad.
  CHECK(sensor_noise({recorded({.rate = rate})}, {false}).position[0] < 5e-6);
}

TEST_CASE("sensor noise: a quantisation step is seen, and is a floor", "[motion]") {
  const double step = 1e-3;
  Recording still = recorded({.step = step});
  still.q.bottomRows(3500).setConstant(still.q(499, 0));  // at rest, differences are 0
  const SensorNoise noise = sensor_noise({still}, {false});
  CHECK(noise.step[0] == Approx(step).epsilon(1e-6));
  CHECK(noise.position[0] == Approx(step / std::sqrt(12.0)).epsilon(1e-6));
  CHECK(sensor_noise({recorded({.noise = 1e-4})}, {false}).step[0] == 0.0);
}

TEST_CASE("sensor noise: a joint that rests in most rows has the noise of the others", "[motion]") {
  Recording still = recorded({.noise = 3e-4});
  still.q.bottomRows(3000).setConstant(still.q(999, 0));
  CHECK(sensor_noise({still}, {false}).position[0] == Approx(3e-4).epsilon(0.1));
}

TEST_CASE("sensor noise: of a fraction of a step it is told as well", "[motion]") {
  const double step = 1e-3, noise = GENERATE(0.2e-3, 0.3e-3, 0.5e-3, 1e-3);
  CAPTURE(noise);
  const SensorNoise seen = sensor_noise({recorded({.noise = noise, .step = step})}, {false});
  CHECK(seen.position[0] == Approx(std::hypot(noise, step / std::sqrt(12.0))).epsilon(0.06));
}

TEST_CASE("sensor noise: rows of a slow sensor count when it has a new value", "[motion]") {
  const Recording slow = recorded({.noise = 3e-4, .refresh = 4});
  const SensorNoise noise = sensor_noise({slow}, {false});
  CHECK(noise.refresh[0] == 4);
  CHECK(noise.position[0] == Approx(3e-4).epsilon(0.1));
  const std::vector<MotionStretch> s = motion_stretches(slow, noise, {false});
  REQUIRE(s.size() == 1);
  for (long k = 0; k < s[0].q.rows(); ++k) CHECK(std::isnan(s[0].q(k, 0)) == (k % 4 != 0));
}

TEST_CASE("stretches: a driven joint ends at a pause and at a row without torque", "[motion]") {
  Recording r = recorded({.noise = 1e-4, .rows = 400});
  r.time.tail(200).array() += 0.5;
  r.tau(50, 0) = std::nan("");
  r.q(120, 0) = std::nan("");  // nothing to end it
  const SensorNoise noise = sensor_noise({r}, {false});
  const std::vector<MotionStretch> driven = motion_stretches(r, noise, {false});
  REQUIRE(driven.size() == 3);
  CHECK(driven[0].time.size() == 50);
  CHECK(driven[1].time.size() == 149);
  CHECK(driven[2].time.size() == 200);
  CHECK(motion_stretches(r, noise, {true}).size() == 1);
  for (const MotionWindow& w : cut_windows(driven, 0.25)) {
    const MotionStretch& s = driven[w.stretch];
    CHECK(w.rows > 2);
    CHECK(s.time[static_cast<std::size_t>(w.first + w.rows - 1)] -
              s.time[static_cast<std::size_t>(w.first)] <
          0.25 + 1e-6);
  }
}

}  // namespace sensor_noise_test
