/// What is read from an MJCF against what MuJoCo itself computes from it.

#include <memory>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <mujoco/mujoco.h>

#include <diffnea/core/random.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/io/model_file.hpp>

#include "support/matrix_near.hpp"
#include "support/temporary_folder.hpp"

namespace mjcf_test {

using namespace diffnea;
using namespace diffnea::test;

namespace {

/// Torques of order 10 to 100 from two algorithms: 1e-13 observed.
constexpr double kTorqueTol = 1e-10;
/// Torques of order 10 where MuJoCo 2.2 finds the principal axes of a full tensor: 2e-8 observed.
constexpr double kPrincipalAxesTol = 1e-7;

/// Everything that a joint can be: several a body, anchors off the origin, references, slides,
/// branches, bodies without joints below and between, principal axes that are not the body's.
constexpr const char* kAwkward = R"(<mujoco model="awkward">
  <compiler angle="radian"/>
  <option gravity="1 -2 -9"/>
  <worldbody>
    <body name="base" pos="0 .1 1" quat=".6 .8 0 0">
      <body name="a" pos=".1 .2 .3" quat=".5 -.5 .5 .5">
        <inertial pos=".1 .02 -.03" quat=".7 .1 .1 .7" mass="2" diaginertia=".02 .03 .025"/>
        <joint name="a1" axis="0 0 1" pos=".1 .2 -.1" ref=".3"/>
        <joint name="a2" axis="1 2 3" pos="-.1 0 .2" armature=".1"/>
        <joint name="a3" type="slide" axis="0 1 1" ref="-.2" pos="1 1 1"/>
        <body name="fixed" pos=".2 0 .1" euler=".3 .4 .5">
          <inertial pos=".1 .1 .1" mass="1.5" diaginertia=".01 .02 .015"/>
          <body name="b" pos="0 .3 0" euler="1 0 0">
            <inertial pos="0 0 -.2" mass="1" diaginertia=".01 .01 .002"/>
            <joint name="b1" axis="0 1 0" pos="0 0 .1" armature=".02"/>
            <body name="tool" pos="0 0 -.4"><geom type="box" size=".05 .02 .1" pos=".02 0 0"/></body>
          </body>
          <body name="c" pos="0 -.3 0">
            <joint name="c1" axis="0 0 1"/>
            <geom type="capsule" size=".03" fromto="0 0 0 .1 .2 .3"/>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>)";

struct DeleteModel {
  void operator()(mjModel* m) const { mj_deleteModel(m); }
};
struct DeleteData {
  void operator()(mjData* d) const { mj_deleteData(d); }
};

/// MuJoCo's torque for a motion, without contacts, limits and passive forces.
class Inverse {
 public:
  explicit Inverse(const std::string& path) {
    char error[1000];
    model_.reset(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
    if (!model_) throw std::runtime_error(error);
    model_->opt.disableflags |= mjDSBL_CONSTRAINT | mjDSBL_PASSIVE;
    data_.reset(mj_makeData(model_.get()));
  }
  VecX<double> operator()(const VecX<double>& q, const VecX<double>& qd, const VecX<double>& qdd) {
    std::copy(q.begin(), q.end(), data_->qpos);
    std::copy(qd.begin(), qd.end(), data_->qvel);
    std::copy(qdd.begin(), qdd.end(), data_->qacc);
    mj_inverse(model_.get(), data_.get());
    return Eigen::Map<VecX<double>>(data_->qfrc_inverse, q.size());
  }

 private:
  std::unique_ptr<mjModel, DeleteModel> model_;
  std::unique_ptr<mjData, DeleteData> data_;
};

VecX<double> random_vector(Rng& rng, int n, double size) {
  VecX<double> v(n);
  for (double& x : v) x = rng.uniform(-size, size);
  return v;
}

void check_torques(const std::string& path, double tolerance = kTorqueTol) {
  const Tree<double> tree = make_tree(read_model(path));
  Inverse inverse(path);
  RneaWorkspace<double, double> ws;
  for (unsigned seed = 0; seed < 20; ++seed) {
    CAPTURE(path, seed);
    Rng rng(seed);
    const int n = tree.num_dofs();
    const VecX<double> q = random_vector(rng, n, 2), qd = random_vector(rng, n, 3),
                       qdd = random_vector(rng, n, 10);
    CHECK_THAT(rnea(tree, VecIn<double>(q), VecIn<double>(qd), VecIn<double>(qdd), ws),
               MatrixNear(inverse(q, qd, qdd), tolerance));
  }
}

}  // namespace

TEST_CASE("mjcf: torques of the tree read from it are MuJoCo's, fixed links lumped", "[io]") {
  const TemporaryFolder folder;
  write_file_atomically(folder.path() / "awkward.xml", kAwkward);
  check_torques((folder.path() / "awkward.xml").string());
  check_torques(DIFFNEA_SOURCE_DIR "/models/wam4.xml", kPrincipalAxesTol);
  check_torques(DIFFNEA_SOURCE_DIR "/models/cart_pole.xml");
  check_torques(DIFFNEA_SOURCE_DIR "/models/furuta.xml");
}

TEST_CASE("mjcf: written back, MuJoCo computes the torques of the new parameters", "[io]") {
  const TemporaryFolder folder;
  const std::string original = (folder.path() / "awkward.xml").string(),
                    written = (folder.path() / "new.xml").string();
  write_file_atomically(original, kAwkward);
  Model model = read_model(original);
  VecX<double> pi = inertial_parameters(make_tree(model));
  pi *= 1.25;  // stays physical
  set_inertial_parameters(model, pi);
  CHECK(write_model(model, written).empty());
  check_torques(written);
  CHECK_THAT(inertial_parameters(make_tree(read_model(written))), MatrixNear(pi, 1e-12));
}

}  // namespace mjcf_test
