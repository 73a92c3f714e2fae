/// For how long a simulation follows held-out motion, without and with what a diagnosis names.

#include "diagnose/simulated.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/report/diagnose_text.hpp>

#include "diagnose/replayed_windows.hpp"
#include "diagnose/spread_windows.hpp"
#include "motion/free_swing.hpp"
#include "motion/joint_windows.hpp"
#include "support/swinging.hpp"
#include "support/three_links.hpp"

namespace simulated_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::StartsWith;

namespace {

const auto kGoOn = [] { return true; };

Model swing_with(double coulomb) {
  Model out = swing_model();
  out.effects = {{"coulomb_friction", "pendulum", {{"coulomb", coulomb, ""}}},
                 {"quadratic_friction", "pendulum", {{"quadratic", FreeSwing{}.quadratic, ""}}}};
  return out;
}

HeldOutSimulation simulated(const Model& base, const Model& extended, bool alike,
                            const HeldOutMotion& motion,
                            const std::function<bool()>& go_on = kGoOn) {
  return simulate_held_out(base, extended, alike, {motion, motion}, {}, go_on);
}

/// Ends of windows [s], stretch by stretch.
double end_of(const std::vector<MotionStretch>& all, const MotionWindow& w) {
  return all[w.stretch].time[static_cast<std::size_t>(w.first + w.rows - 1)];
}

}  // namespace

TEST_CASE("diagnose: a horizon ends where the error crosses its tolerance", "[diagnose]") {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  // A power law: error ∝ T, from a quarter to four times the tolerance.
  CHECK(follows({1.0, 16.0}, {0.25, 4.0}) == Approx(4.0));
  CHECK(follows({1.0, 2.0, 4.0}, {0.1, 0.5, 2.0}) == Approx(2.0 * std::sqrt(2.0)));
  CHECK(follows({1.0, 2.0}, {1.1, 0.5}) == 0.0);            // not even the shortest
  CHECK(follows({1.0, 2.0, 5.0}, {0.1, 0.2, 1.0}) == 5.0);  // all of it
  CHECK(follows({1.0, 2.0, 4.0}, {0.5, 2.0, 0.5}) == Approx(std::sqrt(2.0)));  // the first crossing
  CHECK(follows({1.0, 2.0, 4.0}, {0.5, 0.6, kNaN}) == 2.0);
  CHECK(follows({1.0, 2.0}, {0.0, 2.0}) > 1.0);
}

TEST_CASE("diagnose: windows are spread over all stretches, bounded, and grow where they began",
          "[diagnose]") {
  std::vector<Recording> parts;
  for (const double seconds : {3.0, 40.0, 7.0}) {
    parts.push_back(free_swing({}, even_times(100.0, seconds, 100.0)));
    parts.back().run = static_cast<int>(parts.size()) - 1;
  }
  const HeldOutMotion motion = motion_of(parts);
  REQUIRE(motion.stretches.size() == 3);
  std::vector<MotionWindow> windows = spread_windows(motion.stretches, 0.25, 24);
  CHECK(windows.size() >= 20);
  CHECK(windows.size() <= 26);  // a fraction of a window more in each stretch
  for (double horizon = 0.25; horizon < 40.0; horizon *= 2.0) {
    const std::vector<MotionWindow> longer = lengthened(motion.stretches, windows, horizon, 1e9);
    CAPTURE(horizon, longer.size());
    REQUIRE_FALSE(longer.empty());
    for (std::size_t i = 0; i < longer.size(); ++i) {
      const MotionWindow& w = longer[i];
      const double from = motion.stretches[w.stretch].time[static_cast<std::size_t>(w.first)];
      CHECK(end_of(motion.stretches, w) - from > 0.89 * horizon);
      CHECK(std::ranges::any_of(windows, [&](const MotionWindow& o) {
        return o.stretch == w.stretch && o.first == w.first;
      }));
      if (i > 0 && longer[i - 1].stretch == w.stretch)
        CHECK(from > end_of(motion.stretches, longer[i - 1]) - 0.011);
    }
    windows = longer;
  }
  const std::vector<MotionWindow> whole = lengthened(motion.stretches, windows, 40.0, 1e9);
  REQUIRE(whole.size() == 1);
  CHECK(whole.front().rows == 4001);
  // Where there are too many rows, windows are fewer; that which can become the longest stays.
  const std::vector<MotionWindow> all = spread_windows(motion.stretches, 0.25, 24);
  const std::vector<MotionWindow> few = lengthened(motion.stretches, all, 0.25, 100.0);
  CHECK(few.size() == 3);  // windows of 26 rows
  CHECK(std::ranges::any_of(few,
                            [](const MotionWindow& w) { return w.stretch == 1 && w.first == 0; }));
}

