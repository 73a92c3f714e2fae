/// Forward dynamics with effects: what inverse dynamics, which knows nothing of it, says of the
/// acceleration, and central differences of its derivatives.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/io/model_file.hpp>

namespace forward_dynamics_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;

namespace {

constexpr int kJoints = 4;
/// Torques of order 10 N·m; Newton's steps of implicit effects end at 1e-10 of them.
constexpr double kInverseTol = 1e-8;
/// Central difference, h = 1e-6 on accelerations of order 100: rounding leaves 1e-8 of them.
constexpr double kDifferenceTol = 1e-5;

Model calibrated() {
  Model m = read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml");
  m.effects = {{"armature", "joint2", {{"armature", 0.2, ""}}},
               {"viscous_friction", "all", {{"viscous", 1.5, ""}}},
               {"coulomb_friction", "joint3", {{"coulomb", 1.0, ""}, {"smoothing", 0.5, ""}}},
               {"joint_spring", "joint2", {{"stiffness", 5.0, ""}, {"rest", 0.3, ""}}},
               {"torque_gain", "joint2", {{"gain_error", 0.3, ""}}},
               {"torque_gain", "joint3", {{"gain_error", -0.2, ""}}}};
  return m;
}

/// Friction that follows the load, at a joint with rotor and gain and one without a rotor.
Model loaded() {
  Model m = calibrated();
  m.effects.push_back({"load_friction",
                       "joint2",
                       {{"mu", 0.1, ""}, {"braking_ratio", 0.6, ""}, {"smoothing", 0.5, ""}}});
  m.effects.push_back({"load_friction",
                       "joint3",
                       {{"mu", 0.3, ""}, {"braking_ratio", 0.4, ""}, {"smoothing", 0.5, ""}}});
  return m;
}

VecX<double> draw(Rng& rng, double size) {
  VecX<double> out(kJoints);
  for (double& x : out) x = rng.uniform(-size, size);
  return out;
}

struct State {
  VecX<double> q, qd, u;
};
State draw_state(unsigned seed) {
  Rng rng(seed);
  return {draw(rng, 1.5), draw(rng, 2.0), draw(rng, 20.0)};
}

VecX<double> acceleration(ForwardDynamics& dynamics, const State& s) {
  VecX<double> qdd(kJoints);
  dynamics.acceleration(s.q.data(), s.qd.data(), s.u.data(), 0, qdd.data());
  return qdd;
}

}  // namespace

TEST_CASE("forward dynamics: inverse dynamics gives the recorded torque back", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 5u));
  const Model model = GENERATE(true, false) ? calibrated() : loaded();
  CAPTURE(seed, model.effects.size());
  ForwardDynamics dynamics(extend(model));
  const State s = draw_state(seed);
  const VecX<double> qdd = acceleration(dynamics, s);
  const RowMatX<double> tau =
      inverse_dynamics(extend(model), s.q.transpose(), s.qd.transpose(), qdd.transpose());
  CHECK((tau.row(0).transpose() - s.u).cwiseAbs().maxCoeff() < kInverseTol);
}

TEST_CASE("forward dynamics: derivatives match central differences, with gains and with load",
          "[dynamics]") {
  const bool follows_load = GENERATE(false, true);
  int motoring = 0, braking = 0;  // joints with load friction, states of these kinds
  for (unsigned seed = 0; seed < 5; ++seed) {
    CAPTURE(follows_load, seed);
    ForwardDynamics dynamics(extend(follows_load ? loaded() : calibrated()));
    const State s = draw_state(seed);
    dynamics.linearise(s.q.data(), s.qd.data(), s.u.data(), 0);
    const RowMatX<double> dq = dynamics.dqdd_dq(), dqd = dynamics.dqdd_dqd();
    const RowMatX<double> du =
        dynamics.inverse_mass_matrix() * dynamics.gains().cwiseInverse().asDiagonal();
    CHECK((dynamics.qdd() - acceleration(dynamics, s)).norm() < kInverseTol);
    if (follows_load)
      for (const int j : {1, 2}) ++(dynamics.transmitted()[j] * s.qd[j] > 0.0 ? motoring : braking);
    const auto check = [&](VecX<double> State::* x, const RowMatX<double>& derivative) {
      constexpr double kStep = 1e-6;
      for (int k = 0; k < kJoints; ++k) {
        State up = s, down = s;
        (up.*x)[k] += kStep;
        (down.*x)[k] -= kStep;
        const VecX<double> difference =
            (acceleration(dynamics, up) - acceleration(dynamics, down)) / (2.0 * kStep);
        CAPTURE(k);
        CHECK((difference - derivative.col(k)).cwiseAbs().maxCoeff() <
              kDifferenceTol * (1.0 + derivative.col(k).cwiseAbs().maxCoeff()));
      }
    };
    check(&State::q, dq);
    check(&State::qd, dqd);
    check(&State::u, du);
  }
  CHECK((!follows_load || (motoring > 0 && braking > 0)));
}

TEST_CASE("forward dynamics: a gain that turns the torque around is refused", "[dynamics]") {
  Model model = calibrated();
  model.effects.push_back({"torque_gain", "all", {{"gain_error", -0.9, ""}}});
  CHECK_THROWS_WITH(ForwardDynamics(extend(model)), ContainsSubstring("expected above -1"));
}

TEST_CASE("inverse dynamics: friction that fades with the time has the time of each row",
          "[dynamics]") {
  Model model = calibrated();
  model.effects.push_back(
      {"warm_up", "joint1", {{"viscous", 3.0, ""}, {"time_constant", 2.0, ""}}});
  const State s = draw_state(0);
  const RowMatX<double> q = s.q.transpose().replicate(2, 1), qd = s.qd.transpose().replicate(2, 1);
  const RowMatX<double> qdd = RowMatX<double>::Zero(2, kJoints);
  const VecX<double> time{{0.5, 4.0}};  // [s]
  const RowMatX<double> cold = inverse_dynamics(extend(calibrated()), q, qd, qdd);
  const RowMatX<double> fading = inverse_dynamics(extend(model), q, qd, qdd, 0, &time) - cold;
  for (long k = 0; k < 2; ++k) {  // b e^{−t/T} q̇
    CHECK(std::abs(fading(k, 0) - 3.0 * std::exp(-time[k] / 2.0) * s.qd[0]) < kInverseTol);
    CHECK(fading.row(k).tail(kJoints - 1).isZero(kInverseTol));
  }
  CHECK_THROWS_WITH(inverse_dynamics(extend(model), q, qd, qdd),
                    ContainsSubstring("warm_up at 'joint1'") && ContainsSubstring("time"));
}

}  // namespace forward_dynamics_test
