#include "report/evidence_plots.hpp"

#include <cmath>

#include <catch2/catch_test_macros.hpp>

namespace diffnea::evidence_plots_test {
namespace {

using report::evidence_plots;

/// A joint that moves to and fro, and a model that lacks its friction.
Finding rubbing() {
  ResidualSeries s;
  s.joint = "elbow";
  s.unit = "N*m";
  for (int k = 0; k < 2000; ++k) {
    const double t = 0.01 * k;
    s.time.push_back(t);
    s.q.push_back(std::sin(2.0 * t));
    s.qd.push_back(2.0 * std::cos(2.0 * t));
    s.qdd.push_back(-4.0 * std::sin(2.0 * t));
    s.measured.push_back(0.5 * s.qd.back());
    s.base.push_back(0.0);
    s.extended.push_back(0.4 * s.qd.back());
  }
  Finding out;
  out.series = {s};
  return out;
}

Cause cause(const char* effect, const char* where) {
  Cause out;
  out.effect = effect;
  out.where = where;
  return out;
}

TEST_CASE("evidence plots: a ball's cause shows nothing in the torque", "[report]") {
  Finding finding = rubbing();
  const std::vector<EvidencePlot> overview = evidence_plots(finding);
  REQUIRE(!overview.empty());
  finding.causes = {cause("string_mass", "string")};
  const std::vector<EvidencePlot> plots = evidence_plots(finding);
  REQUIRE(plots.size() == overview.size());
  for (const EvidencePlot& p : plots) {
    CHECK(p.effect.empty());
    CHECK(p.curves.size() == 1);
  }
}

TEST_CASE("evidence plots: friction is shown over velocity, before and after", "[report]") {
  Finding finding = rubbing();
  finding.causes = {cause("viscous_friction", "elbow"), cause("camera_delay", "camera")};
  const std::vector<EvidencePlot> plots = evidence_plots(finding);
  REQUIRE(plots.size() == 1);
  CHECK(plots[0].kind == "velocity");
  CHECK(plots[0].effect == "viscous_friction");
  REQUIRE(plots[0].curves.size() == 2);
  for (const auto& [curve, missing] : {std::pair{0, 0.5}, {1, 0.1}}) {  // [N·m·s/rad]
    const EvidenceCurve& c = plots[0].curves[static_cast<std::size_t>(curve)];
    for (std::size_t k = 0; k < plots[0].x.size(); ++k) {
      if (!std::isfinite(c.mean[k])) continue;
      CHECK(std::abs(c.mean[k] - missing * plots[0].x[k]) < 0.1);  // bins are up to 0.2 rad/s wide
    }
  }
}

TEST_CASE("evidence plots: a witness is seen over what it depends on and over time, with its band",
          "[report]") {
  Finding finding = rubbing();
  finding.witness = {{"elbow", {"qd_elbow"}, 0.9, 100.0}};
  const std::vector<EvidencePlot> plots = evidence_plots(finding);
  REQUIRE(plots.size() == 2);
  CHECK(plots[0].kind == "velocity");
  CHECK(plots[1].kind == "time");
  for (const EvidencePlot& p : plots) CHECK(p.curves[0].low.size() == p.x.size());
}

}  // namespace
}  // namespace diffnea::evidence_plots_test
