/// diagnose() on recordings by MuJoCo, with MuJoCo's own friction and rotors.

#include <algorithm>
#include <support/temporary_folder.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/io/atomic_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/mujoco_world.hpp>

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;

namespace {

/// The first axis is vertical: what it carries turns about it like a rotor.
constexpr const char* kArm = R"(<mujoco model="arm">
  <compiler angle="radian" inertiafromgeom="false"/>
  <worldbody>
    <body name="column" pos="0 0 0.4">
      <inertial pos="0.01 0.02 0.1" mass="6" diaginertia="0.08 0.07 0.05"/>
      <joint name="yaw" axis="0 0 1" limited="true" range="-2 2"/>
      <body name="upper" pos="0 0 0.2">
        <inertial pos="0.2 0.01 0" mass="3" diaginertia="0.01 0.05 0.05"/>
        <joint name="shoulder" axis="0 1 0" limited="true" range="-1.5 1.5"/>
        <body name="fore" pos="0.4 0 0">
          <inertial pos="0.15 0 0.01" mass="2" diaginertia="0.005 0.02 0.02"/>
          <joint name="elbow" axis="0 1 0" limited="true" range="-2 2"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>
)";

struct Arm {
  Arm() {
    const test::TemporaryFolder folder;
    write_file_atomically(folder.path() / "arm.xml", kArm);
    nominal = read_model(folder.path() / "arm.xml");
  }
  /// MuJoCo's arm with these effects, which become its joints' frictionloss and armature.
  Recording recorded(const std::vector<EffectSpec>& hidden, unsigned seed) const {
    Model truth = nominal;
    truth.effects = hidden;
    FourierOptions motion;
    motion.seed = seed;
    motion.duration = 30.0;
    RecordOptions options;
    options.seed = seed + 1000;
    const SimulatedRecording r =
        record_in_mujoco(kArm, truth, nominal, random_fourier(nominal, motion), options);
    if (!r.failure.empty()) throw Error(r.failure);
    return r.recording;
  }
  Model nominal;
};

const Arm& arm() {
  static const Arm kOne;
  return kOne;
}

const EffectSpec kCoulomb{"coulomb_friction", "elbow", {{"coulomb", 0.4, ""}}};

}  // namespace

TEST_CASE("diagnose: nothing is named where nothing is hidden", "[diagnose]") {
  const Finding finding = diagnose(arm().nominal, {arm().recorded({}, 1)}, {arm().recorded({}, 2)});
  CAPTURE(finding.sentence);
  CHECK(finding.verdict == Verdict::kNone);
  CHECK(finding.causes.empty());
  CHECK(finding.witness.empty());
  CHECK(finding.held_out == "test recording");
  CHECK(finding.base == "refit");
  CHECK(finding.model.effects.empty());
  CHECK_FALSE(finding.interrupted);
}

TEST_CASE("diagnose: Coulomb friction is named at its joint, the truth in its interval",
          "[diagnose]") {
  const Finding finding =
      diagnose(arm().nominal, {arm().recorded({kCoulomb}, 1)}, {arm().recorded({kCoulomb}, 2)});
  CAPTURE(finding.sentence);
  REQUIRE(finding.causes.size() == 1);
  const Cause& cause = finding.causes.front();
  CHECK(finding.verdict == Verdict::kNamed);
  CHECK(cause.effect == "coulomb_friction");
  CHECK(cause.where == "elbow");
  const auto coulomb = std::ranges::find(cause.parameters, "coulomb", &CauseParameter::name);
  REQUIRE(coulomb != cause.parameters.end());
  CHECK(coulomb->low <= 0.4);
  CHECK(coulomb->high >= 0.4);
  CHECK(coulomb->high - coulomb->low < 0.1);
  CHECK(cause.delta_bic > 10.0);
  CHECK(finding.gain.low > 0.0);
  CHECK_THAT(finding.sentence, ContainsSubstring("oulomb friction at elbow"));

  const auto elbow = std::ranges::find(finding.joints, "elbow", &JointGain::joint);
  REQUIRE(elbow != finding.joints.end());
  CHECK(elbow->extended < 0.5 * elbow->base);
  CHECK(elbow->extended < 2.0 * elbow->noise_floor);  // reversals count here, not in the noise
  REQUIRE(finding.model.effects.size() == 1);
  CHECK(finding.model.effects.front().effect == "coulomb_friction");
}

