/// Values put into an MJCF read back as they were, whatever else the document says; what it cannot
/// say is refused or noted.

#include <algorithm>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>

#include "support/matrix_near.hpp"
#include "support/temporary_folder.hpp"

namespace mjcf_write_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// Principal axes and the shift from link to body round values of order 1 to 1e-15.
constexpr double kRoundTripTol = 1e-12;

Model model_of(const TemporaryFolder& folder, const char* name, const std::string& text) {
  write_file_atomically(folder.path() / name, text);
  return read_model(folder.path() / name);
}

double value(const Model& m, const std::string& effect, const std::string& where,
             const std::string& name) {
  for (const EffectSpec& e : m.effects)
    for (const EffectParameter& p : e.parameters)
      if (e.effect == effect && e.where == where && p.name == name) return p.value;
  return 0.0;
}
void set(Model& m, const std::string& effect, const std::string& where, const std::string& name,
         double x) {
  for (EffectSpec& e : m.effects)
    for (EffectParameter& p : e.parameters)
      if (e.effect == effect && e.where == where && p.name == name) p.value = x;
}

VecX<double> parameters(const Model& m) { return inertial_parameters(make_tree(m)); }

/// Two links with an inertia each; `more` goes into the first, before the second.
std::string arm(const std::string& head, const std::string& joint = "") {
  return "<mujoco>" + head +
         "<worldbody><body name='a'><inertial pos='0 0 .1' mass='2' diaginertia='.2 .2 .3'/>"
         "<joint name='j1' axis='0 1 0' damping='1' stiffness='1' " +
         joint +
         "/><geom size='.1'/><body name='b' pos='0 0 .5'>"
         "<inertial pos='.01 0 .1' mass='1' diaginertia='.2 .3 .4'/>"
         "<joint name='j2' axis='1 0 0' damping='1' stiffness='1' " +
         joint + "/><geom size='.1'/></body></body></worldbody></mujoco>";
}

/// A cube of edge 0.2 m.
constexpr const char* kCube =
    "v -.1 -.1 -.1\nv .1 -.1 -.1\nv -.1 .1 -.1\nv .1 .1 -.1\nv -.1 -.1 .1\nv .1 -.1 .1\n"
    "v -.1 .1 .1\nv .1 .1 .1\nf 1 3 4\nf 1 4 2\nf 5 6 8\nf 5 8 7\nf 1 2 6\nf 1 6 5\nf 3 7 8\n"
    "f 3 8 4\nf 1 5 7\nf 1 7 3\nf 2 4 8\nf 2 8 6\n";

Model one_link(const SpatialInertia<double>& inertia) {
  Model m;
  ModelLink link;
  link.name = "link";
  link.joint = "joint";
  link.type = ModelJoint::kRevolute;
  link.axis = {0, 0, 1};
  link.inertia = inertia;
  m.links.push_back(link);
  return m;
}

}  // namespace

TEST_CASE("mjcf: values go to their joint where it stands behind the body that it carries",
          "[io]") {
  const TemporaryFolder folder;
  const bool named = GENERATE(true, false);  // names tell the order; without, what is read back
  const auto name = [&](const char* text) {
    return named ? std::string("name='") + text + "' " : std::string();
  };
  Model m = model_of(folder, "original.xml",
                     "<mujoco><compiler angle='radian'/><worldbody><body name='a'>"
                     "<geom size='.1'/><body name='b' pos='0 0 1'><geom size='.1'/><joint " +
                         name("second") + "axis='1 0 0' damping='2'/></body><joint " +
                         name("first") + "axis='0 1 0' damping='1'/></body></worldbody></mujoco>");
  const std::vector<std::string> joints = joint_names(m);
  set(m, "viscous_friction", joints[0], "viscous", 10.0);
  m.links[1].limits.lower = -0.2;
  m.links[1].limits.upper = 0.3;
  CHECK(write_model(m, folder.path() / "new.xml").empty());
  const Model read = read_model(folder.path() / "new.xml");
  CHECK(joint_names(read) == joints);
  CHECK(value(read, "viscous_friction", joints[0], "viscous") == 10.0);
  CHECK(value(read, "viscous_friction", joints[1], "viscous") == 2.0);
  CHECK(std::isinf(read.links[0].limits.upper));
  CHECK(read.links[1].limits.upper == 0.3);
}

TEST_CASE("mjcf: positions in global coordinates are not written in place", "[io]") {
  const TemporaryFolder folder;
  Model m = model_of(folder, "global.xml",
                     "<mujoco><compiler coordinate='global'/><worldbody><body name='a' pos='0 0 1'>"
                     "<inertial pos='0 0 1.1' mass='2' diaginertia='.2 .2 .3'/>"
                     "<joint name='j' pos='0 0 1'/></body></worldbody></mujoco>");
  m.links[0].inertia.m = 3.0;
  CHECK_THROWS_WITH(write_model(m, folder.path() / "new.xml"),
                    ContainsSubstring("global coordinates") && ContainsSubstring(".json"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "new.xml"));
}

