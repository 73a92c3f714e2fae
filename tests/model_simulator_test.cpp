/// The identified model as a world of its own: against Runge–Kutta and against events, lane by
/// lane, and the holes that a search for a policy finds.

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/ball_flight.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/dynamics/cup_contact.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/string_route.hpp>
#include <diffnea/dynamics/string_step.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/model_simulator.hpp>
#include <diffnea/sim/mujoco_world.hpp>
#include <diffnea/sim/record.hpp>

#include "support/matrix_near.hpp"

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

const std::string kWam = DIFFNEA_SOURCE_DIR "/models/wam4_ball.xml";
const VecX<double> kHome = (VecX<double>(4) << 0.0, 0.6, 0.0, 1.25).finished();

/// Joints 2 and 4 swing up and come back; `size` [rad] and `pace` [rad/s] differ from lane to lane.
struct Swing {
  double size, pace;
  double angle(double t) const {
    return t < 1.5 ? size * std::pow(std::sin(M_PI * t / 1.5), 2) * std::sin(pace * t) : 0.0;
  }
  double rate(double t) const { return (angle(t + 1e-6) - angle(t - 1e-6)) / 2e-6; }
};

void command(const Swing& swing, double t, long lane, Lanes& q, Lanes& qd) {
  q.col(lane) = kHome;
  qd.col(lane).setZero();
  for (const int j : {1, 3}) {
    q(j, lane) += swing.angle(t);
    qd(j, lane) += swing.rate(t);
  }
}

Starts starts(int lanes) {
  return {.q = kHome.replicate(1, lanes), .seeds = std::vector<std::uint64_t>(lanes, 0)};
}

/// What every lane showed after `seconds`: (channels × lanes) at every 10th step.
std::vector<Lanes> run(Simulator& world, const std::vector<Swing>& swings, double seconds) {
  world.reset(starts(static_cast<int>(swings.size())));
  Lanes q = Lanes::Zero(4, world.lanes()), qd = q;
  std::vector<Lanes> out;
  const long steps = std::lround(seconds / world.period());
  for (long k = 0; k < steps; ++k) {
    for (std::size_t l = 0; l < swings.size(); ++l)
      command(swings[l], double(k) * world.period(), static_cast<long>(l), q, qd);
    world.step(q, qd);
    if (k % 10 == 9) out.push_back(world.observe().leftCols(static_cast<long>(swings.size())));
  }
  return out;
}

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

