/// Joints that follow others: <mimic> of a URDF, joint equalities of an MJCF, `follows` of JSON.

#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/io/model_info.hpp>
#include <diffnea/model/lock.hpp>

#include "support/mjcf_text.hpp"

namespace io_followers_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;

namespace {

/// The same sums after a way through a file: rounding of numbers of order 1.
constexpr double kRoundingTol = 1e-12;

std::string urdf_link(const std::string& name, double mass) {
  return "<link name='" + name + "'><inertial><origin xyz='0.1 0.02 -0.05'/><mass value='" +
         std::to_string(mass) +
         "'/><inertia ixx='0.01' ixy='0' ixz='0' iyy='0.012' iyz='0' "
         "izz='0.008'/></inertial></link>";
}

/// a–b–c–d in a row, driven by the joints j, k, l; `k` and `l` are what follows the axis of each.
std::string urdf(const std::string& k, const std::string& l) {
  const auto joint = [](const char* name, const char* parent, const char* child, const char* axis,
                        const std::string& more) {
    return std::string("<joint name='") + name +
           "' type='revolute'><origin xyz='0 0 0.3'/><parent "
           "link='" +
           parent + "'/><child link='" + child + "'/><axis xyz='" + axis +
           "'/><limit lower='-2' upper='2' effort='50' velocity='3'/>" + more + "</joint>";
  };
  return "<robot name='r'><link name='a'/>" + urdf_link("b", 2.0) + urdf_link("c", 1.5) +
         urdf_link("d", 0.5) + joint("j", "a", "b", "0 1 0", "") +
         joint("k", "b", "c", "1 0 0", k) + joint("l", "c", "d", "0 1 0", l) + "</robot>";
}

VecX<double> torques(const Model& m, const VecX<double>& y, const VecX<double>& yd,
                     const VecX<double>& ydd) {
  return inverse_dynamics(extend(m), y.transpose(), yd.transpose(), ydd.transpose()).transpose();
}

VecX<double> vec(std::initializer_list<double> values) {
  VecX<double> out(static_cast<long>(values.size()));
  std::copy(values.begin(), values.end(), out.data());
  return out;
}

}  // namespace

TEST_CASE("followers: a chain of mimics moves as the full tree does", "[io]") {
  const std::string rubbing = "<dynamics damping='0.3' friction='0.2'/>";
  const Model m = model_of(urdf("<mimic joint='l' multiplier='-0.5' offset='0.1'/>" + rubbing,
                                "<mimic joint='j' multiplier='2' offset='-0.3'/>"));
  REQUIRE(joint_names(m) == std::vector<std::string>{"j"});
  CHECK(follower_names(m) == std::vector<std::string>{"k", "l"});
  const Model open = model_of(urdf(rubbing, ""));
  const VecX<double> y = vec({0.4}), yd = vec({1.1}), ydd = vec({-2.0});
  // l = 2 j − 0.3, k = −0.5 l + 0.1 = −j + 0.25
  const VecX<double> q = vec({0.4, -0.15, 0.5}), qd = vec({1.1, -1.1, 2.2}),
                     qdd = vec({-2.0, 2.0, -4.0});
  const VecX<double> full = torques(open, q, qd, qdd);
  CHECK(torques(m, y, yd, ydd)[0] ==
        Approx(full[0] - full[1] + 2.0 * full[2]).epsilon(kRoundingTol));
}

TEST_CASE("followers: a multiplier of 0 holds a joint where its offset says", "[io]") {
  const Model m = model_of(urdf("<mimic joint='j' multiplier='0' offset='0.7'/>", ""));
  const Model open = model_of(urdf("", ""));
  const VecX<double> full =
      torques(open, vec({0.3, 0.7, -0.2}), vec({1.0, 0.0, 0.5}), vec({-1.0, 0.0, 2.0}));
  const VecX<double> tau = torques(m, vec({0.3, -0.2}), vec({1.0, 0.5}), vec({-1.0, 2.0}));
  CHECK(tau[0] == Approx(full[0]).epsilon(kRoundingTol));
  CHECK(tau[1] == Approx(full[2]).epsilon(kRoundingTol));
}