TEST_CASE("mjcf: springs and dampers that follow from a time constant are stated instead", "[io]") {
  const TemporaryFolder folder;
  const bool in_default = GENERATE(true, false);
  const std::string attribute = "springdamper='1 1'";
  Model m = model_of(folder, "original.xml",
                     arm(in_default ? "<default><joint " + attribute + "/></default>" : "",
                         in_default ? "" : attribute));
  REQUIRE(value(m, "viscous_friction", "j1", "viscous") != 1.0);  // overruled
  const double held = value(m, "viscous_friction", "j2", "viscous");
  set(m, "viscous_friction", "j1", "viscous", 7.0);
  set(m, "joint_spring", "j1", "stiffness", 9.0);
  m.links[1].inertia = m.links[1].inertia + m.links[1].inertia;  // and what j2's follow from
  CHECK(write_model(m, folder.path() / "new.xml").empty());
  const Model read = read_model(folder.path() / "new.xml");
  CHECK(value(read, "viscous_friction", "j1", "viscous") == 7.0);
  CHECK(value(read, "joint_spring", "j1", "stiffness") == 9.0);
  CHECK(value(read, "viscous_friction", "j2", "viscous") == held);
}

TEST_CASE("mjcf: links that were not fitted keep the inertia that the compiler gave them", "[io]") {
  const TemporaryFolder folder;
  const char* option = GENERATE("settotalmass='7'", "boundmass='1.5'", "boundinertia='.25'",
                                "balanceinertia='true'", "inertiafromgeom='true'");
  CAPTURE(option);
  Model m = model_of(folder, "original.xml", arm("<compiler " + std::string(option) + "/>"));
  m.links[0].inertia = m.links[0].inertia + m.links[0].inertia;
  CHECK(write_model(m, folder.path() / "new.xml").empty());
  const Model read = read_model(folder.path() / "new.xml");
  CHECK_THAT(parameters(read), MatrixNear(parameters(m), kRoundTripTol));
}

TEST_CASE("mjcf: what would read back as another value is not written", "[io]") {
  const TemporaryFolder folder;
  Model m = model_of(folder, "floating.xml",
                     arm("<option gravity='0 0 -9'><flag gravity='disable'/></option>"));
  CHECK(m.gravity.z == 0.0);
  m.gravity.z = -3.7;
  CHECK_THROWS_WITH(write_model(m, folder.path() / "new.xml"),
                    ContainsSubstring("gravity would read back") && ContainsSubstring(".json"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "new.xml"));
}

TEST_CASE("mjcf: the rounding of a flat body or a rod does not keep it from being written",
          "[io]") {
  const TemporaryFolder folder;
  const Sym3<double> about_com = GENERATE(Sym3<double>{1, 0, 0, 1, 0, 2.0000000000000004},
                                          Sym3<double>{-1e-17, 0, 0, 1, 0, 1.0000000000000002});
  const Model m = one_link(inertia_from_com<double>(2.0, {}, about_com));
  CHECK(write_model(m, folder.path() / "flat.xml").empty());
  CHECK_THAT(parameters(read_model(folder.path() / "flat.xml")),
             MatrixNear(parameters(m), kRoundTripTol));
  const Model wrong = one_link(inertia_from_com<double>(2.0, {}, {1, 0, 0, 1, 0, 2.001}));
  CHECK_THROWS_AS(write_model(wrong, folder.path() / "wrong.xml"), ModelError);
}

TEST_CASE("mjcf: ranges without a way between are noted, not refused", "[io]") {
  const TemporaryFolder folder;
  Model m = one_link(inertia_from_com<double>(2.0, {}, {1, 0, 0, 1, 0, 1}));
  m.links[0].limits = {0.0, 0.0, 1.0, 0.0};  // as of a URDF's revolute joint without its limits
  const std::vector<std::string> notes = write_model(m, folder.path() / "m.xml");
  CHECK(notes == std::vector<std::string>{
                     "the limits of 'joint', between which there is no way (0 to 0)",
                     "the velocity limit of 'joint'", "the effort limit of 'joint', which is 0"});
  Model read = read_model(folder.path() / "m.xml");
  CHECK(std::isinf(read.links[0].limits.upper));
  CHECK_FALSE(read.links[0].passive);
  read.links[0].limits.lower = -1.0;  // in place as well
  CHECK(write_model(read, folder.path() / "again.xml") ==
        std::vector<std::string>{"the limit of 'joint' to one side"});
}

