/// Columns of evidence that take a way of their own, against those of the general one; and what
/// bounds candidates' shapes.

#include "diagnose/evidence.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include "diagnose/bounds.hpp"
#include "diagnose/term.hpp"
#include "support/matrix_near.hpp"

namespace evidence_test {

using namespace diffnea;

namespace {

/// Of columns of size 1 and torques of some N·m, summed over some hundred taps and angles; 1e-12
/// observed.
constexpr double kRounding = 1e-9;

Candidate candidate(const Model& model, const std::string& effect, const std::string& where) {
  return make_candidates(model, model, {effect + "@" + where}, {0}, false).at(0);
}

PreprocessPlan noise_of(std::vector<double> positions, std::vector<double> torques = {1.0, 1.0}) {
  PreprocessPlan plan;
  plan.q_noise = std::move(positions);
  plan.tau_noise = std::move(torques);
  return plan;
}

}  // namespace

TEST_CASE("diagnose: ripples by sums of angles are the effect's columns", "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  TriedEffect cogging = candidate(evidence.model, "cogging", "elbow").effect;
  const int joint = cogging.joints.at(0);
  const long m = evidence->times();
  std::vector<MatX<double>> fast;
  evidence->ripples(joint, 3.0, 0.7, 40, [&](int k, MatX<double> columns) {
    CHECK(k == static_cast<int>(fast.size()));
    fast.push_back(std::move(columns));
  });
  REQUIRE(fast.size() == 40);
  for (const int k : {0, 1, 17, 39}) {
    cogging.parameters[2] = 3.0 + 0.7 * k;
    const MatX<double> slow = evidence->columns(cogging, {0, 1}).middleRows(joint * m, m);
    CAPTURE(k);
    REQUIRE(slow.norm() > 1.0);
    CHECK((fast[static_cast<std::size_t>(k)] - slow).cwiseAbs().maxCoeff() < kRounding);
  }
}

TEST_CASE("diagnose: under a tilt the base's columns are those of a tilted robot", "[diagnose]") {
  test::SwingingEvidence level(20.0, false, 1, "viscous_friction", test::slow_down);
  const Vec3<double> more{0.4, 0.0, 0.0};
  Model tilted_model = level.model;
  tilted_model.gravity = tilted_model.gravity + more;
  const PreprocessPlan plan = [&] {
    PreprocessOptions preprocess;
    preprocess.filter_hz = 8.0;
    preprocess.decimate_to_hz = 25.0;
    return plan_preprocess(level.source->sample(), preprocess);
  }();
  const Evidence tilted(tilted_model, {tilted_model}, level.layout, *level.source, plan, 0.0,
                        IdentifyOptions{});
  const MatX<double> before = level->seen_base();
  const VecX<double> torque = level->torque(), x = level.layout.prior();
  level.evidence->set_tilt(more, x);
  CHECK((tilted.seen_base() - before).norm() > 1.0);
  const long model =
      level->seen_base().cols() - 1;  // without the torque's instant, of the reference
  CHECK((level->seen_base() - tilted.seen_base()).leftCols(model).cwiseAbs().maxCoeff() <
        kRounding);
  CHECK((level->torque() - torque - (tilted.seen_base() - before).leftCols(x.size()) * x)
            .cwiseAbs()
            .maxCoeff() < kRounding);
  level.evidence->set_tilt({0, 0, 0}, x);  // and back
  CHECK((level->seen_base() - before).cwiseAbs().maxCoeff() < kRounding);
  CHECK((level->torque() - torque).cwiseAbs().maxCoeff() < kRounding);
}

TEST_CASE("diagnose: the ball's pull at a joint without a drive is part of its rows",
          "[diagnose]") {
  const auto undriven = [](double pull) {
    return test::SwingingEvidence(20.0, false, 1, "viscous_friction", [pull](Recording& r) {
      r.info.passive = {"elbow"};
      r.has_tau[1] = false;
      r.tau.col(1) *= pull;  // 0: nothing acts there
    });
  };
  const test::SwingingEvidence none = undriven(0.0), pulled = undriven(1.0);
  REQUIRE(pulled->joints() == std::vector<int>{0, 1});
  CHECK_FALSE(pulled->passive(0));
  CHECK(pulled->passive(1));
  CHECK(none->passive(1));
  // By what its links take, however the ball pulls.
  CHECK(pulled->size(1) == none->size(1));

  // M(at)/M(x) (Y x - τ), about at: central differences over 1e-6 of residuals of order 1.
  const long m = pulled->times(), p = static_cast<long>(pulled.layout.linear.size());
  const VecX<double> at = pulled.layout.prior(), tau = pulled->torque().segment(m, m);
  REQUIRE(tau.norm() > 1.0);
  const MatX<double> Y = pulled->base().middleRows(m, m).leftCols(p);
  const JointFactor& f = pulled->factors()[1];
  const auto residual = [&](const VecX<double>& x) {
    return VecX<double>((Y * x - tau) * f.inertia.dot(at(f.columns)) / f.inertia.dot(x(f.columns)));
  };
  const MatX<double> rows = pulled->without_scale(1, Y, at);
  for (const int c : f.columns) {
    if (c >= p) continue;
    const VecX<double> step = 1e-6 * VecX<double>::Unit(p, c);
    const VecX<double> slope = (residual(at + step) - residual(at - step)) / 2e-6;
    CAPTURE(pulled.layout.linear[static_cast<std::size_t>(c)].name);
    CHECK((rows.col(c) - slope).cwiseAbs().maxCoeff() < 1e-7 * (1.0 + slope.cwiseAbs().maxCoeff()));
  }
}

TEST_CASE("diagnose: shapes are bounded by what a recording shows", "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  std::vector<Candidate> candidates{candidate(evidence.model, "presliding_dahl", "elbow"),
                                    candidate(evidence.model, "cogging", "elbow"),
                                    candidate(evidence.model, "joint_elasticity", "elbow")};
  const std::vector<Refusal> refused =
      bound_shapes(*evidence, evidence.layout, noise_of({1e-3, 2e-3}), false, candidates);
  REQUIRE(candidates.size() == 2);  // a spring needs two paths
  REQUIRE(refused.size() == 1);
  CHECK(refused[0].effect == "joint_elasticity");
  CHECK(candidates[0].shape_low == std::vector<double>{6e-3});  // 3 standard deviations
  for (const std::vector<double>& g : candidates[0].grid) CHECK(g[0] >= 6e-3);
  double low = 10.0, high = -10.0;
  for (const JointSeries& s : evidence->series()) {
    low = std::min(low, s.q.col(1).minCoeff());
    high = std::max(high, s.q.col(1).maxCoeff());
  }
  const double range = high - low;
  const std::vector<std::vector<double>>& ripples = candidates[1].grid;
  REQUIRE(ripples.size() > 10);
  CHECK(ripples.front()[0] * range >= 4.0 * M_PI * (1.0 - kRounding));  // two periods
  for (std::size_t k = 1; k < ripples.size(); ++k) {
    const double step = ripples[k][0] - ripples[k - 1][0];
    CHECK(0.25 * step * range <= M_PI / 3.0 * (1.0 + 1e-6));  // out of phase, midway, at the ends
  }
}

