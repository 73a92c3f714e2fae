/// Constraints that close loops, in MJCF and JSON: read, checked against MuJoCo's own rows, kept by
/// export, explained by `info`, refused by what does not serve them.

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <mujoco/mujoco.h>

#include <diffnea/dynamics/constraint_projection.hpp>
#include <diffnea/dynamics/tree_constraints.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_info.hpp>

#include "sim/mujoco_model.hpp"
#include "support/matrix_near.hpp"
#include "support/mjcf_text.hpp"
#include "support/random_arm.hpp"

namespace loops_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

namespace {

std::string link_body(const std::string& name, const std::string& pos, const std::string& rest) {
  return "<body name='" + name + "' pos='" + pos +
         "'><inertial pos='.1 .01 .02' mass='1.3' diaginertia='.01 .02 .03'/><joint name='j_" +
         name + "' axis='0 1 0'/>" + rest + "</body>";
}

/// Ground 0.9, crank 0.3, coupler 0.8, rocker 0.6 [m]. At q = 0 all bars lie along x, and the tip
/// of the rocker is 0.8 m beyond its pin.
std::string four_bar(const std::string& equality) {
  return "<mujoco><compiler angle='radian'/><worldbody><site name='ground' pos='.9 0 0'/>" +
         link_body("crank", "0 0 0",
                   link_body("coupler", ".3 0 0",
                             link_body("rocker", ".8 0 0",
                                       "<site name='tip' pos='.6 0 0' euler='.2 .3 .4'/>"))) +
         "</worldbody><equality>" + equality +
         "</equality><actuator><motor joint='j_crank'/></actuator>"
         "<keyframe><key name='home' qpos='-1.1 .6 1.4'/></keyframe></mujoco>";
}
/// A tree of two branches that meet in 3D.
std::string two_branches(const std::string& equality) {
  return "<mujoco><compiler angle='radian'/><worldbody>"
         "<body name='base' pos='.1 .2 .3' euler='.3 .2 .1'>" +
         std::string(kInertial) + "<joint name='k' axis='0 0 1'/>" +
         link_body("left", ".3 .1 0",
                   link_body("tool", ".2 .3 .1",
                             "<site name='a' pos='.1 .2 .3' "
                             "euler='.5 .1 .2'/>")) +
         link_body("right", "-.1 .2 .3", "<site name='b' pos='.3 .1 0' euler='.1 .7 .2'/>") +
         "</body></worldbody><equality>" + equality + "</equality></mujoco>";
}

sim::MujocoModel compiled(const TemporaryFolder& folder, const std::string& text) {
  write_file_atomically(folder.path() / "compiled.xml", text);
  char error[1000] = "";
  sim::MujocoModel m(
      mj_loadXML((folder.path() / "compiled.xml").c_str(), nullptr, error, sizeof error));
  INFO(error);
  REQUIRE(m);
  return m;
}

VecX<double> residual(const TreeRows<double>& at) {
  VecX<double> g(static_cast<Eigen::Index>(at.rows.size()));
  for (std::size_t i = 0; i < at.rows.size(); ++i) g[static_cast<Eigen::Index>(i)] = at.rows[i].g;
  return g;
}

constexpr const char* kPin = "<connect name='pin' body1='rocker' anchor='.6 0 0'/>";
constexpr const char* kPinOfSites = "<connect name='pin' site1='tip' site2='ground'/>";

}  // namespace

