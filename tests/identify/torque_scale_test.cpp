/// Factors that joints agree on, or not; and a WAM in MuJoCo whose recorded torques are in another
/// unit: found with the masses that it has; nothing is said of torques that are right, nor of
/// masses that are wrong link by link.

#include "identify/torque_scale.hpp"

#include <algorithm>
#include <support/wam_study.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/core/random.hpp>

namespace diffnea::torque_scale_test {
namespace {

std::string note(const IdentifyResult& result) {
  const auto found = std::ranges::find_if(result.notes, [](const std::string& n) {
    return n.starts_with("WARNING: the torques are ");
  });
  return found == result.notes.end() ? "" : *found;
}

IdentifyResult fit(const Model& model, Recording recording, double unit) {
  recording.tau *= unit;
  return identify(model, {std::move(recording)}, {});
}

}  // namespace

TEST_CASE("identify: a factor is common to the joints, or it is none", "[identify]") {
  const auto scale = [](const std::vector<double>& factors, double noise) {
    FitLayout layout;
    layout.linear = {{.name = "link.mass", .unit = "kg", .prior = 1.0, .theta = 0}};
    std::vector<JointFactor> joints;
    Rng rng(1);
    for (const double factor : factors) {
      RowMatX<double> rows(200, 2);
      for (long i = 0; i < rows.rows(); ++i) {
        rows(i, 0) = rng.normal();
        rows(i, 1) = factor * rows(i, 0) + noise * rng.normal();
      }
      JointFactor joint{{0}, TriangularFactor(1)};
      joint.factor.add(rows);
      joints.push_back(joint);
    }
    return common_torque_scale(layout, joints);
  };
  const std::optional<TorqueScale> all = scale({2.0, 2.1, 1.9, 2.05, 1.0}, 0.01);
  REQUIRE(all);
  CHECK(std::abs(all->factor - 2.0) < 0.11);
  CHECK(all->of_joint.size() == 4);
  // Currents of drives of 12 and 9 N·m/A, against masses that are wrong by up to 3.
  CHECK(scale({1 / 12.0, 1 / 12.0, 1 / 9.0, 1 / 9.0}, 1e-3)->of_joint.size() == 4);
  CHECK_FALSE(scale({3.0, 3.0, 6.0, 9.0}, 0.01));
  CHECK_FALSE(scale({2.0, 2.1, 1.9, 1.0}, 0.01));  // three of four
  CHECK_FALSE(scale({2.0, 2.5, 3.0, 2.2}, 0.01));  // of no one size
  CHECK_FALSE(scale({1.1, 1.1, 1.1, 1.1}, 0.01));  // small
  CHECK_FALSE(scale({2.0}, 0.01));                 // alone
  CHECK_FALSE(scale({-2.0, -2.0, -2.0}, 0.01));    // of the wrong sign: the audit's
  CHECK_FALSE(scale({2.0, 2.0, 2.0, 2.0}, 3.0));   // the links say nothing of these torques
}

TEST_CASE("identify: torques that are all off by one factor are told", "[identify]") {
  const unsigned seed = GENERATE(1u, 2u);
  CAPTURE(seed);
  const test::WamDraw wam = test::draw_wam(seed, 20.0);

  const double unit = GENERATE(0.4, 1000.0);
  CAPTURE(unit);
  const std::string said = note(fit(wam.truth, wam.train, unit));
  REQUIRE(!said.empty());
  CHECK(std::abs(std::stod(said.substr(25)) / unit - 1.0) < 0.05);
}

TEST_CASE("identify: nothing is said of torques that are right", "[identify]") {
  const unsigned seed = GENERATE(1u, 2u);
  CAPTURE(seed);
  const test::WamDraw wam = test::draw_wam(seed, 20.0);
  CHECK(note(fit(wam.truth, wam.train, 1.0)) == "");
  CHECK(note(fit(wam.nominal, wam.train, 1.0)) == "");

  Model light = wam.truth;  // one link at a third of its mass
  SpatialInertia<double>& last = light.links[moving_links(light).back()].inertia;
  Theta<double> theta = last.theta();
  for (double& value : theta) value /= 3.0;
  last = SpatialInertia<double>::from_theta(theta);
  CHECK(note(fit(light, wam.train, 1.0)) == "");
}

}  // namespace diffnea::torque_scale_test