TEST_CASE("model simulator: the string is never longer than r, and its ball no further", "[sim]") {
  const Model model = read_model(kWam);
  ModelSimulator world({model}, model);
  const int ball = find_channel(world, "ball_x"), cup = find_channel(world, "cup_x");
  double most = 0.0;
  for (const Lanes& seen : run(world, {{0.5, 9.0}}, 2.0))
    most = std::max(most, (seen.col(0).segment(ball, 3) - seen.col(0).segment(cup, 3)).norm());
  CHECK(most < 0.4 + 1e-9);  // rounding: it is put back on the sphere
  CHECK(most > 0.4 - 1e-9);
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

TEST_CASE("model simulator: the cup moves with the arm where there is no ball", "[sim]") {
  const Model model = read_model(kWam);
  Model light = model, alone = model;
  light.ball->mass = 1e-9;
  alone.ball.reset();
  ModelSimulator with_ball({light}, model), without({alone}, model);
  const std::vector<Lanes> with = run(with_ball, {{0.4, 7.0}}, 1.5),
                           lone = run(without, {{0.4, 7.0}}, 1.5);
  const int cup = find_channel(with_ball, "cup_x"), lone_cup = find_channel(without, "cup_x");
  double apart = 0.0, way = 0.0;
  for (std::size_t k = 0; k < with.size(); ++k) {
    apart = std::max(apart, (with[k].middleRows(cup, 3) - lone[k].middleRows(lone_cup, 3)).norm());
    way = std::max(way, (lone[k].middleRows(lone_cup, 3) - lone[0].middleRows(lone_cup, 3)).norm());
  }
  CHECK(apart < 1e-6);  // a ball of 1 µg pulls with 1e-8 N
  CHECK(way > 0.1);     // 0.3 rad, a metre from the shoulder
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

namespace {

/// An anchor that swings in three directions, by closed form.
AnchorMotion<double> shaken(double t) {
  const double A[3] = {0.15, 0.1, 0.12}, w[3] = {7.0, 5.0, 9.0};
  AnchorMotion<double> out;
  double* x[] = {&out.x.x, &out.x.y, &out.x.z};
  double* v[] = {&out.v.x, &out.v.y, &out.v.z};
  double* a[] = {&out.a.x, &out.a.y, &out.a.z};
  for (int k = 0; k < 3; ++k) {
    *x[k] = A[k] * std::sin(w[k] * t);
    *v[k] = A[k] * w[k] * std::cos(w[k] * t);
    *a[k] = -A[k] * w[k] * w[k] * std::sin(w[k] * t);
  }
  return out;
}

struct ShakenWorld {
  bool has_string() const { return true; }
  double length() const { return 0.4; }
  AnchorMotion<double> anchor(double t) const { return shaken(t); }
  Vec3<double> acceleration(const BallSample<double>&) const { return {0.0, 0.0, -9.81}; }
};

/// Largest distance from the event-driven flight over `seconds`.
double distance_from_events(double h, double seconds) {
  const ShakenWorld world;
  BallFlight<double, ShakenWorld> flight(world, {.step = 1e-4});
  const AnchorMotion<double> first = shaken(0.0);
  const ParticleState<double> hanging{first.x + Vec3<double>{0, 0, -0.4},
                                      {first.v.x, first.v.y, first.v.z}};
  flight.start(0.0, hanging, true);
  StringBall<double, bool> ball{.ball = hanging, .a = {0, 0, -9.81}, .taut = true, .u = {0, 0, -1}};
  double most = 0.0;
  const long steps = std::lround(seconds / h);
  for (long k = 1; k <= steps; ++k) {
    step_string_ball(ball, shaken(double(k) * h), 0.4, h,
                     [](const auto&, const auto&, bool) { return Vec3<double>{0.0, 0.0, -9.81}; });
    flight.run_until(double(k) * h);
    const Vec3<double> d = ball.ball.x - flight.state().x;
    most = std::max(most, std::sqrt(dot(d, d)));
  }
  return most;
}

}  // namespace

TEST_CASE("string step: through slack and impacts it is where events put it", "[dynamics]") {
  // A violent swing with several impacts, each up to a step late, and each magnifies what came
  // before: first order, observed 9.6 and 1.2 mm.
  const double coarse = distance_from_events(1e-3, 1.0), fine = distance_from_events(1.25e-4, 1.0);
  CAPTURE(coarse, fine);
  CHECK(coarse < 2e-2);
  CHECK(fine < 0.25 * coarse);
}

TEST_CASE("string step: taut, it follows the driven pendulum", "[dynamics]") {
  const double error = distance_from_events(1e-3, 0.1);
  CHECK(error < 1e-5);  // observed 1.4e-6 m
}

TEST_CASE("string step: becoming taut throws the ball back", "[dynamics]") {
  const double e = GENERATE(0.0, 0.2);
  StringBall<double, bool> ball{.ball = {{0, 0, -0.3999}, {0, 0, -1.0}}, .a = {}, .taut = false};
  const auto none = [](const auto&, const auto&, bool) { return Vec3<double>{}; };
  step_string_ball(ball, AnchorMotion<double>{}, 0.4, 1e-3, none, &e);
  constexpr double kRounding = 1e-12;
  CHECK(std::abs(ball.ball.v.z - e) < kRounding);
  CHECK(std::abs(ball.pull - (1.0 + e)) < kRounding);
}

TEST_CASE("model simulator: a string that lies around the cup is never longer", "[sim]") {
  Model model = read_model(kWam);
  const bool wraps = GENERATE(false, true);
  if (wraps) {
    model.effects.push_back({"string_wrap", "string", {{"size", 1.0, "1"}}});
    model.effects.push_back({"string_rebound", "string", {{"restitution", 0.1, "1"}}});
    model.effects.push_back({"string_folding", "string", {{"resistance", 0.01, "m/s"}}});
  }
  ModelSimulator world({model}, model);
  Rng rng(3);
  const int phase = find_channel(world, "phase"), ball = find_channel(world, "ball_x"),
            cup = find_channel(world, "cup_x"), axis = find_channel(world, "axis_x");
  double longest = 0.0;
  int bent_and_taut = 0;
  for (int round = 0; round < 6; ++round) {
    std::vector<Swing> swings;
    for (int l = 0; l < world.lanes(); ++l)
      swings.push_back({rng.uniform(0.3, 0.9), rng.uniform(5, 11)});
    for (const Lanes& seen : run(world, swings, 2.0))
      for (long l = 0; l < world.lanes(); ++l) {
        if (seen(phase, l) != double(BallPhase::kFree)) continue;
        const VecX<double> d = seen.col(l).segment(ball, 3) - seen.col(l).segment(cup, 3);
        const double height = d.dot(seen.col(l).segment(axis, 3)),
                     radius = std::sqrt(std::max(0.0, d.squaredNorm() - height * height));
        const StringRoute<double> route =
            route_around_cup<double>({height, radius}, {0.0, 0.0}, *model.cup, 1.0);
        const double length =
            route.used + std::hypot(height - route.edge.height, radius - route.edge.radius);
        longest = std::max(longest, length);
        bent_and_taut += route.used > 0.0 && length > model.ball->string->length - 1e-4;
      }
  }
  CAPTURE(wraps, longest, bent_and_taut);
  // The edge that a step begins with is the one that it ends with: 1 ms at 5 m/s, squared, over r.
  constexpr double kStep = 1e-4;
  CHECK((longest < model.ball->string->length + kStep) == wraps);
  if (wraps) CHECK(bent_and_taut > 20);
}

TEST_CASE("cup: caught from above alone, where the ball passes the rim", "[sim]") {
  const CupSpec cup{.inner_radius = 0.04, .wall = 0.003, .floor = 0.0145, .rim = 0.095};
  const double r = 0.02;
  constexpr double kRounding = 1e-15;
  using P = CupPosition<double>;
  CHECK(is_caught(P{0.097, 0.0}, P{0.094, 0.0}, cup, r));
  CHECK(is_caught(P{0.097, 0.0199}, P{0.094, 0.0199}, cup, r));
  CHECK_FALSE(is_caught(P{0.097, 0.0201}, P{0.094, 0.0201}, cup, r));  // rim
  CHECK_FALSE(is_caught(P{0.094, 0.0}, P{0.097, 0.0}, cup, r));        // from below
  CHECK_FALSE(is_caught(P{0.099, 0.0}, P{0.096, 0.0}, cup, r));        // hovers over it
  CHECK_FALSE(is_caught(P{0.097, 0.063}, P{0.094, 0.0}, cup, r));      // past the rim, sideways

  CHECK(std::abs(distance_to_cup(P{0.095 + 0.02, 0.04}, cup) - 0.02) < kRounding);  // over the rim
  CHECK(std::abs(distance_to_cup(P{0.05, 0.063}, cup) - 0.02) < kRounding);
  CHECK(std::abs(distance_to_cup(P{-0.4, 0.0}, cup) - 0.4) < kRounding);  // hangs
  CHECK(std::abs(distance_to_cup(P{0.095 + 0.003, 0.036}, cup) - 0.005) < kRounding);
  CHECK(distance_to_cup(P{0.2, 0.0}, cup) > r);
}

TEST_CASE("model simulator: what is not a catch is not taken for one", "[sim]") {
  const Model model = read_model(kWam);
  REQUIRE(model.cup);
  ModelSimulator world({model}, model);
  const int phase = find_channel(world, "phase"), ball = find_channel(world, "ball_x"),
            cup = find_channel(world, "cup_x"), axis = find_channel(world, "axis_x");
  const double rest = model.cup->floor + model.ball->radius;
  int caught = 0;
  for (unsigned seed = 0; seed < 7; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    std::vector<Swing> swings;
    for (int l = 0; l < world.lanes(); ++l)
      if (seed == 0)  // they throw the ball into the cup, then at its rim
        swings.push_back({0.365 - 6e-4 * l, 6.945});
      else
        swings.push_back({rng.uniform(0.2, 0.9), rng.uniform(4, 11)});
    VecX<double> before = VecX<double>::Zero(world.lanes());
    for (const Lanes& seen : run(world, swings, 2.5)) {
      for (long l = 0; l < world.lanes(); ++l) {
        const VecX<double> d = seen.col(l).segment(ball, 3) - seen.col(l).segment(cup, 3);
        const double height = d.dot(seen.col(l).segment(axis, 3));
        const double now = seen(phase, l);
        if (before[l] != 0.0) CHECK(now == before[l]);  // for good
        if (now == double(BallPhase::kCaptured)) {
          CHECK(std::abs(height - rest) < 1e-12);
          CHECK(std::abs(d.norm() - rest) < 1e-12);
        }
        if (now == double(BallPhase::kFree)) {
          // Free: neither in the cup, nor in anything else, nor under an upside-down one.
          const double radius = std::sqrt(std::max(0.0, d.squaredNorm() - height * height));
          CHECK(distance_to_cup(CupPosition<double>{height, radius}, *model.cup) >
                model.ball->radius - 5e-3);  // 1 ms at 5 m/s
          CHECK(seen(axis + 2, l) > 0.15);
        }
        before[l] = now;
      }
    }
    caught += static_cast<int>((before.array() == double(BallPhase::kCaptured)).count());
  }
  CHECK(caught > 0);
}

TEST_CASE("model simulator: an upside-down cup ends the episode", "[sim]") {
  const Model model = read_model(kWam);
  ModelSimulator world({model}, model);
  world.reset(starts(1));
  Lanes q = Lanes::Zero(4, world.lanes()), qd = q;
  for (int k = 0; k < 500; ++k) {
    q.col(0) = kHome;
    q(3, 0) += 2.2 * std::min(1.0, k / 400.0);
    world.step(q, qd);
  }
  CHECK(world.observe()(find_channel(world, "phase"), 0) == double(BallPhase::kUpsideDown));
}
