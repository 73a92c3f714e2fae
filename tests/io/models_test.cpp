/// The robots in models/: that they load, can be true, and have the names the recordings use.

#include <filesystem>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/io/model_file.hpp>

#include "support/matrix_near.hpp"

namespace models_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

const std::filesystem::path kModels = DIFFNEA_SOURCE_DIR "/models";

VecX<double> vector(std::initializer_list<double> values) {
  VecX<double> v(static_cast<long>(values.size()));
  std::copy(values.begin(), values.end(), v.begin());
  return v;
}

}  // namespace

TEST_CASE("models: each loads, nothing looks wrong, names are those of the recordings",
          "[models]") {
  using Names = std::vector<std::string>;
  const auto [file, joints] = GENERATE(table<std::string, Names>(
      {{"cart_pole.xml", {"cart", "pole"}},
       {"double_pendulum.urdf", {"shoulder", "elbow"}},
       {"emps.urdf", {"carriage"}},
       {"furuta.xml", {"arm", "pendulum"}},
       {"panda.urdf",
        {"panda_joint1", "panda_joint2", "panda_joint3", "panda_joint4", "panda_joint5",
         "panda_joint6", "panda_joint7"}},
       {"pendulum.json", {"pendulum"}},
       {"table_tennis.json", {}},
       {"wam4.xml", {"joint1", "joint2", "joint3", "joint4"}},
       {"wam4_ball.xml", {"joint1", "joint2", "joint3", "joint4"}},
       {"wam4_ball_in_cup.xml", {"joint1", "joint2", "joint3", "joint4"}}}));
  CAPTURE(file);
  const Model model = read_model(kModels / file);
  CHECK(joint_names(model) == joints);
  CHECK(make_tree(model).num_dofs() == static_cast<int>(joints.size()));
  for (const ModelIssue& issue : check_model(model)) FAIL_CHECK(issue.link << ": " << issue.text);
}

TEST_CASE("models: every file of the folder is in the list above", "[models]") {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kModels))
    if (entry.path().extension() != ".md" &&
        !entry.path().filename().string().starts_with("surrogate_"))  // ranges, no robots
      ++count;
  CHECK(count == 10);
}

TEST_CASE("models: those that nobody drives say so", "[models]") {
  CHECK(read_model(kModels / "pendulum.json").links[0].passive);
  const Model cart_pole = read_model(kModels / "cart_pole.xml");
  CHECK_FALSE(cart_pole.links[0].passive);
  CHECK(cart_pole.links[1].passive);
  CHECK(read_model(kModels / "furuta.xml").links[1].passive);
}

TEST_CASE("models: small swings of the pendulum have the measured frequency", "[models]") {
  const Tree<double> tree = make_tree(read_model(kModels / "pendulum.json"));
  MassMatrixWorkspace<double, double> ws;
  RneaWorkspace<double, double> rnea_ws;
  const VecX<double> q = vector({1e-6});
  const double stiffness = gravity_torques(tree, VecIn<double>(q), rnea_ws)[0] / 1e-6;
  constexpr double kMeasured =
      33.32;  // [1/s²]; the mass and length published with it have three digits
  CHECK(std::abs(stiffness / mass_matrix(tree, VecIn<double>(q), ws)(0, 0) - kMeasured) < 0.05);
}

TEST_CASE("models: the WAM has the mass matrix and gravity torques of Barrett's tables",
          "[models]") {
  Model model = read_model(kModels / "wam4.xml");
  for (ModelLink& link : model.links)
    if (link.name == "cup") link.inertia = {};  // the tables know no tool
  const Tree<double> tree = make_tree(model);
  const VecX<double> q = vector({0, 0.6, 0, 1.25});
  MassMatrixWorkspace<double, double> ws;
  RneaWorkspace<double, double> rnea_ws;
  // From the tables without rotors, printed with five digits; the gravity torques from centres of
  // mass rounded to 1e-5 m: 2 kg · 9.81 m/s² · 1e-5 m.
  constexpr double kPrinted = 1e-5, kRounded = 2e-4;
  const VecX<double> links = vector({0.50569, 0.75256, 0.04914, 0.04119}),
                     rotors = vector({0.205, 0.186, 0.066, 0.038});
  CHECK_THAT(mass_matrix(tree, VecIn<double>(q), ws).diagonal(),
             MatrixNear(links + rotors, kPrinted));
  CHECK_THAT(gravity_torques(tree, VecIn<double>(q), rnea_ws),
             MatrixNear(vector({0, -8.91667, 0.00012, -1.50963}), kRounded));
  for (int i = 0; i < 4; ++i) CHECK(tree.links[i].armature == rotors[i]);
  CHECK(model.links[2].limits.effort == 125.0);
}

TEST_CASE("models: the WAM's cup opens upwards at home, at the published place", "[models]") {
  const Model model = read_model(kModels / "wam4.xml");
  const TreeMap map = map_to_tree(model);
  const Tree<double> tree = make_tree(model);
  const VecX<double> q = vector({0, 0.63, 0, 1.27});  // home, as the arm droops there
  const ModelFrame* cup = nullptr;
  for (const ModelFrame& f : model.frames)
    if (f.name == "cup") cup = &f;
  REQUIRE(cup);
  Pose<double> X_WL = Pose<double>::identity();
  for (int i = 0; i < 4; ++i) X_WL = X_WL * joint_pose(tree.links[i], q[i]);
  const Pose<double> X_WC = X_WL * map.X_LF[cup->link] * cup->X_LF;
  CHECK(X_WC.R.col[2].z > 0.9);  // the cup leans by 0.63 + 1.27 − π/2 = 19°
  // Published: where the ball shall rest, 28 mm above the knot along the cup's axis; base at 0.84
  // m.
  const Vec3<double> rest = X_WC.p + X_WC.R.col[2] * 0.02817;
  CHECK_THAT(to_eigen(rest), MatrixNear(Eigen::Vector3d(0.8143, 0, 1.48), 0.01));
}

}  // namespace models_test
