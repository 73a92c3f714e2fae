/// The three formats: what is read, what is written back, and what is said about files that are
/// wrong.

#include <filesystem>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/model_info.hpp>
#include <diffnea/model/physical.hpp>

#include "support/matrix_near.hpp"
#include "support/temporary_folder.hpp"

namespace model_file_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// Values of order 1 that pass through mass · centre of mass, a rotation and back: 1e-15 observed.
constexpr double kRoundTripTol = 1e-12;

constexpr const char* kUrdf = R"(<?xml version="1.0"?>
<!-- kept -->
<robot name="two">
  <link name="world"/>
  <joint name="mount" type="fixed"><parent link="world"/><child link="base"/><origin xyz="0 0 1" rpy="0 0 .5"/></joint>
  <link name="base"><visual><geometry><mesh filename="package://nowhere/base.stl"/></geometry></visual></link>
  <joint name="z_first" type="continuous">
    <parent link="base"/><child link="one"/><origin xyz=".1 .2 .3" rpy=".3 -.4 .5"/><axis xyz="0 2 0"/>
    <dynamics damping=".3" friction=".7"/>
  </joint>
  <link name="one"><inertial><origin xyz=".01 .02 .03" rpy=".1 .2 .3"/><mass value="2"/>
    <inertia ixx=".02" ixy=".001" ixz=".002" iyy=".03" iyz="-.001" izz=".025"/></inertial></link>
  <joint name="a_second" type="prismatic">
    <parent link="one"/><child link="two"/><axis xyz="1 0 0"/><limit lower="-1" upper="2" effort="9" velocity="0"/>
  </joint>
  <link name="two"><inertial><mass value="1"/><inertia ixx=".01" ixy="0" ixz="0" iyy=".01" iyz="0" izz=".01"/></inertial></link>
  <joint name="weld" type="fixed"><parent link="two"/><child link="tool"/><origin xyz="0 .1 0"/></joint>
  <link name="tool"><inertial><mass value=".5"/><inertia ixx=".001" ixy="0" ixz="0" iyy=".001" iyz="0" izz=".001"/></inertial></link>
</robot>)";

constexpr const char* kMjcf = R"(<mujoco model="three">
  <!-- kept -->
  <compiler angle="degree"/>
  <option gravity="0 1 -9"/>
  <default><joint damping=".2"/></default>
  <worldbody>
    <site name="origin" pos="1 2 3"/>
    <body name="base" pos="0 0 1" euler="0 0 30">
      <geom type="box" size=".1 .1 .1"/>
      <body name="wrist" pos=".1 0 .2">
        <inertial pos=".01 .02 .03" mass="2" diaginertia=".02 .03 .025" quat=".5 .5 -.5 .5"/>
        <joint name="yaw" axis="0 0 1" pos="0 .1 0" range="-90 45" limited="true" frictionloss=".4"/>
        <joint name="pitch" axis="0 1 0" pos=".05 0 0" ref="20" stiffness="3" springref="10" armature=".07"/>
        <site name="cup" pos="0 0 .1" quat=".5 .5 .5 .5"/>
        <body pos="0 0 .3">
          <joint type="slide" axis="1 1 0" ref=".1" damping="0"/>
          <geom type="sphere" size=".05" pos=".01 0 0"/>
          <body name="tool" pos="0 0 .1"><geom type="capsule" fromto="0 0 0 .1 0 .1" size=".02"/></body>
        </body>
      </body>
    </body>
    <body name="ball" pos="0 0 3"><freejoint/><geom type="sphere" size=".02"/><site name="knot"/></body>
  </worldbody>
  <tendon><spatial name="string" limited="true" range="0 .4"><site site="cup"/><site site="knot"/></spatial></tendon>
  <actuator>
    <motor joint="yaw" gear="10" ctrllimited="true" ctrlrange="-2 3"/>
    <motor joint="pitch"/>
  </actuator>
</mujoco>)";

Model model_of(const TemporaryFolder& folder, const std::string& name, const std::string& text) {
  write_file_atomically(folder.path() / name, text);
  return read_model(folder.path() / name);
}