TEST_CASE("diagnose: a rotor that the links absorb is declared, not named", "[diagnose]") {
  const EffectSpec rotor{"armature", "yaw", {{"armature", 0.2, ""}}};
  const Finding finding =
      diagnose(arm().nominal, {arm().recorded({rotor}, 1)}, {arm().recorded({rotor}, 2)});
  CAPTURE(finding.sentence);
  CHECK(finding.causes.empty());
  CHECK(finding.verdict == Verdict::kNone);
  const bool declared = std::ranges::any_of(finding.absorbed, [](const Absorbed& a) {
    return a.effect == "armature" && a.where == "yaw";
  });
  CHECK(declared);
}

TEST_CASE("diagnose: without test data blocks of time are held out", "[diagnose]") {
  const Finding finding = diagnose(arm().nominal, {arm().recorded({kCoulomb}, 1)}, {});
  CAPTURE(finding.sentence);
  CHECK(finding.held_out == "time blocks");
  // Blocks of the same motion hold out less: a small ripple may stand beside the cause
  // (docs/diagnosis.md).
  REQUIRE_FALSE(finding.causes.empty());
  CHECK(finding.causes.front().effect == "coulomb_friction");
  CHECK(finding.causes.front().where == "elbow");
}

TEST_CASE("diagnose: chosen candidates are the only ones", "[diagnose]") {
  DiagnoseOptions options;
  options.effects = {"viscous_friction", "coulomb_friction@yaw"};
  const Finding finding = diagnose(arm().nominal, {arm().recorded({kCoulomb}, 1)},
                                   {arm().recorded({kCoulomb}, 2)}, options);
  CHECK(finding.candidates.size() == 4);
  for (const CandidateScore& c : finding.candidates)
    CHECK((c.effect == "viscous_friction" || (c.effect == "coulomb_friction" && c.where == "yaw")));
}

TEST_CASE("diagnose: a base that is held shows what a refit would hide", "[diagnose]") {
  const EffectSpec rotor{"armature", "yaw", {{"armature", 0.2, ""}}};
  DiagnoseOptions options;
  options.base = Base::kFixed;
  const Finding finding =
      diagnose(arm().nominal, {arm().recorded({rotor}, 1)}, {arm().recorded({rotor}, 2)}, options);
  CAPTURE(finding.sentence);
  CHECK(finding.base == "fixed");
  REQUIRE_FALSE(finding.causes.empty());
  CHECK(std::ranges::any_of(
      finding.causes, [](const Cause& c) { return c.where == "yaw" && c.effect == "armature"; }));
}

TEST_CASE("diagnose: stopped at once, it returns what there is", "[diagnose]") {
  DiagnoseOptions options;
  options.progress = [](const FitProgress& p) { return p.stage != "testing"; };
  const Finding finding = diagnose(arm().nominal, {arm().recorded({kCoulomb}, 1)}, {}, options);
  CHECK(finding.interrupted);
  CHECK(finding.causes.empty());
}

TEST_CASE("diagnose: refuses what cannot be answered", "[diagnose]") {
  const Recording train = arm().recorded({}, 1);
  CHECK_THROWS_WITH(diagnose(arm().nominal, {train}, {train}), ContainsSubstring("same rows"));
  DiagnoseOptions options;
  options.base = Base::kPrior;
  CHECK_THROWS_WITH(diagnose(arm().nominal, {train}, {}, options),
                    ContainsSubstring("no posterior"));
  options.base = Base::kAuto;
  options.effects = {"magic"};
  CHECK_THROWS_WITH(diagnose(arm().nominal, {train}, {}, options),
                    ContainsSubstring("magic") && ContainsSubstring("coulomb_friction"));
  CHECK_THROWS_AS(verdict_from("MAYBE"), ModelError);
  for (const Verdict v : {Verdict::kNamed, Verdict::kClass, Verdict::kUnknown, Verdict::kNone,
                          Verdict::kNotIdentifiable})
    CHECK(verdict_from(name_of(v)) == v);
}
