/// MJCF of versions after MuJoCo 2.2: its meaning for a tree; places in the user's files; bases
/// that float, loops, meshes that are missing.

#include <algorithm>
#include <cmath>
#include <limits>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/text_file.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/io/model_file.hpp>

#include "support/matrix_near.hpp"
#include "support/mjcf_text.hpp"
#include "support/temporary_folder.hpp"

namespace mjcf_today_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::StartsWith;

namespace {}  // namespace

TEST_CASE("mjcf: equal notes are one, with how often and the first line", "[io]") {
  const Model m = model_of(
      "<mujoco>\n<option ls_iterations='3'>\n<flag eulerdamp='disable'/></option>\n<worldbody>"
      "<body><joint name='j'/><geom size='1'/></body></worldbody>\n<actuator>\n"
      "<position joint='j' timeconst='1'/>\n<position joint='j' timeconst='2'/></actuator>"
      "</mujoco>");
  CHECK_THAT(notes_of(m),
             ContainsSubstring("settings of a simulation are left out: option ls_iterations "
                               "(line 2), flag eulerdamp (line 3)\n"));
  CHECK_THAT(notes_of(m), ContainsSubstring("position timeconst (2 times, first in line 6)\n"));
}

TEST_CASE("mjcf: messages name the line of the user's file, included ones by name", "[io]") {
  const TemporaryFolder folder;
  write_file_atomically(folder.path() / "part.xml",
                        "<mujoco>\n<actuator>\n<motor joint='j' wrong='1'/></actuator></mujoco>");
  const std::string body = "<body name='b'>\n<joint name='j'/>\n<geom size='1'/></body>";
  const auto said = [&](const std::string& text) { return refusal(folder, text); };
  const std::string included =
      said("<mujoco>\n<include file='part.xml'/>\n<worldbody>" + body + "</worldbody></mujoco>");
  CHECK_THAT(included, ContainsSubstring("unrecognized attribute: 'wrong'") &&
                           ContainsSubstring("line 3 of part.xml") &&
                           ContainsSubstring("words up to 4.0 are translated"));
  // Looks, sensors and frames before it are gone when MuJoCo reads it.
  const std::string before =
      "<mujoco>\n<visual>\n<map/>\n</visual>\n<sensor>\n</sensor>\n<worldbody>\n<light/>\n"
      "<frame>\n" +
      body + "</frame>\n";
  CHECK_THAT(said(before + "<geom sise='1'/></worldbody></mujoco>"),
             ContainsSubstring("'sise'") && ContainsSubstring("line 13"));
  CHECK_THAT(said(before + "<body>\n<inertial pos='0 0 0' mass='1' diaginertia='1 1 3'/>\n<joint/>"
                           "</body></worldbody></mujoco>"),
             ContainsSubstring("line 13"));
  CHECK_THAT(said("<mujoco>\n<worldbody>\n<body name='b'>\n<joint name='k' type='ball'/>"
                  "<geom size='1'/></body></worldbody></mujoco>"),
             ContainsSubstring("joint 'k' of body 'b' (line 3) is a ball joint"));
  CHECK_THAT(said("<mujoco>\n<include file='none.xml'/></mujoco>"), ContainsSubstring("line 2"));
}

TEST_CASE("mjcf: ranges are limits unless the document says otherwise", "[io]") {
  const double inf = std::numeric_limits<double>::infinity();
  const Model m = model_of(one_joint({"<compiler angle='radian'/>", "range='-1 2'"}));
  CHECK(m.links[0].limits.lower == -1.0);
  CHECK(m.links[0].limits.upper == 2.0);
  const auto upper = [](const std::string& head, const std::string& joint) {
    return model_of(one_joint({head, joint})).links[0].limits.upper;
  };
  CHECK(upper("<compiler angle='radian'/>", "range='-1 2' limited='auto'") == 2.0);
  CHECK(upper("<compiler angle='radian'/>", "range='-1 2' limited='false'") == inf);
  CHECK(upper("<compiler angle='radian' autolimits='false'/>", "range='-1 2' limited='true'") ==
        2.0);
  CHECK_THAT(refusal(one_joint({"<compiler autolimits='false'/>", "range='-1 2'"})),
             ContainsSubstring("limited"));
}