VecX<double> random_parameters(int num_links, std::uint64_t seed) {
  Rng rng(seed);
  VecX<double> pi(kThetaSize * num_links);
  for (int i = 0; i < num_links; ++i) {
    Theta<double> phi;
    for (double& x : phi) x = rng.uniform(-0.5, 0.5);
    const Theta<double> theta = theta_from_log_cholesky(phi);
    std::copy(theta.begin(), theta.end(), pi.data() + kThetaSize * i);
  }
  return pi;
}

const EffectSpec* find(const Model& m, const std::string& effect, const std::string& where) {
  for (const EffectSpec& e : m.effects)
    if (e.effect == effect && e.where == where) return &e;
  return nullptr;
}

void check_equal(const Model& a, const Model& b, double tolerance) {
  REQUIRE(a.links.size() == b.links.size());
  CHECK_THAT(inertial_parameters(make_tree(a)),
             MatrixNear(inertial_parameters(make_tree(b)), tolerance));
  for (std::size_t i = 0; i < a.links.size(); ++i) {
    const ModelLink &x = a.links[i], &y = b.links[i];
    CAPTURE(x.name);
    CHECK(x.name == y.name);
    CHECK(x.joint == y.joint);
    CHECK(x.parent == y.parent);
    CHECK(x.type == y.type);
    CHECK(x.passive == y.passive);
    CHECK_THAT(to_eigen(x.X_PJ.R), MatrixNear(to_eigen(y.X_PJ.R), tolerance));
    CHECK_THAT(to_eigen(x.X_PJ.p), MatrixNear(to_eigen(y.X_PJ.p), tolerance));
    CHECK_THAT(to_eigen(x.axis), MatrixNear(to_eigen(y.axis), tolerance));
    CHECK(x.limits.lower == y.limits.lower);
    CHECK(x.limits.upper == y.limits.upper);
    CHECK(x.limits.velocity == y.limits.velocity);
    CHECK(x.limits.effort == y.limits.effort);
  }
  REQUIRE(a.effects.size() == b.effects.size());
  for (std::size_t i = 0; i < a.effects.size(); ++i) {
    const EffectSpec &x = a.effects[i], &y = b.effects[i];
    CHECK(x.effect == y.effect);
    CHECK(x.where == y.where);
    REQUIRE(x.parameters.size() == y.parameters.size());
    for (std::size_t k = 0; k < x.parameters.size(); ++k) {
      CHECK(x.parameters[k].name == y.parameters[k].name);
      CHECK(x.parameters[k].unit == y.parameters[k].unit);
      CHECK(std::abs(x.parameters[k].value - y.parameters[k].value) <= tolerance);
    }
  }
  REQUIRE(a.frames.size() == b.frames.size());
  REQUIRE(a.ball.has_value() == b.ball.has_value());
  if (!a.ball) return;
  CHECK(std::abs(a.ball->mass - b.ball->mass) <= tolerance);
  CHECK(a.ball->radius == b.ball->radius);
  REQUIRE(a.ball->string.has_value() == b.ball->string.has_value());
  if (!a.ball->string) return;
  CHECK(a.ball->string->link == b.ball->string->link);
  CHECK(std::abs(a.ball->string->length - b.ball->string->length) <= tolerance);
  CHECK_THAT(to_eigen(a.ball->string->p_LS), MatrixNear(to_eigen(b.ball->string->p_LS), tolerance));
}

}  // namespace

TEST_CASE("urdf: fixed joints stay links, order follows the document, meshes are not opened",
          "[io]") {
  const TemporaryFolder folder;
  const Model m = model_of(folder, "two.urdf", kUrdf);
  CHECK(m.name == "two");
  REQUIRE(m.links.size() == 5);
  CHECK(joint_names(m) == std::vector<std::string>{"z_first", "a_second"});
  CHECK(m.links[0].name == "world");
  CHECK(m.links[1].joint == "mount");
  CHECK(m.links[1].type == ModelJoint::kFixed);
  CHECK(m.links[2].limits.upper == std::numeric_limits<double>::infinity());
  CHECK(m.links[2].axis.y == 1.0);
  CHECK(m.links[3].limits.lower == -1.0);
  CHECK(m.links[3].limits.effort == 9.0);
  CHECK(m.links[3].limits.velocity == std::numeric_limits<double>::infinity());
  CHECK(make_tree(m).links[1].inertia.m == 1.5);
  REQUIRE(find(m, "viscous_friction", "z_first"));
  CHECK(find(m, "viscous_friction", "z_first")->parameters[0].value == 0.3);
  CHECK(find(m, "coulomb_friction", "z_first")->parameters[0].value == 0.7);
  CHECK(check_model(m).empty());
}