TEST_CASE("followers: a joint that follows none is refused, with the reason", "[io]") {
  struct Case {
    std::string k, l, says;
  };
  const Case c =
      GENERATE(Case{"<mimic joint='l'/>", "<mimic joint='k'/>",
                    "joint 'l' follows 'k', which follows it in turn"},
               Case{"<mimic joint='k'/>", "", "joint 'k' follows 'k', which follows it in turn"},
               Case{"<mimic joint='knuckle'/>", "",
                    "joint 'k' follows 'knuckle', which is no joint of the model; joints: j, l"});
  CHECK_THAT(refusal(urdf(c.k, c.l)), ContainsSubstring(c.says));
  std::string fixed = urdf("<mimic joint='l'/>", "");
  fixed.replace(fixed.find("name='l' type='revolute'"), 24, "name='l' type='fixed'");
  CHECK_THAT(refusal(fixed), ContainsSubstring("joint 'k' follows 'l', which is fixed"));
}

TEST_CASE("followers: URDF, MJCF and JSON give the same dynamics back", "[io]") {
  const TemporaryFolder folder;
  const Model m = model_of(urdf("<mimic joint='l' multiplier='-0.5' offset='0.1'/>", ""));
  const VecX<double> y = vec({0.4, 0.9}), yd = vec({1.1, -0.6}), ydd = vec({-2.0, 3.0});
  for (const char* name : {"r.json", "r.urdf", "r.xml"}) {
    CAPTURE(name);
    Model out = m;
    out.source = "";  // drawn anew, not written into the document it came from
    write_model(out, folder.path() / name);
    const Model back = read_model(folder.path() / name);
    REQUIRE(joint_names(back) == joint_names(m));
    CHECK(link_of(back, "k").follows->leader == "l");
    CHECK((torques(back, y, yd, ydd) - torques(m, y, yd, ydd)).norm() < 1e-10);
  }
}

TEST_CASE("followers: an MJCF's joint equalities, references and drives included", "[io]") {
  const std::string body = std::string("<mujoco><compiler angle='radian'/><worldbody><body>") +
                           kInertial + "<joint name='j' ref='0.2'/><body>" + kInertial +
                           "<joint name='k' ref='-0.1'/><body>" + kInertial +
                           "<joint name='l'/></body></body></body></worldbody><equality>";
  const auto drive = [](const char* joint) {
    return std::string("</equality><actuator><motor joint='") + joint +
           "' ctrllimited='true' ctrlrange='-3 3'/></actuator></mujoco>";
  };
  // k + 0.1 = 0.5 + 2 (j − 0.2)
  const Model m =
      model_of(body + "<joint joint1='k' joint2='j' polycoef='0.5 2 0 0 0'/>" + drive("k"));
  REQUIRE(joint_names(m) == std::vector<std::string>{"j", "l"});
  CHECK(link_of(m, "k").follows->ratio == 2.0);
  CHECK(link_of(m, "k").follows->offset == Approx(-0.1 + 0.5 - 2.0 * 0.2));
  CHECK(!link_of(m, "j").passive);  // driven at k
  CHECK(link_of(m, "j").limits.effort == Approx(6.0));
  CHECK(link_of(m, "l").passive);

  // Two constraints of one joint: the third joint follows the first.
  const Model both = model_of(body + "<joint joint1='k' joint2='j'/>" +
                              "<joint joint1='k' joint2='l' polycoef='0 4 0 0 0'/>" + drive("j"));
  CHECK(joint_names(both) == std::vector<std::string>{"j"});
  CHECK(link_of(both, "l").follows->leader == "k");
  CHECK(link_of(both, "l").follows->ratio == 0.25);

  const Model locked = model_of(body + "<joint joint1='k' polycoef='0.4 0 0 0 0'/>" + drive("j"));
  CHECK(joint_names(locked) == std::vector<std::string>{"j", "l"});
  CHECK_THAT(notes_of(locked), ContainsSubstring("joint 'k' is locked") &&
                                   ContainsSubstring("at 0.30000000000000004"));
  CHECK_THAT(refusal(body + "<joint joint1='k' joint2='j' polycoef='0 1 0.2 0 0'/>" + drive("j")),
             ContainsSubstring("polynomial of degree 2"));
  CHECK_THAT(
      refusal(body + "<joint joint1='k' joint2='j'/><joint joint1='j' joint2='k'/>" + drive("j")),
      ContainsSubstring("in turn"));
}

