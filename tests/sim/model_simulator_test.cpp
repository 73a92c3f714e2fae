/// The identified model as a world of its own: against Runge–Kutta, and lane by lane.

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/model_simulator.hpp>
#include <diffnea/sim/record.hpp>

#include "support/matrix_near.hpp"
#include "support/swinging_wam.hpp"

namespace model_simulator_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

Model with_friction(Model model) {
  for (int j = 1; j <= 4; ++j) {
    const std::string joint = "joint" + std::to_string(j);
    model.effects.push_back({"coulomb_friction", joint, {{"coulomb", 1.0, "N*m"}}});
    model.effects.push_back({"viscous_friction", joint, {{"viscous", 0.8, "N*m*s/rad"}}});
    model.effects.push_back({"torque_offset", joint, {{"offset", 0.2, "N*m"}}});
  }
  return model;
}

}  // namespace

TEST_CASE("model simulator: the arm moves as Runge-Kutta with small steps moves it", "[sim]") {
  const Model nominal = read_model(kWam);
  Model model = with_friction(nominal);
  model.ball.reset();
  const Swing swing{0.4, 7.0};
  ModelSimulatorOptions options;
  options.settle_time = 0.0;
  ModelSimulator world({model}, nominal, options);
  const std::vector<Lanes> seen = run(world, {swing}, 2.0);

  Trajectory desired;
  desired.joint_names = world.joints();
  const long rows = 1001;
  desired.time = VecX<double>::LinSpaced(rows, 0.0, 2.0);
  desired.q.resize(rows, 4);
  desired.qd = desired.qdd = RowMatX<double>::Zero(rows, 4);
  for (long k = 0; k < rows; ++k) {
    Lanes q(4, 1), qd(4, 1);
    command(swing, desired.time[k], 0, q, qd);
    desired.q.row(k) = q.col(0).transpose();
    desired.qd.row(k) = qd.col(0).transpose();
  }
  RecordOptions record;
  record.scale_noise(0.0);
  const SimulatedRecording truth = record_model(model, nominal, desired, record);
  REQUIRE(truth.failure.empty());
  double error = 0.0;
  for (std::size_t k = 0; k < seen.size(); ++k)
    error = std::max(error, (seen[k].col(0).head(4).transpose() -
                             truth.recording.q.row(10 * static_cast<long>(k) + 10))
                                .cwiseAbs()
                                .maxCoeff());
  CAPTURE(error);
  // Gravity and Coriolis torques are those of the step's beginning: 1 ms late of what changes by
  // 100 N·m/s against gains of 100 N·m/rad; 0.3 mm at the cup.
  CHECK(error < 5e-4);
}

TEST_CASE("model simulator: a lane does what it does alone, and in every instruction set",
          "[sim]") {
  const Model nominal = read_model(kWam);
  Model model = with_friction(nominal);
  model.effects.push_back({"linear_drag", "ball", {{"drag", 0.05, "1/s"}}});
  model.effects.push_back({"string_mass", "string", {{"mass_ratio", 0.05, "1"}}});
  std::vector<Swing> swings;
  for (int k = 0; k < 8; ++k) swings.push_back({0.1 + 0.05 * k, 6.0 + 0.5 * k});
  std::vector<Lanes> reference;
  for (const Swing& swing : swings) {
    ModelSimulator world({model}, nominal);
    const std::vector<Lanes> alone = run(world, {swing}, 1.0);
    reference.push_back(alone.back());
  }
  for (const std::string& isa : batch_instruction_sets()) {
    CAPTURE(isa);
    ModelSimulatorOptions options;
    options.instruction_set = isa;
    ModelSimulator world({model}, nominal, options);
    const int lanes = world.lanes();
    for (std::size_t begin = 0; begin < swings.size(); begin += static_cast<std::size_t>(lanes)) {
      const std::size_t end = std::min(begin + static_cast<std::size_t>(lanes), swings.size());
      const std::vector<Swing> some(swings.begin() + begin, swings.begin() + end);
      const std::unique_ptr<Simulator> other = world.clone();
      const Lanes together = run(world, some, 1.0).back(), again = run(*other, some, 1.0).back();
      CHECK(together == again);
      for (std::size_t l = 0; l < some.size(); ++l) {
        if (isa == batch_instruction_sets().front())
          CHECK(together.col(l) == reference[begin + l].col(0));
        else  // fused or not: rounding alone, grown by a second of motion and impacts
          CHECK((together.col(l) - reference[begin + l].col(0)).cwiseAbs().maxCoeff() < 1e-6);
      }
    }
  }
}

