/// Robots on a free base: floating joints of a URDF, free bodies of an MJCF, roots that the user
/// lets float; written, read back, and refused where nothing serves them yet.

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_info.hpp>
#include <diffnea/model/free_base.hpp>
#include <diffnea/model/lock.hpp>
#include <diffnea/sim/record.hpp>

#include "support/mjcf_text.hpp"
#include "support/random_floating.hpp"

namespace io_free_base_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// The same sums after a way through a file: rounding of numbers of order 10.
constexpr double kRoundTripTol = 1e-12;

std::string urdf_link(const std::string& name, double mass) {
  return "<link name='" + name + "'><inertial><origin xyz='0.1 0.02 -0.05'/><mass value='" +
         std::to_string(mass) +
         "'/><inertia ixx='0.02' ixy='0.001' ixz='0' iyy='0.022' iyz='0' "
         "izz='0.018'/></inertial></link>";
}
std::string urdf_joint(const std::string& name, const std::string& type, const std::string& parent,
                       const std::string& child, const std::string& more = "") {
  return "<joint name='" + name + "' type='" + type +
         "'><origin xyz='0.1 -0.2 0.3' rpy='0.3 0.1 -0.2'/><parent link='" + parent +
         "'/><child link='" + child + "'/><axis xyz='0 1 0'/>" + more + "</joint>";
}
/// A trunk with a camera and two legs of one joint.
std::string urdf(const std::string& root = "") {
  return "<robot name='walker'>" + root + urdf_link("trunk", 5.0) + urdf_link("camera", 0.3) +
         urdf_link("left", 1.0) + urdf_link("right", 1.2) +
         urdf_joint("mount", "fixed", "trunk", "camera") +
         urdf_joint("hip", "continuous", "trunk", "left", "<dynamics damping='0.4'/>") +
         urdf_joint("other_hip", "continuous", "trunk", "right") + "</robot>";
}
std::string floating(const std::string& more = "") {
  return urdf("<link name='world'>" + more + "</link>" +
              urdf_joint("root", "floating", "world", "trunk"));
}
std::string mjcf(const std::string& in_world = "",
                 const std::string& free = "<freejoint name='root'/>",
                 const std::string& tail = "") {
  return "<mujoco>\n<worldbody>" + in_world +
         "<body name='trunk' pos='0 .1 .5' quat='.8 .6 0 0'>\n" + free +
         "<inertial pos='.1 0 .02' mass='5' diaginertia='.1 .2 .25'/>"
         "<body name='camera' pos='.2 0 0'><inertial pos='0 0 0' mass='.3' diaginertia='.01 .01 "
         ".01'/>"
         "</body><body name='leg' pos='0 .1 0'><joint name='hip' axis='1 0 0' pos='0 .02 0' "
         "damping='1' armature='.1'/><inertial pos='0 0 -.2' mass='1' diaginertia='.03 .03 .01'/>"
         "</body></body></worldbody>" +
         tail + "</mujoco>";
}

/// q̈ and M of one state, whose base is anywhere.
MatX<double> dynamics(const Model& m) {
  const Tree<double> tree = make_tree(m);
  Rng rng(5);
  const VecX<double> q = random_positions(rng, tree), v = random_vector(rng, tree.num_velocities()),
                     tau = random_vector(rng, tree.num_velocities(), 5.0);
  AbaWorkspace<double, double> aba_ws;
  MassMatrixWorkspace<double, double> mass_ws;
  MatX<double> out(tree.num_velocities(), tree.num_velocities() + 1);
  out << aba(tree, q, v, tau, aba_ws), mass_matrix(tree, q, mass_ws);
  return out;
}

Model read_back(const TemporaryFolder& folder, const Model& m, const char* name,
                std::vector<std::string>& lost) {
  lost = write_model(m, folder.path() / name);
  return read_model(folder.path() / name);
}

}  // namespace

TEST_CASE("free base: a floating joint at a URDF's root, and a root that the user lets float",
          "[io]") {
  const Model m = model_of(floating());
  REQUIRE(m.free_base);
  CHECK(m.links[0].name == "trunk");
  CHECK(m.links[0].joint == "root");
  CHECK(m.links[0].X_PJ.p.z == 0.3);
  CHECK(joint_names(m) == std::vector<std::string>{"hip", "other_hip"});
  const Tree<double> tree = make_tree(m);
  REQUIRE(tree.free_base);
  CHECK(tree.num_links() == 3);
  CHECK(tree.num_positions() == 9);
  CHECK(tree.num_velocities() == 8);
  CHECK(std::abs(tree.links[0].inertia.m - 5.3) < 1e-12);  // with the camera
  CHECK(inertial_parameters(tree).size() == 30);

  const Model freed = model_of(urdf(), {.free_base = true});
  CHECK(freed.free_base);
  CHECK(freed.links[0].joint.empty());
  CHECK_THAT(dynamics(freed), MatrixNear(dynamics(m), kRoundTripTol));
  CHECK_FALSE(model_of(urdf()).free_base);
  CHECK_FALSE(model_of(floating(), {.fix_base = true}).free_base);
  CHECK_THAT(refusal(urdf(), {.fix_base = true, .free_base = true}),
             ContainsSubstring("--fix-base") && ContainsSubstring("contradict"));
}