TEST_CASE("diagnose: of a fast log some rows are simulated, and all of the torque", "[diagnose]") {
  const FreeSwing truth;
  Recording fast = free_swing(truth, even_times(0.0, 4.0, 1000.0));
  fast.info.passive.clear();
  fast.has_tau = {true};
  fast.info.torque_sampling = TorqueSampling::kHold;
  for (long k = 0; k < fast.rows(); ++k) fast.tau(k, 0) = static_cast<double>(k % 8);
  const HeldOutMotion motion = motion_of({fast});
  REQUIRE(motion.stretches.size() == 1);
  const MotionStretch& s = motion.stretches[0];
  CHECK(s.time.size() == 501);  // 12 rows in 0.1 s and no more than needed: every eighth
  CHECK(s.time[3] == Approx(0.024));
  CHECK(s.u(3, 0) == Approx(3.5));
  CHECK(s.u_end(3, 0) == Approx(3.5));
  CHECK(motion.noise.position[0] == Approx(truth.noise).epsilon(0.1));
}

TEST_CASE("diagnose: the right friction follows a pendulum to its end, a wrong one does not",
          "[diagnose]") {
  const FreeSwing truth;
  const HeldOutMotion motion = motion_of({free_swing(truth, even_times(0.0, 40.0, 100.0))});
  CHECK(motion.noise.position[0] == Approx(truth.noise).epsilon(0.1));
  CHECK(motion.tolerance[0] == Approx(0.011).epsilon(0.1));  // 1 % of ± 0.6 rad, less what it loses
  const Model wrong = swing_with(0.0), right = swing_with(truth.coulomb);
  const SimulatedMotion m = simulated(wrong, right, false, motion).motion;
  CAPTURE(m.reason, m.base_follows, m.extended_follows);
  REQUIRE(m.reason.empty());
  CHECK(m.horizons.back().horizon == Approx(40.0));
  CHECK(m.extended_follows == m.horizons.back().horizon);
  for (const SimulatedHorizon& h : m.horizons) {
    CAPTURE(h.horizon, h.windows);
    CHECK(h.extended_rmse.at(0) == Approx(truth.noise).epsilon(0.15));
    CHECK(h.extended == Approx(h.extended_rmse.at(0) / motion.tolerance[0]));
    CHECK(h.extended_apart == 0);
  }
  CHECK(m.base_follows > m.horizons.front().horizon);
  CHECK(m.base_follows < 0.5 * m.extended_follows);
  CHECK(m.joints.at(0).base_follows == m.base_follows);  // there is no other joint
  // Drawn is the first horizon that the base does not follow.
  CHECK(m.window > m.base_follows);
  CHECK(m.joints[0].base_rmse > m.joints[0].tolerance);
  CHECK(m.joints[0].time.size() == m.joints[0].extended.size());
  CHECK(m.joints[0].time.size() > 500);
  CHECK(m.joints[0].time.size() <= 3001);
  const SimulatedMotion same = simulated(wrong, wrong, true, motion).motion;
  CHECK(same.extended_follows == m.base_follows);
}

TEST_CASE("diagnose: torques drive a simulation when they act", "[diagnose]") {
  const SwingingEvidence evidence(20.0);
  const double row = 0.01;
  const HeldOutMotion logged = held_out_motion(*evidence.source, *evidence, {}, 0.0),
                      late = held_out_motion(*evidence.source, *evidence, {}, 2.0 * row),
                      half = held_out_motion(*evidence.source, *evidence, {}, 0.5 * row);
  const RowMatX<double>&u = logged.stretches[0].u, &v = late.stretches[0].u,
                       &w = half.stretches[0].u;
  REQUIRE(logged.stretches[0].time[1] - logged.stretches[0].time[0] == Approx(row));
  REQUIRE(u.rows() > 100);
  const auto apart = [](const auto& a, const auto& b) {
    return (a - b).cwiseAbs().maxCoeff();
  };
  CHECK(apart(v.middleRows(10, 80), u.middleRows(8, 80)) < 1e-9);
  CHECK(apart(w.middleRows(10, 80), 0.5 * (u.middleRows(10, 80) + u.middleRows(9, 80))) < 1e-9);
  CHECK(apart(v.middleRows(10, 80), u.middleRows(10, 80)) > 0.1);
}

