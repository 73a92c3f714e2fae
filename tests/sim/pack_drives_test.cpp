/// Effects with memory in the policy's simulator, against the reference plant with fine steps: the
/// same formulas, another integration, and steps of 2 ms against those that the stiffest spring
/// asks for.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/model_simulator.hpp>
#include <diffnea/sim/record.hpp>

#include "support/add_effect.hpp"

namespace pack_drives_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;
using diffnea::test::add;

namespace {

const std::string kWam = DIFFNEA_SOURCE_DIR "/models/wam4.xml";
const VecX<double> kHome = (VecX<double>(4) << 0.0, 0.6, 0.0, 1.25).finished();

/// A swing of every joint, and a stop: reversals, and a second at rest.
void command(double t, VecX<double>& q, VecX<double>& qd) {
  q = kHome;
  qd.setZero(4);
  if (t >= 1.5) return;
  for (int j = 0; j < 4; ++j) {
    const double pace = 5.0 + j, x = M_PI * t / 1.5, s = std::sin(x);
    q[j] += 0.3 * s * s * std::sin(pace * t);
    qd[j] = 0.3 * (2.0 * s * std::cos(x) * M_PI / 1.5 * std::sin(pace * t) +
                   s * s * pace * std::cos(pace * t));
  }
}

constexpr long kSteps = 1000;  // of 2 ms

/// Joint angles every 2 ms, (kSteps, 4), of lane `lane`.
RowMatX<double> run(Simulator& world, int lane = 0, std::uint64_t seeds = 0) {
  Starts starts{kHome.replicate(1, world.lanes()), {}};
  for (int l = 0; l < world.lanes(); ++l)
    starts.seeds.push_back(seeds + static_cast<std::uint64_t>(l));
  world.reset(starts);
  RowMatX<double> out(kSteps, 4);
  VecX<double> q, qd;
  for (long k = 0; k < kSteps; ++k) {
    command(double(k) * world.period(), q, qd);
    world.step(q.replicate(1, world.lanes()), qd.replicate(1, world.lanes()));
    out.row(k) = world.observe().col(lane).head(4).transpose();
  }
  return out;
}

/// The same of the reference plant, steps of at most 0.1 ms.
RowMatX<double> reference(const Model& model, const Model& controller) {
  Trajectory desired;
  desired.joint_names = joint_names(model);
  desired.time = VecX<double>::LinSpaced(kSteps + 1, 0.0, 2e-3 * kSteps);
  desired.q.resize(kSteps + 1, 4);
  desired.qd = desired.qdd = RowMatX<double>::Zero(kSteps + 1, 4);
  VecX<double> q, qd;
  for (long k = 0; k <= kSteps; ++k) {
    command(desired.time[k], q, qd);
    desired.q.row(k) = q.transpose();
    desired.qd.row(k) = qd.transpose();
  }
  RecordOptions options;
  options.physics_step = 1e-4;
  options.scale_noise(0.0);
  const SimulatedRecording r = record_model(model, controller, desired, options);
  REQUIRE(r.failure.empty());
  return r.recording.q.bottomRows(kSteps);
}

ModelSimulatorOptions without_settling() {
  ModelSimulatorOptions o;
  o.settle_time = 0.0;
  return o;
}

std::string joint(int j) { return "joint" + std::to_string(j); }

/// Rotors of 0.1 kg m² and friction.
Model with_rotors_and_friction(Model model) {
  for (int j = 1; j <= 4; ++j) {
    add(model, "armature", joint(j), {{"armature", 0.1}});
    add(model, "coulomb_friction", joint(j), {{"coulomb", 1.0}});
    add(model, "viscous_friction", joint(j), {{"viscous", 1.0}});
  }
  return model;
}

/// Locked, the links swing at 11, 9, 20 and 29 Hz.
void add_springs(Model& model, double share, double softer = 1.0) {
  const double stiffness[] = {3000.0, 2500.0, 900.0, 1400.0};
  for (int j = 1; j <= 4; ++j)
    add(model, "joint_elasticity", joint(j),
        {{"stiffness", stiffness[j - 1] / softer},
         {"damping", 1.5e-3 * stiffness[j - 1] / softer},
         {"motor_inertia", 0.1},
         {"friction_share", share}});
}

struct Case {
  const char* name;
  double bound;  ///< [rad]
};

Model model_of(const std::string& name, const Model& nominal) {
  Model m = with_rotors_and_friction(nominal);
  const bool all = name == "all";
  if (name == "springs" || all) add_springs(m, 1.0);
  if (name == "springs, friction at links") add_springs(m, 0.0);
  if (name == "springs, friction on both") add_springs(m, 0.4);
  if (name == "part of the rotor")
    add(m, "joint_elasticity", "joint2",
        {{"stiffness", 2500.0}, {"damping", 3.0}, {"motor_inertia", 0.06}});
  if (name == "dahl") add(m, "presliding_dahl", "all", {{"coulomb", 1.5}, {"presliding", 0.01}});
  if (name == "lugre" || all)
    add(m, "presliding_lugre", "all",
        {{"stiffness", 300.0},
         {"damping", 1.0},
         {"coulomb", 1.0},
         {"stiction", 1.4},
         {"stribeck_velocity", 0.1}});
  if (name == "springs and dahl on both") {
    add_springs(m, 0.4);
    add(m, "presliding_dahl", "all", {{"coulomb", 1.5}, {"presliding", 0.01}});
  }
  if (name == "delay" || all) add(m, "actuator_delay", "all", {{"delay", 3.3e-3}});
  if (name == "short delay") add(m, "actuator_delay", "joint2", {{"delay", 0.7e-3}});
  if (name == "lag" || all) add(m, "actuator_lag", "all", {{"time_constant", 4e-3}});
  if (name == "saturation" || all) {
    add(m, "saturation", "joint1", {{"limit", 8.0}});
    add(m, "saturation", "joint2", {{"limit", 14.0}});
  }
  return m;
}

}  // namespace

