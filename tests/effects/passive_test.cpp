/// Joints that nothing drives, beside driven ones: a cart-pole and a rotary pendulum.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/identify/linear_fit.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/model_simulator.hpp>
#include <diffnea/worlds/world.hpp>

#include "support/matrix_near.hpp"

namespace passive_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

const std::string kCartPole = DIFFNEA_SOURCE_DIR "/models/cart_pole.xml";

/// Central difference, h = 1e-6 on residuals of order 1: rounding leaves 1e-10.
constexpr double kCentralDifferenceTol = 1e-8;
/// The arm's step of 2 ms against Runge–Kutta at 0.5 ms over 2 s of a swinging pole (1 rad); 5.5e-3
/// rad observed.
constexpr double kSwingTol = 1.5e-2;

}  // namespace

TEST_CASE("passive: rows without scale are those of M(at)/M(x) (Y x - τ), linear about at",
          "[passive]") {
  const unsigned seed = GENERATE(range(0u, 5u));
  const double pull = GENERATE(0.0, 1.0);  // τ: nothing, or what a ball on a string pulls with
  CAPTURE(seed, pull);
  Rng rng(seed);
  const auto draw = [&](long rows, long columns) {
    MatX<double> out(rows, columns);
    for (long i = 0; i < out.size(); ++i) out.data()[i] = rng.normal();
    return out;
  };
  JointFactor f{{4, 0, 2}, TriangularFactor(3)};
  f.inertia = draw(3, 1).cwiseAbs();
  const VecX<double> at = draw(5, 1).cwiseAbs();
  const MatX<double> Y = draw(7, 3);
  const VecX<double> tau = pull * draw(7, 1);
  MatX<double> rows(7, 4);
  rows << Y, tau;
  const MatX<double> mapped = rows * f.without_scale(at);
  const auto residual = [&](const VecX<double>& x) {
    return VecX<double>((Y * x(f.columns) - tau) * f.inertia.dot(at(f.columns)) /
                        f.inertia.dot(x(f.columns)));
  };
  const VecX<double> x0 = at(f.columns);
  CHECK_THAT(MatX<double>(mapped.leftCols(3) * x0 - mapped.col(3)),
             MatrixNear(MatX<double>(residual(at)), 1e-14));
  for (long k = 0; k < 3; ++k) {
    const double h = 1e-6;
    VecX<double> more = at, less = at;
    more[f.columns[static_cast<std::size_t>(k)]] += h;
    less[f.columns[static_cast<std::size_t>(k)]] -= h;
    CHECK_THAT(MatX<double>(mapped.col(k)),
               MatrixNear(MatX<double>((residual(more) - residual(less)) / (2 * h)),
                          kCentralDifferenceTol));
  }
  f.inertia.resize(0);  // a driven joint's rows stay
  CHECK(f.without_scale(at) == MatX<double>(MatX<double>::Identity(4, 4)));
}

TEST_CASE("passive: a shaft turns two hinges or moves two slides, never one of each", "[passive]") {
  const EffectInfo& shaft = find_effect("cable_differential_friction");
  CHECK(places(shaft, read_model(kCartPole)).empty());
  CHECK(places(shaft, read_model(DIFFNEA_SOURCE_DIR "/models/furuta.xml")) ==
        std::vector<std::string>{"arm,pendulum"});
}

