/// Effects that are added as docs/extend/effect.md says, a header and two lines: one with memory
/// (docs/examples/cpp/maxwell_element.hpp) and one that changes the tree, in every part that
/// computes with effects. Truth is the element's linear differential equation, solved in closed
/// form or by the exponential of its matrix.

#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/effects/series.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/model_simulator.hpp>
#include <diffnea/sim/mujoco_world.hpp>

#include "sim/model_plant.hpp"

namespace diffnea::added_effect_test {
namespace {

constexpr double kStiffness = 40.0, kTime = 0.25;

EffectSpec maxwell(const std::string& joint) {
  return {
      "maxwell_element", joint, {{"stiffness", kStiffness, ""}, {"relaxation_time", kTime, ""}}};
}

/// A cart of 2 kg on a rail, nothing else.
Model rail() {
  Model m;
  m.name = "rail";
  m.gravity = {0, 0, 0};
  ModelLink cart;
  cart.name = "cart";
  cart.joint = "slide";
  cart.type = ModelJoint::kPrismatic;
  cart.axis = {1, 0, 0};
  cart.inertia.m = 2.0;
  m.links = {cart};
  return m;
}

Model wam() { return read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml"); }

RecordOptions quiet() {
  RecordOptions o;
  o.scale_noise(0.0);
  return o;
}

/// Two periods of a motion of all joints.
Trajectory motion(const Model& model, unsigned seed, double period = 4.0) {
  FourierOptions f;
  f.period = period;
  f.duration = 2.0 * period;
  f.seed = seed;
  return random_fourier(model, f);
}

}  // namespace

TEST_CASE("added effect: the catalogue has it, and its units", "[added]") {
  const BoundEffect e = bind(maxwell("slide"), rail());
  CHECK(e.info().name == "maxwell_element");
  CHECK(e.parameter_info[0].unit == "N/m");
  CHECK(known_effect("link_extension") != nullptr);
  CHECK(std::ranges::is_sorted(catalogue(), {}, &EffectInfo::name));
}

TEST_CASE("added effect: torque over a swing is the closed form", "[added]") {
  const double A = 0.3, w = 7.0, a = 1.0 / kTime;
  JointSeries x;
  x.dt = 2e-3;
  const long n = 1500;
  x.q.resize(n, 1), x.qd.resize(n, 1), x.qdd.resize(n, 1);
  VecX<double> tau(n);
  for (long k = 0; k < n; ++k) {
    const double t = x.dt * static_cast<double>(k);
    x.q(k, 0) = A * std::sin(w * t);
    x.qd(k, 0) = A * w * std::cos(w * t);
    x.qdd(k, 0) = -A * w * w * std::sin(w * t);
    // ż = q̇ − a z from 0.
    tau[k] = kStiffness * A * w / (a * a + w * w) *
             (a * std::cos(w * t) + w * std::sin(w * t) - a * std::exp(-a * t));
  }
  const Model model = rail();
  const BoundEffect e = bind(maxwell("slide"), model);
  const Tree<double> tree = make_tree(model);
  const VecX<double> ours = series_torque(e, tree, x, e.parameters.data()).col(0);
  // The velocity is straight between rows: (w dt)²/12 of it, 2e-5.
  CHECK((ours - tau).cwiseAbs().maxCoeff() < 5e-5 * tau.cwiseAbs().maxCoeff());
  const std::vector<RowMatX<double>> columns =
      series_columns(e, tree, x, e.parameters.data(), {0, 1});
  CHECK((kStiffness * columns[0].col(0) - ours).cwiseAbs().maxCoeff() < 1e-12 * kStiffness);
  // ∂τ/∂ln T = −a ∂τ/∂a, of the formula above.
  for (long k = 0; k < n; k += 50) {
    const double t = x.dt * static_cast<double>(k), d = a * a + w * w;
    const double bracket = a * std::cos(w * t) + w * std::sin(w * t) - a * std::exp(-a * t);
    const double slope =
        kStiffness * A * w *
        ((std::cos(w * t) - (1.0 - a * t) * std::exp(-a * t)) / d - 2.0 * a * bracket / (d * d));
    CHECK(std::abs(columns[1](k, 0) + a * slope) < 2e-4 * kStiffness * A);
  }
}

TEST_CASE("added effect: a pushed cart moves as the exponential of its matrix says", "[added]") {
  Model model = rail();
  model.effects.push_back(maxwell("slide"));
  RecordOptions o = quiet();
  o.control_rate = 500.0;
  o.physics_step = 2e-4;
  sim::ModelPlant plant(model, o);
  plant.reset(VecX<double>::Zero(1));
  const double force = 3.0, period = 1.0 / o.control_rate;
  // (q, q̇, z, 1): m q̈ = F − k z, ż = q̇ − z/T.
  Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
  A(0, 1) = 1.0;
  A(1, 2) = -kStiffness / 2.0;
  A(1, 3) = force / 2.0;
  A(2, 1) = 1.0;
  A(2, 2) = -1.0 / kTime;
  const Eigen::Matrix4d step = (A * period).exp();
  Eigen::Vector4d x(0.0, 0.0, 0.0, 1.0);
  double worst = 0.0;
  for (int k = 0; k < 1000; ++k) {
    REQUIRE(plant.step(VecX<double>::Constant(1, force)) == "");
    x = step * x;
    worst = std::max(worst, std::abs(plant.q()[0] - x[0]));
  }
  CAPTURE(worst, x[0]);
  CHECK(x[0] > 0.3);    // it creeps: without the element's relaxation it would stop at F/k
  CHECK(worst < 1e-6);  // [m]; the velocity is constant within a fifth of a millisecond
}

TEST_CASE("added effect: MuJoCo and packs of worlds move as the model does", "[added]") {
  const Model nominal = wam();
  Model robot = nominal;
  for (const char* joint : {"joint2", "joint4"}) robot.effects.push_back(maxwell(joint));
  const Trajectory t = motion(nominal, 3, 2.0);
  RecordOptions o = quiet();
  o.physics_step = 2.5e-4;
  const Recording ours = record_model(robot, nominal, t, o).recording;
  const Recording without = record_model(nominal, nominal, t, o).recording;
  const std::string path = DIFFNEA_SOURCE_DIR "/models/wam4.xml";
  const Recording theirs = record_in_mujoco(read_mjcf(path), robot, nominal, t, o).recording;
  const double effect = (ours.q - without.q).cwiseAbs().maxCoeff();
  CHECK(effect > 5e-3);
  const double off = (ours.q - theirs.q).cwiseAbs().maxCoeff();
  CAPTURE(effect, off);
  CHECK(off < 1e-3);  // [rad], as in simulate_effects_test.cpp

  ModelSimulatorOptions options;
  options.settle_time = 0.0;
  ModelSimulator world({robot}, nominal, options);
  const VecX<double> home = t.q.row(0).transpose();
  Starts starts{home.replicate(1, world.lanes()), {}};
  for (int l = 0; l < world.lanes(); ++l) starts.seeds.push_back(0);
  world.reset(starts);
  double pack_off = 0.0;
  for (long k = 0; k + 1 < ours.rows(); ++k) {
    const long row = std::min(std::lround(ours.time[k] / (t.time[1] - t.time[0])), t.rows() - 1);
    world.step(t.q.row(row).transpose().replicate(1, world.lanes()),
               t.qd.row(row).transpose().replicate(1, world.lanes()));
    pack_off = std::max(
        pack_off,
        (world.observe().col(0).head(4) - ours.q.row(k + 1).transpose()).cwiseAbs().maxCoeff());
  }
  CAPTURE(pack_off);
  CHECK(pack_off < 1e-3);  // [rad], as in pack_drives_test.cpp
}

TEST_CASE("added effect: a diagnosis names it, with its numbers", "[added]") {
  const Model nominal = wam();
  Model robot = nominal;
  robot.effects.push_back(maxwell("joint2"));
  const auto record = [&](unsigned seed) {
    RecordOptions o;
    o.seed = seed;
    o.period = 10.0;
    return record_model(robot, nominal, motion(nominal, seed, o.period), o).recording;
  };
  int alone = 0;
  for (const unsigned seed : {1u, 3u, 5u, 7u}) {
    CAPTURE(seed);
    const Finding finding = diagnose(nominal, {record(seed)}, {record(seed + 1)});
    CAPTURE(finding.sentence);
    const auto cause = std::ranges::find(finding.causes, "maxwell_element", &Cause::effect);
    REQUIRE(cause != finding.causes.end());
    CHECK(cause->where == "joint2");
    // In slow motion its dashpot is a viscous friction, which then may stand beside it.
    CHECK(finding.causes.size() <= 2);
    if (finding.causes.size() > 1) continue;
    ++alone;
    CHECK(std::abs(cause->parameters.at(0).value - kStiffness) < 0.1 * kStiffness);
    CHECK(std::abs(cause->parameters.at(1).value - kTime) < 0.1 * kTime);
  }
  CHECK(alone >= 2);
}

TEST_CASE("added effect: what changes the tree is identified", "[added]") {
  const Model nominal = wam();
  const double length = 0.03;
  Model robot = nominal;
  robot.effects.push_back({"link_extension", "joint4", {{"length", length, ""}}});
  const auto record = [&](unsigned seed) {
    return record_model(robot, nominal, motion(nominal, seed), quiet()).recording;
  };
  IdentifyOptions options;
  options.choice.effects = {"viscous_friction", "link_extension@joint4"};
  options.choice.fit = {"effects", "shapes"};
  const IdentifyResult result = identify(nominal, {record(1)}, {record(2)}, options);
  const auto fitted = std::ranges::find(result.parameters, "joint4.link_extension.length",
                                        &ParameterEstimate::name);
  REQUIRE(fitted != result.parameters.end());
  CHECK(std::abs(fitted->value - length) < 1e-3);  // [m]
}

}  // namespace diffnea::added_effect_test