TEST_CASE("free base: an MJCF's free body", "[io]") {
  const Model m =
      model_of(mjcf("", "<freejoint name='root'/>",
                    "<keyframe><key name='home' qpos='0 0 1 1 0 0 0 .3\n '/></keyframe>"));
  REQUIRE(m.free_base);
  CHECK(m.links[0].name == "trunk");
  CHECK(m.links[0].joint == "root");
  CHECK(m.links[0].X_PJ.p.z == 0.5);
  CHECK(joint_names(m) == std::vector<std::string>{"hip"});
  CHECK(m.home == std::vector<double>{0.3});
  CHECK(make_tree(m).num_links() == 2);
  // A table beside it stands in its way, and is no part of it.
  const Model beside =
      model_of(mjcf("<body name='table'><geom size='1'/></body><site name='mark'/>"));
  CHECK(beside.links[0].name == "trunk");
  CHECK_THAT(notes_of(beside), ContainsSubstring("'table'"));
  CHECK_THAT(dynamics(beside), MatrixNear(dynamics(m), kRoundTripTol));
  CHECK(beside.frames[0].link == -1);
  const Model damped =
      model_of(mjcf("", "<joint name='root' type='free' damping='1' armature='.1'/>"));
  CHECK_THAT(notes_of(damped), ContainsSubstring("free joint of body 'trunk'"));
  CHECK_THAT(dynamics(damped), MatrixNear(dynamics(m), kRoundTripTol));
  CHECK_FALSE(model_of(mjcf(), {.fix_base = true}).free_base);
}

TEST_CASE("free base: what floats elsewhere, or beside others, is refused by name", "[io]") {
  struct Case {
    std::string text, says;
    ModelReading reading = {};
  };
  const Case c = GENERATE(
      Case{urdf("<link name='world'/><link name='x'/>" +
                urdf_joint("root", "floating", "world", "trunk") +
                urdf_joint("beside", "fixed", "world", "x")),
           "carries other links"},
      Case{urdf("<link name='w'/><link name='world'/>" + urdf_joint("f", "fixed", "w", "world") +
                urdf_joint("root", "floating", "world", "trunk")),
           "joint 'root' is floating, on link 'world', which is not the root"},
      Case{floating("<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' "
                    "iyz='0'/></inertial>"),
           "has a mass"},
      Case{mjcf("<body name='door'><joint/><geom size='1'/></body>"),
           "body 'trunk' (line 2) is free, and 'door' (line 2) moves beside it"},
      Case{mjcf("<body name='cart'><freejoint/><geom size='1'/></body>"),
           "bodies 'cart' (line 2) and 'trunk' (line 2) are free"},
      Case{mjcf("<body name='ball'><freejoint/><geom size='.1'/></body>"), "ball"},
      Case{mjcf("", ""), "its base is fixed", {.free_base = true}});
  CAPTURE(c.text);
  CHECK_THAT(refusal(c.text, c.reading), ContainsSubstring(c.says));
}

