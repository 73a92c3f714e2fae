/// Models that came in one form, drawn in another: the dynamics stay, and what is lost is said.

#include <algorithm>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/io/model_file.hpp>

#include "support/matrix_near.hpp"
#include "support/random_arm.hpp"
#include "support/temporary_folder.hpp"

namespace export_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// Torques of order 100 through quaternions or roll–pitch–yaw and principal axes: 1e-12 observed.
constexpr double kRneaTol = 1e-9;
/// Accelerations of order 100, which small inertias magnify: 1e-10 observed.
constexpr double kAbaTol = 1e-8;

/// A random branching robot with frames, limits, and what a joint of either format can have.
Model random_model(unsigned seed) {
  Rng rng(seed);
  const Tree<double> tree = random_tree(rng);
  Model m;
  m.name = "random";
  m.gravity = tree.gravity;
  for (int i = 0; i < tree.num_dofs(); ++i) {
    const Link<double>& l = tree.links[static_cast<std::size_t>(i)];
    const std::string number = std::to_string(i);
    ModelLink link;
    link.name = "link" + number;
    link.joint = "joint" + number;
    link.parent = l.parent;
    link.type = l.type == JointType::kRevolute ? ModelJoint::kRevolute : ModelJoint::kPrismatic;
    link.axis = l.axis;
    link.X_PJ = l.X_PJ;
    link.inertia = l.inertia;
    if (i % 2 == 0) link.limits = {-0.1 - rng.uniform(), rng.uniform(), 2.0 + i, 10.0 + i};
    m.links.push_back(link);
    m.effects.push_back({"armature", link.joint, {{"armature", l.armature, ""}}});
    m.effects.push_back({"viscous_friction", link.joint, {{"viscous", rng.uniform(), ""}}});
    m.effects.push_back({"coulomb_friction", link.joint, {{"coulomb", rng.uniform(), ""}}});
    m.effects.push_back(
        {"joint_spring", link.joint, {{"stiffness", rng.uniform(), ""}, {"rest", 0.3, ""}}});
  }
  ModelLink tool;
  tool.name = "tool";
  tool.parent = static_cast<int>(m.links.size()) - 1;
  tool.X_PJ = random_pose(rng);
  tool.inertia = random_inertia(rng);
  m.links.push_back(tool);
  m.frames.push_back({"tip", tool.parent + 1, random_pose(rng)});
  return m;
}

double parameter(const Model& m, const std::string& effect, const std::string& where,
                 const std::string& name) {
  double sum = 0.0;
  for (const EffectSpec& e : m.effects)
    for (const EffectParameter& p : e.parameters)
      if (e.effect == effect && e.where == where && p.name == name) sum += p.value;
  return sum;
}

/// Values of `b`'s joints in the order of `a`'s.
VecX<double> reordered(const Model& a, const Model& b, const VecX<double>& x) {
  VecX<double> out(x.size());
  const std::vector<std::string> joints = joint_names(a);
  for (std::size_t i = 0; i < joints.size(); ++i)
    out[static_cast<long>(i)] = x[find_joint(b, joints[i])];
  return out;
}

void check_same_dynamics(const Model& a, const Model& b, unsigned seed, bool same_rotors) {
  Tree<double> A = make_tree(a), B = make_tree(b);
  if (!same_rotors)
    for (Link<double>& link : A.links) link.armature = 0.0;
  B.gravity = A.gravity;  // of a URDF it is that of the Earth
  const int n = A.num_dofs();
  REQUIRE(B.num_dofs() == n);
  Rng rng(seed + 1000);
  const VecX<double> q = random_vector(rng, n), qd = random_vector(rng, n),
                     x = random_vector(rng, n, 5.0);
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> aba_ws;
  const VecX<double> qb = reordered(b, a, q), qdb = reordered(b, a, qd), xb = reordered(b, a, x);
  CHECK_THAT(reordered(a, b, rnea<double, double>(B, qb, qdb, xb, rnea_ws)),
             MatrixNear(rnea<double, double>(A, q, qd, x, rnea_ws), kRneaTol));
  CHECK_THAT(reordered(a, b, aba<double, double>(B, qb, qdb, xb, aba_ws)),
             MatrixNear(aba<double, double>(A, q, qd, x, aba_ws), kAbaTol));
}

}  // namespace

