/// An elastic joint against MuJoCo, where motor and link are bodies of their own with a tendon
/// between them, and friction on either.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include "sim/model_plant.hpp"
#include "sim/mujoco_model.hpp"
#include "support/mujoco_tree.hpp"

namespace elasticity_mujoco_test {

using namespace diffnea;

namespace {

constexpr double kStiffness = 60.0, kDamping = 0.3, kRotor = 0.05, kViscous = 1.5;
constexpr double kPeriod = 2e-3, kStep = 2.5e-4;  // [s]

/// Two integrations of order four of one equation, three turns of the spring's period apart: 1e-8
/// rad observed.
constexpr double kSame = 1e-6;

double torque_at(double t) { return 4.0 * std::sin(9.0 * t) + 3.0 * std::sin(21.0 * t); }

/// A pendulum of 2 kg; its drive's rotor beside it, which nothing else holds.
std::string mjcf(double share) {
  return "<mujoco><compiler angle='radian'/><option timestep='" + test::numbers({kStep}) +
         "' integrator='RK4'/><worldbody><body><joint name='link' axis='0 1 0' damping='" +
         test::numbers({(1.0 - share) * kViscous}) +
         "'/><inertial pos='0 0 -0.3' mass='2' diaginertia='0.02 0.02 0.02'/></body>"
         "<body><joint name='motor' axis='0 1 0' armature='" +
         test::numbers({kRotor}) + "' damping='" + test::numbers({share * kViscous}) +
         "'/><inertial pos='0 0 0' mass='1e-9' diaginertia='1e-12 1e-12 1e-12'/></body></worldbody>"
         "<tendon><fixed stiffness='" +
         test::numbers({kStiffness}) + "' damping='" + test::numbers({kDamping}) +
         "'><joint joint='motor' coef='1'/><joint joint='link' coef='-1'/></fixed></tendon>"
         "</mujoco>";
}

Model pendulum(double share, bool at_motor) {
  Model m;
  m.name = "pendulum";
  m.gravity = {0.0, 0.0, -9.81};
  ModelLink link;
  link.name = "rod";
  link.joint = "link";
  link.type = ModelJoint::kRevolute;
  link.axis = {0.0, 1.0, 0.0};
  link.inertia = inertia_from_com<double>(2.0, {0.0, 0.0, -0.3}, {0.02, 0.0, 0.0, 0.02, 0.0, 0.02});
  m.links = {link};
  m.effects = {{"armature", "link", {{"armature", kRotor, ""}}},
               {"viscous_friction", "link", {{"viscous", kViscous, ""}}},
               {"joint_elasticity",
                "link",
                {{"stiffness", kStiffness, ""},
                 {"damping", kDamping, ""},
                 {"motor_inertia", kRotor, ""},
                 {"friction_share", share, ""},
                 {"encoder_side", at_motor ? 1.0 : 0.0, ""}}}};
  return m;
}

/// Positions of the link, or of its motor, every period over 2 s.
VecX<double> simulated(double share, bool at_motor) {
  RecordOptions options;
  options.control_rate = 1.0 / kPeriod;
  options.physics_step = kStep;
  sim::ModelPlant plant(pendulum(share, at_motor), options);
  plant.reset(VecX<double>::Zero(1));
  VecX<double> out(1000);
  for (long k = 0; k < out.size(); ++k) {
    REQUIRE(plant.step(VecX<double>::Constant(1, torque_at(kPeriod * static_cast<double>(k)))) ==
            "");
    out[k] = plant.q()[0];
  }
  return out;
}

}  // namespace

TEST_CASE("joint_elasticity: motor and link move as two bodies in MuJoCo, friction on either",
          "[sim][mujoco]") {
  const double share = GENERATE(0.0, 0.4, 1.0);
  CAPTURE(share);
  sim::MujocoFiles files;
  const sim::MujocoModel model = sim::compile_mujoco(mjcf(share), files, "elasticity");
  const sim::MujocoData data(mj_makeData(model.get()));
  VecX<double> theirs(1000), motor(1000);
  for (long k = 0; k < theirs.size(); ++k) {
    data->qfrc_applied[1] = torque_at(kPeriod * static_cast<double>(k));
    for (int i = 0; i < std::lround(kPeriod / kStep); ++i) mj_step(model.get(), data.get());
    theirs[k] = data->qpos[0];
    motor[k] = data->qpos[1];
  }
  CHECK((simulated(share, false) - theirs).cwiseAbs().maxCoeff() < kSame);
  CHECK((simulated(share, true) - motor).cwiseAbs().maxCoeff() < kSame);
  CHECK((motor - theirs).cwiseAbs().maxCoeff() > 1e4 * kSame);
  CHECK((simulated(share > 0.5 ? 0.0 : 1.0, false) - theirs).cwiseAbs().maxCoeff() > 1e4 * kSame);
}

}  // namespace elasticity_mujoco_test