TEST_CASE("pack drives: joints move as those of the reference plant with fine steps", "[sim]") {
  // The step holds gravity and Coriolis torques for 2 ms; see model_simulator_test.cpp, 0.5 mrad.
  // Springs are of second order: 1 % of a vibration's frequency at 30 Hz.
  const Case c = GENERATE(
      Case{"none", 5e-4}, Case{"springs", 1e-3}, Case{"springs, friction at links", 1e-3},
      Case{"springs, friction on both", 1e-3}, Case{"part of the rotor", 1e-3}, Case{"dahl", 5e-4},
      Case{"lugre", 5e-4}, Case{"springs and dahl on both", 1e-3}, Case{"delay", 5e-4},
      Case{"short delay", 5e-4}, Case{"lag", 5e-4}, Case{"saturation", 1e-3}, Case{"all", 2e-3});
  CAPTURE(c.name);
  const Model nominal = read_model(kWam), model = model_of(c.name, nominal);
  ModelSimulator world({model}, nominal, without_settling());
  const RowMatX<double> truth = reference(model, nominal);
  const double error = (run(world) - truth).cwiseAbs().maxCoeff();
  UNSCOPED_INFO("error " << error);  // 0.15 … 0.36 mrad observed
  CHECK(error < c.bound);
  if (std::string(c.name) == "none") return;
  // What the effect does is far more than the bound.
  const double effect =
      (reference(with_rotors_and_friction(nominal), nominal) - truth).cwiseAbs().maxCoeff();
  UNSCOPED_INFO("effect " << effect);
  CHECK(effect > 2.0 * error);
}

TEST_CASE("pack drives: with shorter steps they approach the reference", "[sim]") {
  const Model nominal = read_model(kWam), model = model_of("all", nominal);
  const RowMatX<double> truth = reference(model, nominal);
  ModelSimulatorOptions o = without_settling();
  ModelSimulator coarse({model}, nominal, o);
  o.arm_step = 2.5e-4;
  ModelSimulator fine({model}, nominal, o);
  const double before = (run(coarse) - truth).cwiseAbs().maxCoeff(),
               after = (run(fine) - truth).cwiseAbs().maxCoeff();
  CAPTURE(before, after);
  CHECK(after < 0.25 * before);  // gravity is of first order: an eighth
}

TEST_CASE("pack drives: stable at 2 ms, whatever is stiff", "[sim]") {
  const Model nominal = read_model(kWam);
  const double stiffness = GENERATE(1e3, 1e4, 1e5, 1e7, 1e10), rotor = GENERATE(1e-4, 0.1, 2.0);
  const double damping = GENERATE(0.02, 3.0);  // of the motor against its spring
  const double presliding = GENERATE(1e-7, 1e-3);
  CAPTURE(stiffness, rotor, damping, presliding);
  Model model = nominal;
  for (int j = 1; j <= 4; ++j) {
    add(model, "armature", joint(j), {{"armature", rotor}});
    add(model, "viscous_friction", joint(j), {{"viscous", 3.0}});
    add(model, "joint_elasticity", joint(j),
        {{"stiffness", stiffness},
         {"damping", 2.0 * damping * std::sqrt(stiffness * rotor) + 5.0},
         {"motor_inertia", rotor},
         {"friction_share", 0.5}});
  }
  add(model, "presliding_dahl", "all", {{"coulomb", 2.0}, {"presliding", presliding}});
  add(model, "presliding_lugre", "all",
      {{"stiffness", 1.0 / presliding},
       {"damping", 1e-3 / presliding},
       {"coulomb", 1.0},
       {"stiction", 3.0},
       {"stribeck_velocity", 1e-3}});
  add(model, "actuator_lag", "all", {{"time_constant", 1e-7}});
  ModelSimulator world({model}, nominal);
  const RowMatX<double> q = run(world);
  REQUIRE(q.allFinite());
  VecX<double> desired, rate;
  double most = 0.0;
  for (long k = 0; k < kSteps; ++k) {
    command(2e-3 * double(k), desired, rate);
    most = std::max(most, (q.row(k).transpose() - desired).cwiseAbs().maxCoeff());
  }
  CHECK(most < 0.5);  // it follows; what is unstable is gone within a second
  // The motion is over: nothing rings from step to step.
  const RowMatX<double> late = q.bottomRows(102);
  const double ringing = (late.topRows(100) - 2.0 * late.middleRows(1, 100) + late.bottomRows(100))
                             .cwiseAbs()
                             .maxCoeff();
  UNSCOPED_INFO("ringing " << ringing);
  // Bristles that yield within a fraction of a step are a relay: what predicts the velocity is
  // a step old, and it chatters, by less than 0.1 rad/s.
  CHECK(ringing < (presliding < 1e-6 ? 2e-4 : 1e-5));
}