TEST_CASE("loops: connect and weld have MuJoCo's rows at any posture", "[io][loops][mujoco]") {
  const std::string equality = GENERATE(
      as<std::string>{}, "<connect name='c' body1='tool' body2='right' anchor='.1 .2 .3'/>",
      "<connect name='c' body1='tool' anchor='.1 .2 .3'/>",
      "<weld name='c' body1='tool' body2='right'/>",
      "<weld name='c' body1='tool' body2='right' relpose='.1 .2 .3 .5 .5 .5 -.5' anchor='.3 0 "
      ".1'/>",
      "<weld name='c' body1='right'/>");
  const unsigned seed = GENERATE(range(0u, 4u));
  CAPTURE(equality, seed);
  const TemporaryFolder folder;
  const std::string text = two_branches(equality);
  const Model model = model_of(text);
  REQUIRE(model.constraints.size() == 1);
  CHECK(model.constraints[0].name == "c");
  const sim::MujocoModel m = compiled(folder, text);
  const sim::MujocoData d(mj_makeData(m.get()));
  Rng rng(seed);
  const VecX<double> q = random_vector(rng, 4), v = random_vector(rng, 4);
  std::copy(q.begin(), q.end(), d->qpos);
  std::copy(v.begin(), v.end(), d->qvel);
  mj_forward(m.get(), d.get());
  const TreeRows<double> at = tree_rows(make_tree(model), tree_constraints(model), q, v);
  const bool weld = model.constraints[0].kind == ConstraintKind::kWeld;
  REQUIRE(d->nefc == (weld ? 6 : 3));
  REQUIRE(at.rows.size() == static_cast<std::size_t>(d->nefc));
  // MuJoCo's difference is of the first body against the second, ours of the second against the
  // first.
  const Eigen::Map<const Eigen::Vector3d> position(d->efc_pos);
  CHECK_THAT(residual(at).head<3>(), MatrixNear(-position, 1e-12));
  const Eigen::Map<const RowMatX<double>> J(d->efc_J, d->nefc, m->nv);
  CHECK_THAT(at.J.topRows(3), MatrixNear(-J.topRows(3), 1e-12));
  if (!weld) return;
  // Rows of the turn: sin θ a here, sin(θ/2) a there, each in a frame of its own. Lengths agree.
  const Eigen::Map<const Eigen::Vector3d> half(d->efc_pos + 3);
  const double s = half.norm();  // torquescale is 1
  CHECK_THAT(residual(at).tail<3>().norm(), WithinAbs(2 * s * std::sqrt(1 - s * s), 1e-9));
}

TEST_CASE("loops: a four-bar loads, closes, and swings", "[io][loops]") {
  const std::string equality = kPinOfSites;
  const Model model = model_of(four_bar(equality));
  REQUIRE(model.constraints.size() == 1);
  CHECK(model.notes.empty());
  const ConstraintSpec& pin = model.constraints[0];
  CHECK(pin.name == "pin");
  CHECK(pin.kind == ConstraintKind::kConnect);
  CHECK(pin.first.link == 2);
  CHECK(pin.second.link == -1);
  CHECK_THAT(to_eigen(pin.first.X_LF.p), MatrixNear(Eigen::Vector3d(.6, 0, 0), 1e-15));
  CHECK_THAT(to_eigen(pin.second.X_LF.p), MatrixNear(Eigen::Vector3d(.9, 0, 0), 1e-15));
  const Tree<double> tree = make_tree(model);
  const TreeConstraints<double> constraints = tree_constraints(model);
  VecX<double> q(3);
  q << -1.1, .6, 1.4;
  const ProjectedPositions closed = project_positions(tree, constraints, q, {.held = {0}});
  REQUIRE(closed.converged);
  ConstrainedTreeWorkspace<double, double> ws;
  const VecX<double> zero = VecX<double>::Zero(3);
  const VecX<double> qdd =
      constrained_forward_dynamics<double, double>(tree, constraints, closed.q, zero, zero, {}, ws);
  CHECK(qdd.norm() > 1.0);  // it falls
  CHECK_THAT(ws.constraints.J * qdd, MatrixNear(VecX<double>::Zero(3), 1e-10));
}

TEST_CASE("loops: sites are where the loop closes, bodies where it closes at q = 0",
          "[io][loops]") {
  // Between bodies MuJoCo takes the second point from q = 0.
  const Model bodies = model_of(four_bar(kPin));
  CHECK_THAT(to_eigen(bodies.constraints[0].second.X_LF.p),
             MatrixNear(Eigen::Vector3d(1.7, 0, 0), 1e-15));
  // Both frames of a weld between sites.
  const Model weld = model_of(two_branches("<weld site1='a' site2='b'/>"));
  REQUIRE(weld.constraints.size() == 1);
  const ConstraintSpec& c = weld.constraints[0];
  CHECK(c.kind == ConstraintKind::kWeld);
  for (const auto& [end, frame] : {std::pair{&c.first, "a"}, std::pair{&c.second, "b"}}) {
    const auto site = std::ranges::find(weld.frames, frame, &ModelFrame::name);
    REQUIRE(site != weld.frames.end());
    CHECK(end->link == site->link);
    CHECK_THAT(to_eigen(end->X_LF.p), MatrixNear(to_eigen(site->X_LF.p), 1e-15));
    CHECK_THAT(to_eigen(end->X_LF.R), MatrixNear(to_eigen(site->X_LF.R), 1e-15));
  }
}

