/// A body that some recordings carry: its parameters where torque constants are known, and the
/// torque constants where it is known. MuJoCo records; gains are put on its torques afterwards.

#include <algorithm>
#include <fstream>
#include <support/temporary_folder.hpp>
#include <support/wam_study.hpp>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/sidecar.hpp>
#include <diffnea/worlds/surrogate.hpp>

#include "support/found.hpp"

namespace payload_test {

using namespace diffnea;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;
using diffnea::test::find;

namespace {

const SpatialInertia<double> kBody =
    inertia_from_com<double>(1.7, {0.03, -0.02, 0.08}, {0.012, 0.0, 0.001, 0.011, 0.0, 0.008});
constexpr double kGains[] = {0.08, -0.10, 0.06, 0.10};
/// One draw, fixed: three standard errors leave out 1 in 370, and what they stand for is small
/// (below).
constexpr double kInterval = 3.0;

/// Runs 0 and 1 without the body and with it, and one more with it (held out).
struct Pair {
  Model nominal, truth;
  Recording empty, loaded, loaded_again;
};

const Pair& draw() {
  static const Pair kPair = [] {
    const std::string path = std::string(DIFFNEA_SOURCE_DIR) + "/models/wam4.xml";
    Pair out;
    out.nominal = read_model(path);
    out.truth = perturbed(out.nominal, surrogate_a(), 41);
    Model carries = out.truth;
    SpatialInertia<double>& last = carries.links[moving_links(carries).back()].inertia;
    last = last + kBody;
    const auto record = [&](const Model& robot, unsigned seed) {
      FourierOptions motion;
      motion.duration = 25.0;
      motion.seed = seed;
      RecordOptions options;
      options.seed = seed + 1000;
      SimulatedRecording r = record_in_mujoco(read_text_file(path), robot, out.nominal,
                                              random_fourier(out.nominal, motion), options);
      REQUIRE(r.failure.empty());
      return r.recording;
    };
    out.empty = record(out.truth, 7);
    out.loaded = record(carries, 8);
    out.loaded_again = record(carries, 9);
    return out;
  }();
  return kPair;
}

/// Torques as drives report them whose constants are off by `gains`.
Recording with_gains(Recording r, const double* gains) {
  for (int j = 0; j < r.num_joints(); ++j) r.tau.col(j) *= 1.0 + gains[j];
  return r;
}

bool has_note(const IdentifyResult& result, const std::string& part) {
  return std::ranges::any_of(
      result.notes, [&](const std::string& n) { return n.find(part) != std::string::npos; });
}

IdentifyOptions with_effects(std::vector<std::string> more) {
  IdentifyOptions o;
  o.choice.effects = {"armature", "viscous_friction", "coulomb_friction", "torque_offset"};
  o.choice.effects->insert(o.choice.effects->end(), more.begin(), more.end());
  return o;
}

void check_gains(const IdentifyResult& result, const double* gains) {
  const std::vector<std::string> joints = joint_names(result.model);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const ParameterEstimate& g = find(result, joints[j] + ".torque_gain.gain_error");
    CAPTURE(g.name, g.value, g.std, gains[j]);
    REQUIRE(g.identifiable);
    CHECK(g.std < 0.03);
    CHECK(std::abs(g.value - gains[j]) < kInterval * g.std);
  }
}

}  // namespace

TEST_CASE("payload: an unknown body in one of two recordings is found", "[identify][payload]") {
  const IdentifyResult result = identify(draw().nominal, {draw().empty, draw().loaded}, {},
                                         with_effects({"payload@tip:run=1"}));
  REQUIRE(result.summary.converged);
  const Theta<double> truth = kBody.theta();
  const char* const names[] = {"mass", "hx", "hy", "hz"};
  for (int k = 0; k < 4; ++k) {
    const ParameterEstimate& p = find(result, std::string("tip:run=1.payload.") + names[k]);
    CAPTURE(p.name, p.value, p.std, truth[k]);
    REQUIRE(p.identifiable);
    CHECK(p.std < (k == 0 ? 0.03 * kBody.m : 0.01));
    CHECK(std::abs(p.value - truth[k]) < kInterval * p.std);
  }
  CHECK(has_note(result, "hangs on the torque constants"));
}

