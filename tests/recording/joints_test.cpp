#include "diffnea/recording/joints.hpp"

#include <cmath>
#include <limits>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>

using Catch::Matchers::ContainsSubstring;

namespace diffnea::joints_test {
namespace {

Recording recording() {
  Recording r;
  r.source = "arm.csv";
  r.joint_names = {"a", "b"};
  r.has_tau = {true, false};
  r.time = VecX<double>::LinSpaced(3, 0.0, 0.2);
  r.q.resize(3, 2);
  r.q << 1, 10, 2, 20, 3, 30;
  r.tau = r.q;
  return r;
}

}  // namespace

TEST_CASE("joints: columns take the model's order", "[recording]") {
  std::vector<Recording> all = {recording()};
  match_joints({{.name = "b"}, {.name = "a"}}, all);
  CHECK(all[0].joint_names == std::vector<std::string>{"b", "a"});
  CHECK(all[0].has_tau == std::vector<bool>{false, true});
  CHECK(all[0].q(2, 0) == 30.0);
  CHECK(all[0].q(2, 1) == 3.0);
  CHECK(all[0].tau(1, 1) == 2.0);
  CHECK(all[0].qd.size() == 0);
}

TEST_CASE("joints: a joint that the model calls passive has torque zero", "[recording]") {
  std::vector<Recording> all = {recording()};
  match_joints({{.name = "a", .passive = true}, {.name = "b"}}, all);
  CHECK(all[0].has_tau == std::vector<bool>{false, false});
  CHECK(all[0].tau.col(0).isZero(0.0));
  CHECK(all[0].info.passive == std::vector<std::string>{"a"});
}

TEST_CASE("joints: columns of other joints are left out", "[recording]") {
  std::vector<Recording> all = {recording()};
  match_joints({{.name = "b"}}, all);
  CHECK(all[0].joint_names == std::vector<std::string>{"b"});
  CHECK(all[0].q.cols() == 1);
  CHECK(all[0].q(2, 0) == 30.0);
}

TEST_CASE("joints: a joint without columns is refused, both sets named", "[recording]") {
  std::vector<Recording> all = {recording()};
  for (const std::vector<JointDescription>& joints :
       {std::vector<JointDescription>{{.name = "a"}, {.name = "c"}},
        std::vector<JointDescription>{{.name = "a"}, {.name = "b"}, {.name = "c"}}})
    CHECK_THROWS_WITH(
        match_joints(joints, all),
        ContainsSubstring("arm.csv: the joints are not the model's; recording: a, b; model: a"));
}

TEST_CASE("joints: degrees show by limits that only they would fit", "[recording]") {
  const std::vector<Recording> all = {recording()};  // to 3 and to 30
  const auto warned = [&](const JointDescription& b) {
    std::string out;
    for (const ChannelWarning& w : find_degrees({{.name = "a"}, b}, all))
      out += w.joint + ": " + w.text;
    return out;
  };
  CHECK(warned({.name = "b", .lower = -3.0, .upper = 3.0})
            .starts_with("b: q_b runs from 10 to 30 rad"));
  CHECK(warned({.name = "b"}).starts_with("b: q_b runs from 10 to 30 rad, outside the usual"));
  CHECK(warned({.name = "b", .prismatic = true, .lower = -3.0, .upper = 3.0}).empty());
  CHECK(warned({.name = "b", .lower = -40.0, .upper = 40.0}).empty());
  // As degrees it would not fit either: something else is wrong.
  CHECK(warned({.name = "b", .lower = -0.1, .upper = 0.1}).empty());
}

TEST_CASE("joints: a model without joints takes a ball's recording and no robot's", "[recording]") {
  Recording ball;
  ball.time = VecX<double>::LinSpaced(3, 0.0, 0.2);
  ball.q.resize(3, 0);
  ball.tau.resize(3, 0);
  ball.ball = RowMatX<double>::Ones(3, 3);
  std::vector<Recording> all = {ball};
  match_joints({}, all);
  CHECK(all[0].ball.rows() == 3);
  CHECK(find_degrees({}, all).empty());
  CHECK(blank_absurd_torque({}, all).empty());
  std::vector<Recording> robot = {recording()};
  CHECK_THROWS_WITH(match_joints({}, robot), ContainsSubstring("the model has no joint"));
  CHECK_THROWS_WITH(match_joints({{.name = "a"}}, all), ContainsSubstring("recording: none"));
}

TEST_CASE("joints: torque beyond twice the effort limit is a question of units", "[recording]") {
  const std::vector<Recording> all = {recording()};  // tau_a up to 3, tau_b not measured
  const auto warned = [&](double effort) {
    return find_excess_torque({{.name = "a", .effort = effort}, {.name = "b", .effort = 1.0}}, all)
        .size();
  };
  CHECK(warned(1.0) == 1);
  CHECK(warned(2.0) == 0);
  CHECK(warned(0.0) == 0);
  CHECK(warned(std::numeric_limits<double>::infinity()) == 0);
}

TEST_CASE("joints: a burst of absurd torque becomes a gap", "[recording]") {
  Recording r;
  r.source = "arm";
  r.joint_names = {"a"};
  r.has_tau = {true};
  r.time = VecX<double>::LinSpaced(1000, 0.0, 9.99);
  r.q = r.tau = RowMatX<double>::Constant(1000, 1, 1.5);
  r.tau(500, 0) = r.tau(999, 0) = -1e6;
  r.tau.middleRows(100, 15).setConstant(1e4);
  std::vector<Recording> all = {r};
  const std::vector<std::string> notes = blank_absurd_torque({{.name = "a"}}, all);
  REQUIRE(notes.size() == 1);
  CHECK_THAT(notes[0], ContainsSubstring("arm: tau_a is 10000 at 1 s") &&
                           ContainsSubstring("17 such values are taken as gaps"));
  long gaps = 0;
  for (long i = 0; i < 1000; ++i) gaps += std::isnan(all[0].tau(i, 0)) ? 1 : 0;
  CHECK(gaps == 17);
  CHECK(blank_absurd_torque({{.name = "a"}}, all).empty());
}

TEST_CASE("joints: a passive joint's torque that is known already stays", "[recording]") {
  // What a ball pulls at it was taken out of the zero.
  Recording r = recording();
  r.has_tau = {false, false};
  r.info.passive = {"a"};
  std::vector<Recording> all = {r};
  match_joints({{.name = "a", .passive = true}, {.name = "b"}}, all);
  CHECK(all[0].tau.col(0) == r.tau.col(0));
  all[0].tau(1, 0) = std::numeric_limits<double>::quiet_NaN();  // a simulation's
  match_joints({{.name = "a", .passive = true}, {.name = "b"}}, all);
  CHECK(all[0].tau.col(0).isZero(0.0));
}

}  // namespace diffnea::joints_test