TEST_CASE("mjcf: an actuator of a tendon drives its joints, the others keep their limits", "[io]") {
  const TemporaryFolder folder;
  const std::string body = "<geom size='.1'/><site name='";
  const Model m = model_of(
      folder, "m.xml",
      "<mujoco><worldbody><body name='a'><joint name='j1'/>" + body +
          "s1'/>"
          "<body name='b'><joint name='j2'/>" +
          body +
          "s2'/>"
          "<body name='c'><joint name='j3'/>" +
          body +
          "s3'/>"
          "<body name='d'><joint name='j4'/>" +
          body +
          "s4'/></body></body></body></body></worldbody>"
          "<tendon><fixed name='coupled'><joint joint='j3' coef='1'/></fixed>"
          "<spatial name='muscle'><site site='s1'/><site site='s2'/></spatial></tendon>"
          "<actuator><motor name='pull' tendon='muscle'/><motor name='turn' tendon='coupled'/>"
          "<motor joint='j1' ctrllimited='true' ctrlrange='-3 3'/></actuator></mujoco>");
  REQUIRE(m.links.size() == 4);
  CHECK(m.links[0].limits.effort == 3.0);  // carries both ends of the muscle
  CHECK(std::isinf(m.links[1].limits.effort));
  CHECK_FALSE(m.links[1].passive);
  CHECK_FALSE(m.links[2].passive);
  CHECK(m.links[3].passive);
  REQUIRE(m.notes.size() == 1);
  CHECK_THAT(m.notes[0], ContainsSubstring("('pull', 'turn')"));
}

TEST_CASE("mjcf: of meshes that are left out, contacts stay known", "[io]") {
  const TemporaryFolder folder;
  const std::string text =
      "<mujoco><asset><mesh name='foot' file='missing.stl'/></asset><worldbody>"
      "<body name='leg'><inertial pos='0 0 .1' mass='2' diaginertia='.2 .2 .3'/><joint name='j'/>"
      "<geom name='foot' type='mesh' mesh='foot'/><site name='tip'/>"
      "<body name='hand' pos='0 0 1'><geom size='.01' contype='0' conaffinity='0'/><site "
      "name='cup'/></body></body>"
      "<geom name='floor' type='plane' size='1 1 1' contype='0' conaffinity='0'/>"
      "<body name='ball' pos='0 0 2'><freejoint/><geom size='.02' mass='.1'/><site name='knot'/>"
      "</body></worldbody><contact><pair geom1='foot' geom2='floor'/></contact>"
      "<tendon><spatial name='string' limited='true' range='0 .4'><site site='tip'/>"
      "<site site='knot'/></spatial></tendon>"
      "<custom><numeric name='cup' data='.04 .003 .01 .09'/></custom></mujoco>";
  const Model m = model_of(folder, "m.xml", text);
  CHECK(m.links[0].inertia.m == 2.0);
  CHECK(m.obstacles.size() == 0);
  REQUIRE(m.notes.size() == 1);
  CHECK_THAT(m.notes[0], ContainsSubstring("shapes of 'leg'"));
  const std::string alone = read_mjcf(folder.path() / "m.xml");  // a world without the mesh
  CHECK_THAT(alone, !ContainsSubstring("foot"));
  CHECK(model_of(folder, "alone.xml", alone).links[0].inertia.m == 2.0);
}

TEST_CASE("export: of a run whose MJCF misses its meshes the loss is listed", "[io]") {
  const TemporaryFolder folder;
  write_file_atomically(folder.path() / "cube.obj", kCube);
  Model m = model_of(folder, "m.xml",
                     "<mujoco><asset><mesh file='cube.obj'/></asset><worldbody><body name='a'>"
                     "<joint name='j1' damping='1'/><geom type='mesh' mesh='cube'/></body>"
                     "</worldbody></mujoco>");
  CHECK(document_extension(m) == ".xml");
  set(m, "viscous_friction", "j1", "viscous", 2.0);
  const std::filesystem::path run = folder.path() / "run";
  std::filesystem::create_directory(run);
  write_model(m, run / "model.json");
  write_model(m, run / "model.xml");
  const Model back = read_model_or_run(run);
  const std::vector<std::string> notes = write_model(back, folder.path() / "out.xml");
  REQUIRE(notes.size() == 1);
  CHECK_THAT(notes[0], ContainsSubstring("looks and shapes of the original document, which cannot "
                                         "be read") &&
                           ContainsSubstring("cube.obj"));
  CHECK(value(read_model(folder.path() / "out.xml"), "viscous_friction", "j1", "viscous") == 2.0);
  CHECK(write_model(back, folder.path() / "out.json").empty());
  std::filesystem::remove(run / "model.xml");
  CHECK(document_extension(back).empty());
}

}  // namespace mjcf_write_test