TEST_CASE("payload: its mass is off by what the torque constants are off", "[identify][payload]") {
  const double all[] = {0.1, 0.1, 0.1, 0.1};
  const IdentifyResult result =
      identify(draw().nominal, {with_gains(draw().empty, all), with_gains(draw().loaded, all)}, {},
               with_effects({"payload@tip:run=1"}));
  const ParameterEstimate& m = find(result, "tip:run=1.payload.mass");
  CAPTURE(m.value, m.std);
  CHECK(std::abs(m.value - 1.1 * kBody.m) < kInterval * m.std);
  CHECK(std::abs(m.value - kBody.m) > kInterval * m.std);
}

TEST_CASE("payload: a known mass calibrates every torque constant", "[identify][payload]") {
  Recording empty = with_gains(draw().empty, kGains), loaded = with_gains(draw().loaded, kGains);
  for (Recording* r : {&empty, &loaded})
    r->info.torque_constant = {{joint_names(draw().nominal)[1], 2.0}};
  IdentifyOptions options = with_effects({"payload@tip:run=1", "torque_gain"});
  options.choice.fix = {"*payload.mass=1.7"};
  const IdentifyResult result = identify(draw().nominal, {empty, loaded}, {}, options);
  REQUIRE(result.summary.converged);
  check_gains(result, kGains);
  CHECK(find(result, "tip:run=1.payload.mass").value == 1.7);
  CHECK(find(result, "tip:run=1.payload.mass").fixed);
  REQUIRE(result.torque_constants.size() == 1);
  const TorqueConstant& k = result.torque_constants[0];
  CHECK(k.unit == "N*m/A");
  CHECK(k.assumed == 2.0);
  CHECK(std::abs(k.value - 2.0 / (1.0 + kGains[1])) < kInterval * k.std);
  CHECK(has_note(result, "calibrates the torque"));
}

TEST_CASE(
    "payload: the calibrated model predicts held-out recordings, with the body and as recorded",
    "[identify][payload]") {
  IdentifyOptions options = with_effects({"payload@tip:run=1+2", "torque_gain"});
  options.choice.fix = {"*payload.mass=1.7"};
  const std::vector<Recording> train{with_gains(draw().empty, kGains),
                                     with_gains(draw().loaded, kGains)};
  const std::vector<Recording> test{with_gains(draw().loaded_again, kGains)};
  const IdentifyResult held = identify(draw().nominal, train, test, options);
  options.choice.effects = with_effects({"payload@tip:run=1", "torque_gain"}).choice.effects;
  const IdentifyResult dropped = identify(draw().nominal, train, test, options);
  // What is left without any gain, by a fit that knows of none.
  const IdentifyResult clean =
      identify(draw().nominal, {draw().empty, draw().loaded}, {draw().loaded_again},
               with_effects({"payload@tip:run=1+2"}));
  for (std::size_t j = 1; j < held.errors.size();
       ++j) {  // joint 1 turns about the vertical: no weight
    CAPTURE(j, held.errors[j].test, clean.errors[j].test);
    // Four more parameters cost next to nothing: 25 s hold some 50.
    CHECK(held.errors[j].test < 1.1 * (1.0 + kGains[j]) * clean.errors[j].test);
    CHECK(dropped.errors[j].test > 2.0 * held.errors[j].test);
    CHECK(dropped.errors[j].test_raw > 1.2 * held.errors[j].test_raw);
  }
}

TEST_CASE("payload: what the sidecar says of a body is used", "[identify][payload]") {
  std::vector<Recording> runs{with_gains(draw().empty, kGains), with_gains(draw().loaded, kGains)};
  HeldBody body;
  body.mass = 1.7;
  body.com = {0.03, -0.02, 0.08};
  body.about_com = {0.012, 0.0, 0.001, 0.011, 0.0, 0.008};
  runs[1].info.payload = body;
  const IdentifyResult result = identify(draw().nominal, runs, {}, with_effects({"torque_gain"}));
  check_gains(result, kGains);
  const Theta<double> truth = kBody.theta();
  CHECK(find(result, "tip:run=1.payload.hz").value == Approx(truth[3]));
  CHECK(find(result, "tip:run=1.payload.Ixx").value == Approx(truth[4]));
  CHECK(find(result, "tip:run=1.payload.Ixx").fixed);

  runs[1].info.payload = HeldBody{};  // there is one, nothing else is known
  const IdentifyResult unknown = identify(draw().nominal, runs, {}, with_effects({}));
  CHECK(find(unknown, "tip:run=1.payload.mass").identifiable);
}

