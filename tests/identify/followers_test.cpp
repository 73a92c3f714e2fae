/// identify() on a robot whose joints follow others.

#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/identify/identify.hpp>

#include "support/found.hpp"

namespace identify_followers_test {

using namespace diffnea;
using Catch::Approx;
using diffnea::test::find;

namespace {

/// Three turning links in a row; the second joint follows the first and rubs, the third is driven.
Model hand() {
  Model m;
  m.name = "hand";
  const char* joints[] = {"knuckle", "middle", "tip"};
  for (int i = 0; i < 3; ++i) {
    ModelLink link;
    link.name = std::string(joints[i]) + "_link";
    link.joint = joints[i];
    link.parent = i - 1;
    link.type = ModelJoint::kRevolute;
    link.axis = i == 1 ? Vec3<double>{1, 0, 0} : Vec3<double>{0, 1, 0};
    link.X_PJ.p = {0.0, 0.0, i == 0 ? 0.0 : 0.3};
    link.inertia =
        inertia_from_com<double>(2.0 - 0.5 * i, {0.05, 0.02, 0.1}, {.02, 0, 0, .03, 0, .01});
    m.links.push_back(link);
  }
  m.links[1].follows = Follow{"knuckle", -1.4, 0.2};
  m.effects = {{"viscous_friction", "middle", {{"viscous", 0.6, "N*m*s/rad"}}},
               {"coulomb_friction", "tip", {{"coulomb", 0.3, "N*m"}}}};
  return m;
}

/// 20 s at 200 Hz with torque noise of 1 mN·m.
Recording recorded(const Model& truth, unsigned seed) {
  Rng rng(seed);
  Recording r;
  r.source = "hand";
  r.joint_names = {"knuckle", "tip"};
  r.has_tau = {true, true};
  r.info.torque_sampling = TorqueSampling::kInstant;
  const long rows = 4000;
  r.time.setLinSpaced(rows, 0.0, 20.0 - 0.005);
  RowMatX<double> qdd = RowMatX<double>::Zero(rows, 2);
  r.q = r.qd = qdd;
  for (int j = 0; j < 2; ++j)
    for (int k = 1; k <= 5; ++k) {
      const double w = 2.0 * 3.141592653589793 * 0.1 * k * (1.0 + 0.13 * j),
                   a = 0.5 * rng.normal() / k, phase = rng.uniform(0.0, 6.0);
      r.q.col(j).array() += a * (w * r.time.array() + phase).sin();
      r.qd.col(j).array() += a * w * (w * r.time.array() + phase).cos();
      qdd.col(j).array() -= a * w * w * (w * r.time.array() + phase).sin();
    }
  r.tau = inverse_dynamics(extend(truth), r.q, r.qd, qdd);
  for (double& x : r.tau.reshaped()) x += 1e-3 * rng.normal();
  r.qd.resize(0, 0);
  return r;
}

}  // namespace

TEST_CASE("identify: where a joint follows another, residuals fall to the noise", "[identify]") {
  const Model truth = hand();
  Model start = truth;
  for (ModelLink& link : start.links) {
    Theta<double> theta = link.inertia.theta();
    for (double& x : theta) x *= 1.4;
    link.inertia = SpatialInertia<double>::from_theta(theta);
  }
  for (EffectSpec& e : start.effects) e.parameters[0].value = 0.0;
  const IdentifyResult result = identify(start, {recorded(truth, 1)}, {recorded(truth, 2)});
  REQUIRE(result.summary.converged);
  REQUIRE(result.errors.size() == 2);
  for (const JointError& e : result.errors) {
    CAPTURE(e.joint, e.nominal_test);
    CHECK(e.test < 2e-3);  // noise 1e-3 before the filter, 1e-3 of the torque what filtering leaves
    CHECK(e.test < 0.01 * e.nominal_test);
  }
  // Friction at the follower is seen through the joint that it follows, by 1.4².
  CHECK(find(result, "tip.coulomb_friction.coulomb").value == Approx(0.3).epsilon(0.02));
  const double viscous = find(result, "knuckle.viscous_friction.viscous").value +
                         1.96 * find(result, "middle.viscous_friction.viscous").value;
  CHECK(viscous == Approx(1.96 * 0.6).epsilon(0.02));
}

}  // namespace identify_followers_test
