/// The controller of simulated robots: its gains, its two laws, its limits.

#include <limits>

#include <Eigen/Cholesky>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/io/model_file.hpp>

#include "sim/joint_controller.hpp"
#include "support/matrix_near.hpp"

namespace controller_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// Torques of order 10, accelerations of order 100: 1e-13 observed.
constexpr double kRoundingTol = 1e-10;

Model wam() { return read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml"); }

VecX<double> vector(std::initializer_list<double> values) {
  return Eigen::Map<const VecX<double>>(std::data(values), static_cast<long>(values.size()));
}

const VecX<double> kHome = vector({0.0, 0.6, 0.0, 1.25}), kStill = VecX<double>::Zero(4);

}  // namespace

TEST_CASE("controller: derived gains are those of the inertia that a joint feels", "[controller]") {
  const Model model = wam();
  const JointGains pd = joint_gains(model, {.bandwidth = 10.0, .damping = 0.5}, kHome);
  MassMatrixWorkspace<double, double> ws;
  const MatX<double> M = mass_matrix(make_tree(model), VecIn<double>(kHome), ws);
  for (int j = 0; j < 4; ++j) {
    // Accelerates by 1 under that torque when the others move freely.
    const VecX<double> qdd = M.ldlt().solve(VecX<double>::Unit(4, j) * pd.kp[j] / 100.0);
    CHECK(std::abs(qdd[j] - 1.0) < kRoundingTol);
  }
  CHECK_THAT(pd.kd, MatrixNear(VecX<double>(pd.kp * 0.1), kRoundingTol));
  const JointGains ct = joint_gains(
      model, {.law = ControlLaw::kComputedTorque, .kd = vector({1, 2, 3, 4}), .bandwidth = 10.0},
      kHome);
  CHECK(ct.kp == VecX<double>::Constant(4, 100.0));
  CHECK(ct.kd == vector({1, 2, 3, 4}));
  CHECK_THROWS_WITH(joint_gains(model, {.kp = vector({1, 2})}, kHome),
                    ContainsSubstring("controller: kp: got 2 values, expected 4"));
}

TEST_CASE("controller: PD adds the errors to the gravity of the measured position",
          "[controller]") {
  const Model model = wam();
  ControllerOptions options{.kp = vector({200, 300, 100, 100}), .kd = vector({7, 15, 5, 2.5})};
  const VecX<double> q = vector({0.1, 0.5, -0.1, 1.3}), qd = vector({0.1, 0.2, -0.3, 0.4});
  const VecX<double> error = options.kp.cwiseProduct(kHome - q) - options.kd.cwiseProduct(qd);
  RneaWorkspace<double, double> ws;
  const VecX<double> gravity = gravity_torques(make_tree(model), VecIn<double>(q), ws);
  sim::JointController with(model, model, options, kHome);
  CHECK_THAT(with.torque(q, qd, kHome, kStill),
             MatrixNear(VecX<double>(gravity + error), kRoundingTol));
  CHECK_FALSE(with.saturated());
  options.gravity_compensation = false;
  sim::JointController without(model, model, options, kHome);
  CHECK_THAT(without.torque(q, qd, kHome, kStill), MatrixNear(error, kRoundingTol));
}

TEST_CASE("controller: computed torque gives the acceleration that is asked for", "[controller]") {
  Model model = wam();
  const ControllerOptions options{.law = ControlLaw::kComputedTorque};
  sim::JointController controller(model, model, options, kHome);
  const VecX<double> q = vector({0.1, 0.5, -0.1, 1.3}), qd = vector({0.1, 0.2, -0.3, 0.4}),
                     faster = vector({0.01, -0.02, 0.01, 0.0});
  const auto acceleration = [&](const VecX<double>& torque) {
    AbaWorkspace<double, double> ws;
    return VecX<double>(
        aba(make_tree(model), VecIn<double>(q), VecIn<double>(qd), VecIn<double>(torque), ws));
  };
  const double w = options.bandwidth, d = 2.0 * options.damping * w;
  const VecX<double> first = w * w * (kHome - q) + d * (kStill - qd);
  CHECK_THAT(acceleration(controller.torque(q, qd, kHome, kStill)), MatrixNear(first, 1e-9));
  // The desired velocity grew within a period of 2 ms.
  CHECK_THAT(acceleration(controller.torque(q, qd, kHome, faster)),
             MatrixNear(VecX<double>(first + d * faster + faster * 500.0), 1e-9));
  controller.start(kHome);  // forgets it
  CHECK_THAT(acceleration(controller.torque(q, qd, kHome, faster)),
             MatrixNear(VecX<double>(first + d * faster), 1e-9));
}

TEST_CASE("controller: limits hold, passive joints get nothing", "[controller]") {
  Model robot = wam();
  robot.links[moving_links(robot)[2]].passive = true;
  sim::JointController controller(wam(), robot, {}, kHome);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const VecX<double> u =
      controller.torque(kHome, kStill, vector({50, 0.6, nan, 1.25}), vector({0, 0, nan, 0}));
  CHECK(u[0] == 150.0);
  CHECK(u[2] == 0.0);
  CHECK(u.allFinite());
  CHECK(controller.saturated());
  controller.torque(kHome, kStill, kHome, kStill);
  CHECK_FALSE(controller.saturated());
}

TEST_CASE("controller: another robot's model is refused", "[controller]") {
  const Model other = read_model(DIFFNEA_SOURCE_DIR "/models/furuta.xml");
  CHECK_THROWS_WITH(sim::JointController(other, wam(), {}, kHome),
                    ContainsSubstring("its joints are not those of the robot"));
  CHECK_THROWS_AS(sim::JointController(wam(), wam(), {.control_rate = 0.0}, kHome), Error);
}

}  // namespace controller_test
