/// identify() on recordings of a MuJoCo WAM that the model does not know, and on what it must
/// refuse.

#include <algorithm>
#include <support/temporary_folder.hpp>
#include <support/wam_study.hpp>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/model/physical.hpp>

#include "support/found.hpp"

namespace identify_test {

using namespace diffnea;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;
using diffnea::test::find;

namespace {

/// One draw serves all tests of this file: recording takes a tenth of a second.
const test::WamDraw& draw() {
  static const test::WamDraw kDraw = test::draw_wam(300, 20.0);
  return kDraw;
}

double mean_test_error(const IdentifyResult& result) {
  double sum = 0.0;
  for (const JointError& e : result.errors) sum += e.test;
  return sum / static_cast<double>(result.errors.size());
}

bool has_note(const IdentifyResult& result, const std::string& part) {
  return std::ranges::any_of(
      result.notes, [&](const std::string& n) { return n.find(part) != std::string::npos; });
}

}  // namespace

TEST_CASE("identify: a MuJoCo arm's residual falls to the noise floor", "[identify]") {
  const IdentifyResult result = identify(draw().nominal, {draw().train}, {draw().test});
  REQUIRE(result.summary.converged);
  IdentifyOptions held;  // what the truth itself leaves of the same rows
  held.choice.fit = {"effects"};
  held.choice.effects = std::vector<std::string>{"torque_offset"};
  held.choice.fix = {"*friction*", "*armature*"};
  held.preprocess.filter_hz = result.plan.filter_hz;
  const IdentifyResult floor = identify(draw().truth, {draw().train}, {draw().test}, held);
  for (std::size_t j = 0; j < result.errors.size(); ++j) {
    CAPTURE(j);
    // 20 s hold some 40 parameters: 1.02 is expected, 1.06 the worst of the study's 40 s runs.
    CHECK(result.errors[j].test < 1.15 * floor.errors[j].nominal_test);
    CHECK(result.errors[j].test < 0.25 * result.errors[j].nominal_test);
  }
  const Tree<double> fitted = make_tree(result.model);
  for (const Link<double>& link : fitted.links)
    CHECK(smallest_pseudo_inertia_eigenvalue(link.inertia.theta()) > 0.0);
}

TEST_CASE("identify: base parameters lie within their intervals", "[identify]") {
  const IdentifyResult result = identify(draw().nominal, {draw().train}, {});
  const test::Coverage c = test::coverage(result, draw().truth);
  REQUIRE(c.of > 30);
  // One draw: the study's rate is 0.85 or more, its spread over draws 0.08.
  CHECK(c.inside > 0.65 * c.of);
}

TEST_CASE("identify: friction comes out as MuJoCo had it", "[identify]") {
  const IdentifyResult result = identify(draw().nominal, {draw().train}, {});
  const std::map<std::string, double> truth = test::true_parameters(draw().truth);
  for (const char* name : {"joint1.viscous_friction.viscous", "joint2.coulomb_friction.coulomb",
                           "joint4.viscous_friction.viscous", "joint3.coulomb_friction.coulomb"}) {
    CAPTURE(name);
    CHECK(find(result, name).identifiable);
    CHECK(find(result, name).value == Approx(truth.at(name)).epsilon(0.05));  // 2 % observed
  }
  CHECK(find(result, "joint1.armature.armature").fixed);  // the first link's inertia absorbs it
  CHECK(has_note(result, "joint1.armature.armature cannot be told"));
}

TEST_CASE("identify: streamed from files is the same as from memory", "[identify]") {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "train.csv";
  const test::WamDraw longer = test::draw_wam(300, 40.0);
  REQUIRE(longer.train.rows() > 16384);  // more than a block of the stream
  write_recording(longer.train, path);
  const auto in_memory = recordings_in_files(longer.nominal, {path}, {});
  const auto streamed = recordings_in_files(longer.nominal, {path}, {}, /*keep_bytes=*/0);
  const IdentifyResult a = identify(longer.nominal, *in_memory, nullptr);
  const IdentifyResult b = identify(longer.nominal, *streamed, nullptr);
  REQUIRE(a.parameters.size() == b.parameters.size());
  for (std::size_t k = 0; k < a.parameters.size(); ++k) {
    CAPTURE(a.parameters[k].name);
    // Bit by bit: the filter's blocks are cut by row, however the rows arrive.
    CHECK(a.parameters[k].value == b.parameters[k].value);
    CHECK((std::isnan(a.parameters[k].std) ? std::isnan(b.parameters[k].std)
                                           : a.parameters[k].std == b.parameters[k].std));
  }
}

TEST_CASE("identify: what reading a stream brought up is reported, held out or not", "[identify]") {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "train.csv";
  Recording spoiled = draw().train;
  spoiled.tau(1000, 2) = 1e6;
  write_recording(spoiled, path);
  const auto streamed = recordings_in_files(draw().nominal, {path}, {}, /*keep_bytes=*/0);
  const IdentifyResult fitted = identify(draw().nominal, *streamed, nullptr);
  CHECK(fitted.data_report.quarantined == 1);
  CHECK(fitted.data_report.rows == spoiled.rows());
  const auto held_out = recordings_in_files(draw().nominal, {path}, {});
  const auto train = recordings_in_memory(draw().nominal, {draw().test});
  CHECK(has_note(identify(draw().nominal, *train, held_out.get()), "held-out data: 1 of"));
}

TEST_CASE("identify: the forward loss agrees where the model is right", "[identify]") {
  IdentifyOptions options;
  options.loss = Loss::kForward;
  const IdentifyResult forward = identify(draw().nominal, {draw().train}, {draw().test}, options);
  const IdentifyResult inverse = identify(draw().nominal, {draw().train}, {draw().test});
  CHECK(forward.summary.passes > 1);
  CHECK(mean_test_error(forward) <
        1.3 * mean_test_error(inverse));  // another weighting of the same rows
}

TEST_CASE("identify: robust losses shrug off bursts on the torque", "[identify]") {
  Recording spoiled = draw().train;
  for (long k = 0; k + 100 < spoiled.rows(); k += 500)  // a tenth of the time
    for (long r = k; r < k + 50; ++r)
      for (int j = 0; j < 4; ++j) spoiled.tau(r, j) += 30.0;
  IdentifyOptions plain, robust;
  robust.robust = Robust::kCauchy;
  const double e_plain = mean_test_error(identify(draw().nominal, {spoiled}, {draw().test}, plain));
  const double e_robust =
      mean_test_error(identify(draw().nominal, {spoiled}, {draw().test}, robust));
  CHECK(e_robust < 0.3 * e_plain);
}

TEST_CASE("identify: a misplaced joint is found by its fixed transform", "[identify]") {
  Model wrong = draw().nominal;
  const std::vector<int> moving = moving_links(wrong);
  wrong.links[moving[3]].X_PJ.p.x += 0.05;  // the elbow, 5 cm off
  IdentifyOptions as_is, kinematic;
  kinematic.choice.fit = {"inertia", "armature", "effects", "kinematics@joint4"};
  const double held = mean_test_error(identify(wrong, {draw().train}, {draw().test}, as_is));
  const IdentifyResult found = identify(wrong, {draw().train}, {draw().test}, kinematic);
  const double right =
      mean_test_error(identify(draw().nominal, {draw().train}, {draw().test}, as_is));
  CHECK(held > 1.1 * right);
  CHECK(mean_test_error(found) < right + 0.2 * (held - right));
  // "Before" is the model before the fit, its misplaced joint included.
  const IdentifyResult unmoved = identify(wrong, {draw().train}, {draw().test}, as_is);
  for (std::size_t j = 0; j < found.errors.size(); ++j)
    CHECK(found.errors[j].nominal_test == Approx(unmoved.errors[j].nominal_test));
}

TEST_CASE("identify: a joint that never moves is held, the others are fitted", "[identify]") {
  Recording still = draw().train;
  still.q.col(2).setConstant(0.3);
  still.qcmd.resize(0, 0);
  const IdentifyResult result = identify(draw().nominal, {still}, {});
  CHECK(has_note(result, "joint3 never moves"));
  CHECK(find(result, "joint3.viscous_friction.viscous").fixed);
  CHECK_FALSE(find(result, "joint3.viscous_friction.viscous").identifiable);
  CHECK_FALSE(find(result, "joint1.viscous_friction.viscous").fixed);
}

TEST_CASE("identify: fixed parameters keep the model's value", "[identify]") {
  IdentifyOptions options;
  options.choice.fix = {"forearm.*"};
  const IdentifyResult result = identify(draw().nominal, {draw().train}, {}, options);
  const ParameterEstimate& mass = find(result, "forearm.mass");
  CHECK(mass.fixed);
  CHECK(mass.value == mass.prior);
}

TEST_CASE("identify: a session's offset is not that of a held-out recording", "[identify]") {
  Recording apart = draw().train;
  apart.tau.col(1).array() += 3.0;  // [N·m]
  IdentifyOptions options;
  options.choice.effects = std::vector<std::string>{"armature", "viscous_friction",
                                                    "coulomb_friction", "session_offset"};
  const IdentifyResult result = identify(draw().nominal, {apart}, {draw().test}, options);
  CHECK(find(result, "joint2.session_offset.offset_0").value > 2.0);
  CHECK(result.errors.at(1).test < 1.0);  // [N·m]
}

TEST_CASE("identify: a callback that says stop is obeyed, what was read is fitted", "[identify]") {
  IdentifyOptions options;
  options.progress = [](const FitProgress&) { return false; };
  const IdentifyResult result = identify(draw().nominal, {draw().train}, {}, options);
  CHECK(result.summary.interrupted);
  CHECK_THAT(result.summary.termination, ContainsSubstring("interrupted"));
}

TEST_CASE("identify: stopped while testing, the fit is whole and says what errors are of",
          "[identify]") {
  IdentifyOptions options;
  const IdentifyResult whole = identify(draw().nominal, {draw().train}, {draw().test}, options);
  options.progress = [](const FitProgress& p) { return p.stage != "testing"; };
  const IdentifyResult stopped = identify(draw().nominal, {draw().train}, {draw().test}, options);
  CHECK(stopped.summary.interrupted);
  CHECK(stopped.summary.converged);
  CHECK_THAT(stopped.summary.termination, ContainsSubstring("while testing"));
  CHECK(find(stopped, "forearm.mass").value == find(whole, "forearm.mass").value);
}

TEST_CASE("identify: input that cannot be fitted is refused with the reason", "[identify]") {
  const auto first = [](long rows) {
    Recording brief = draw().train;
    brief.time = VecX<double>(brief.time.head(rows));
    brief.q = RowMatX<double>(brief.q.topRows(rows));
    brief.tau = RowMatX<double>(brief.tau.topRows(rows));
    brief.qcmd.resize(0, 0);
    return brief;
  };
  IdentifyOptions sparse;
  sparse.preprocess.decimate_to_hz = 5.0;
  CHECK_THROWS_WITH(identify(draw().nominal, {first(2000)}, {}, sparse),  // 4 s, 20 rows a joint
                    ContainsSubstring("parameters"));
  CHECK_THROWS_WITH(identify(draw().nominal, {first(1000)}, {}, sparse),  // shorter than the filter
                    ContainsSubstring("no torque sample is left"));

  CHECK_THROWS_WITH(identify(draw().nominal, {draw().train}, {draw().train}),
                    ContainsSubstring("same rows"));

  Recording other = draw().train;
  other.joint_names = {"a", "b", "c", "d"};
  CHECK_THROWS_WITH(identify(draw().nominal, {other}, {}), ContainsSubstring("joint1"));
  CHECK_THROWS_AS(identify(draw().nominal, std::vector<Recording>{}, {}), DataError);
}

TEST_CASE("identify: nothing left to fit, or no band to fit in, is refused", "[identify]") {
  IdentifyOptions options;
  options.choice.fix = {"*"};
  CHECK_THROWS_WITH(identify(draw().nominal, {draw().train}, {}, options),
                    ContainsSubstring("nothing is left"));
  options.loss = Loss::kMotion;
  CHECK_THROWS_WITH(identify(draw().nominal, {draw().train}, {}, options),
                    ContainsSubstring("nothing is left"));
  options = {};
  options.preprocess.filter_hz = 1e-6;
  CHECK_THROWS_WITH(identify(draw().nominal, {draw().train}, {}, options), ContainsSubstring("Hz"));
  options = {};
  options.preprocess.decimate_to_hz = 1e-6;
  CHECK_THROWS_WITH(identify(draw().nominal, {draw().train}, {}, options), ContainsSubstring("Hz"));
}

TEST_CASE("identify: torque of the wrong sign is not passed over in silence", "[identify]") {
  Recording flipped = draw().train;
  flipped.tau = -flipped.tau;
  CHECK(has_note(identify(draw().nominal, {flipped}, {}), "check its sign"));
  const std::string other = "is reproduced worse on held-out data than by the model before the fit";
  CHECK(has_note(identify(draw().nominal, {flipped}, {draw().test}), other));
  CHECK_FALSE(has_note(identify(draw().nominal, {draw().train}, {draw().test}), other));
}

}  // namespace identify_test