TEST_CASE("mjcf: joints of one body become a chain; anchor, ref, defaults and actuators count",
          "[io]") {
  const TemporaryFolder folder;
  const Model m = model_of(folder, "three.xml", kMjcf);
  CHECK(m.name == "three");
  CHECK(m.gravity.y == 1.0);
  REQUIRE(m.links.size() == 5);
  CHECK(m.links[1].name == "wrist/yaw");
  CHECK(m.links[2].name == "wrist");
  CHECK(joint_names(m) == std::vector<std::string>{"yaw", "pitch", "joint2"});
  CHECK(m.links[1].limits.lower == -M_PI / 2);
  CHECK(m.links[1].limits.effort == 30.0);
  CHECK_FALSE(m.links[2].passive);
  CHECK(m.links[3].passive);
  REQUIRE(find(m, "joint_spring", "pitch"));
  CHECK(find(m, "joint_spring", "pitch")->parameters[0].value == 3.0);
  CHECK(std::abs(find(m, "joint_spring", "pitch")->parameters[1].value - M_PI / 18) < 1e-15);
  CHECK(find(m, "viscous_friction", "yaw")->parameters[0].value == 0.2);
  CHECK(find(m, "coulomb_friction", "yaw")->parameters[0].value == 0.4);
  CHECK(find(m, "armature", "pitch")->parameters[0].value == 0.07);
  CHECK_FALSE(find(m, "viscous_friction", "joint2"));
  REQUIRE(m.frames.size() == 2);
  CHECK(m.frames[0].link == -1);
  CHECK(m.frames[1].link == 2);
  CHECK(m.notes.empty());
  CHECK(m.ball.has_value());      // and no joint of the robot
  CHECK(check_model(m).empty());  // wrist/yaw has no inertia, but carries the wrist
}

TEST_CASE("json: every double comes back bit by bit", "[io]") {
  const TemporaryFolder folder;
  Model m = GENERATE(0, 1) ? model_of(folder, "m.urdf", kUrdf) : model_of(folder, "m.xml", kMjcf);
  set_inertial_parameters(m, random_parameters(static_cast<int>(moving_links(m).size()), 3));
  m.links.back().limits.velocity = 0.1 + 0.2;
  m.links.back().passive = true;
  m.effects.push_back(
      {"stribeck_friction", joint_names(m)[0], {{"stiction_excess", 1.0 / 3.0, "N*m"}}});
  m.posterior = Posterior{{"a", "b"}, {1.0 / 3, 2e-300}, {1, 1e-17, 1e-17, 1e300}, {"9a3f"}};
  const std::string text = model_to_json(m);
  const Model back = model_from_json(text, "text");
  check_equal(m, back, 0.0);
  CHECK(back.posterior->information == m.posterior->information);
  CHECK(back.posterior->mean == m.posterior->mean);
  CHECK(back.posterior->recordings == m.posterior->recordings);
  CHECK(back.notes == m.notes);
  CHECK(model_to_json(back) == text);
  CHECK(write_model(m, folder.path() / "m.json").empty());
  CHECK(model_to_json(read_model(folder.path() / "m.json")) == text);
}

TEST_CASE("json: an axis of six digits is one", "[io]") {
  const std::string text =
      R"({"schema": "diffnea/model/1", "links": [{"name": "a", "joint": {"name": "j",
          "type": "revolute", "axis": [0.707107, 0.707107, 0]}}]})";
  const Model m = model_from_json(text, "text");
  CHECK(std::abs(m.links[0].axis.x - std::sqrt(0.5)) < 1e-15);
  CHECK(make_tree(m).num_dofs() == 1);
  std::string off = text;
  off.replace(off.find("0.707107"), 8, "0.70720");
  CHECK_THROWS_WITH(model_from_json(off, "text"), ContainsSubstring("axis of joint 'j'"));
}

