#include <algorithm>
#include <string>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/layout.hpp>
#include <diffnea/io/model_file.hpp>

namespace layout_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;

namespace {

Model wam() { return read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/wam4.xml"); }

const FitParameter* find(const FitLayout& layout, const std::string& name) {
  for (const auto* list : {&layout.linear, &layout.shape})
    for (const FitParameter& p : *list)
      if (p.name == name) return &p;
  return nullptr;
}

}  // namespace

TEST_CASE("layout: links, then the model's effects, then what is asked for", "[identify]") {
  const FitLayout layout = make_layout(wam(), {}, {0});
  CHECK(layout.num_dofs == 4);
  CHECK(layout.linear.front().name.ends_with(".mass"));
  CHECK(layout.bodies() == std::vector<int>{0, 10, 20, 30});
  REQUIRE(find(layout, "joint3.armature.armature") != nullptr);
  CHECK(find(layout, "joint3.armature.armature")->prior > 0.0);  // the model's own rotor inertia
  CHECK(find(layout, "joint1.coulomb_friction.coulomb")->sign == Sign::kNonNegative);
  CHECK(find(layout, "joint1.coulomb_friction.smoothing")->fixed);
}

TEST_CASE("layout: a joint's torque reads the links it carries and its own effects", "[identify]") {
  const Model model = wam();
  const FitLayout layout = make_layout(model, {}, {0});
  const std::vector<int> columns = layout.columns_of_row(make_tree(model), 3);
  for (const int c : columns) {
    const FitParameter& p = layout.linear[c];
    CAPTURE(p.name);
    CHECK((p.dof == 3 || p.name.starts_with("joint4.")));
  }
  CHECK(layout.columns_of_row(make_tree(model), 0).size() > columns.size());
}

TEST_CASE("layout: fix holds what a pattern names", "[identify]") {
  FitChoice choice;
  choice.fix = {"joint2.*"};
  const FitLayout layout = make_layout(wam(), choice, {0});
  CHECK(find(layout, "joint2.viscous_friction.viscous")->fixed);
  CHECK_FALSE(find(layout, "joint1.viscous_friction.viscous")->fixed);
}

TEST_CASE("layout: what does not exist is refused with what does", "[identify]") {
  FitChoice choice;
  choice.fit = {"inertias"};
  CHECK_THROWS_WITH(make_layout(wam(), choice, {0}),
                    ContainsSubstring("armature, effects, string, shapes"));
  choice = {};
  choice.fix = {"elbow.mass"};
  CHECK_THROWS_WITH(make_layout(wam(), choice, {0}), ContainsSubstring("joint1.viscous_friction"));
  choice = {};
  choice.effects = std::vector<std::string>{"columb_friction"};
  CHECK_THROWS_WITH(make_layout(wam(), choice, {0}), ContainsSubstring("coulomb_friction"));
  choice = {};
  choice.fit = {"inertia", "kinematics@joint9"};
  CHECK_THROWS_WITH(make_layout(wam(), choice, {0}), ContainsSubstring("joint4"));
  choice = {};
  choice.effects = std::vector<std::string>{"cable_differential_friction"};
  CHECK_THROWS_WITH(make_layout(wam(), choice, {0}), ContainsSubstring("pair of joints"));
  choice.effects = std::vector<std::string>{"actuator_lag@joint2"};
  CHECK_THROWS_WITH(make_layout(wam(), choice, {0}),
                    ContainsSubstring("cannot fit actuator_lag at 'joint2'") &&
                        ContainsSubstring("`diffnea diagnose` fits it"));
}

TEST_CASE("layout: behind the drive, motor effects are left out unless asked for", "[identify]") {
  FitChoice choice;
  choice.link_side = true;
  const FitLayout left_out = make_layout(wam(), choice, {0});
  CHECK(find(left_out, "joint1.armature.armature") == nullptr);
  CHECK(find(left_out, "joint1.torque_offset.offset") != nullptr);
  choice.effects = std::vector<std::string>{"coulomb_friction"};
  CHECK(find(make_layout(wam(), choice, {0}), "joint1.coulomb_friction.coulomb") != nullptr);
}

TEST_CASE("layout: applying the prior changes nothing", "[identify]") {
  const Model model = wam();
  FitChoice choice;
  choice.fit = {"inertia", "armature", "effects", "kinematics"};
  const FitLayout layout = make_layout(model, choice, {0});
  VecX<double> shape(layout.shape.size());
  for (std::size_t s = 0; s < layout.shape.size(); ++s) shape[s] = layout.shape[s].prior;
  const Model same = apply_fit(model, layout, layout.prior(), shape);
  CHECK(inertial_parameters(make_tree(same)) == inertial_parameters(make_tree(model)));
  CHECK(make_tree(same).links[2].armature == make_tree(model).links[2].armature);
}

TEST_CASE("layout: a value that is held is in the model, whether inertias are fitted or not",
          "[identify]") {
  const Model model = wam();
  FitChoice choice;
  choice.fix = {"forearm.mass=2.8"};
  SECTION("with the inertias") {}
  SECTION("without") { choice.fit = {"effects"}; }
  const FitLayout layout = make_layout(model, choice, {0});
  VecX<double> shape(layout.shape.size());
  for (std::size_t s = 0; s < layout.shape.size(); ++s) shape[s] = layout.shape[s].prior;
  const Model held = apply_fit(model, layout, layout.prior(), shape);
  CHECK(make_tree(held).links[3].inertia.m == 2.8);
}

}  // namespace layout_test
