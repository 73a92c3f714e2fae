#include "diffnea/identify/joint_choice.hpp"

#include <fstream>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/source.hpp>

#include "support/csv_file.hpp"

using Catch::Matchers::ContainsSubstring;

namespace diffnea::joint_choice_test {
namespace {

using Names = std::vector<std::string>;

Model model_of(const Names& joints) {
  Model model;
  model.name = "robot";
  for (const std::string& joint : joints) {
    ModelLink link;
    link.name = "link_" + joint;
    link.joint = joint;
    link.parent = static_cast<int>(model.links.size()) - 1;
    link.type = ModelJoint::kRevolute;
    link.inertia.m = 1.0;
    model.links.push_back(link);
  }
  return model;
}

ServedModel serve(const Model& model, const Names& logged, const JointChoice& choice) {
  return serve_joints(model, logged, choice);
}

}  // namespace

TEST_CASE("joint choice: the same joints change nothing", "[recording]") {
  const ServedModel served = serve(model_of({"a", "b"}), {"b", "a"}, {});
  CHECK(served.note.empty());
  CHECK(joint_names(served.model) == Names{"a", "b"});
}

TEST_CASE("joint choice: what is not logged is locked, and said", "[recording]") {
  Model model = model_of({"a", "head", "b"});
  model.links[1].limits = {.lower = 0.2, .upper = 1.0};
  const ServedModel served = serve(model, {"a", "b"}, {});
  CHECK(joint_names(served.model) == Names{"a", "b"});
  CHECK(served.note ==
        "locked: head at 0.2 rad, since the recordings do not have it (--lock JOINT=VALUE)");
  const ServedModel stated = serve(model, {"a", "b"}, {.joints = {}, .lock = {"head=0.5"}});
  CHECK(stated.note == "locked: head at 0.5 rad");
}

TEST_CASE("joint choice: other columns are left out, and said", "[recording]") {
  const ServedModel served = serve(model_of({"a"}), {"a", "wheel"}, {});
  CHECK(served.note == "columns left out: those of wheel");
}

TEST_CASE("joint choice: more here and fewer there is a matter of names", "[recording]") {
  const Model model = model_of({"shoulder", "elbow"});
  CHECK_THROWS_WITH(serve(model, {"shoulder", "elbw"}, {}),
                    ContainsSubstring("only in the recording: elbw; only in the model: elbow") &&
                        ContainsSubstring("are they the same, --map \"q_elbw=q_elbow\"?") &&
                        ContainsSubstring("--joints shoulder"));
  CHECK_THROWS_AS(serve(model, {"left", "right"}, {}), DataError);
  const ServedModel served =
      serve(model, {"shoulder", "elbw"}, {.joints = {"shoulder"}, .lock = {}});
  CHECK(served.note == "locked: elbow at 0 rad; columns left out: those of elbw");
}

TEST_CASE("joint choice: nothing holds a passive joint", "[recording]") {
  Model model = model_of({"a", "pendulum"});
  model.links[1].passive = true;
  CHECK_THROWS_WITH(serve(model, {"a"}, {}),
                    ContainsSubstring("the passive joint 'pendulum' is not logged"));
  CHECK_NOTHROW(serve(model, {"a"}, {.joints = {}, .lock = {"pendulum=0"}}));
}

TEST_CASE("joint choice: names and numbers that are none are refused", "[recording]") {
  const Model model = model_of({"a", "b"});
  const auto with = [&](const JointChoice& choice) { return serve(model, {"a", "b"}, choice); };
  CHECK_THROWS_WITH(with({.joints = {"c"}, .lock = {}}), ContainsSubstring("joints: a, b"));
  CHECK_THROWS_WITH(with({.joints = {}, .lock = {"b=fast"}}), ContainsSubstring("JOINT=VALUE"));
  CHECK_THROWS_WITH(with({.joints = {}, .lock = {"b", "b=1"}}), ContainsSubstring("twice"));
  CHECK_THROWS_WITH(serve(model, {"a"}, {.joints = {"b"}, .lock = {}}),
                    ContainsSubstring("b is asked for and not logged"));
}

TEST_CASE("joint choice: a lock without a value is where the file has the joint", "[recording]") {
  const test::CsvFile file(
      "time,q_a,q_grip,tau_a,tau_grip\n0,0,0.5,1,0\n1,1,0.25,1,0\n2,0,0.25,1,0\n");
  const JointChoice choice{.joints = {}, .lock = {"grip"}};
  const ServedModel served = serve_joints(
      model_of({"a", "grip"}), std::vector<std::filesystem::path>{file.path}, {}, choice);
  CHECK(served.note ==
        "locked: grip at 0.25 rad (logged from 0.25 to 0.5); columns left out: those of grip");
  // Its torque, zero throughout, is not read: else it would be refused.
  const auto source = recordings_in_files(served.model, {file.path}, {});
  CHECK(source->sample()[0].joint_names == Names{"a"});
  CHECK_THAT(source->report().notes.at(0), ContainsSubstring("are left out: grip"));
}

TEST_CASE("joint choice: what moves in one recording, moves in all", "[recording]") {
  const Model model = model_of({"a", "b"});
  Recording both, one;
  both.source = "both.csv";
  both.joint_names = {"a", "b"};
  one.source = "one.csv";
  one.joint_names = {"a"};
  for (const auto& order : {std::vector{both, one}, std::vector{one, both}})
    CHECK_THROWS_WITH(
        serve_joints(model, order, JointChoice{}),
        ContainsSubstring(order[1].source + ": its joints are not those of " + order[0].source) &&
            ContainsSubstring("b"));
  const ServedModel served =
      serve_joints(model, std::vector{one, both}, {.joints = {}, .lock = {"b=0"}});
  CHECK(joint_names(served.model) == Names{"a"});
}

}  // namespace diffnea::joint_choice_test