TEST_CASE("info: an effect shows its table as the model's file does", "[io]") {
  Model m;
  m.effects.push_back({"residual", "j", {}, BumpTable{{"q_j"}, {0.125}, {2.0}, {3.5}, 1.5}});
  const std::string info = model_info_json(m), file = model_to_json(m);
  const std::size_t begin = info.find("\"table\""), end = info.find(']', info.find("weights"));
  REQUIRE(begin != info.npos);
  CHECK_THAT(file, ContainsSubstring(info.substr(begin, end - begin)));
  CHECK_THAT(info, ContainsSubstring("3.5"));
}

TEST_CASE("urdf and mjcf: identified values land in the original document", "[io]") {
  const TemporaryFolder folder;
  const bool urdf = GENERATE(true, false);
  const std::string extension = urdf ? ".urdf" : ".xml";
  Model m = model_of(folder, "original" + extension, urdf ? kUrdf : kMjcf);
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    CAPTURE(urdf, seed);
    VecX<double> pi = random_parameters(static_cast<int>(moving_links(m).size()), seed);
    if (!urdf) pi.head(kThetaSize).setZero();  // wrist/yaw is no body: it cannot hold one
    set_inertial_parameters(m, pi);
    for (EffectSpec& e : m.effects) e.parameters[0].value += 0.1;
    const std::filesystem::path path = folder.path() / ("written" + extension);
    CHECK(write_model(m, path).empty());
    check_equal(read_model(path), m, kRoundTripTol);
    CHECK_THAT(read_text_file(path), ContainsSubstring("<!-- kept -->"));
  }
  // Unchanged, nothing is touched.
  const Model same = read_model(folder.path() / ("original" + extension));
  write_model(same, folder.path() / ("same" + extension));
  check_equal(read_model(folder.path() / ("same" + extension)), same, 0.0);
}

TEST_CASE("writing: what the format cannot express is returned", "[io]") {
  const TemporaryFolder folder;
  Model m = model_of(folder, "two.urdf", kUrdf);
  m.effects.push_back({"armature", "z_first", {{"armature", 0.5, "kg*m^2"}}});
  m.effects.push_back({"cogging", "a_second", {}});
  const std::vector<std::string> notes = write_model(m, folder.path() / "out.urdf");
  CHECK(notes == std::vector<std::string>{"armature at z_first = 0.5", "cogging at a_second"});
  CHECK_THROWS_AS(write_model(m, folder.path() / "out.txt"), ModelError);
  m.links.pop_back();
  CHECK_THROWS_AS(write_model(m, folder.path() / "out.urdf"), ModelError);
}

