/// Position servos as actuators of MuJoCo: a simulation there moves as the servo's law says.

#include <cmath>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <mujoco/mujoco.h>

#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>

#include "sim/mujoco_model.hpp"
#include "support/temporary_folder.hpp"

namespace mjcf_servo_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Approx;

namespace {

constexpr double kMass = 0.5, kCom = 0.1, kInertia = 0.001, kRotor = 0.02, kGravity = 9.81;
constexpr double kStiffness = 9.0, kDamping = 0.4, kReach = 0.2, kCommand = 0.9, kOffset = 0.3;

/// A pendulum that swings about y, with a servo.
/// @param derivative  time of what of the damping is within the reach [s]
Model bench(double reach, double derivative = 0.0) {
  Model m;
  m.name = "bench";
  ModelLink link;
  link.name = "arm";
  link.joint = "servo";
  link.type = ModelJoint::kRevolute;
  link.axis = {0, 1, 0};
  link.inertia =
      inertia_from_com<double>(kMass, {0, 0, -kCom}, {kInertia, 0, 0, kInertia, 0, kInertia});
  m.links.push_back(link);
  m.effects = {{"armature", "servo", {{"armature", kRotor, "kg*m^2"}}},
               {"viscous_friction", "servo", {{"viscous", 0.1, "N*m*s/rad"}}},
               {"position_servo",
                "servo",
                {{"stiffness", kStiffness, "N*m/rad"},
                 {"damping", kDamping, "N*m*s/rad"},
                 {"delay", 0.02, "s"},
                 {"reach", reach, "rad"},
                 {"derivative_time", derivative, "s"}}},
               {"torque_offset", "servo", {{"offset", kOffset, "N*m"}}}};
  return m;
}

/// Where the servo has led the pendulum half a second after a step of its command.
double swung(double reach, double derivative = 0.0) {
  constexpr double kStep = 1e-5;
  double q = 0.0, v = 0.0;
  for (int k = 0; k < 50'000; ++k) {
    const double error = std::clamp(kCommand - q - derivative * v, -reach, reach);
    const double tau = kStiffness * error - kOffset -
                       (kDamping - kStiffness * derivative + 0.1) * v -
                       kMass * kGravity * kCom * std::sin(q);
    v += kStep * tau / (kInertia + kMass * kCom * kCom + kRotor);
    q += kStep * v;
  }
  return q;
}

double simulated(const std::filesystem::path& file) {
  char error[500] = "";
  const sim::MujocoModel m(mj_loadXML(file.string().c_str(), nullptr, error, sizeof error));
  INFO(error);
  REQUIRE(m);
  REQUIRE(m->nu == 1);
  m->opt.timestep = 1e-4;
  mjData* d = mj_makeData(m.get());
  d->ctrl[0] = kCommand;
  for (int k = 0; k < 5'000; ++k) mj_step(m.get(), d);
  const double q = d->qpos[0];
  mj_deleteData(d);
  return q;
}

/// An MJCF of the same robot whose class and actuators say something else.
std::string document(const std::string& actuator) {
  return "<mujoco><compiler angle='radian'/><default><position kp='3' forcerange='-1 1'/></default>"
         "<worldbody><body name='arm'><inertial pos='0 0 -.1' mass='.5' "
         "diaginertia='.001 .001 .001'/><joint name='servo' axis='0 1 0' damping='.7'/>"
         "<geom size='.01'/></body></worldbody><actuator>" +
         actuator + "</actuator></mujoco>";
}

}  // namespace

TEST_CASE("servo: MuJoCo's actuator moves as the law says", "[io][mujoco]") {
  const double reach = GENERATE(kReach, 1e3), derivative = GENERATE(0.0, 0.03);
  CAPTURE(reach, derivative);
  const TemporaryFolder folder;
  const std::vector<std::string> lost =
      write_model(bench(reach, derivative), folder.path() / "bench.xml");
  CHECK(std::ranges::find(lost, "delay of the position servo at servo = 0.02") != lost.end());
  CHECK(lost.size() == 1);
  // Euler's steps of 0.1 ms are off by about their length times the rate of 10 rad/s.
  CHECK(simulated(folder.path() / "bench.xml") == Approx(swung(reach, derivative)).epsilon(2e-3));
  const Model again = read_model(folder.path() / "bench.xml");
  REQUIRE(again.links[0].servo);
  CHECK(again.links[0].servo->kp == kStiffness);
}

TEST_CASE("servo: the drive that a file has comes back", "[io][mujoco]") {
  Model model = bench(kReach);
  model.effects.clear();
  model.links[0].servo = ServoGains{7.0, 0.3};
  model.links[0].limits.effort = 2.0;
  const TemporaryFolder folder;
  for (const char* name : {"bench.xml", "bench.json"}) {
    CAPTURE(name);
    write_model(model, folder.path() / name);
    const ModelLink link = read_model(folder.path() / name).links[0];
    REQUIRE(link.servo);
    CHECK(link.servo->kp == 7.0);
    CHECK(link.servo->kd == 0.3);
    CHECK(link.limits.effort == 2.0);
  }
}

TEST_CASE("servo: an actuator in place becomes the servo", "[io][mujoco]") {
  const std::string actuator = GENERATE("<position name='drive' joint='servo' kp='2'/>",
                                        "<motor name='drive' joint='servo' ctrlrange='-2 2'/>", "");
  CAPTURE(actuator);
  const double reach = GENERATE(kReach, 1e3);
  const TemporaryFolder folder;
  write_file_atomically(folder.path() / "in.xml", document(actuator));
  Model model = read_model(folder.path() / "in.xml");
  model.effects = bench(reach).effects;
  write_model(model, folder.path() / "out.xml");
  CHECK(simulated(folder.path() / "out.xml") == Approx(swung(reach)).epsilon(2e-3));
}

TEST_CASE("servo: dry friction holds in MuJoCo, unless the file says how it does", "[io][mujoco]") {
  const std::string own = GENERATE("", " solreffriction='0.05 1'");
  const TemporaryFolder folder;
  std::string text = document("");
  text.insert(text.find(" axis="), own);
  write_file_atomically(folder.path() / "in.xml", text);
  Model model = read_model(folder.path() / "in.xml");
  model.effects = bench(kReach).effects;
  model.effects.push_back({"coulomb_friction", "servo", {{"coulomb", 3.0, "N*m"}}});
  write_model(model, folder.path() / "out.xml");
  const sim::MujocoModel m(
      mj_loadXML((folder.path() / "out.xml").string().c_str(), nullptr, nullptr, 0));
  REQUIRE(m);
  CHECK(m->dof_frictionloss[0] == 3.0);
  CHECK(m->dof_solref[0] == (own.empty() ? 0.002 : 0.05));
}

}  // namespace mjcf_servo_test
