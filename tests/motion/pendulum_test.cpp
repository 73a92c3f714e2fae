/// A pendulum with known friction, integrated elsewhere, is found from any recording of it.

#include <algorithm>
#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/identify/identify.hpp>

#include "motion/free_swing.hpp"
#include "support/found.hpp"

namespace pendulum_test {

using namespace diffnea;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;
using diffnea::test::even_times;
using diffnea::test::find;
using diffnea::test::free_swing;
using diffnea::test::FreeSwing;
using diffnea::test::swing_model;

namespace {

IdentifyOptions friction_alone() {
  IdentifyOptions options;
  options.loss = Loss::kMotion;
  options.choice.fit = {"effects"};
  options.choice.effects = {{"coulomb_friction", "quadratic_friction"}};
  return options;
}

double coulomb(const IdentifyResult& r) {
  return find(r, "pendulum.coulomb_friction.coulomb").value;
}

std::string note_with(const IdentifyResult& r, const std::string& text) {
  const auto it =
      std::ranges::find_if(r.notes, [&](const std::string& n) { return n.find(text) != n.npos; });
  return it == r.notes.end() ? std::string() : *it;
}

/// Both to within four of their standard errors, and these are small.
void check_found(const IdentifyResult& r, const FreeSwing& truth, double share) {
  const ParameterEstimate& c = find(r, "pendulum.coulomb_friction.coulomb");
  const ParameterEstimate& d = find(r, "pendulum.quadratic_friction.quadratic");
  CAPTURE(c.value, c.std, d.value, d.std, r.summary.termination);
  CHECK(r.summary.converged);
  CHECK(c.value == Approx(truth.coulomb).epsilon(share));
  CHECK(d.value == Approx(truth.quadratic).epsilon(share));
  CHECK(std::abs(c.value - truth.coulomb) < 4.0 * c.std);
  CHECK(std::abs(d.value - truth.quadratic) < 4.0 * d.std);
}

}  // namespace

TEST_CASE("motion: friction of a pendulum from one run, the horizon the whole of it", "[motion]") {
  const FreeSwing truth;
  const IdentifyResult r = identify(
      swing_model(), {free_swing(truth, even_times(0.0, 40.0, 100.0))}, {}, friction_alone());
  check_found(r, truth, 0.02);
  CHECK(r.summary.horizon == Approx(40.0));
  // Nothing is left but the noise, at every horizon.
  for (const HorizonError& e : r.horizons) {
    CAPTURE(e.horizon);
    CHECK(e.train == Approx(truth.noise).epsilon(0.1));
    CHECK(e.apart == 0);
    CHECK(std::isnan(e.test));
  }
  CHECK(r.horizons.back().nominal_train > 100.0 * truth.noise);
}

TEST_CASE("motion: friction of a pendulum from forty runs of 0.6 s", "[motion]") {
  FreeSwing swing;
  std::vector<Recording> runs;
  for (int k = 0; k < 40; ++k) {
    swing.q0 = 0.2 + 0.03 * k;
    swing.qd0 = 3.0 - 0.15 * k;
    swing.seed = static_cast<unsigned>(k + 1);
    runs.push_back(free_swing(swing, even_times(5.0, 0.6, 250.0)));
    runs.back().run = k;
    runs.back().source = "run " + std::to_string(k);
  }
  const IdentifyResult r = identify(swing_model(), runs, {}, friction_alone());
  check_found(r, swing, 0.3);  // 24 s in pieces, the noise 2e-4 rad: 4 to 10 % (observed)
  CHECK(r.summary.horizon == Approx(0.6));
}

TEST_CASE("motion: friction of a pendulum from a clock that jitters and has gaps", "[motion]") {
  const FreeSwing truth;
  Rng rng(7);
  std::vector<double> times;
  for (double t = 0.0; t < 30.0; t += 0.004 + 0.012 * rng.uniform())
    if (!(t > 8.0 && t < 8.7) && !(t > 19.0 && t < 21.0)) times.push_back(t);
  Recording data = free_swing(truth, times);
  for (long k = 0; k < data.rows(); k += 17) data.q(k, 0) = std::nan("");
  const IdentifyResult r = identify(swing_model(), {data}, {}, friction_alone());
  check_found(r, truth, 0.03);
  CHECK(r.summary.horizon > 29.0);  // nothing drives it: it swings through the gaps
}

TEST_CASE("motion: a start far off is led to the truth, and lost without continuation",
          "[motion]") {
  FreeSwing truth{.coulomb = 0.0, .quadratic = 0.0, .viscous = 2e-4};
  Model model = swing_model();
  // 20 % of the frequency: after two periods the simulation swings against the recording.
  model.links.at(0).inertia.h.z *= 0.7;
  IdentifyOptions options = friction_alone();
  options.choice.fit = {"effects", "inertia"};
  options.choice.fix = {"rod.mass", "rod.Ixx", "rod.Iyy", "rod.Izz", "rod.Ixy",
                        "rod.Ixz",  "rod.Iyz", "rod.hx",  "rod.hy"};
  options.choice.effects = {{"viscous_friction"}};
  const Recording data = free_swing(truth, even_times(0.0, 40.0, 100.0));
  const IdentifyResult led = identify(model, {data}, {}, options);
  CHECK(led.summary.converged);
  CHECK(find(led, "rod.hz").value == Approx(-0.107 * 0.23).epsilon(1e-3));
  CHECK(find(led, "pendulum.viscous_friction.viscous").value ==
        Approx(truth.viscous).epsilon(0.01));
  CHECK(led.errors[0].train == Approx(truth.noise).epsilon(0.1));
  options.motion.first_horizon = 40.0;
  const IdentifyResult lost = identify(model, {data}, {}, options);
  CAPTURE(lost.errors[0].train, lost.summary.termination, led.errors[0].train);
  CHECK(lost.errors[0].train > 100.0 * truth.noise);
  CHECK_FALSE(lost.summary.converged);  // a window that falls apart is no result
}

TEST_CASE("motion: windows that fall apart are reported with joint, time, horizon and count",
          "[motion]") {
  // The recording is pushed at 20 s and at 30 s, of which nothing tells: no model follows beyond.
  FreeSwing swing;
  Recording data = free_swing(swing, even_times(0.0, 10.0, 100.0));
  const auto go_on = [&](double from, double to, double q0) {
    FreeSwing next = swing;
    next.q0 = q0;
    const Recording more = free_swing(next, even_times(from, to - from, 100.0));
    const long rows = data.rows(), m = more.rows() - 1;
    data.time.conservativeResize(rows + m);
    data.q.conservativeResize(rows + m, 1);
    data.tau.conservativeResize(rows + m, 1);
    data.time.tail(m) = more.time.tail(m);
    data.q.bottomRows(m) = more.q.bottomRows(m);
    data.tau.bottomRows(m).setZero();
  };
  go_on(10.0, 20.0, -0.4);
  go_on(20.0, 30.0, 0.9);
  go_on(30.0, 40.0, -0.8);
  const IdentifyResult r = identify(swing_model(), {data}, {}, friction_alone());
  const std::string note = note_with(r, "falls apart at a horizon of");
  INFO(note);
  CHECK_THAT(note, ContainsSubstring("pendulum at") && ContainsSubstring("windows, after"));
  CHECK(r.horizons.back().horizon == r.summary.horizon);
  // The result is that of the last horizon that held: no window of ten seconds is without a push.
  CHECK(r.summary.horizon < 10.0);
  CAPTURE(r.summary.termination);
  CHECK(r.summary.converged);
}

TEST_CASE("motion: the shape of a curve is fitted, too", "[motion]") {
  // Slow enough that a row every 5 ms sees the curve.
  FreeSwing truth{.coulomb = 6e-4, .quadratic = 0.0, .smoothing = 0.2};
  Model model = swing_model();
  model.effects.push_back(
      {"coulomb_friction", "pendulum", {{"coulomb", 3e-4, ""}, {"smoothing", 0.5, ""}}});
  IdentifyOptions options = friction_alone();
  options.choice.fit = {"effects", "shapes"};
  options.choice.effects = std::vector<std::string>{};
  truth.noise = 2e-5;
  const IdentifyResult r =
      identify(model, {free_swing(truth, even_times(0.0, 40.0, 200.0))}, {}, options);
  CHECK(r.summary.converged);
  CHECK(coulomb(r) == Approx(truth.coulomb).epsilon(0.01));
  const ParameterEstimate& v0 = find(r, "pendulum.coulomb_friction.smoothing");
  CHECK(v0.std > 0.0);
  CHECK(v0.value == Approx(truth.smoothing).epsilon(0.05));
  CHECK(std::abs(v0.value - truth.smoothing) < 4.0 * v0.std);
}

TEST_CASE("motion: held-out runs are judged at the same horizons", "[motion]") {
  FreeSwing other{.q0 = 0.3, .seed = 9};
  const IdentifyResult r =
      identify(swing_model(), {free_swing({}, even_times(0.0, 20.0, 100.0))},
               {free_swing(other, even_times(100.0, 20.0, 100.0))}, friction_alone());
  CHECK(r.errors[0].test == Approx(other.noise).epsilon(0.2));
  CHECK(r.errors[0].nominal_test > 20.0 * other.noise);
  CHECK(r.horizons.back().test == r.errors[0].test);
  for (std::size_t k = 1; k < r.horizons.size(); ++k)
    CHECK(r.horizons[k].horizon > r.horizons[k - 1].horizon);
}

}  // namespace pendulum_test
