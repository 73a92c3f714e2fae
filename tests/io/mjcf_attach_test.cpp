/// Models inside models, against the one document that says the same.

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include "support/mjcf_text.hpp"

namespace mjcf_attach_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// A tetrahedron, and an arm in radians whose parts have classes, one of them its own.
constexpr const char* kMesh =
    "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
constexpr const char* kArm = R"(<mujoco model="arm">
  <compiler angle="radian" eulerseq="zyx" meshdir="meshes"/>
  <default>
    <joint damping="1"/>
    <default class="k"><joint armature=".5" range="-1 1"/></default>
  </default>
  <asset><mesh file="part.obj"/></asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="base" pos="0 0 .1" euler=".3 .2 .1">
      <geom size=".1"/>
      <body name="a" childclass="k">
        <joint name="j" ref=".1"/><joint name="s" type="slide" axis="1 0 0"/>
        <geom type="mesh" mesh="part"/><site name="tip" pos="0 0 1"/>
      </body>
      <body name="b"><joint name="l" axis="0 1 0"/><geom size=".1" pos=".1 0 0"/></body>
    </body>
    <body name="other"><joint name="o"/><geom size=".1"/></body>
  </worldbody>
  <actuator><position joint="j" kp="1" kv="1" forcerange="-2 2"/><motor joint="o"/></actuator>
</mujoco>)";

class Folder {
 public:
  Folder() {
    std::filesystem::create_directories(folder_.path() / "sub" / "meshes");
    write_file_atomically(folder_.path() / "sub" / "meshes" / "part.obj", kMesh);
    write_file_atomically(folder_.path() / "sub" / "arm.xml", kArm);
  }
  Model read(const std::string& text) const { return model_of(folder_, text); }
  std::string refusal(const std::string& text) const { return test::refusal(folder_, text); }

 private:
  TemporaryFolder folder_;
};

std::string cell(const std::string& head, const std::string& attach) {
  return "<mujoco>" + head + "\n<asset><model file='sub/arm.xml'/></asset>\n<worldbody>" +
         "<body name='stand'><geom size='.2'/>\n" + attach + "</body></worldbody></mujoco>";
}

}  // namespace

TEST_CASE("mjcf: a model inside a model is what it is alone, with a prefix", "[io]") {
  const Folder folder;
  const Model m = folder.read(cell("",
                                   "<frame pos='0 1 0' euler='0 0 90'>"
                                   "<attach model='arm' body='base' prefix='l_'/></frame>"
                                   "<attach model='arm' body='base' prefix='r_'/>"));
  const auto arm = [](const std::string& p, const std::string& place) {
    return "<body name='" + p + "base' " + place + "><geom size='.1'/><body name='" + p +
           "a'><joint name='" + p +
           "j' ref='.1' damping='1' armature='.5' range='-1 1'/><joint name='" + p +
           "s' type='slide' axis='1 0 0' damping='1' armature='.5' range='-1 1'/>"
           "<geom type='mesh' mesh='part'/><site name='" +
           p + "tip' pos='0 0 1'/></body><body name='" + p + "b'><joint name='" + p +
           "l' axis='0 1 0' damping='1'/><geom size='.1' pos='.1 0 0'/></body></body>";
  };
  const Model flat = folder.read(
      "<mujoco><compiler angle='radian' eulerseq='zyx' meshdir='sub/meshes'/><asset>"
      "<mesh file='part.obj'/></asset><worldbody><body name='stand'><geom size='.2'/>"
      "<frame pos='0 1 0' axisangle='0 0 1 1.5707963267948966'>" +
      arm("l_", "pos='0 0 .1' euler='.3 .2 .1'") + "</frame>" +
      arm("r_", "pos='0 0 .1' euler='.3 .2 .1'") +
      "</body></worldbody><actuator><motor joint='l_j' forcerange='-2 2'/>"
      "<motor joint='r_j' forcerange='-2 2'/></actuator></mujoco>");
  check_same(m, flat);
  for (std::size_t i = 0; i < m.links.size(); ++i) {
    const JointLimits &a = m.links[i].limits, &b = flat.links[i].limits;
    CAPTURE(m.links[i].joint);
    CHECK((a.lower == b.lower || std::abs(a.lower - b.lower) < kPoseTol));
    CHECK((a.upper == b.upper || std::abs(a.upper - b.upper) < kPoseTol));
    CHECK(a.effort == b.effort);
    CHECK(m.links[i].passive == flat.links[i].passive);
  }
  REQUIRE(m.effects.size() == flat.effects.size());
  for (std::size_t i = 0; i < m.effects.size(); ++i) {
    CHECK(m.effects[i].where == flat.effects[i].where);
    CHECK(m.effects[i].parameters[0].value == flat.effects[i].parameters[0].value);
  }
}

TEST_CASE("mjcf: values go into one document that needs no other model", "[io]") {
  const TemporaryFolder folder;
  write_file_atomically(folder.path() / "arm.xml",
                        "<mujoco model='arm'><worldbody><body name='a'>"
                        "<joint name='j' damping='1'/>"
                        "<geom size='.1'/></body></worldbody></mujoco>");
  Model m = model_of(folder,
                     "<mujoco><asset><model file='arm.xml'/></asset><worldbody>"
                     "<attach model='arm' prefix='p_'/></worldbody></mujoco>");
  REQUIRE(m.effects.size() == 1);
  m.effects[0].parameters[0].value = 2.0;
  CHECK(write_model(m, folder.path() / "out.xml").empty());
  std::filesystem::remove(folder.path() / "arm.xml");
  CHECK(read_model(folder.path() / "out.xml").effects[0].parameters[0].value == 2.0);
}

TEST_CASE("mjcf: without a body all of the model's world is attached", "[io]") {
  const Folder folder;
  const Model m = folder.read(cell("", "<attach model='arm' prefix='x_'/>"));
  CHECK(joint_names(m) == std::vector<std::string>{"x_j", "x_s", "x_l", "x_o"});
}

TEST_CASE("mjcf: a model that cannot be put into the document is refused, with the line", "[io]") {
  struct Case {
    std::string head, attach, says;
  };
  const Folder folder;
  const Case c = GENERATE(
      Case{"", "<attach model='none' prefix='p'/>", "names the model 'none', which no <asset> has"},
      Case{"", "<attach model='arm' body='none' prefix='p'/>",
           "names no body of the model: 'none'"},
      Case{"<compiler inertiafromgeom='true'/>", "<attach model='arm' prefix='p'/>",
           "inertiafromgeom = 'auto', and the document has 'true'"},
      Case{"<default><geom density='1'/></default>", "<attach model='arm' prefix='p'/>",
           "defaults of no class"});
  CHECK_THAT(folder.refusal(cell(c.head, c.attach)),
             ContainsSubstring("line 4: <attach>") && ContainsSubstring(c.says));
}

}  // namespace mjcf_attach_test