namespace {

void check_same_constraints(const Model& a, const Model& b, double tolerance) {
  REQUIRE(a.constraints.size() == b.constraints.size());
  for (std::size_t i = 0; i < a.constraints.size(); ++i) {
    const ConstraintSpec &x = a.constraints[i], &y = b.constraints[i];
    CHECK(x.name == y.name);
    CHECK(x.kind == y.kind);
    CHECK(x.radius == y.radius);
    CHECK(x.first.link == y.first.link);
    CHECK(x.second.link == y.second.link);
    if (x.kind == ConstraintKind::kConnect) {  // points alone
      CHECK_THAT(to_eigen(x.first.X_LF.p), MatrixNear(to_eigen(y.first.X_LF.p), tolerance));
      CHECK_THAT(to_eigen(x.second.X_LF.p), MatrixNear(to_eigen(y.second.X_LF.p), tolerance));
      continue;
    }
    // The frames against each other, wherever they are on the links.
    const Pose<double> X = x.first.X_LF * inverse(x.second.X_LF),
                       Y = y.first.X_LF * inverse(y.second.X_LF);
    CHECK_THAT(to_eigen(X.p), MatrixNear(to_eigen(Y.p), tolerance));
    CHECK_THAT(to_eigen(X.R), MatrixNear(to_eigen(Y.R), tolerance));
  }
}

}  // namespace

TEST_CASE("loops: JSON keeps constraints bit by bit, MJCF to rounding", "[io][loops]") {
  const std::string text = GENERATE(
      four_bar(kPin), four_bar(kPinOfSites), two_branches("<weld name='w' site1='a' site2='b'/>"),
      two_branches("<connect name='c' body1='tool' body2='right' anchor='.1 .2 .3'/>"));
  const Model model = model_of(text);
  const std::string json = model_to_json(model);
  const Model again = model_from_json(json, "again");
  check_same_constraints(model, again, 0.0);
  CHECK(model_to_json(again) == json);
  // Drawn anew, for there is no document.
  const TemporaryFolder folder;
  CHECK(write_model(again, folder.path() / "drawn.xml").empty());
  check_same_constraints(model, read_model(folder.path() / "drawn.xml"), 1e-14);
  // In the document that it came from, with another mass.
  Model heavier = model_of(folder, text);
  heavier.links.back().inertia = heavier.links.back().inertia + heavier.links.back().inertia;
  CHECK(write_model(heavier, folder.path() / "written.xml").empty());
  const Model written = read_model(folder.path() / "written.xml");
  check_same_constraints(model, written, 1e-14);
  CHECK_THAT(written.links.back().inertia.m, WithinAbs(heavier.links.back().inertia.m, 1e-14));
  // A URDF is a tree.
  const std::vector<std::string> lost = write_model(again, folder.path() / "r.urdf");
  CHECK(std::ranges::any_of(lost, [&](const std::string& note) {
    return note.find("constraint '" + model.constraints[0].name + "'") != note.npos;
  }));
}

TEST_CASE("loops: a hinge and a wheel of a JSON", "[io][loops]") {
  Model model = model_of(two_branches(""));
  model.constraints.push_back({.name = "h",
                               .kind = ConstraintKind::kHinge,
                               .first = {2, Pose<double>::translation({.1, .2, .3})},
                               .second = {3, Pose<double>::translation({.3, 0, 0})}});
  model.constraints.push_back({.name = "w",
                               .kind = ConstraintKind::kRolling,
                               .second = {1, Pose<double>::translation({0, .1, 0})},
                               .radius = .25});
  const Model again = model_from_json(model_to_json(model), "again");
  check_same_constraints(model, again, 0.0);
  CHECK(tree_rows(make_tree(again), tree_constraints(again), VecX<double>::Constant(4, .3),
                  VecX<double>::Zero(4))
            .rows.size() == 5 + 3);
  // An MJCF has points for the hinge, and no wheels.
  const TemporaryFolder folder;
  const std::vector<std::string> lost =
      write_model(model_from_json(model_to_json(model), "m"), folder.path() / "drawn.xml");
  REQUIRE(lost.size() == 2);
  CHECK_THAT(lost[0] + lost[1],
             ContainsSubstring("'h' is a hinge") && ContainsSubstring("'w', a wheel that rolls"));
  const Model drawn = read_model(folder.path() / "drawn.xml");
  REQUIRE(drawn.constraints.size() == 2);
  const VecX<double> still = VecX<double>::Zero(4), q = VecX<double>::Constant(4, .3);
  model.constraints.pop_back();
  const MatX<double> hinge = tree_rows(make_tree(model), tree_constraints(model), q, still).J,
                     points = tree_rows(make_tree(drawn), tree_constraints(drawn), q, still).J;
  CHECK(constraint_null_space(hinge).cols() == constraint_null_space(points).cols());
}