TEST_CASE("export: a drawn MJCF has the dynamics, the friction and the limits", "[io]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const TemporaryFolder folder;
  const Model a = random_model(seed);
  const std::vector<std::string> notes = write_model(a, folder.path() / "a.xml");
  CHECK(notes == std::vector<std::string>{"the velocity limit of 'joint0'",
                                          "the velocity limit of 'joint2'",
                                          "the velocity limit of 'joint4'"});
  const Model b = read_model(folder.path() / "a.xml");
  check_same_dynamics(a, b, seed, true);
  CHECK(b.effects.size() == a.effects.size());
  for (const ModelLink& link : a.links) {
    if (link.type == ModelJoint::kFixed) continue;
    CAPTURE(link.joint);
    for (const char* effect : {"armature", "viscous_friction", "coulomb_friction", "joint_spring"})
      for (const char* name : {"armature", "viscous", "coulomb", "stiffness", "rest"})
        CHECK(parameter(a, effect, link.joint, name) == parameter(b, effect, link.joint, name));
    const auto it = std::ranges::find(b.links, link.joint, &ModelLink::joint);
    REQUIRE(it != b.links.end());
    CHECK(it->limits.lower == link.limits.lower);
    CHECK(it->limits.upper == link.limits.upper);
    CHECK(it->limits.effort == link.limits.effort);
    CHECK_FALSE(it->passive);
  }
  REQUIRE(b.frames.size() == 1);
  CHECK(b.links[static_cast<std::size_t>(b.frames[0].link)].name == "tool");
}

TEST_CASE("export: a drawn URDF has the dynamics, damping, friction and limits", "[io]") {
  const unsigned seed = GENERATE(range(0u, 10u));
  CAPTURE(seed);
  const TemporaryFolder folder;
  const Model a = random_model(seed);
  const std::vector<std::string> notes = write_model(a, folder.path() / "a.urdf");
  for (const char* what : {"armature at joint0", "joint_spring at joint5", "gravity"})
    CHECK(std::ranges::any_of(notes, [&](const auto& n) { return n.starts_with(what); }));
  const Model b = read_model(folder.path() / "a.urdf");
  check_same_dynamics(a, b, seed, false);
  CHECK(b.links.front().name == "world");  // joints of the first links move against it
  for (const ModelLink& link : a.links) {
    if (link.type == ModelJoint::kFixed) continue;
    CAPTURE(link.joint);
    CHECK(parameter(a, "viscous_friction", link.joint, "viscous") ==
          parameter(b, "viscous_friction", link.joint, "viscous"));
    CHECK(parameter(a, "coulomb_friction", link.joint, "coulomb") ==
          parameter(b, "coulomb_friction", link.joint, "coulomb"));
    const auto it = std::ranges::find(b.links, link.joint, &ModelLink::joint);
    REQUIRE(it != b.links.end());
    CHECK(it->limits.effort == link.limits.effort);
    CHECK(it->limits.velocity == link.limits.velocity);
    if (link.type == ModelJoint::kPrismatic && !std::isfinite(link.limits.lower)) continue;
    CHECK(it->limits.lower == link.limits.lower);
    CHECK(it->limits.upper == link.limits.upper);
  }
  CHECK(std::ranges::any_of(b.links, [](const ModelLink& l) { return l.name == "tip"; }));
}