TEST_CASE("pack drives: a spring that is stiff is none", "[sim]") {
  const Model nominal = read_model(kWam), rigid = with_rotors_and_friction(nominal);
  Model stiff = rigid;
  for (int j = 1; j <= 4; ++j)
    add(stiff, "joint_elasticity", joint(j), {{"stiffness", 1e9}, {"motor_inertia", 0.1}});
  ModelSimulator with({stiff}, nominal), without({rigid}, nominal);
  // Friction is that of the same speeds; what is left is a nanoradian of wind-up, and rounding.
  CHECK((run(with) - run(without)).cwiseAbs().maxCoeff() < 1e-6);
}

TEST_CASE("pack drives: a lane has the numbers of its draw, in every instruction set", "[sim]") {
  const Model nominal = read_model(kWam);
  std::vector<Model> draws;
  for (int k = 0; k < 3; ++k) {
    Model m = with_rotors_and_friction(nominal);
    add_springs(m, 0.5 * k, 1.0 + 0.3 * k);
    add(m, "presliding_dahl", "all", {{"coulomb", 1.0 + k}, {"presliding", 0.01 * (k + 1)}});
    add(m, "actuator_delay", "all", {{"delay", 1.7e-3 * k}});
    add(m, "actuator_lag", "all", {{"time_constant", 1e-3 * k}});
    add(m, "saturation", "joint2", {{"limit", 12.0 + 3.0 * k}});
    draws.push_back(m);
  }
  std::vector<RowMatX<double>> alone;
  for (std::uint64_t k = 0; k < draws.size(); ++k) {
    ModelSimulator world(draws, nominal);
    Starts s{kHome, {k}};
    world.reset(s);
    alone.push_back(run(world, 0, k));
  }
  CHECK((alone[0] - alone[1]).cwiseAbs().maxCoeff() > 1e-3);
  CHECK((alone[1] - alone[2]).cwiseAbs().maxCoeff() > 1e-3);
  for (const std::string& isa : batch_instruction_sets()) {
    CAPTURE(isa);
    ModelSimulatorOptions options;
    options.instruction_set = isa;
    ModelSimulator world(draws, nominal, options);
    const std::unique_ptr<Simulator> other = world.clone();
    for (int lane = 0; lane < std::min(world.lanes(), 3); ++lane) {
      const RowMatX<double> together = run(world, lane);
      CHECK(together == run(*other, lane));
      const double apart = (together - alone[static_cast<std::size_t>(lane)]).cwiseAbs().maxCoeff();
      if (isa == batch_instruction_sets().front())
        CHECK(apart == 0.0);
      else
        CHECK(apart < 1e-6);  // fused or not: rounding alone, grown by two seconds
    }
  }
}

TEST_CASE("pack drives: what is left is refused by name", "[sim]") {
  const Model nominal = read_model(kWam);
  for (const std::string effect : {"backlash", "encoder_offset", "load_friction"}) {
    Model model = nominal;
    add(model, effect, "joint2", {});
    CHECK_THROWS_WITH(ModelSimulator({model}, nominal), ContainsSubstring(effect));
  }
  Model read_at_motor = nominal;
  add(read_at_motor, "joint_elasticity", "joint2", {{"motor_inertia", 0.1}, {"encoder_side", 1.0}});
  CHECK_THROWS_WITH(ModelSimulator({read_at_motor}, nominal), ContainsSubstring("encoders"));
  Model twice = nominal;
  for (int k = 0; k < 2; ++k)
    add(twice, "joint_elasticity", "joint2", {{"stiffness", 1e3}, {"motor_inertia", 0.1}});
  CHECK_THROWS_WITH(ModelSimulator({twice}, nominal), ContainsSubstring("one elasticity a joint"));
  Model late = nominal;
  add(late, "actuator_delay", "all", {{"delay", 1e7}});
  CHECK_THROWS_WITH(ModelSimulator({late}, nominal), ContainsSubstring("expected at most 10 s"));
}

}  // namespace pack_drives_test