TEST_CASE("mjcf: the range of force of all drives of a joint limits its effort", "[io]") {
  const auto text = [](const std::string& j, const std::string& k, const std::string& actuators) {
    return "<mujoco><default><joint actuatorfrcrange='-4 5'/><default class='none'>"
           "<joint actuatorfrclimited='false'/></default></default><worldbody><body>" +
           std::string(kInertial) + "<joint name='j' " + j + "/><body>" + kInertial +
           "<joint name='k' " + k + "/></body></body></worldbody><actuator>" + actuators +
           "</actuator></mujoco>";
  };
  const auto effort = [](const Model& m, const char* joint) {
    return link_of(m, joint).limits.effort;
  };
  const double inf = std::numeric_limits<double>::infinity();
  const Model none = model_of(text("actuatorfrcrange='-7 6'", "user='1 2'", ""));
  CHECK(effort(none, "j") == 7.0);
  CHECK(effort(none, "k") == 5.0);  // its class's; numbers of `user` are not read
  const Model some = model_of(text("", "", "<motor joint='j' forcerange='-3 3'/>"));
  CHECK(effort(some, "j") == 3.0);
  CHECK(link_of(some, "k").passive);
  CHECK(effort(some, "k") == inf);
  const Model more = model_of(text("", "class='none'",
                                   "<motor joint='j' forcerange='-9 9'/>"
                                   "<position joint='k' kp='1' kv='1' inheritrange='1'/>"));
  CHECK(effort(more, "j") == 5.0);
  CHECK(effort(more, "k") == inf);
  CHECK(effort(model_of(text("actuatorfrclimited='false' actuatorfrcrange='-1 1'", "", "")), "j") ==
        inf);
}

TEST_CASE("mjcf: a drive of a later kind drives its joint, with its range of force", "[io]") {
  const std::string drive =
      GENERATE("plugin plugin='mujoco.pid' actdim='1'", "dcmotor resistance='1'", "pid kp='1'");
  const Model m =
      model_of("<mujoco><worldbody><body>" + std::string(kInertial) + "<joint name='j'/><body>" +
               kInertial + "<joint name='k'/></body></body></worldbody><actuator><" + drive +
               " joint='k' gear='2' forcerange='-3 3'/></actuator></mujoco>");
  CAPTURE(drive);
  CHECK(m.links[0].passive);
  CHECK_FALSE(m.links[1].passive);
  CHECK(m.links[1].limits.effort == 6.0);
}

TEST_CASE("mjcf: a joint's position drive is read with its gains", "[io]") {
  const auto servo = [](const std::string& classes, const std::string& drives) {
    return model_of("<mujoco><default>" + classes + "</default><worldbody><body>" +
                    std::string(kInertial) + "<joint name='j' armature='.2'/></body></worldbody>" +
                    "<actuator>" + drives + "</actuator></mujoco>")
        .links[0]
        .servo;
  };
  const auto is = [](const std::optional<ServoGains>& gains, double kp, double kd) {
    CHECK(gains.has_value());
    CHECK(gains.value_or(ServoGains{}).kp == Approx(kp));
    CHECK(gains.value_or(ServoGains{}).kd == Approx(kd).margin(1e-12));
  };
  is(servo("", "<position joint='j' kp='20' gear='3'/>"), 180.0, 0.0);  // g² of both
  is(servo("<position kp='20' kv='1'/>", "<position joint='j' gear='3'/>"), 180.0, 9.0);
  is(servo("", "<general joint='j' gainprm='5' biastype='affine' biasprm='1 -5 -.3'/>"), 5.0, 0.3);
  // Half of the critical damping of kp and the inertia about the joint.
  const Model m = model_of("<mujoco><worldbody><body>" + std::string(kInertial) +
                           "<joint name='j' armature='.2'/></body></worldbody></mujoco>");
  MassMatrixWorkspace<double, double> ws;
  const double inertia = mass_matrix<double, double>(make_tree(m), VecX<double>::Zero(1), ws)(0, 0);
  is(servo("", "<position joint='j' kp='20' dampratio='.5'/>"), 20.0, std::sqrt(20.0 * inertia));
  CHECK_FALSE(servo("", "<motor joint='j'/>"));
  CHECK_FALSE(servo("", "<velocity joint='j' kv='1'/>"));
  CHECK_FALSE(servo("", "<position joint='j' kp='1'/><position joint='j' kp='2'/>"));
  CHECK_FALSE(servo("", "<motor joint='j' user='3 4'/>"));
  is(servo("", "<position joint='j' kp='1' user='3 4'/>"), 1.0, 0.0);  // the user's own numbers
}