TEST_CASE("export: a ball on a string, a cup, obstacles and a posture are drawn into an MJCF",
          "[io]") {
  const TemporaryFolder folder;
  Model a = random_model(3);
  a.home = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  a.frames.push_back({"cup", 5, Pose<double>::identity()});
  a.cup = CupSpec{0.04, 0.003, 0.0145, 0.095};
  a.obstacles.push_back({2, {0, 0, 0}, {0, 0, 0.3}, 0.05});
  a.obstacles.push_back({1, {0, 0.1, 0}, {0, 0.1, 0}, 0.07});
  a.ball = BallSpec{0.024, 0.02, StringSpec{5, {0.01, 0.02, 0.03}, 0.4, 0.0}};
  write_model(a, folder.path() / "a.xml");
  const Model b = read_model(folder.path() / "a.xml");
  check_same_dynamics(a, b, 3, true);
  REQUIRE(b.ball);
  CHECK(b.ball->mass == a.ball->mass);
  CHECK(b.ball->radius == a.ball->radius);
  REQUIRE(b.ball->string);
  CHECK(b.ball->string->length == a.ball->string->length);
  CHECK(b.links[static_cast<std::size_t>(b.ball->string->link)].name == "link5");
  CHECK_THAT(to_eigen(b.ball->string->p_LS), MatrixNear(to_eigen(a.ball->string->p_LS), 1e-15));
  REQUIRE(b.cup);
  CHECK(b.cup->rim == a.cup->rim);
  REQUIRE(b.obstacles.size() == 2);
  for (const CapsuleSpec& o : b.obstacles)
    CHECK(o.radius == (b.links[static_cast<std::size_t>(o.link)].name == "link2" ? 0.05 : 0.07));
  for (const std::string& joint : joint_names(a))
    CHECK(b.home[static_cast<std::size_t>(find_joint(b, joint))] ==
          a.home[static_cast<std::size_t>(find_joint(a, joint))]);
}

TEST_CASE("export: what no MJCF or URDF can say is refused or noted", "[io]") {
  const TemporaryFolder folder;
  Model m = random_model(1);
  m.effects.push_back({"cogging", "joint1", {}});
  m.links[0].passive = true;
  for (const char* name : {"a.urdf", "a.xml"}) {
    const std::vector<std::string> notes = write_model(m, folder.path() / name);
    CHECK(std::ranges::find(notes, "cogging at joint1") != notes.end());
    // A motor at every other joint says it.
    const bool said = std::ranges::find(notes, "joint 'joint0' is passive") != notes.end();
    CHECK(said == (std::string(name) == "a.urdf"));
  }
  const Model b = read_model(folder.path() / "a.xml");
  CHECK(std::ranges::find(b.links, "joint0", &ModelLink::joint)->passive);

  Model impossible = random_model(2);
  impossible.links[3].inertia.m = -1.0;
  CHECK_THROWS_AS(write_model(impossible, folder.path() / "b.xml"), ModelError);
  Model massless = random_model(2);
  massless.links[3].inertia.m = 0.0;
  CHECK_THROWS_WITH(write_model(massless, folder.path() / "b.urdf"),
                    ContainsSubstring("'link3' has an inertia, but no mass"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "b.urdf"));
}

TEST_CASE("export: of a run's folder the fitted model is read, in the document that lies there",
          "[io]") {
  const TemporaryFolder folder;
  const Model a = random_model(4);
  const std::filesystem::path run = folder.path() / "run";
  std::filesystem::create_directory(run);
  CHECK_THROWS_WITH(read_model_or_run(run), ContainsSubstring("no run of a robot"));
  write_model(a, run / "model.urdf");
  std::string text = read_text_file(run / "model.urdf");
  text.insert(text.find("<robot"), "<!-- kept -->\n");
  write_file_atomically(run / "model.urdf", text);
  Model fitted = read_model(run / "model.urdf");
  fitted.effects.push_back({"torque_offset", "joint1", {{"offset", 0.5, ""}}});
  write_model(fitted, run / "model.json");
  const Model back = read_model_or_run(run);
  const std::vector<std::string> notes = write_model(back, folder.path() / "out.urdf");
  CHECK(notes == std::vector<std::string>{"torque_offset at joint1"});
  CHECK_THAT(read_text_file(folder.path() / "out.urdf"), ContainsSubstring("<!-- kept -->"));
}

}  // namespace export_test