TEST_CASE("followers: columns of theirs are merged, and checked", "[io]") {
  const Model m = model_of(urdf("<mimic joint='j' multiplier='-2' offset='0.5'/>", ""));
  const double off = GENERATE(0.0, 0.01);  // beyond a noise of 1e-4 rad
  Recording r;
  r.joint_names = {"l", "k", "j"};
  r.has_tau = {true, true, true};
  const long rows = 400;
  r.time.setLinSpaced(rows, 0.0, 4.0);
  r.q.resize(rows, 3);
  r.tau.resize(rows, 3);
  for (long i = 0; i < rows; ++i) {
    const double j = std::sin(2.0 * r.time[i]), noise = i % 2 == 0 ? 1e-4 : -1e-4;
    r.q.row(i) << 0.3 * j, 0.5 - 2.0 * j + noise + (std::cos(2.0 * r.time[i]) > 0.0 ? off : -off),
        j;
    r.tau.row(i) << 1.0, 0.25, 3.0 * j;
  }
  const auto source = recordings_in_memory(m, {r});
  const Recording merged = source->sample().front();
  CHECK(merged.joint_names == std::vector<std::string>{"j", "l"});
  CHECK(merged.q(7, 0) == r.q(7, 2));
  CHECK(merged.tau(7, 0) == Approx(r.tau(7, 2) - 2.0 * 0.25));
  CHECK(merged.tau(7, 1) == 1.0);
  if (off == 0.0) {
    CHECK(source->warnings().empty());
  } else {
    REQUIRE(source->warnings().size() == 1);
    CHECK_THAT(source->warnings()[0].text, ContainsSubstring("q_k is not -2 q_j + 0.5"));
  }
}

TEST_CASE("followers: those of a joint that is locked stand still with it", "[io]") {
  Model m = model_of(urdf("<mimic joint='l' multiplier='-0.5' offset='0.1'/>",
                          "<mimic joint='j' multiplier='2' offset='-0.3'/>"));
  lock_joint(m, "j", 0.4);  // l = 0.5, k = -0.15
  CHECK(joint_names(m).empty());
  CHECK(follower_names(m).empty());
  const Model open = model_of(urdf("", ""));
  LinkKinematics<double> kinematics;
  forward_kinematics<double, double>(make_tree(open), vec({0.4, -0.15, 0.5}), kinematics);
  const TreeMap map = map_to_tree(m);
  const Vec3<double> off = kinematics.links[2].X_WL.p - map.X_LF.back().p;
  CHECK(std::sqrt(dot(off, off)) < kRoundingTol);
}

TEST_CASE("followers: info says what they follow, effects other than friction are refused",
          "[io]") {
  Model m = model_of(urdf("<mimic joint='j' multiplier='-2' offset='0.5'/>", ""));
  CHECK_THAT(model_info_text(m),
             ContainsSubstring("= -2 j + 0.5") && ContainsSubstring("2 degrees of freedom"));
  m.effects.push_back({"joint_elasticity", "k", {}});
  CHECK_THROWS_WITH(extend(m), ContainsSubstring("joint 'k' follows another"));
}

}  // namespace io_followers_test