TEST_CASE("mjcf: what stands in frames stands where they have it", "[io]") {
  // Turned by 90 degrees about z, then x along y, 2 up; inside, once more by 90 degrees about x.
  const Model framed = model_of(R"(<mujoco>
    <default><default class="heavy"><geom density="2000"/>
      <default class="off"><geom pos="1 0 0"/></default></default></default>
    <worldbody>
      <frame pos="0 0 2" euler="0 0 90" childclass="heavy">
        <body name="a" pos="1 0 0">
          <geom size=".1" class="off"/>
          <frame pos="0 1 0">
            <joint name="j" axis="1 0 0" pos="0 0 .5"/>
            <frame axisangle="1 0 0 90">
              <geom type="capsule" size=".1" fromto="0 0 0 0 1 0"/>
              <geom type="box" size=".1 .2 .3" pos="0 0 1" xyaxes="0 1 0 -1 0 0"/>
              <site name="s" pos="0 1 0" zaxis="0 1 0"/>
              <body name="b"><inertial pos="0 1 0" mass="2" diaginertia=".3 .2 .2"/></body>
            </frame>
          </frame>
        </body>
      </frame>
    </worldbody></mujoco>)");
  const Model flat = model_of(R"(<mujoco>
    <worldbody>
      <body name="a" pos="0 1 2" euler="0 0 90">
        <joint name="j" axis="1 0 0" pos="0 1 .5"/>
        <geom size=".1" density="2000" pos="1 0 0"/>
        <geom type="capsule" size=".1" fromto="0 1 0 0 1 1" density="2000"/>
        <geom type="box" size=".1 .2 .3" pos="0 0 0" xyaxes="0 0 1 -1 0 0" density="2000"/>
        <site name="s" pos="0 1 1" xyaxes="1 0 0 0 -1 0" />
        <body name="b" pos="0 1 0" euler="90 0 0">
          <inertial pos="0 1 0" mass="2" diaginertia=".3 .2 .2"/></body>
      </body>
    </worldbody></mujoco>)");
  REQUIRE(framed.frames.size() == 1);
  Model turned = flat;  // the site's axes: z along the body's z
  turned.frames[0].X_LF.R = Mat3<double>::identity();
  check_same(framed, turned);
}