TEST_CASE("diagnose: a cause with which a simulation follows less well is told", "[diagnose]") {
  const FreeSwing truth;
  const HeldOutMotion motion = motion_of({free_swing(truth, even_times(0.0, 40.0, 100.0))});
  const Model right = swing_with(truth.coulomb), wrong = swing_with(2.0 * truth.coulomb);
  CHECK(simulated(right, wrong, false, motion).loses);
  CHECK_FALSE(simulated(wrong, right, false, motion).loses);
  CHECK_FALSE(simulated(right, right, false, motion).loses);
  // Four times the error, of a hundredth of the motion: in 8 s both follow all along.
  const HeldOutMotion brief = motion_of({free_swing(truth, even_times(0.0, 8.0, 100.0))});
  const HeldOutSimulation within = simulated(right, wrong, false, brief);
  const auto h = std::ranges::find(within.motion.horizons, 6, &SimulatedHorizon::windows);
  REQUIRE(h != within.motion.horizons.end());
  CHECK(h->extended > 4.0 * h->base);
  CHECK(within.motion.extended_follows == within.motion.base_follows);
  CHECK_FALSE(within.loses);
  // Half as much again of an error is none to refute by.
  CHECK_FALSE(simulated(right, swing_with(1.05 * truth.coulomb), false, motion).loses);
}

TEST_CASE("diagnose: windows that fall apart are reported with model, joint, time and horizon",
          "[diagnose]") {
  // From 10 to 13 s a hand holds the pendulum, of which nothing tells.
  const FreeSwing swing;
  Recording data = free_swing(swing, even_times(0.0, 20.0, 100.0));
  for (long k = 0; k < data.rows(); ++k)
    if (data.time[k] > 10.0 && data.time[k] < 13.0) data.q(k, 0) = 0.9;
  const Model right = swing_with(swing.coulomb);
  const SimulatedMotion motion =
      simulated(right, right, true, motion_of({data})).motion;
  CAPTURE(motion.reason, motion.base_follows);
  REQUIRE_FALSE(motion.apart.empty());
  const ApartWindow& at = motion.apart.front();
  CAPTURE(at.model, at.time, at.horizon);
  CHECK(at.model == "base");
  CHECK(at.joint == "pendulum");
  CHECK(at.run == 0);
  const auto h = std::ranges::find(motion.horizons, at.horizon, &SimulatedHorizon::horizon);
  REQUIRE(h != motion.horizons.end());
  CHECK(h->base_apart == std::ssize(motion.apart));
  CHECK(h->base > 1.0);
  for (const ApartWindow& a : motion.apart) {
    CHECK(a.time > 10.0 - a.horizon);
    CHECK(a.time < 13.0 + a.horizon);
    CHECK(a.horizon == at.horizon);
  }
  CHECK(motion.base_follows < at.horizon);
}

TEST_CASE("diagnose: a simulation that runs away ends the ladder, its error is the motion's size",
          "[diagnose]") {
  Model wild = swing_with(0.0);
  wild.links.at(0).inertia.h.z *= -1.0;  // upside down: away from 0 by e in a sixth of a second
  const FreeSwing truth;
  const HeldOutMotion held = motion_of({free_swing(truth, even_times(0.0, 40.0, 100.0))});
  const SimulatedMotion motion = simulated(wild, wild, true, held).motion;
  CAPTURE(motion.reason);
  REQUIRE_FALSE(motion.horizons.empty());
  const SimulatedHorizon& last = motion.horizons.back();
  CHECK(last.horizon < 10.0);
  CHECK(2 * last.base_apart >= last.windows);
  CHECK(last.base_rmse.at(0) <= held.size[0] * (1.0 + 1e-9));
  CHECK(last.base_rmse.at(0) > 0.5 * held.size[0]);
  CHECK(motion.base_follows < 1.0);
}