TEST_CASE("reading: a wrong file is named, with the reason", "[io]") {
  const TemporaryFolder folder;
  struct Case {
    const char *name, *text, *message;
  };
  const Case c = GENERATE(
      Case{"a.urdf", "", "is empty"}, Case{"a.urdf", "hello", "no robot description"},
      Case{"a.urdf", "<robot name='x'>", "is not XML"}, Case{"a.sdf", "<sdf/>", "expected <robot>"},
      Case{"a.urdf", "<robot name='x'/>", "not a valid URDF"},
      Case{
          "a.urdf",
          "<robot name='x'><link name='a'><inertial><mass value='nan1'/></inertial></link></robot>",
          "not a valid URDF"},
      Case{"a.urdf",
           "<robot name='x'><link name='a'/><link name='b'/><link name='c'/>"
           "<joint name='i' type='fixed'><parent link='a'/><child link='b'/></joint>"
           "<joint name='j' type='floating'><parent link='b'/><child link='c'/></joint></robot>",
           "is floating"},
      Case{"a.urdf",
           "<robot name='x'><link name='a'/><link name='b'/>"
           "<joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint>"
           "<joint name='k' type='continuous'><parent link='a'/><child link='b'/></joint></robot>",
           "child of two joints"},
      Case{"a.urdf",
           "<robot name='x'><link name='r'/><link name='a'/><link name='b'/>"
           "<joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint>"
           "<joint name='k' type='continuous'><parent link='b'/><child link='a'/></joint></robot>",
           "its own ancestor"},
      Case{"a.urdf",
           "<robot name='x'><link name='a'/><link name='b'/><joint name='j' "
           "type='continuous'><parent link='a'/>"
           "<child link='b'/><axis xyz='0 0 0'/></joint></robot>",
           "axis is zero"},
      Case{"a.xml", "<mujoco><worldbody><body><joint/></body></worldbody></mujoco>",
           "MuJoCo cannot compile it"},
      Case{"a.xml", "<mujoco><wrldbody/></mujoco>", "wrldbody"},
      Case{"a.xml",
           "<mujoco><worldbody><body><joint type='ball'/><geom "
           "size='1'/></body></worldbody></mujoco>",
           "ball joint"},
      Case{"a.xml",
           "<mujoco><worldbody><body name='b'><freejoint/><geom size='1'/></body>"
           "<body name='c'><freejoint/><geom size='1'/></body></worldbody></mujoco>",
           "bodies 'b' (line 1) and 'c' (line 1) are free"},
      Case{"a.xml", "<mujoco><include file='/etc/passwd'/></mujoco>", "outside the model's folder"},
      Case{"a.xml", "<mujoco><include file='../x.xml'/></mujoco>", "outside the model's folder"},
      Case{"a.xml", "<mujoco><include file='a.xml'/></mujoco>", "more than once"},
      Case{"a.xml",
           "<mujoco><asset><mesh file='../../m.stl'/></asset><worldbody><body><joint/><geom "
           "type='mesh' mesh='m'/>"
           "</body></worldbody></mujoco>",
           "outside the model's folder"},
      Case{"a.xml",
           "<mujoco><worldbody><body pos='nan 0 0'><joint/><geom "
           "size='1'/></body></worldbody></mujoco>",
           "NaN"},
      Case{"a.xml",
           "<mujoco><worldbody><body><composite type='grid' count='300 300 1' spacing='1'><geom "
           "size='1'/>"
           "</composite></body></worldbody></mujoco>",
           "the limit is 1000"},
      Case{"a.xml",
           "<mujoco><worldbody><body><joint name='j'/><geom size='1'/><body><joint name='k'/><geom "
           "size='1'/></body>"
           "</body></worldbody><equality><joint name='gear' joint1='j' "
           "joint2='k' polycoef='0 1 2 0 0'/></equality></mujoco>",
           "equality constraint 'gear'"},
      Case{"a.xml",
           "<mujoco><worldbody><body name='bad'><inertial pos='0 0 0' mass='1' diaginertia='1 1 "
           "3'/><joint/></body>"
           "</worldbody></mujoco>",
           "Object name = bad"},
      Case{"a.json", "{", "is not JSON"}, Case{"a.json", "{}", "key 'schema' is missing"},
      Case{"a.json", R"({"schema":"diffnea/model/2"})", "expected diffnea/model/1"},
      Case{"a.json", R"({"schema":"diffnea/model/1","links":[],"colour":1})",
           "unknown key 'colour'; keys: schema"},
      Case{"a.json", R"({"schema":"diffnea/model/1","links":[{"name":"a","parent":"b"}]})",
           "no link 'b'"},
      Case{"a.json", R"({"schema":"diffnea/model/1","links":[{"name":"a"},{"name":"a"}]})",
           "two links of this name"},
      Case{"a.json",
           R"({"schema":"diffnea/model/1","links":[{"name":"a","joint":{"type":"hinge"}}]})",
           "expected fixed, revolute, prismatic or floating"},
      Case{"a.json", R"({"schema":"diffnea/model/1","gravity":[0,0,1e999],"links":[]})",
           "number overflow"},
      Case{"a.json",
           R"({"schema":"diffnea/model/1","links":[{"name":"a","inertia":{"mass":"1"}}]})",
           "links[0].inertia.mass: got \"1\", expected a number"});
  CAPTURE(c.text);
  write_file_atomically(folder.path() / c.name, c.text);
  try {
    read_model(folder.path() / c.name);
    FAIL("nothing was thrown");
  } catch (const Error& error) {
    CHECK_THAT(error.what(), ContainsSubstring(c.message) && ContainsSubstring(c.name));
  }
}