TEST_CASE("mjcf: replicas stand where each step takes them, with numbered names", "[io]") {
  const Model m = model_of(R"(<mujoco>
    <worldbody>
      <body name="root">
        <geom size=".1"/>
        <replicate count="3" offset="0 0 1" euler="90 0 0" sep="_">
          <body name="b" pos="0 1 0"><joint name="j"/><geom size=".1"/></body>
        </replicate>
        <replicate count="11" offset="1 0 0"><site name="s"/></replicate>
      </body>
    </worldbody>
    <actuator><motor name="m" joint="j" forcerange="-2 2"/></actuator></mujoco>)");
  const Model drawn = model_of(R"(<mujoco>
    <worldbody>
      <body name="root">
        <geom size=".1"/>
        <body name="b_0" pos="0 1 0"><joint name="j_0"/><geom size=".1"/></body>
        <body name="b_1" pos="0 0 2" euler="90 0 0"><joint name="j_1"/><geom size=".1"/></body>
        <body name="b_2" pos="0 -2 1" euler="180 0 0"><joint name="j_2"/><geom size=".1"/></body>
        <site name="s00"/><site name="s01" pos="1 0 0"/><site name="s02" pos="2 0 0"/>
        <site name="s03" pos="3 0 0"/><site name="s04" pos="4 0 0"/><site name="s05" pos="5 0 0"/>
        <site name="s06" pos="6 0 0"/><site name="s07" pos="7 0 0"/><site name="s08" pos="8 0 0"/>
        <site name="s09" pos="9 0 0"/><site name="s10" pos="10 0 0"/>
      </body>
    </worldbody></mujoco>)");
  check_same(m, drawn);
  for (const char* joint : {"j_0", "j_1", "j_2"}) CHECK(link_of(m, joint).limits.effort == 2.0);
  CHECK(m.frames.back().name == "s10");
  CHECK_THAT(refusal("<mujoco><worldbody>\n<replicate count='1e9'><geom size='1'/></replicate>"
                     "</worldbody></mujoco>"),
             ContainsSubstring("line 2: <replicate> has count = '1e9'; the limit is 5000"));
}

TEST_CASE("mjcf: classes in circles, numbers in names and endless copies end", "[io]") {
  const std::string body = "<body><joint/><geom size='1'/></body></worldbody></mujoco>";
  const std::string twice =
      "<body name='line 99999999999999999999'><joint/><geom size='1'/></body>";
  CHECK_THAT(refusal("<mujoco><default><default class='a'><default class='b'><default class='a'/>"
                     "</default></default></default><worldbody><frame childclass='b'>" +
                     twice + "</frame></worldbody></mujoco>"),
             ContainsSubstring("repeated default class"));
  CHECK_THAT(refusal("<mujoco><worldbody>" + twice + twice + body),
             ContainsSubstring("= line 99999999999999999999, id = 2, line 1"));
  std::string motors;
  for (int i = 0; i < 60; ++i) motors += "<motor joint='j'/>";
  CHECK_THAT(refusal("<mujoco><worldbody>\n<replicate count='90'><body><joint name='j'/>"
                     "<geom size='1'/></body></replicate></worldbody><actuator>" +
                     motors + "</actuator></mujoco>"),
             ContainsSubstring("line 2: <replicate> has count = '90'; the limit is 5000"));
  CHECK_THAT(refusal("<mujoco><worldbody><frame pos='0 0 1'><body pos='1e999 0 0'><joint/>"
                     "<geom size='1'/></body></frame></worldbody></mujoco>"),
             !StartsWith("was read"));
}

TEST_CASE("mjcf: principal axes of a full tensor are exact", "[io]") {
  const Model m = model_of(
      "<mujoco><worldbody><body><joint/><inertial pos='.1 .2 .3' mass='2' "
      "fullinertia='.3 .2 .25 .01 -.02 .03'/></body></worldbody></mujoco>");
  const SpatialInertia<double> expected =
      inertia_from_com<double>(2.0, {.1, .2, .3}, {.3, .01, -.02, .2, .03, .25});
  const Theta<double> s = m.links[0].inertia.theta(), t = expected.theta();
  for (int k = 0; k < kThetaSize; ++k) CHECK(std::abs(s[k] - t[k]) <= kPoseTol);
}

