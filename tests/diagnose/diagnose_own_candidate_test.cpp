/// A caller's own candidates in a diagnosis.

#include <algorithm>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/record.hpp>

namespace diffnea::diagnose_own_candidate_test {
namespace {

const Model& arm() {
  static const Model kOne = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  return kOne;
}

Recording greasy(unsigned seed) {
  Model truth = arm();
  truth.effects.push_back({"viscous_friction", "elbow", {{"viscous", 0.3, ""}}});
  FourierOptions motion;
  motion.seed = seed;
  motion.duration = 10.0;
  RecordOptions options;
  options.seed = seed;
  return record_model(truth, arm(), random_fourier(arm(), motion), options).recording;
}

/// Viscous friction of the elbow, but for a share of its position.
OwnCandidate grease(const std::string& name, double share) {
  OwnCandidate out;
  out.name = name;
  out.where = "elbow";
  out.parameters = {{.name = "viscous", .unit = "N*m*s/rad", .unit_prismatic = "N*s/m"}};
  out.columns = [share](const JointSeries& x) -> RowMatX<double> {
    return x.qd.col(1).cwiseProduct((1.0 + share * x.q.col(1).array()).matrix());
  };
  return out;
}

}  // namespace

TEST_CASE("diagnose: an own candidate has a class and a next experiment like any effect",
          "[diagnose][excite]") {
  DiagnoseOptions options;
  options.effects = {"quadratic_friction@elbow"};
  options.candidates = {grease("grease", 0.0), grease("glue", 1e-4)};
  const Finding finding = diagnose(arm(), {greasy(1)}, {greasy(2)}, options);
  CAPTURE(finding.sentence);
  REQUIRE(finding.verdict == Verdict::kClass);
  REQUIRE(finding.causes.size() == 1);
  REQUIRE(finding.causes[0].members.size() == 1);
  CHECK(finding.model.effects.empty());
  REQUIRE(finding.next_experiment);
  CHECK(finding.next_experiment->pairs.size() == 1);
}

TEST_CASE("diagnose: own candidates alone, nothing of the catalogue", "[diagnose]") {
  DiagnoseOptions options;
  options.own_alone = true;
  options.candidates = {grease("grease", 0.0)};
  const Finding finding = diagnose(arm(), {greasy(1)}, {greasy(2)}, options);
  CHECK(finding.verdict == Verdict::kNamed);
  REQUIRE(finding.candidates.size() == 1);
  CHECK(finding.candidates[0].effect == "grease");
}

}  // namespace diffnea::diagnose_own_candidate_test
