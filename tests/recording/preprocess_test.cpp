#include "diffnea/recording/preprocess.hpp"

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

namespace diffnea::preprocess_test {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
/// What the filter remembers of a block's end is below 1e-15; q̈ of a 1 kHz grid carries the
/// rounding of q (1e-16) magnified by 1/h² = 1e6: 3e-10 of accelerations of order 1 was seen on
/// measured data.
constexpr double kBlockTol = 1e-9;

/// One joint, q(t) at the given times.
Recording sampled(const std::vector<double>& time, const std::function<double(double)>& q) {
  Recording r;
  r.source = "test.csv";
  r.joint_names = {"a"};
  r.has_tau = {true};
  r.info.torque_sampling = TorqueSampling::kInstant;
  const long rows = static_cast<long>(time.size());
  r.time = Eigen::Map<const VecX<double>>(time.data(), rows);
  r.q.resize(rows, 1);
  for (long i = 0; i < rows; ++i) r.q(i, 0) = q(time[i]);
  r.tau = r.q;
  return r;
}

std::vector<double> uniform_times(long rows, double dt) {
  std::vector<double> out(rows);
  for (long i = 0; i < rows; ++i) out[i] = static_cast<double>(i) * dt;
  return out;
}

std::vector<double> jittered_times(long rows, double dt, double jitter) {
  Rng rng(7);
  std::vector<double> out = uniform_times(rows, dt);
  for (double& t : out) t += jitter * dt * rng.uniform(-1.0, 1.0);
  return out;
}

Recording rows_of(const Recording& r, long first, long count) {
  Recording out = r;
  out.time = VecX<double>(r.time.segment(first, count));
  for (auto member : {&Recording::q, &Recording::qd, &Recording::tau})
    if ((r.*member).size() > 0) out.*member = RowMatX<double>((r.*member).middleRows(first, count));
  return out;
}

/// Several harmonics of three joints with noise, jitter, short and long gaps, a prescribed joint.
Recording long_recording(long rows) {
  Rng rng(11);
  Recording r = sampled(jittered_times(rows, 0.002, 0.1), [](double t) { return t; });
  r.joint_names = {"a", "b", "c"};
  r.has_tau = {true, false, true};
  r.q.resize(rows, 3);
  r.tau.setConstant(rows, 3, kNaN);
  r.qd.resize(rows, 3);
  for (long i = 0; i < rows; ++i)
    for (int j = 0; j < 3; ++j) {
      const double w = 2.0 * kPi * (0.3 + 0.4 * j), t = r.time[i];
      r.q(i, j) = std::sin(w * t) + 0.3 * std::cos(3.0 * w * t) + 1e-4 * rng.normal();
      r.qd(i, j) = w * std::cos(w * t) - 0.9 * w * std::sin(3.0 * w * t) + 1e-2 * rng.normal();
      if (j != 1) r.tau(i, j) = rng.normal();
    }
  for (const auto& [first, count] :
       {std::pair{700L, 2L}, {1500L, 60L}, {1700L, 40L}, {5000L, 300L}})
    r.q.middleRows(first, count).col(1).setConstant(kNaN);
  r.tau(3000, 2) = kNaN;
  return r;
}

double largest(const RowMatX<double>& x) { return x.cwiseAbs().maxCoeff(); }

}  // namespace

TEST_CASE("preprocess: polynomials to degree 4 are differentiated exactly", "[recording]") {
  // The path's gain is 1 − O(ω⁸), so that it keeps them too, away from the ends.
  const int degree = GENERATE(1, 2, 3, 4);
  CAPTURE(degree);
  const double dt = 0.01;
  const Recording r =
      sampled(uniform_times(1001, dt), [&](double t) { return std::pow(0.2 * (t - 5.0), degree); });
  const PreprocessPlan plan = plan_preprocess({r}, {.filter_hz = 10.0});
  const Preprocessed p = preprocess(r, plan);
  REQUIRE(p.rows() == 1001);
  CHECK_THAT(p.dt, WithinAbs(dt, 1e-15));
  for (long k = 0; k < p.rows(); ++k) {
    const double t = p.time[k], x = 0.2 * (t - 5.0);
    if (std::abs(x) > 0.7) continue;  // 1.5 s: 40 time constants of the filter
    const auto power = [&](int n) { return n < 0 ? 0.0 : std::pow(x, n); };
    CHECK_THAT(p.q(k, 0), WithinAbs(power(degree), 1e-12));
    CHECK_THAT(p.qd(k, 0), WithinAbs(0.2 * degree * power(degree - 1), 1e-11));
    // 1e-16/h² = 1e-12, with the path's rounding 1e-10.
    CHECK_THAT(p.qdd(k, 0), WithinAbs(0.04 * degree * (degree - 1) * power(degree - 2), 1e-9));
  }
}