TEST_CASE("mjcf: a floating base is fixed where the file has it, if asked", "[io]") {
  const TemporaryFolder folder;
  const std::string text =
      "<mujoco>\n<worldbody>\n<body name='trunk' pos='0 0 .5'>\n<freejoint name='root'/>" +
      std::string(kInertial) + "<body name='leg' pos='0 .1 0'>" + kInertial +
      "<joint name='hip' damping='1'/></body></body></worldbody>"
      "<keyframe><key name='home' qpos='0 0 1 1 0 0 0 .3'/></keyframe></mujoco>";
  const ModelReading fixed{.fix_base = true};
  Model m = model_of(folder, text, fixed);
  REQUIRE(m.links.size() == 2);
  CHECK(m.links[0].type == ModelJoint::kFixed);
  CHECK(m.links[0].X_PJ.p.z == 0.5);
  CHECK(m.home.empty());
  CHECK_THAT(notes_of(m), ContainsSubstring("body 'trunk' floats (line 4)"));
  // Written back, it floats as before, with the new number.
  m.effects[0].parameters[0].value = 2.0;
  CHECK(write_model(m, folder.path() / "out.xml").empty());
  CHECK_THAT(read_text_file(folder.path() / "out.xml"), ContainsSubstring("<freejoint"));
  CHECK(read_model(folder.path() / "out.xml", fixed).effects[0].parameters[0].value == 2.0);
}

TEST_CASE("urdf: a floating joint is fixed, a mimic joint moves alone, if asked", "[io]") {
  const std::string text =
      "<robot name='r'><link name='a'/><link name='b'/><link name='c'/><link name='d'/>"
      "<joint name='f' type='floating'><parent link='a'/><child link='b'/></joint>"
      "<joint name='j' type='continuous'><parent link='b'/><child link='c'/></joint>"
      "<joint name='k' type='continuous'><parent link='c'/><child link='d'/><mimic joint='j'/>"
      "</joint></robot>";
  CHECK(model_of(text).free_base);
  CHECK_FALSE(model_of(text, {.fix_base = true}).free_base);
  CHECK(joint_names(model_of(text, {.fix_base = true})) == std::vector<std::string>{"j"});
  const Model m = model_of(text, {.fix_base = true, .open_loops = true});
  CHECK(joint_names(m) == std::vector<std::string>{"j", "k"});
  CHECK(m.notes.size() == 3);  // both, and that no link states an inertia
}

TEST_CASE("mjcf: a constraint is refused by line and objects, or left out if asked", "[io]") {
  struct Case {
    std::string constraint, says;
  };
  const Case c = GENERATE(Case{"<joint joint1='j' joint2='k' polycoef='0 1 .1 0 0'/>",
                               "(line 3) couples joints 'j' and 'k'"},
                          Case{"<tendon tendon1='p'/>", "(line 3) couples tendons 'p'"});
  const std::string text =
      "<mujoco>\n<worldbody><body name='a'>" + std::string(kInertial) +
      "<joint name='j'/><site name='s'/><body name='b'>" + kInertial +
      "<joint name='k'/><site name='t'/></body></body></worldbody><tendon><fixed name='p'>"
      "<joint joint='j' coef='1'/></fixed></tendon><equality>\n" +
      c.constraint + "</equality></mujoco>";
  CHECK_THAT(refusal(text), ContainsSubstring(c.says) && ContainsSubstring("--open-loops"));
  const Model m = model_of(text, {.open_loops = true});
  CHECK(m.links.size() == 2);
  CHECK_THAT(notes_of(m), ContainsSubstring(c.says) && ContainsSubstring("left out, as asked"));
}

TEST_CASE("mjcf: files outside the model's folder are read if asked", "[io]") {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.path() / "robot");
  write_file_atomically(folder.path() / "arm.xml",
                        "<mujoco><body name='a'><joint/><geom size='.1'/></body></mujoco>");
  const std::filesystem::path robot = folder.path() / "robot" / "m.xml";
  write_file_atomically(robot,
                        "<mujoco><worldbody><include file='../arm.xml'/></worldbody></mujoco>");
  CHECK_THROWS_WITH(read_model(robot), ContainsSubstring("--allow-outside"));
  CHECK(read_model(robot, {.allow_outside = true}).links.size() == 1);
}