TEST_CASE("free base: written in any form and read back, the dynamics are the same", "[io]") {
  const bool from_urdf = GENERATE(true, false);
  const TemporaryFolder folder;
  Model m = model_of(folder, from_urdf ? floating() : mjcf());
  VecX<double> pi = inertial_parameters(make_tree(m));
  pi.head<10>() *= 1.25;  // of the base
  set_inertial_parameters(m, pi);
  const MatX<double> expected = dynamics(m);
  for (const char* name : {"out.json", "out.urdf", "out.mjcf"}) {
    CAPTURE(name);
    std::vector<std::string> lost;
    Model from = m;
    if (std::string(name) == "out.urdf" && !from_urdf)
      std::erase_if(from.effects, [](const EffectSpec& e) {
        return e.effect == "armature";  // no URDF has it
      });
    const Model read = read_back(folder, from, name, lost);
    REQUIRE(read.free_base);
    CHECK(read.links[0].name == "trunk");
    CHECK(read.links[0].joint == "root");
    CHECK_THAT(to_eigen(read.links[0].X_PJ.p), MatrixNear(to_eigen(m.links[0].X_PJ.p), kPoseTol));
    CHECK_THAT(dynamics(read), MatrixNear(dynamics(from), kRoundTripTol));
    if (from.effects.size() == m.effects.size())
      CHECK_THAT(dynamics(read), MatrixNear(expected, kRoundTripTol));
  }
  // A root that was let float only floats where the document says so: a URDF keeps its own.
  const Model freed = model_of(folder, urdf(), {.free_base = true});
  const std::vector<std::string> lost = write_model(freed, folder.path() / "freed.urdf");
  REQUIRE(lost.size() == 1);
  CHECK_THAT(lost[0], ContainsSubstring("'trunk' floats: --free-base"));
  CHECK_FALSE(read_model(folder.path() / "freed.urdf").free_base);
  CHECK(read_model(folder.path() / "freed.urdf", {.free_base = true}).free_base);
  write_model(freed, folder.path() / "freed.json");
  CHECK(read_model(folder.path() / "freed.json").free_base);
  CHECK_FALSE(read_model(folder.path() / "freed.json", {.fix_base = true}).free_base);
}

TEST_CASE("free base: info says what floats, and what looks wrong with it", "[io]") {
  const Model m = model_of(mjcf());
  const std::string text = model_info_text(m), json = model_info_json(m);
  CHECK_THAT(text, ContainsSubstring("a free base and joints of 1 degree of freedom, 3 links") &&
                       ContainsSubstring("trunk (floating: root)") &&
                       ContainsSubstring("nothing looks wrong"));
  CHECK_THAT(json, ContainsSubstring("\"free_base\": \"trunk\"") &&
                       ContainsSubstring("\"type\": \"floating\""));
  CHECK_THAT(model_info_json(model_of(mjcf(), {.fix_base = true})),
             ContainsSubstring("\"free_base\": null"));
  const Model massless = model_of("<robot name='r'><link name='base'/>" + urdf_link("leg", 1.0) +
                                      urdf_joint("hip", "continuous", "base", "leg") + "</robot>",
                                  {.free_base = true});
  CHECK_THAT(model_info_text(massless), ContainsSubstring("base that floats has no inertia"));
}

TEST_CASE("free base: a joint can be locked, and moves with its carrier then", "[io]") {
  Model m = model_of(mjcf());
  CHECK(lock_joint(m, "hip", 0.4).size() == 2);  // damping and armature go with it
  CHECK(joint_names(m).empty());
  const Tree<double> tree = make_tree(m);
  CHECK(tree.num_links() == 1);
  CHECK(std::abs(tree.links[0].inertia.m - 6.3) < 1e-12);
}

TEST_CASE("free base: what does not serve it yet refuses it, and names --fix-base", "[io]") {
  const Model m = model_of(mjcf());
  const auto refuses = [](const auto& call) {
    CHECK_THROWS_WITH(call(), ContainsSubstring("'trunk'") && ContainsSubstring("--fix-base"));
  };
  IdentifyOptions by_motion;
  by_motion.loss = Loss::kMotion;
  refuses([&] { identify(m, std::vector<Recording>{}, std::vector<Recording>{}, by_motion); });
  refuses([&] { record_model(m, m, Trajectory{}); });
  // Friction of its joints is served, what acts on links is not.
  const ExtendedTree rubbing = extend(m);
  Rng rng(1);
  const RowMatX<double> q = random_positions(rng, rubbing.tree).transpose(),
                        v = random_vector(rng, 7).transpose(), a = v;
  RneaWorkspace<double, double> ws;
  VecX<double> tau = rnea<double, double>(rubbing.tree, q.row(0), v.row(0), a.row(0), ws);
  tau[6] += 1.0 * v(0, 6);  // damping of the hip
  const RowMatX<double> with_effects = inverse_dynamics(rubbing, q, v, a);
  CHECK_THAT(with_effects.transpose(), MatrixNear(tau, kRoundTripTol));
  ForwardDynamics dynamics(rubbing);
  VecX<double> found(7);
  dynamics.acceleration(q.data(), v.data(), with_effects.data(), 0, found.data());
  CHECK_THAT(found, MatrixNear(a.transpose(), 1e-10));
  Model pushed = m;
  pushed.effects.push_back(to_spec(bind({"tip_force", "tip", {}}, m)));
  CHECK_THROWS_WITH(inverse_dynamics(extend(pushed), q, v, a), ContainsSubstring("--fix-base"));
  CHECK_THROWS_WITH(ForwardDynamics(extend(pushed)), ContainsSubstring("--fix-base"));
}

}  // namespace io_free_base_test