TEST_CASE("preprocess: derivatives are those of the path", "[recording]") {
  const double hz = GENERATE(0.5, 3.0, 8.0, 20.0);
  CAPTURE(hz);
  const double dt = 0.01, w = 2.0 * kPi * hz;
  const Recording r = sampled(uniform_times(2001, dt), [&](double t) { return std::sin(w * t); });
  const PreprocessPlan plan = plan_preprocess({r}, {.filter_hz = 10.0});
  const Preprocessed p = preprocess(r, plan);
  // Samples far apart against the sine's period lower the spline's gain a little.
  const double gain = 1.0 / (1.0 + std::pow(hz / 10.0, 8));
  const double off = hz < 5.0 ? 1e-5 : 0.02;
  for (long k = 900; k < 1100; ++k) {
    const double t = p.time[k];
    CHECK_THAT(p.q(k, 0), WithinAbs(gain * std::sin(w * t), off));
    CHECK_THAT(p.qd(k, 0), WithinAbs(gain * w * std::cos(w * t), off * w));
    CHECK_THAT(p.qdd(k, 0), WithinAbs(-gain * w * w * std::sin(w * t), off * w * w));
  }
}

TEST_CASE("preprocess: block by block it is the whole", "[recording]") {
  const bool measured = GENERATE(false, true);
  const long block_rows = GENERATE(100L, 1500L, 0L), pushed = GENERATE(333L, 20'000L);
  CAPTURE(measured, block_rows, pushed);
  const Recording r = long_recording(20'000);
  const PreprocessPlan plan =
      plan_preprocess({r}, {.filter_hz = 8.0, .min_segment = 0.5, .measured_velocity = measured});
  const Preprocessed whole = preprocess(r, plan);
  Preprocessor stream(plan, block_rows);
  long at = 0;
  const auto compare = [&](const Preprocessed& part) {
    const long n = part.rows();
    REQUIRE(at + n <= whole.rows());
    if (n == 0) return;
    CHECK(part.time == whole.time.segment(at, n));
    CHECK(part.segment ==
          std::vector<int>(whole.segment.begin() + at, whole.segment.begin() + at + n));
    CHECK(largest(part.q - whole.q.middleRows(at, n)) < kBlockTol * largest(whole.q));
    CHECK(largest(part.qd - whole.qd.middleRows(at, n)) < kBlockTol * largest(whole.qd));
    CHECK(largest(part.qdd - whole.qdd.middleRows(at, n)) < kBlockTol * largest(whole.qdd));
    CHECK(part.tau.col(2) == whole.tau.middleRows(at, n).col(2));
    at += n;
  };
  for (long i = 0; i < r.rows(); i += pushed)
    compare(stream.push(rows_of(r, i, std::min(pushed, r.rows() - i))));
  compare(stream.finish());
  CHECK(at == whole.rows());
}

TEST_CASE("preprocess: gaps cut into segments, short ones are bridged", "[recording]") {
  const Recording r = long_recording(20'000);
  const PreprocessPlan plan = plan_preprocess({r}, {.filter_hz = 8.0, .min_segment = 0.5});
  const Preprocessed p = preprocess(r, plan);
  // Two rows and one row without data are bridged. 60, 40 and 300 rows are pauses; between the
  // first two lie 0.28 s, which is dropped.
  CHECK(p.segment.front() == 0);
  CHECK(p.segment.back() == 2);
  REQUIRE(p.notes.size() == 1);
  CHECK_THAT(p.notes[0],
             ContainsSubstring("the stretch from 3.1") && ContainsSubstring("was dropped"));
  for (long k = 1; k < p.rows(); ++k) {
    const double step = p.time[k] - p.time[k - 1];
    if (p.segment[k] == p.segment[k - 1])
      REQUIRE_THAT(step, WithinAbs(plan.dt, 1e-12));
    else
      REQUIRE(step > 0.1);
  }
  CHECK(std::isnan(p.tau(0, 1)));
  CHECK(p.q.allFinite());
  CHECK(p.tau.col(0).allFinite());
}

TEST_CASE("preprocess: torques that are logged less often than positions set the rate",
          "[recording]") {
  const double w = 2.0 * kPi * 0.5, dt = 0.001;
  const auto path = [&](double t) { return std::sin(w * t); };
  const Recording fast = sampled(uniform_times(20'000, dt), path);
  Recording slow = fast;
  for (long i = 0; i < slow.rows(); ++i)
    if (i % 10 != 3) slow.tau(i, 0) = kNaN;
  const PreprocessPlan plan = plan_preprocess({slow}, {.filter_hz = 8.0});
  CHECK_THAT(plan.dt, WithinAbs(10.0 * dt, 1e-12));
  const Preprocessed p = preprocess(slow, plan);
  CHECK(p.rows() == 2000);
  for (long k = 200; k < p.rows() - 200; ++k) {
    REQUIRE_THAT(p.q(k, 0), WithinAbs(path(p.time[k]), 1e-6));
    REQUIRE_THAT(p.tau(k, 0), WithinAbs(path(p.time[k]), 1e-9));
  }
  // A pause of the torque stays one.
  slow.tau.middleRows(8000, 2000).setConstant(kNaN);
  CHECK(preprocess(slow, plan_preprocess({slow}, {.filter_hz = 8.0})).segment.back() == 1);
}

TEST_CASE("preprocess: jitter costs what a cubic through the neighbours leaves", "[recording]") {
  const double w = 2.0 * kPi * 1.0, dt = 0.01;
  const Recording r =
      sampled(jittered_times(3000, dt, 0.2), [&](double t) { return std::sin(w * t); });
  const PreprocessPlan plan = plan_preprocess({r}, {.filter_hz = 20.0});
  CHECK(plan.timing_jitter > 0.5);
  CHECK_THAT(plan.dt, WithinAbs(dt, 1e-5));
  const Preprocessed p = preprocess(r, plan);
  double q_error = 0.0, qd_error = 0.0, tau_error = 0.0;
  for (long k = 200; k < p.rows() - 200; ++k) {
    const double t = p.time[k];
    q_error = std::max(q_error, std::abs(p.q(k, 0) - std::sin(w * t)));
    qd_error = std::max(qd_error, std::abs(p.qd(k, 0) - w * std::cos(w * t)));
    tau_error = std::max(tau_error, std::abs(p.tau(k, 0) - std::sin(w * t)));
  }
  // Cubic: 9/384 (w·1.4h)⁴ = 1.4e-6. Line: (w·1.4h)²/8 = 1e-3. A sample that is 2 % of a period off
  // the grid is taken as it is: 0.02 w h = 1.3e-3.
  CHECK(q_error < 1.4e-3);
  CHECK(qd_error < 0.05);
  CHECK(tau_error < 1.4e-3);
}

TEST_CASE("preprocess: torque of a drive that holds it is put at the rows' instants",
          "[recording]") {
  // Held values are the means of t³ over their periods; at the rows stands t³ itself.
  const double h = 0.01;
  Recording r = sampled(uniform_times(500, h), [](double t) { return std::sin(t); });
  for (long i = 0; i < r.rows(); ++i) {
    const double t = r.time[i];
    r.tau(i, 0) = (std::pow(t + h, 4) - std::pow(t, 4)) / (4.0 * h);
  }
  const PreprocessPlan plan = plan_preprocess({r}, {.filter_hz = 10.0});
  const Preprocessed instant = preprocess(r, plan);
  r.info.torque_sampling = TorqueSampling::kHold;
  const Preprocessed hold = preprocess(r, plan);
  for (long k = 2; k < hold.rows() - 1; ++k) {  // rows at the ends lack a neighbour
    CHECK(instant.tau(k, 0) == r.tau(k, 0));
    CHECK_THAT(hold.tau(k, 0), WithinAbs(std::pow(hold.time[k], 3), 1e-11));
  }
}

TEST_CASE("preprocess: the automatic cut-off is near the best there is", "[recording]") {
  const double noise = GENERATE(1e-3, 1e-4, 1e-5), motion_hz = GENERATE(0.2, 1.0);
  CAPTURE(noise, motion_hz);
  // Harmonics that fall as 1/n³, as excitation trajectories and their control do.
  const double dt = 0.002;
  const auto harmonics = [&](double t, int derivative) {
    double sum = 0.0;
    for (int n = 1; n <= 8; ++n) {
      const double w = 2.0 * kPi * motion_hz * n, phase = w * t + n * n;
      sum += (derivative == 0 ? std::sin(phase) : -w * w * std::sin(phase)) / (n * n * n);
    }
    return sum;
  };
  Rng rng(5);
  const Recording r = sampled(uniform_times(15'000, dt),
                              [&](double t) { return harmonics(t, 0) + noise * rng.normal(); });
  const auto error_of = [&](double hz) {
    const Preprocessed p = preprocess(r, plan_preprocess({r}, {.filter_hz = hz}));
    double sum = 0.0;
    for (long k = 1000; k < p.rows() - 1000; ++k)
      sum += std::pow(p.qdd(k, 0) - harmonics(p.time[k], 2), 2);
    return std::sqrt(sum);
  };
  const PreprocessPlan plan = plan_preprocess({r});
  double best = std::numeric_limits<double>::infinity();
  for (double hz = 0.3; hz < 100.0; hz *= 1.15) best = std::min(best, error_of(hz));
  CAPTURE(plan.filter_hz);
  // "Best" knows the truth; 2.3 times its error is the most observed.
  CHECK(error_of(plan.filter_hz) < 2.6 * best);
  CHECK(std::abs(plan.q_noise[0] / noise - 1.0) < 0.2);
}

TEST_CASE("preprocess: motion behind a quiet band is not cut off", "[recording]") {
  Rng rng(5);
  const Recording r = sampled(uniform_times(15'000, 0.002), [&](double t) {
    return std::sin(2.0 * kPi * 0.4 * t) + 0.01 * std::sin(2.0 * kPi * 15.0 * t) +
           1e-5 * rng.normal();
  });
  const PreprocessPlan plan = plan_preprocess({r});
  CHECK(plan.filter_hz > 20.0);
  // 15 Hz carry nearly all of the acceleration: 50 Hz would keep them only to 17.5.
  CHECK(plan.decimator.factor <= 11);
}

TEST_CASE("preprocess: what comes at events is motion, however little of all time it takes",
          "[recording]") {
  // Once a second something lets go, and swings out within 30 ms: 100 times the noise, but spread
  // over all time a slope without a lowest point.
  const double dt = 0.002, every = 1.0, fades = 0.012, noise = 2e-5;
  const double events = GENERATE(0.0, 1.0);  // none, or these
  Rng rng(6);
  const Recording r = sampled(uniform_times(10'000, dt), [&](double t) {
    const double since = std::fmod(t, every);
    return std::sin(2.0 * kPi * 0.3 * t) + noise * rng.normal() +
           events * 100.0 * noise * std::exp(-since / fades) * std::sin(2.0 * kPi * 20.0 * since);
  });
  const PreprocessPlan plan = plan_preprocess({r});
  CAPTURE(events, plan.filter_hz);
  CHECK((plan.filter_hz > 10.0) == (events > 0.0));
}

TEST_CASE("preprocess: one start from rest is no reason for a wider band", "[recording]") {
  const double dt = 0.002, noise = 2e-5;
  Rng rng(7);
  const Recording r =
      sampled(uniform_times(10'000, dt), [&](double t) {  // a controller's first jerk
        return std::sin(2.0 * kPi * 0.3 * t) - 0.02 * std::exp(-t / 0.02) + noise * rng.normal();
      });
  CHECK(plan_preprocess({r}).filter_hz < 20.0);
}

TEST_CASE("preprocess: lines of an even motion over an encoder's steps are no motion",
          "[recording]") {
  // Moves at an even speed between pauses, as a controller plans them: a joint that hardly takes
  // part, at 2 mrad/s, which it reaches in 0.12 s; its encoder has 19 bits.
  const double step = 2.0 * kPi / (1 << 19), dt = 0.004, ramp = 0.12;
  Rng rng(GENERATE(3u, 4u));
  std::vector<double> path;
  for (double at = 0.0, side = 1.0; path.size() < 12'500; side = -side) {
    const double speed = side * rng.uniform(0.002, 0.0022), length = rng.uniform(2.0, 8.0);
    const long rows = std::lround(length / dt), pause = std::lround(rng.uniform(0.1, 0.7) / dt);
    for (long k = 0; k < rows + pause; ++k) {
      const double left = static_cast<double>(rows - k) * dt, since = static_cast<double>(k) * dt;
      path.push_back(at);
      if (left > 0.0) at += dt * speed * std::min({1.0, since / ramp, left / ramp});
    }
  }
  const auto rounded = [&](double t) {
    return std::round(path[static_cast<std::size_t>(std::lround(t / dt))] / step) * step;
  };
  const PreprocessPlan plan = plan_preprocess({sampled(uniform_times(12'500, dt), rounded)});
  CAPTURE(plan.filter_hz);
  CHECK(plan.filter_hz < 0.2 / dt);
  CHECK_THAT(plan.q_step[0], Catch::Matchers::WithinRel(step, 1e-6));
}

TEST_CASE("preprocess: decimation is about 50 Hz, at most twice the cut-off", "[recording]") {
  const auto factor = [](double dt, double wanted, double filter_hz) {
    Rng rng(5);
    const Recording r = sampled(uniform_times(5000, dt), [&](double t) {
      return std::sin(2.0 * kPi * 0.4 * t) + 1e-5 * rng.normal();
    });
    return plan_preprocess({r}, {.filter_hz = filter_hz, .decimate_to_hz = wanted})
        .decimator.factor;
  };
  CHECK(factor(0.001, 0.0, 60.0) == 20);  // 50 Hz
  CHECK(factor(0.01, 0.0, 40.0) == 2);
  CHECK(factor(0.025, 0.0, 15.0) == 1);
  CHECK(factor(0.001, 0.0, 10.0) == 50);  // 20 Hz: rows further apart than the filter's memory
  CHECK(factor(0.001, 100.0, 10.0) == 10);
  CHECK(factor(0.001, 5000.0, 10.0) == 1);
}

TEST_CASE("preprocess: measured velocities are filtered, and give the accelerations",
          "[recording]") {
  const double w = 2.0 * kPi, dt = 0.005;
  Recording r = sampled(uniform_times(2000, dt), [&](double t) { return std::sin(w * t); });
  r.qd.resize(2000, 1);
  for (long i = 0; i < 2000; ++i)
    r.qd(i, 0) = 2.0 * w * std::cos(w * r.time[i]);  // twice: told apart
  const Preprocessed p =
      preprocess(r, plan_preprocess({r}, {.filter_hz = 20.0, .measured_velocity = true}));
  for (long k = 500; k < 1500; ++k) {
    CHECK_THAT(p.qd(k, 0), WithinAbs(2.0 * w * std::cos(w * p.time[k]), 1e-6));
    CHECK_THAT(p.qdd(k, 0), WithinAbs(-2.0 * w * w * std::sin(w * p.time[k]), 1e-4));
  }
}

TEST_CASE("preprocess: what cannot be done is said", "[recording]") {
  const Recording good = sampled(uniform_times(500, 0.01), [](double t) { return std::sin(t); });
  CHECK_THROWS_AS(plan_preprocess({}), DataError);
  Recording none = good;
  none.q.setConstant(kNaN);
  CHECK_THROWS_WITH(plan_preprocess({none}), ContainsSubstring("nothing to differentiate"));
  Recording other = good;
  other.joint_names = {"b"};
  CHECK_THROWS_WITH(plan_preprocess({good, other}),
                    ContainsSubstring("the joints are not those of"));
  CHECK_THROWS_WITH(plan_preprocess({good}, {.filter_hz = 50.0}),
                    ContainsSubstring("filter_hz is 50") && ContainsSubstring("below half"));
  CHECK_THROWS_WITH(plan_preprocess({good}, {.measured_velocity = true}),
                    ContainsSubstring("no column qd_<joint>"));
  const Recording brief = sampled(uniform_times(20, 0.01), [](double t) { return std::sin(t); });
  CHECK_THROWS_WITH(plan_preprocess({brief}), ContainsSubstring("lasts 0.19 s"));
  CHECK(preprocess(brief, plan_preprocess({brief}, {.min_segment = 0.0})).rows() == 20);
  CHECK_THROWS_WITH(plan_preprocess({brief}, {.filter_hz = 10.0}),
                    ContainsSubstring("10 Hz leaves fewer than five rows of 0.19 s") &&
                        ContainsSubstring("expected 26.32 Hz or more"));
  Recording pieces = good;  // half an hour, of which 2.5 s are together
  pieces.time.tail(250).array() += 1800.0;
  CHECK_THROWS_WITH(plan_preprocess({pieces}, {.filter_hz = 0.1}),
                    ContainsSubstring("five rows of 2.49 s (its longest stretch without a gap)"));
  Preprocessor stream(plan_preprocess({good}));
  stream.push(good);
  other = good;
  other.run = 1;
  CHECK_THROWS_WITH(stream.push(other), ContainsSubstring("finish() ends a recording"));
}

}  // namespace diffnea::preprocess_test