TEST_CASE("mjcf: a mesh that is missing stops only a body that moves and is weighed by it",
          "[io]") {
  const TemporaryFolder folder;
  const auto text = [](const std::string& base, const std::string& moving,
                       const std::string& head = "") {
    return "<mujoco>" + head + "<default><default class='m'><geom type='mesh' mesh='gone'/>" +
           "</default></default><asset><mesh name='gone' file='gone.stl'/></asset><worldbody>" +
           "<geom class='m'/>\n<body name='base'>" + base + "\n<body name='arm'>" + moving +
           "<joint name='j'/></body></body></worldbody></mujoco>";
  };
  const std::string shape = "<geom class='m'/>", drawn = "<geom type='mesh' mesh='gone'/>";
  const Model stated = model_of(folder, text("", kInertial + shape));
  CHECK(stated.links[1].inertia.m == 1.0);
  const Model standing = model_of(folder, text(drawn, kInertial));
  CHECK(standing.links[0].inertia.m == 0.0);
  CHECK_THAT(notes_of(standing), ContainsSubstring("the mass of 'base', which does not move"));
  for (const char* weightless : {"mass='0'", "density='0'", "group='4'"}) {
    CAPTURE(weightless);
    const std::string looks = "<geom size='.1'/><geom class='m' " + std::string(weightless) + "/>";
    CHECK(model_of(folder, text("", looks, "<compiler inertiagrouprange='0 3'/>"))
              .links[1]
              .inertia.m > 0.0);
  }
  CHECK_THAT(refusal(folder, text("", shape)),
             ContainsSubstring("mesh 'gone'") && ContainsSubstring("which is not there") &&
                 ContainsSubstring("body 'arm' (line 3)") && ContainsSubstring("<inertial>"));
}

TEST_CASE("mjcf: masses from meshes are noted with the rule, and `exact` is one", "[io]") {
  // An L of three unit cubes, 3 m³: MuJoCo 2.2 counts its volume larger, about its centre.
  const std::string vertices =
      "0 0 0 2 0 0 2 1 0 1 1 0 1 2 0 0 2 0 0 0 1 2 0 1 2 1 1 1 1 1 1 2 1 0 2 1";
  const std::string faces =
      "0 2 1 0 3 2 0 4 3 0 5 4 6 7 8 6 8 9 6 9 10 6 10 11 0 1 7 0 7 6 1 2 8 1 8 7 2 3 9 2 9 8 "
      "3 4 10 3 10 9 4 5 11 4 11 10 5 0 6 5 6 11";
  const auto mass = [&](const std::string& rule, std::string& notes) {
    const Model m =
        model_of("<mujoco><asset><mesh name='l' vertex='" + vertices + "' face='" + faces + "'" +
                 rule + "/></asset><worldbody><body name='b'><joint/>" +
                 "<geom type='mesh' mesh='l' density='1'/></body></worldbody></mujoco>");
    notes = notes_of(m);
    return m.links[0].inertia.m;
  };
  std::string notes;
  CHECK(std::abs(mass(" inertia='exact'", notes) - 3.0) < 1e-6);  // single precision
  CHECK_THAT(notes, ContainsSubstring("meshes give 'b' their inertia, by the rule of MuJoCo"));
  CHECK(mass("", notes) >= 3.0 - 1e-6);
}

TEST_CASE("mjcf: a simulated world of a document of today reads back as the same robot", "[io]") {
  const TemporaryFolder folder;
  const std::string text =
      "<mujoco><compiler angle='radian' assetdir='x'/><option integrator='implicitfast'/>"
      "<worldbody><frame euler='0 0 1'><body name='a' pos='1 0 0' gravcomp='1'>" +
      std::string(kInertial) +
      "<joint name='j' range='-1 1' damping='.1'/></body></frame></worldbody>"
      "<actuator><position joint='j' kv='1' forcerange='-3 3'/></actuator></mujoco>";
  const Model m = model_of(folder, text);
  const std::string world = read_mjcf(folder.path() / "robot.xml");
  write_file_atomically(folder.path() / "world.xml", world);
  const Model again = read_model(folder.path() / "world.xml");
  check_same(m, again);
  CHECK(again.links[0].limits.upper == 1.0);
  CHECK(again.links[0].limits.effort == 3.0);
}

}  // namespace mjcf_today_test