TEST_CASE("payload: gains without a known mass are held, and it is said", "[identify][payload]") {
  const std::string joint = joint_names(draw().nominal)[1] + ".torque_gain.gain_error";
  SECTION("no body at all") {
    const IdentifyResult result =
        identify(draw().nominal, {draw().empty}, {}, with_effects({"torque_gain"}));
    CHECK(find(result, joint).fixed);
    CHECK(has_note(result, "hold no known mass"));
  }
  SECTION("a body of unknown mass") {
    const IdentifyResult result = identify(draw().nominal, {draw().empty, draw().loaded}, {},
                                           with_effects({"torque_gain", "payload@tip:run=1"}));
    CHECK(find(result, joint).fixed);
    CHECK(has_note(result, "hold no known mass"));
  }
  SECTION("a known body that is never put down is one with its link") {
    IdentifyOptions options = with_effects({"torque_gain", "payload@tip"});
    options.choice.fix = {"*payload.mass=1.7"};
    const IdentifyResult result = identify(draw().nominal, {draw().loaded}, {}, options);
    CHECK(find(result, joint).fixed);
    CHECK(has_note(result, "hold no known mass"));
  }
  SECTION("the masses of a model that is right are known masses") {
    IdentifyOptions options = with_effects({"torque_gain"});
    options.choice.fit = {"effects", "armature"};
    check_gains(identify(draw().truth, {with_gains(draw().empty, kGains)}, {}, options), kGains);
  }
  SECTION("nothing but gains to fit") {
    IdentifyOptions options;
    options.choice.fit = {"effects"};
    options.choice.effects = std::vector<std::string>{"torque_gain"};
    options.choice.fix = {"*friction*", "*armature*"};
    const IdentifyResult result = identify(draw().truth, {draw().empty}, {}, options);
    CHECK(std::abs(find(result, joint).value) < 0.03);  // there is none
  }
  SECTION("one gain held: the others are relative to it") {
    IdentifyOptions options = with_effects({"torque_gain"});
    options.choice.fix = {joint + "=-0.1"};
    const IdentifyResult result =
        identify(draw().nominal, {with_gains(draw().empty, kGains)}, {}, options);
    const ParameterEstimate& g =
        find(result, joint_names(draw().nominal)[3] + ".torque_gain.gain_error");
    REQUIRE(g.identifiable);
    CHECK(std::abs(g.value - kGains[3]) < kInterval * g.std);
  }
}

TEST_CASE("payload: gains of a robot that stands, each time with an offset of its own",
          "[identify][payload]") {
  // Four poses, held: drives report what gravity asks for, by constants that are off.
  Model bare = draw().truth;
  bare.effects
      .clear();  // what stands tells nothing of dry friction: rows at rest would be left out
  const ExtendedTree robot = extend(bare);
  const double poses[][4] = {
      {0, 0.3, 0.2, 0.5}, {0.4, -0.5, 0.9, 1.2}, {-0.4, 0.8, -0.7, 1.6}, {0.2, 1.1, 0.4, 0.8}};
  std::vector<Recording> stands;
  Rng rng(5);
  for (const auto& pose : poses) {
    const VecX<double> q = Eigen::Map<const VecX<double>>(pose, 4);
    RneaWorkspace<double, double> ws;
    const VecX<double> weight = gravity_torques<double, double>(robot.tree, q, ws);
    Recording r;
    r.source = "stand " + std::to_string(stands.size());
    r.joint_names = joint_names(draw().nominal);
    r.time = VecX<double>::LinSpaced(600, 0.0, 2.995);
    r.q = q.transpose().replicate(600, 1);
    r.tau = weight.transpose().replicate(600, 1);
    for (long k = 0; k < r.rows(); ++k)
      for (int j = 0; j < 4; ++j) {
        r.q(k, j) += 1e-5 * rng.normal();
        r.tau(k, j) = (1.0 + kGains[j]) * r.tau(k, j) + 0.1 * rng.normal();
      }
    r.has_tau.assign(4, true);
    stands.push_back(r);
  }
  IdentifyOptions options;
  options.preprocess.filter_hz = 5.0;  // [Hz]; what stands has no band to choose from
  options.choice.fit = {"effects"};
  options.choice.effects = std::vector<std::string>{"torque_gain"};
  const std::string joint = joint_names(draw().nominal)[1] + ".torque_gain.gain_error";
  const ParameterEstimate known = find(identify(bare, stands, {}, options), joint);
  REQUIRE(known.identifiable);
  CHECK(std::abs(known.value - kGains[1]) < kInterval * known.std);

  options.choice.effects = std::vector<std::string>{"torque_gain", "session_offset"};
  const IdentifyResult result = identify(bare, stands, {}, options);
  CHECK(result.summary.converged);
  CHECK(find(result, joint).fixed);  // an offset a pose says all that its weight does
  CHECK(find(result, joint).value == 0.0);
  CHECK(has_note(result, "no better than to 50 %"));
}

