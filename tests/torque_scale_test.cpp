/// A WAM in MuJoCo whose recorded torques are in another unit: found with the masses that it has;
/// nothing is said of torques that are right, nor of masses that are wrong link by link.

#include <algorithm>
#include <support/wam_study.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

namespace diffnea {
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

}  // namespace diffnea