TEST_CASE("loops: info says how far the reference posture is from closing", "[io][loops]") {
  const Model model = model_of(four_bar(kPinOfSites));
  CHECK_THAT(model_info_text(model),
             ContainsSubstring("pin: connect of rocker at (0.6 0 0) and the ground at (0.9 0 0), "
                               "apart by ") &&
                 ContainsSubstring("they leave 1 of 3 degrees of freedom") &&
                 ContainsSubstring("they close where joints move by at most"));
  CHECK_THAT(model_info_json(model),
             ContainsSubstring("\"dofs_left\": 1") && ContainsSubstring("\"closes\": true"));
  const Model closed =
      model_of(two_branches("<connect name='c' body1='tool' body2='right' anchor='.1 .2 .3'/>"));
  CHECK_THAT(model_info_text(closed), ContainsSubstring(", closed\n"));
  Model never = model;
  never.constraints[0].second.X_LF.p.x = 3.0;
  CHECK_THAT(model_info_text(never), ContainsSubstring("no posture near the reference closes") &&
                                         !ContainsSubstring("nothing looks wrong"));
}

TEST_CASE("loops: info of links that cannot move says whether they are closed", "[io][loops]") {
  const std::string head = R"({"schema":"diffnea/model/1","links":[{"name":"a"}],"constraints":[)";
  const std::string weld = R"({"name":"c","kind":"weld","first":{},"second":{"link":"a")";
  const Model closed = model_from_json(head + weld + "}}]}", "m.json");
  CHECK_THAT(model_info_text(closed),
             ContainsSubstring("closed\n  they leave 0 of 0 degrees of freedom"));
  const Model apart =
      model_from_json(head + weld + R"(,"pose":{"position":[0,0,0.1]}}}]})", "m.json");
  CHECK_THAT(model_info_text(apart), ContainsSubstring("apart by 100 mm") &&
                                         ContainsSubstring("no posture near the reference"));
}

TEST_CASE("loops: what does not serve constraints says so", "[io][loops]") {
  const Model model = model_of(four_bar(kPinOfSites));
  IdentifyOptions by_motion;
  by_motion.loss = Loss::kMotion;
  CHECK_THROWS_WITH(identify(model, std::vector<Recording>{}, {}, by_motion),
                    ContainsSubstring("by this loss") && ContainsSubstring("constraints, 'pin'"));
  // The tree is read without if asked.
  const Model open = model_of(four_bar(kPinOfSites), {.open_loops = true});
  CHECK(open.constraints.empty());
  CHECK_THAT(notes_of(open), ContainsSubstring("'pin'") && ContainsSubstring("left out, as asked"));
}

TEST_CASE("loops: a constraint of a JSON that cannot be is refused by its place", "[io][loops]") {
  struct Case {
    std::string constraint, says;
  };
  const Case c = GENERATE(
      Case{R"({"name":"c","kind":"glue","first":{},"second":{"link":"a"}})",
           "constraints[0].kind: got 'glue', expected connect, weld, hinge or rolling"},
      Case{R"({"name":"c","kind":"weld","first":{"link":"x"},"second":{"link":"a"}})",
           "there is no link 'x'"},
      Case{R"({"name":"c","kind":"weld","first":{"link":"a"},"second":{"link":"a"}})",
           "constraint 'c': both of its ends are on one link"},
      Case{R"({"name":"c","kind":"rolling","second":{"link":"a"},"radius":0})",
           "the wheel's radius is 0 m, expected > 0"},
      Case{R"({"name":"","kind":"weld","first":{},"second":{"link":"a"}})", "needs a name"},
      Case{R"({"name":"c","kind":"weld","first":{},"second":{"link":"a"},"stiff":1})",
           "unknown key 'stiff'"});
  CHECK_THROWS_WITH(
      model_from_json(R"({"schema":"diffnea/model/1","links":[{"name":"a"}],"constraints":[)" +
                          c.constraint + "]}",
                      "m.json"),
      ContainsSubstring(c.says));
}

}  // namespace loops_test