TEST_CASE("diagnose: what no simulation holds beside the base is told from a base that none holds",
          "[diagnose]") {
  const FreeSwing truth;
  const HeldOutMotion held = motion_of({free_swing(truth, even_times(0.0, 20.0, 100.0))});
  const Model base = swing_with(0.0);
  Model both = base;
  const EffectSpec spring{
      "joint_elasticity", "pendulum", {{"stiffness", 10.0, ""}, {"motor_inertia", 1e-3, ""}}};
  both.effects.push_back(spring);
  both.effects.push_back({"backlash", "pendulum", {{"motor_inertia", 1e-3, ""}}});
  const HeldOutSimulation out = simulated(base, both, false, held);
  CHECK_THAT(out.unheld, ContainsSubstring("hidden motor already"));
  CHECK_THAT(out.motion.reason, ContainsSubstring("hidden motor already"));
  Model more = both;
  more.effects.push_back({"viscous_friction", "pendulum", {{"viscous", 1e-4, ""}}});
  const HeldOutSimulation none = simulated(both, more, false, held);
  CHECK(none.unheld.empty());
  CHECK_THAT(none.motion.reason, ContainsSubstring("hidden motor already"));
}

TEST_CASE("diagnose: effects without derivatives are replayed, on any clock, from the same states",
          "[diagnose]") {
  Rng rng(3);
  std::vector<double> times;
  for (double t = 50.0; t < 56.0; t += 0.008 + 0.004 * rng.uniform()) times.push_back(t);
  const FreeSwing truth;
  const HeldOutMotion motion = motion_of({free_swing(truth, times)});
  const Model model = swing_with(truth.coulomb);
  MotionWindow window{0, 100, 300, VecX<double>::Zero(2)};
  const LocalMotion at = local_motion(motion.stretches[0], motion.stretches[0].time[100], 100, 12);
  window.state << at.q, at.qd;
  JointWindows exact(extend(model), {}, {}, SteppingOptions{});
  PathWindows path(extend(model));
  ReplayedWindows replayed(extend(model), 50.0);
  // 2 % of the tolerance: steps over a reversal differ.
  CHECK((replayed.positions(motion.stretches[0], window) -
         exact.positions(motion.stretches[0], window))
            .cwiseAbs()
            .maxCoeff() < 2e-4);
  MotionWindow a = window, b = window, c = window;
  fit_state(exact, motion.stretches[0], a, motion.tolerance, {});
  fit_state(replayed, motion.stretches[0], b, motion.tolerance, {});
  fit_state(path, motion.stretches[0], c, motion.tolerance, {});
  CHECK((a.state - c.state).cwiseAbs().maxCoeff() < 1e-4);
  CHECK((a.state - b.state).cwiseAbs().maxCoeff() < 2e-3);

  CHECK_FALSE(needs_replay(extend(model)));
  Model late = model;
  late.effects.push_back({"time_shift", "all", {{"shift", 0.05, ""}}});
  REQUIRE(needs_replay(extend(late)));
  // The pendulum's clock alone shifts nothing that a state does not take over.
  const SimulatedMotion both = simulated(model, late, false, motion).motion;
  CAPTURE(both.reason);
  REQUIRE(both.reason.empty());
  CHECK(both.extended_follows == both.base_follows);
  CHECK(both.horizons.back().extended == Approx(both.horizons.back().base).epsilon(0.05));
}