TEST_CASE("model simulator: the string pulls on the arm", "[sim]") {
  const Model model = read_model(kWam);
  Model light = model;
  light.ball->mass = 1e-9;
  ModelSimulator heavy_world({model}, model), light_world({light}, model);
  const int cup = find_channel(heavy_world, "cup_x");
  const auto at_cup = [&](Simulator& world) {
    std::vector<Lanes> out = run(world, {{0.4, 7.0}}, 1.5);
    for (Lanes& seen : out) seen = seen.middleRows(cup, 3).eval();
    return out;
  };
  const std::vector<Lanes> with = at_cup(heavy_world), without = at_cup(light_world);
  double most = 0.0;
  for (std::size_t k = 0; k < with.size(); ++k)
    most = std::max(most, (with[k] - without[k]).norm());
  CAPTURE(most);
  // 24 g at some g, a metre from the shoulder, against 500 N·m/rad: 11 mm (observed), half as much
  // either way for another loop.
  CHECK(most > 5.5e-3);
  CHECK(most < 1.7e-2);
}

TEST_CASE("model simulator: a world takes the parameters that its seed says", "[sim]") {
  Model a = read_model(kWam), b = a;
  b.ball->string->length = 0.35;
  ModelSimulator world({a, b}, a);
  Starts s = starts(2);
  s.seeds = {1, 4};
  world.reset(s);
  const int ball = find_channel(world, "ball_z"), cup = find_channel(world, "cup_z");
  const Lanes& seen = world.observe();
  CHECK(std::abs(seen(cup, 0) - seen(ball, 0) - 0.35) < 1e-12);
  CHECK(std::abs(seen(cup, 1) - seen(ball, 1) - 0.40) < 1e-12);
}

TEST_CASE("model simulator: a torque over another joint's speed is no friction", "[sim]") {
  // Axes at right angles through the centres of mass: nothing else couples the two.
  const Model bare = model_from_json(R"({"schema": "diffnea/model/1", "name": "two", "links": [
      {"name": "A", "joint": {"name": "a", "type": "revolute", "axis": [0, 0, 1]},
       "inertia": {"mass": 1, "com": [0, 0, 0], "about_com": [0.5, 0, 0, 0.5, 0, 0.5]}},
      {"name": "B", "parent": "A", "joint": {"name": "b", "type": "revolute", "axis": [1, 0, 0]},
       "inertia": {"mass": 1, "com": [0, 0, 0], "about_com": [0.01, 0, 0, 0.01, 0, 0.01]}}]})",
                                     "two.json");
  ModelSimulatorOptions options;
  options.controller.kp = Eigen::Vector2d{200.0, 25.0};
  options.controller.kd = Eigen::Vector2d{20.0, 1.0};
  const auto pushed = [&](double torque) {
    Model model = bare;
    model.effects.push_back({"residual",
                             "a",
                             {{"scale", 1.0, "1"}},
                             BumpTable{{"qd_b"}, {1.0}, {0.4}, {torque}, std::abs(torque)}});
    ModelSimulator world({model}, bare, options);
    world.reset({Lanes::Zero(2, 1), {0}});
    VecX<double> out(300);
    for (long k = 0; k < out.size(); ++k) {
      const double t = static_cast<double>(k) * world.period();
      Lanes q = Lanes::Zero(2, world.lanes()), qd = q;
      q.row(1).setConstant(0.2 * (1.0 - std::cos(5.0 * t)));
      qd.row(1).setConstant(std::sin(5.0 * t));
      world.step(q, qd);
      out[k] = world.observe()(0, 0);
    }
    return out;
  };
  const VecX<double> one = pushed(2.0), other = pushed(-2.0);
  CHECK(one.cwiseAbs().maxCoeff() > 5e-3);  // 2 N·m against 200 N·m/rad
  CHECK_THAT(MatX<double>(one), MatrixNear(MatX<double>(-other), 1e-12));
}