TEST_CASE("passive: the model as a world takes commands for the cart and swings the pole as MuJoCo",
          "[passive]") {
  const Model model = read_model(kCartPole);
  ModelSimulator ours({model}, model);
  CHECK(ours.joints() == std::vector<std::string>{"cart"});
  CHECK(ours.channels() == std::vector<std::string>{"q_cart", "q_pole", "qd_cart", "qd_pole"});
  MujocoSimulator theirs(read_mjcf(kCartPole), model, model, {});
  ours.reset({Lanes::Zero(1, 1), {0}});
  theirs.reset({Lanes::Zero(1, 1), {0}});
  const auto twin = ours.clone();
  twin->reset({Lanes::Zero(1, 1), {0}});
  double swing = 0.0;
  for (long k = 0; k < 1000; ++k) {
    const double t = static_cast<double>(k) * ours.period(), w = 5.0;
    const Lanes q = Lanes::Constant(1, ours.lanes(), 0.05 * (1.0 - std::cos(w * t))),
                qd = Lanes::Constant(1, ours.lanes(), 0.05 * w * std::sin(w * t));
    ours.step(q, qd);
    twin->step(q, qd);
    theirs.step(q.leftCols(1), qd.leftCols(1));
    swing = std::max(swing, std::abs(theirs.observe()(1, 0)));
    CHECK(std::abs(ours.observe()(1, 0) - theirs.observe()(1, 0)) < kSwingTol);
  }
  CHECK(swing > 0.5);
  CHECK(twin->observe() == ours.observe());
  CHECK_THROWS_AS(ours.step(Lanes::Zero(2, ours.lanes()), Lanes::Zero(2, ours.lanes())),
                  ShapeError);
}

TEST_CASE("passive: a computed torque asks nothing of a joint that nothing drives", "[passive]") {
  const Model model = read_model(kCartPole);
  ModelSimulatorOptions mine;
  MujocoSimulatorOptions its;
  mine.controller.law = its.controller.law = ControlLaw::kComputedTorque;
  ModelSimulator ours({model}, model, mine);
  MujocoSimulator theirs(read_mjcf(kCartPole), model, model, its);
  ours.reset({Lanes::Zero(1, 1), {0}});
  theirs.reset({Lanes::Zero(1, 1), {0}});
  double swing = 0.0, apart = 0.0;
  for (long k = 0; k < 1000; ++k) {
    const double t = static_cast<double>(k) * ours.period(), w = 5.0;
    const Lanes q = Lanes::Constant(1, ours.lanes(), 0.05 * (1.0 - std::cos(w * t))),
                qd = Lanes::Constant(1, ours.lanes(), 0.05 * w * std::sin(w * t));
    ours.step(q, qd);
    theirs.step(q.leftCols(1), qd.leftCols(1));
    swing = std::max(swing, std::abs(theirs.observe()(1, 0)));
    apart = std::max(apart, std::abs(ours.observe()(1, 0) - theirs.observe()(1, 0)));
  }
  CHECK(swing > 0.4);
  CHECK(apart < kSwingTol);
}

TEST_CASE("passive: a world hides the effects that it is asked to", "[passive]") {
  const std::string name = "mujoco:" + kCartPole + ",perturb=A,seed=3";
  const WorldSpec world = parse_world(
      name + ",effect=cogging@cart:sine=0.4+cycles=1e+2,effect=viscous_friction@pole:viscous=2e-3");
  REQUIRE(world.effects.size() == 2);
  CHECK(world.effects[0].effect == "cogging");
  CHECK(world.effects[0].where == "cart");
  REQUIRE(world.effects[0].parameters.size() == 2);
  CHECK(world.effects[0].parameters[1].name == "cycles");
  CHECK(world.effects[0].parameters[1].value == 1e2);
  CHECK_THROWS_WITH(parse_world(name + ",effect=cogging"), ContainsSubstring("NAME@WHERE"));
  CHECK_THROWS_WITH(parse_world(name + ",effect=cogging@cart:sine=much"),
                    ContainsSubstring("effect: sine"));
  const Model model = read_model(kCartPole);
  const auto truth = [&](const std::string& keys) {
    Model out;
    make_simulator(parse_world(name + keys), model, {}, 0, &out);
    return out.effects;
  };
  // What perturb drew at that place makes room.
  const std::vector<EffectSpec> drawn = truth(""),
                                asked = truth(",effect=coulomb_friction@cart:coulomb=2");
  CHECK(drawn.size() == asked.size());
  CHECK(asked.back().effect == "coulomb_friction");
  CHECK(asked.back().parameters[0].value == 2.0);
  CHECK(asked.back().parameters[0].unit == "N");
  CHECK_THROWS_WITH(truth(",effect=cogging@wheel:sine=1"), ContainsSubstring("wheel"));
  CHECK_THROWS_WITH(truth(",effect=cogging@cart:size=1"), ContainsSubstring("size"));
}

}  // namespace passive_test