TEST_CASE("diagnose: derivatives along the path are those of its first state", "[diagnose]") {
  const FreeSwing truth;
  const HeldOutMotion motion = motion_of({free_swing(truth, even_times(0.0, 6.0, 200.0))});
  const Model model = swing_with(truth.coulomb);
  MotionWindow window{0, 100, 200, VecX<double>::Zero(2)};
  const LocalMotion at = local_motion(motion.stretches[0], motion.stretches[0].time[100], 100, 12);
  window.state << at.q, at.qd;
  JointWindows exact(extend(model), {}, {}, SteppingOptions{});
  PathWindows path(extend(model));
  TriangularFactor of_exact(2), of_path(2);
  REQUIRE(exact.linearise(motion.stretches[0], window, motion.tolerance, of_exact));
  REQUIRE(path.linearise(motion.stretches[0], window, motion.tolerance, of_path));
  const MatX<double> R = of_exact.R(), S = of_path.R();
  // Steps of a row, of order one: 2 % of each column over a second.
  CHECK((R.transpose() * R - S.transpose() * S).norm() < 0.05 * (R.transpose() * R).norm());
  REQUIRE(path.sharpen());
  CHECK_FALSE(path.sharpen());
  TriangularFactor of_differences(2);
  REQUIRE(path.linearise(motion.stretches[0], window, motion.tolerance, of_differences));
  const MatX<double> D = of_differences.R();
  CHECK((R.transpose() * R - D.transpose() * D).norm() < 0.01 * (R.transpose() * R).norm());
}

TEST_CASE("diagnose: whoever interrupts a simulation waits for one window at most", "[diagnose]") {
  const HeldOutMotion motion = motion_of({free_swing({}, even_times(0.0, 40.0, 100.0))});
  for (const int allowed : {0, 5, 40, 77}) {  // 24 windows a model and horizon
    int asked = 0;
    const SimulatedMotion m =
        simulated(swing_with(0.0), swing_with(1e-4), false, motion, [&] {
          return asked++ < allowed;
        }).motion;
    CHECK(asked == allowed + 1);
    CHECK(m.horizons.empty() != (m.reason.empty()));
    CHECK(m.horizons.size() == (allowed < 48 ? 0 : 1));
    CHECK(m.joints.size() == m.horizons.size());
  }
}

TEST_CASE("diagnose: the first sentence says how long the simulation follows, before and after",
          "[diagnose]") {
  const Recording train = arm().recorded({kCoulomb}, 1), test = arm().recorded({kCoulomb}, 2);
  const Finding finding = diagnose(arm().nominal, {train}, {test});
  const SimulatedMotion& motion = finding.simulated;
  CAPTURE(finding.sentence, motion.reason);
  REQUIRE(finding.causes.size() == 1);
  CHECK(motion.extended_follows > 1.5 * motion.base_follows);
  REQUIRE(motion.joints.size() == 3);
  const SimulatedSeries& elbow = motion.joints[2];
  CHECK(elbow.joint == "elbow");
  CHECK(elbow.unit == "rad");
  CHECK(elbow.extended_follows > 1.5 * elbow.base_follows);
  CHECK(elbow.extended_rmse < 0.5 * elbow.base_rmse);
  CHECK_THAT(finding.sentence, StartsWith("Your simulation ") &&
                                   ContainsSubstring(" within 1 % of each joint's motion (") &&
                                   ContainsSubstring(" mrad); with this cause") &&
                                   ContainsSubstring(". The model lacks coulomb friction"));
}

TEST_CASE("diagnose: where nothing is named the first sentence has one clause", "[diagnose]") {
  const Recording train = arm().recorded({}, 1), test = arm().recorded({}, 2);
  const Finding finding = diagnose(arm().nominal, {train}, {test});
  CAPTURE(finding.sentence);
  REQUIRE(finding.causes.empty());
  CHECK(finding.simulated.base_follows > 0.0);
  CHECK(finding.simulated.extended_follows == finding.simulated.base_follows);
  CHECK_THAT(finding.sentence, StartsWith("Your simulation follows the robot for ") &&
                                   ContainsSubstring(" mrad). Nothing is left to explain"));
  CHECK(finding.sentence.find("; with") == std::string::npos);
}

TEST_CASE("diagnose: a motion that cannot be simulated is declared with the reason", "[diagnose]") {
  Recording train = arm().recorded({}, 1), test = arm().recorded({}, 2);
  for (Recording* r : {&train, &test}) {  // the yaw is moved by something else
    r->has_tau[0] = false;
    r->tau.col(0).setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  const Finding finding = diagnose(arm().nominal, {train}, {test});
  CHECK(finding.simulated.joints.empty());
  CHECK_THAT(finding.simulated.reason, ContainsSubstring("yaw"));
  CHECK_THAT(finding.sentence,
             StartsWith("For how long your simulation follows the robot is not known: ") &&
                 ContainsSubstring("yaw"));
}

}  // namespace simulated_test