TEST_CASE("model simulator: gains that are not given are those of the start", "[sim]") {
  const Model model = read_model(kWam);
  ModelSimulatorOptions options;
  options.controller.kp = joint_gains(model, options.controller, kHome).kp;
  const auto after = [&](const ModelSimulatorOptions& o) {
    ModelSimulator world({model}, model, o);
    return run(world, {{0.4, 7.0}}, 0.5).back();
  };
  const Lanes derived = after(options);
  options.controller.kd = joint_gains(model, options.controller, kHome).kd;
  CHECK(after(options) == derived);
}

TEST_CASE("model simulator: lanes that start elsewhere have the gains of their own start",
          "[sim]") {
  const Model model = read_model(kWam);
  Starts both{.q = kHome.replicate(1, 2), .seeds = {0, 0}};
  both.q.col(1) << 0.0, -0.9, 0.3, 2.6;
  const auto after = [&](const Starts& begin) {
    ModelSimulator world({model}, model);
    world.reset(begin);
    Lanes q = Lanes::Zero(4, world.lanes());
    for (long lane = 0; lane < q.cols(); ++lane)
      q.col(lane) = begin.q.col(std::min(lane, begin.q.cols() - 1)).array() + 0.3;
    const Lanes still = Lanes::Zero(4, world.lanes());
    for (int k = 0; k < 50; ++k) world.step(q, still);
    return Lanes(world.observe());
  };
  const Lanes together = after(both);
  for (long lane = 0; lane < 2; ++lane) {
    const Lanes alone = after({.q = both.q.col(lane), .seeds = {0}});
    CHECK(together.col(lane) == alone.col(0));
  }
}

TEST_CASE("model simulator: without a start it does not move", "[sim]") {
  const Model model = read_model(kWam);
  ModelSimulator world({model}, model);
  const Lanes still = Lanes::Zero(4, world.lanes());
  CHECK_THROWS_WITH(world.step(still, still), ContainsSubstring("reset"));
  world.reset(starts(1));
  CHECK_NOTHROW(world.step(still, still));
  CHECK_THROWS_WITH(world.clone()->step(still, still), ContainsSubstring("reset"));
}

TEST_CASE("model simulator: a lane fails wherever it diverges, not at its first joint alone",
          "[sim]") {
  // Two wheels on the world: what one does the other never feels.
  const Model model = model_from_json(R"({"schema": "diffnea/model/1", "name": "two", "links": [
      {"name": "A", "joint": {"name": "a", "type": "revolute", "axis": [0, 0, 1]},
       "inertia": {"mass": 1, "com": [0, 0, 0], "about_com": [0.1, 0, 0, 0.1, 0, 0.1]}},
      {"name": "B", "joint": {"name": "b", "type": "revolute", "axis": [0, 0, 1]},
       "inertia": {"mass": 1, "com": [0, 0, 0], "about_com": [0.1, 0, 0, 0.1, 0, 0.1]}}]})",
                                      "two.json");
  ModelSimulatorOptions options;
  options.controller.kp = Eigen::Vector2d{10.0, 10.0};
  // Each step of 2 ms multiplies the second one's speed by 1 - kd h/J = -199.
  options.controller.kd = Eigen::Vector2d{1.0, 1e4};
  ModelSimulator world({model}, model, options);
  world.reset({Lanes::Zero(2, 1), {0}});
  const Lanes q = Lanes::Constant(2, world.lanes(), 0.1), qd = Lanes::Zero(2, world.lanes());
  for (int k = 0; k < 200; ++k) world.step(q, qd);  // 199^200 is beyond any double
  CHECK(std::isfinite(world.observe()(0, 0)));
  CHECK(world.failures()[0] == "the integration is unstable");
}

TEST_CASE("model simulator: what it does not simulate is refused by name", "[sim]") {
  const Model model = read_model(kWam);
  Model loose = model;
  loose.effects.push_back({"backlash", "joint2", {{"gap", 0.01, "rad"}}});
  CHECK_THROWS_WITH(ModelSimulator({loose}, model), ContainsSubstring("backlash"));
  Model other = model;
  other.effects.push_back({"linear_drag", "ball", {}});
  CHECK_THROWS_WITH(ModelSimulator({model, other}, model), ContainsSubstring("draws"));
  ModelSimulator world({model}, model);
  Starts none;
  none.q.resize(4, 0);
  CHECK_THROWS_AS(world.reset(none), ShapeError);
}

}  // namespace model_simulator_test