TEST_CASE("diagnose: limits are tried if the torque is clear of its noise", "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);  // torques of 1 N·m, white
  for (const auto& [noise, tried] :
       {std::pair{0.01, true}, {1.0, false}, {std::numeric_limits<double>::quiet_NaN(), false}}) {
    CAPTURE(noise);
    std::vector<Candidate> limits{candidate(evidence.model, "saturation", "elbow")};
    const std::vector<Refusal> refused =
        bound_shapes(*evidence, evidence.layout, noise_of({1.0, 1.0}, {1.0, noise}), true, limits);
    CHECK(limits.size() == (tried ? 1 : 0));
    CHECK(refused.size() == (tried ? 0 : 1));
  }
}

TEST_CASE("diagnose: gaps are tried down to what the positions' noise hides", "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  const double most = 0.1;  // [rad], the catalogue's
  for (const double noise : {2e-5, 4e-4, 1e-2}) {
    std::vector<Candidate> gaps{candidate(evidence.model, "backlash", "elbow")};
    bound_shapes(*evidence, evidence.layout, noise_of({1.0, noise}), true, gaps);
    REQUIRE(gaps.size() == 1);
    const std::vector<std::vector<double>>& grid = gaps[0].grid;
    CAPTURE(noise, grid.size());
    CHECK(grid.front() == std::vector<double>{2.0 * noise});  // 2 standard deviations
    CHECK(gaps[0].shape_low == grid.front());
    CHECK_THAT(grid.back()[0], Catch::Matchers::WithinRel(most, kRounding));
    for (std::size_t k = 1; k < grid.size(); ++k)  // pulses grow with the gap
      CHECK(grid[k][0] / grid[k - 1][0] < 1.6 * (1.0 + kRounding));
  }
  std::vector<Candidate> none{candidate(evidence.model, "backlash", "elbow")};
  const std::vector<Refusal> refused =
      bound_shapes(*evidence, evidence.layout, noise_of({1.0, 0.6 * most}), true, none);
  CHECK(none.empty());
  REQUIRE(refused.size() == 1);
  CHECK(refused[0].effect == "backlash");
}

