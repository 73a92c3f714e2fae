/// Measured recordings that are not part of the project: what is known of the robots is found.

#include <algorithm>
#include <cmath>
#include <support/data_folder.hpp>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/recording/csv.hpp>

#include "support/between.hpp"

namespace diffnea::recorded_test {
namespace {

using test::between;

using test::data_folder;

bool names(const Finding& finding, std::initializer_list<const char*> effects) {
  return std::ranges::any_of(finding.causes, [&](const Cause& c) {
    return std::ranges::find(effects, c.effect) != effects.end();
  });
}

}  // namespace

TEST_CASE("recorded data: a pendulum that swings freely has dry friction and drag",
          "[data][diagnose]") {
  ReadOptions options;
  options.info.passive = {"pendulum"};
  const Recording all =
      read_recordings(data_folder() / "pendulum_free_swing" / "free_swing.csv", options).at(0);
  const Model model = read_model(DIFFNEA_SOURCE_DIR "/models/pendulum.json");
  // A hand leads it until 8 s; from 115 s on it rests. From 62 s on it swings half as far.
  const Finding finding =
      diagnose(model, {between(all, 8.0, 62.0)}, {between(all, 62.0, 115.0)});
  CAPTURE(finding.sentence);
  CHECK(names(finding, {"coulomb_friction", "presliding_dahl"}));
  CHECK(names(finding, {"quadratic_friction"}));
  CHECK_FALSE(names(finding, {"viscous_friction"}));
  CHECK(finding.causes.size() == 2);
  REQUIRE(finding.joints.size() == 1);
  CHECK(finding.joints[0].extended < 0.5 * finding.joints[0].base);
}

TEST_CASE("recorded data: half the swing tells which friction a pendulum has", "[data][diagnose]") {
  ReadOptions options;
  options.info.passive = {"pendulum"};
  const Recording all =
      read_recordings(data_folder() / "pendulum_free_swing" / "free_swing.csv", options).at(0);
  const Finding finding = diagnose(read_model(DIFFNEA_SOURCE_DIR "/models/pendulum.json"),
                                   {between(all, 8.0, 43.7)}, {between(all, 62.0, 115.0)});
  CAPTURE(finding.sentence);
  CHECK(finding.verdict != Verdict::kUnknown);
  CHECK(names(finding, {"coulomb_friction"}));
  CHECK(names(finding, {"quadratic_friction"}));
  CHECK(finding.causes.size() == 2);
  CHECK(finding.gain.after < 1.2);
}

TEST_CASE("recorded data: a pendulum logged at 20 Hz has a friction, and no cause of another kind",
          "[data][diagnose]") {
  ReadOptions options;
  options.info.passive = {"pendulum"};
  const Recording all =
      read_recordings(data_folder() / "pendulum_free_swing" / "free_swing.csv", options).at(0);
  const Recording swing = between(all, 8.0, 115.0);
  Recording slow = swing;
  const auto rows = Eigen::seq(0, swing.rows() - 1, 12);
  slow.time = swing.time(rows);
  slow.q = swing.q(rows, Eigen::all);
  slow.tau = swing.tau(rows, Eigen::all);
  slow.extra.clear();
  const Finding finding =
      diagnose(read_model(DIFFNEA_SOURCE_DIR "/models/pendulum.json"), {slow}, {});
  CAPTURE(finding.sentence);
  CHECK(finding.verdict != Verdict::kUnknown);
  REQUIRE_FALSE(finding.causes.empty());
  CHECK(names(finding, {"coulomb_friction", "presliding_dahl", "sublinear_friction"}));
  CHECK(finding.causes[0].share > 0.9);
  // Nothing of its class does better: what is named is the best of what stands for it.
  for (const Cause& cause : finding.causes)
    for (const Rival& rival : cause.members) CHECK(rival.delta_bic > -10.0);
}

TEST_CASE("recorded data: a torque gain that comes to -67 % beside friction is no drive's",
          "[data][diagnose]") {
  const auto record = [](const char* name) {
    return read_recordings(data_folder() / "double_pendulum" / name).at(0);
  };
  const Model model = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  const Finding finding = diagnose(model, {record("record_00.csv"), record("record_01.csv")},
                                   {record("record_05.csv")});
  CAPTURE(finding.sentence);
  CHECK_FALSE(finding.causes.empty());
  for (const Cause& cause : finding.causes)
    for (const CauseParameter& p : cause.parameters)
      if (p.name == "gain_error") CHECK(std::abs(p.value) <= 0.5);
}

}  // namespace diffnea::recorded_test