TEST_CASE("reading: an inertia that cannot be true is read, and reported with its size", "[io]") {
  const TemporaryFolder folder;
  const Model m = model_of(
      folder, "a.urdf",
      "<robot name='x'><link name='a'/><link name='b'><inertial><mass value='1'/><inertia "
      "ixx='1' iyy='1' izz='3' ixy='0' ixz='0' iyz='0'/></inertial></link>"
      "<joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint></robot>");
  const std::vector<ModelIssue> issues = check_model(m);
  REQUIRE(issues.size() == 1);
  CHECK(issues[0].link == "b");
  CHECK_THAT(issues[0].text, ContainsSubstring("by 1 kg"));
}

TEST_CASE("mjcf: includes are resolved inside the model's folder, links that lead out are not",
          "[io]") {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.path() / "robot" / "parts");
  write_file_atomically(
      folder.path() / "robot" / "parts" / "arm.xml",
      "<mujoco><body name='arm'><joint name='j'/><geom size='.1'/></body></mujoco>");
  write_file_atomically(folder.path() / "robot" / "m.xml",
                        "<mujoco><worldbody><include file='parts/arm.xml'/></worldbody></mujoco>");
  CHECK(read_model(folder.path() / "robot" / "m.xml").links.size() == 1);
  write_file_atomically(folder.path() / "secret.xml", "<mujoco/>");
  std::filesystem::create_symlink(folder.path() / "secret.xml",
                                  folder.path() / "robot" / "link.xml");
  write_file_atomically(folder.path() / "robot" / "n.xml",
                        "<mujoco><include file='link.xml'/></mujoco>");
  CHECK_THROWS_AS(read_model(folder.path() / "robot" / "n.xml"), ModelError);
}

TEST_CASE("mjcf: a mesh gives its body an inertia, and the self-contained text keeps it", "[io]") {
  const TemporaryFolder folder;
  // A cube of edge 0.2 m, eight corners and twelve faces.
  write_file_atomically(
      folder.path() / "cube.obj",
      "v -.1 -.1 -.1\nv .1 -.1 -.1\nv -.1 .1 -.1\nv .1 .1 -.1\nv -.1 -.1 .1\nv .1 -.1 .1\n"
      "v -.1 .1 .1\nv .1 .1 .1\nf 1 3 4\nf 1 4 2\nf 5 6 8\nf 5 8 7\nf 1 2 6\nf 1 6 5\nf 3 7 8\n"
      "f 3 8 4\nf 1 5 7\nf 1 7 3\nf 2 4 8\nf 2 8 6\n");
  const Model m = model_of(
      folder, "m.xml",
      "<mujoco><asset><mesh file='cube.obj'/></asset><worldbody><body name='b'><joint name='j'/>"
      "<geom type='mesh' mesh='cube' pos='0 0 .3'/></body></worldbody></mujoco>");
  constexpr double kMass = 8.0;                          // 0.008 m³ at MuJoCo's 1000 kg/m³
  CHECK(std::abs(m.links[0].inertia.m - kMass) < 1e-6);  // single precision vertices
  const std::string text = read_mjcf(folder.path() / "m.xml");
  CHECK_THAT(text, !ContainsSubstring("mesh"));
  check_equal(model_of(folder, "self_contained.xml", text), m, kRoundTripTol);
}

TEST_CASE("atomic file: errors name path and reason, and leave nothing behind", "[io]") {
  const TemporaryFolder folder;
  CHECK_THROWS_AS(read_text_file(folder.path() / "none"), FileError);
  CHECK_THROWS_AS(read_text_file(folder.path()), FileError);
  CHECK_THROWS_AS(write_file_atomically(folder.path() / "no" / "file", "x"), FileError);
  std::filesystem::create_directory(folder.path() / "taken");
  try {
    write_file_atomically(folder.path() / "taken", "x");
    FAIL("nothing was thrown");
  } catch (const FileError& error) {
    CHECK_THAT(error.what(), ContainsSubstring("taken: cannot be written (Is a directory)"));
  }
  write_file_atomically(folder.path() / "file", "one");
  write_file_atomically(folder.path() / "file", "two");
  CHECK(read_text_file(folder.path() / "file") == "two");
  CHECK_THROWS_AS(read_text_file(folder.path() / "file", 2), FileError);
  std::filesystem::directory_iterator entries(folder.path());
  CHECK(std::distance(begin(entries), end(entries)) == 2);
}

}  // namespace model_file_test