TEST_CASE("diagnose: a gap's torque has the size that its flights are told by, and no model has it",
          "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  std::vector<Candidate> gaps{candidate(evidence.model, "backlash", "elbow")};
  const std::size_t points = gaps[0].grid.size();
  tell_flights(gaps);
  CHECK(gaps[0].grid.size() == 3 * points);  // each with dull and hard teeth
  CHECK(gaps[0].shapes.size() == 2);
  TriedEffect gap = term_at(gaps[0], 0, gaps[0].grid.back()).effect;
  REQUIRE(gap.told == static_cast<int>(gap.parameters.size()) - 1);
  double& told = gap.parameters[static_cast<std::size_t>(gap.told)];
  told = 1.0;
  const VecX<double> whole = evidence->torque_of(gap);
  const MatX<double> of_gap = evidence->columns(gap, {0});
  CHECK(whole.norm() > 0.0);
  told = 0.25;
  VecX<double> torque;
  const MatX<double> columns = evidence->columns(gap, {gap.told, 0}, &torque);
  CHECK_THAT(torque, test::MatrixNear(0.25 * whole, 1e-12 * whole.norm()));
  CHECK_THAT(columns.col(0), test::MatrixNear(whole, 1e-12 * whole.norm()));
  CHECK_THAT(columns.col(1), test::MatrixNear(0.25 * of_gap.col(0), 1e-12 * of_gap.norm()));
  const EffectSpec spec = to_spec(gap);
  CHECK(spec.parameters.size() == gap.parameters.size() - 1);
  CHECK(bind(spec, evidence.model).parameters.size() == spec.parameters.size());
}

TEST_CASE("diagnose: a tilt leaves a joint without torque what it is", "[diagnose]") {
  test::SwingingEvidence s(20.0, false, 1, "viscous_friction", [](Recording& r) {
    r.tau.col(1).setZero();
    r.has_tau[1] = false;
    r.info.passive = {"elbow"};
  });
  REQUIRE(s->passive(1));
  REQUIRE(s->has_passive_beside_torques());
  s.evidence->set_tilt({0.4, 0.0, 0.0}, s.layout.prior());
  REQUIRE(s->torque().tail(s->times()).norm() > 0.1);  // what the tilt has moved there
  CHECK(s->passive(1));
  CHECK_FALSE(s->passive(0));
}

TEST_CASE(
    "diagnose: friction and encoder of an elastic joint are tried on either side at every "
    "stiffness",
    "[diagnose]") {
  Model model = test::SwingingEvidence(20.0).model;
  // Without a rotor no simulation has an encoder at the motor.
  CHECK(candidate(model, "joint_elasticity", "elbow").choices == std::vector<int>{3});
  model.effects.push_back({"armature", "elbow", {{"armature", 0.1, ""}}});
  const Candidate c = candidate(model, "joint_elasticity", "elbow");
  REQUIRE(c.shapes == std::vector<int>{0});
  REQUIRE(c.choices == std::vector<int>{3, 4});
  REQUIRE(c.grid.size() == 4 * 7);
  // Link and rotor on the spring swing at 1.6 to 50 Hz, whatever they weigh.
  const Tree<double> tree = make_tree(model);
  MassMatrixWorkspace<double, double> ws;
  const double inertia =
      mass_matrix<double, double>(tree, VecX<double>::Zero(tree.num_dofs()), ws)(1, 1);
  BoundEffect effect = c.effect;
  for (std::size_t k = 0; k < c.grid.size(); ++k) {
    c.set(c.grid[k], effect);
    const double frequency = 10.0 * std::pow(10.0, 0.25 * static_cast<double>(k / 4));  // [rad/s]
    CHECK_THAT(effect.parameters[0] / inertia,
               Catch::Matchers::WithinRel(frequency * frequency, 1e-9));
    CHECK(effect.parameters[3] == (k / 2 % 2 == 0 ? 1.0 : 0.0));
    CHECK(effect.parameters[4] == (k % 2 == 0 ? 0.0 : 1.0));
  }
}

}  // namespace evidence_test
