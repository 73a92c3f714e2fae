/// What winds up the spring of a joint.

#include <cmath>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/effects/series.hpp>
#include <diffnea/io/model_file.hpp>

#include "support/matrix_near.hpp"

namespace spring_load_test {

using namespace diffnea;
using namespace diffnea::test;

TEST_CASE("series: a force on the tip winds up the springs of all joints before it", "[effects]") {
  Model model = read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml");
  model.effects.clear();
  const ExtendedTree bare = extend(model);
  JointSeries x;
  x.dt = 0.002;
  constexpr long kRows = 500;
  x.q.resize(kRows, 4);
  x.qd = x.qdd = x.tau = x.q;
  for (long i = 0; i < kRows; ++i)
    for (long j = 0; j < 4; ++j) {
      const double w = 5.0 + 2.0 * static_cast<double>(j),
                   a = w * x.dt * static_cast<double>(i) + static_cast<double>(j);
      x.q(i, j) = 0.6 * std::sin(a);
      x.qd(i, j) = 0.6 * w * std::cos(a);
      x.qdd(i, j) = -w * w * x.q(i, j);
      x.tau(i, j) = 3.0 * std::cos(a);
    }
  x.total = x.logged = x.tau;
  model.effects = {
      {"tip_force", "tip", {{"force_x", 10.0, ""}, {"force_y", -6.0, ""}, {"force_z", 20.0, ""}}}};
  const ExtendedTree pulled = extend(model);
  JointSeries carried = x;  // the same pull, as part of what the links transmit
  carried.tau +=
      inverse_dynamics(pulled, x.q, x.qd, x.qdd) - inverse_dynamics(bare, x.q, x.qd, x.qdd);
  for (const char* joint : {"joint1", "joint2", "joint4"}) {
    CAPTURE(joint);
    const BoundEffect spring = bind(
        {"joint_elasticity", joint, {{"stiffness", 800.0, ""}, {"motor_inertia", 0.1, ""}}}, model);
    const double* p = spring.parameters.data();
    const RowMatX<double> torque = series_torque(spring, pulled, x, p);
    // Sums in another order, differentiated twice: 1e-16 / dt² of torques of 10 N·m.
    CHECK_THAT(torque, MatrixNear(series_torque(spring, bare, carried, p), 1e-8));
    CHECK((torque - series_torque(spring, bare, x, p)).cwiseAbs().maxCoeff() > 1e-3);
  }
}

}  // namespace spring_load_test