TEST_CASE("payload: recordings that do not exist, and places that say nothing, are refused",
          "[identify][payload]") {
  const auto fit = [&](const std::string& effect, const std::string& fix) {
    IdentifyOptions options = with_effects({effect});
    if (!fix.empty()) options.choice.fix = {fix};
    return identify(draw().nominal, {draw().empty, draw().loaded}, {draw().loaded_again}, options);
  };
  CHECK_THROWS_WITH(fit("payload@tip:run=3", ""),
                    ContainsSubstring("does not exist; recordings: 0 "));
  CHECK_THROWS_WITH(fit("payload@tip:run=3", "*payload.mass=1"),
                    ContainsSubstring("does not exist"));
  CHECK_THROWS_WITH(fit("payload@tip:run=2", ""), ContainsSubstring("none of its recordings"));
  CHECK_THROWS_WITH(fit("payload@tip:run=", ""), ContainsSubstring("run=K"));
  CHECK_THROWS_WITH(fit("payload@tip:run=-1", ""), ContainsSubstring("run=K"));
  CHECK_THROWS_WITH(fit("payload@tip:loaded", ""), ContainsSubstring("run=K"));
  CHECK_THROWS_WITH(fit("torque_gain@" + joint_names(draw().nominal)[0] + ":run=1", ""),
                    ContainsSubstring("belongs to the robot"));
  CHECK_THROWS_WITH(fit("payload@tip:run=1", "*payload.mass=-1"),
                    ContainsSubstring("not negative"));
  CHECK_THROWS_WITH(fit("payload@tip:run=1", "*payload.Ixx"), ContainsSubstring("no body has"));
  IdentifyOptions forward = with_effects({"torque_gain"});
  forward.loss = Loss::kForward;
  CHECK_THROWS_WITH(identify(draw().nominal, {draw().empty}, {}, forward),
                    ContainsSubstring("does not fit torque gains"));
}

TEST_CASE("payload: the sidecar's body survives the file, and a half-known one is refused",
          "[io][payload]") {
  const test::TemporaryFolder folder;
  RecordingInfo info;
  info.payload = HeldBody{"disc", "tip", 2.5, std::array{0.0, 0.1, 0.2}, std::nullopt};
  write_sidecar(info, folder.path() / "arm.csv");
  CHECK(read_sidecar(folder.path() / "arm.csv")->info.payload == info.payload);
  for (const auto& [text, message] :
       {std::pair{R"({"payload": {"com": [0, 0, 0]}})", "needs the mass"},
        std::pair{R"({"payload": {"mass": -2}})", "0 kg or more"},
        std::pair{R"({"payload": {"mass": 2, "com": [0, 0]}})", "payload.com"},
        std::pair{R"({"payload": {"weight": 2}})", "weight"}}) {
    std::ofstream(folder.path() / "arm.json") << text;
    CAPTURE(text);
    CHECK_THROWS_WITH(read_sidecar(folder.path() / "arm.csv"), ContainsSubstring(message));
  }
}

}  // namespace payload_test
