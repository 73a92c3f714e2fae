/// A joint of an arm on a bench of its own: what the others' motion asks of it, and where its fit's
/// beginning goes.

#include "identify/joint_bench.hpp"

#include <cmath>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/effects/catalogue.hpp>

namespace diffnea::joint_bench_test {
namespace {

/// Two point masses on a plane without gravity (Craig 2005, eq. 6.55 with g = 0).
constexpr double kMass[] = {0.7, 0.4}, kLength[] = {0.3, 0.25};
/// Swing of both joints [rad], their frequencies [rad/s].
constexpr double kSwing[] = {0.8, 1.1}, kRate[] = {3.0, 4.3};

Model arm() {
  Model out;
  out.gravity = {0.0, 0.0, 0.0};
  out.links.resize(3);
  out.links[0].name = "base";
  for (int k : {0, 1}) {
    ModelLink& l = out.links[static_cast<std::size_t>(k + 1)];
    l.name = k == 0 ? "upper" : "fore";
    l.joint = k == 0 ? "shoulder" : "elbow";
    l.parent = k;
    l.type = ModelJoint::kRevolute;
    if (k == 1) l.X_PJ.p = {kLength[0], 0.0, 0.0};
    const double h = kMass[k] * kLength[k], I = h * kLength[k];
    l.inertia = SpatialInertia<double>::from_theta({kMass[k], h, 0, 0, 1e-9, 0, 0, I, 0, I});
  }
  return out;
}

struct Motion {
  double q[2], qd[2], qdd[2];
};

Motion motion_at(double t) {
  Motion out{};
  for (int k : {0, 1}) {
    out.q[k] = kSwing[k] * std::sin(kRate[k] * t);
    out.qd[k] = kSwing[k] * kRate[k] * std::cos(kRate[k] * t);
    out.qdd[k] = -kRate[k] * kRate[k] * out.q[k];
  }
  return out;
}

double shoulder_torque(const Motion& x) {
  const double m2 = kMass[1], l1 = kLength[0], l2 = kLength[1], c = std::cos(x.q[1]),
               s = std::sin(x.q[1]);
  const double M11 = kMass[0] * l1 * l1 + m2 * (l1 * l1 + l2 * l2 + 2.0 * l1 * l2 * c),
               M12 = m2 * (l2 * l2 + l1 * l2 * c);
  return M11 * x.qdd[0] + M12 * x.qdd[1] -
         m2 * l1 * l2 * s * (2.0 * x.qd[0] * x.qd[1] + x.qd[1] * x.qd[1]);
}

MotionData recorded(long rows, double dt) {
  MotionData out;
  MotionStretch s;
  s.q.resize(rows, 2);
  for (long k = 0; k < rows; ++k) {
    s.time.push_back(dt * static_cast<double>(k));
    const Motion x = motion_at(s.time.back());
    s.q.row(k) << x.q[0], x.q[1];
  }
  s.u = s.u_end = RowMatX<double>::Zero(rows, 2);
  s.command = std::make_shared<CommandPath>(s.time, s.q, VecX<double>::Ones(2));
  out.train.push_back(std::move(s));
  const VecX<double> noise = VecX<double>::Constant(2, 1e-6);
  out.noise = {noise, noise, {1, 1}, noise, noise, VecX<double>::Constant(2, dt)};
  out.runs = {0};
  out.rows = rows;
  return out;
}

FitLayout servos(const Model& model) {
  FitChoice choice;
  choice.fit = {"armature", "effects", "shapes"};
  choice.effects = {"position_servo", "armature", "coulomb_friction", "load_friction"};
  choice.simulated = true;
  return make_layout(model, choice, {0});
}

}  // namespace

TEST_CASE("joint bench: the other's motion is a torque that is known", "[identify]") {
  constexpr long kRows = 300;
  constexpr double kPeriod = 0.01, kHorizon = 0.1;
  const Model model = arm();
  const std::vector<JointBench> benches =
      joint_benches(model, recorded(kRows, kPeriod), servos(model), kHorizon);
  REQUIRE(benches.size() == 2);
  const JointBench& shoulder = benches[0];
  REQUIRE(joint_names(shoulder.model()) == std::vector<std::string>{"shoulder"});
  const double inertia = shoulder.model().links[1].inertia.I.zz;
  const MotionStretch& s = shoulder.data().train.at(0);
  REQUIRE(s.q.cols() == 1);
  double most = 0.0, off = 0.0;
  for (long k = 10; k + 10 < kRows; ++k) {  // at the ends the polynomials look to one side
    const Motion x = motion_at(s.time[static_cast<std::size_t>(k)]);
    const double torque = shoulder_torque(x);
    most = std::max(most, std::abs(torque));
    off = std::max(off, std::abs(inertia * x.qdd[0] - s.u(k, 0) - torque));
    CHECK(s.u_end(k, 0) == s.u(k + 1, 0));
  }
  // A cubic over T = 0.1 s leaves ω²T²/56 of an acceleration: 0.3 % at 4.3 rad/s, and of products.
  CHECK(off < 0.01 * most);
}

TEST_CASE("joint bench: its gear goes with it, and the others move as they are simulated",
          "[identify]") {
  constexpr long kRows = 300;
  Model model = arm();
  model.effects.push_back({"backlash", "shoulder", {{"gap", 0.02, ""}}});
  const MotionData data = recorded(kRows, 0.01);
  FitChoice choice;
  choice.fit = {"armature", "effects", "shapes"};
  choice.effects = {"position_servo"};
  choice.simulated = true;
  const FitLayout layout = make_layout(model, choice, {0});
  const JointBench bench(model, data, data.train, layout, 0, BenchGears::kTaken);
  CHECK(bench.is_whole());
  CHECK(std::ranges::any_of(bench.layout().effects,
                            [](const BoundEffect& e) { return e.info().name == "backlash"; }));
  CHECK_FALSE(JointBench(model, data, layout, 0.1, 0).is_whole());
  const MotionStretch& s = bench.data().train.at(0);
  CHECK(s.at_links);
  const double inertia = bench.model().links[1].inertia.I.zz;
  double most = 0.0, off = 0.0;
  for (long k = 1; k + 1 < kRows; ++k) {
    const Motion x = motion_at(s.time[static_cast<std::size_t>(k)]);
    const double torque = shoulder_torque(x);
    most = std::max(most, std::abs(torque));
    off = std::max(off, std::abs(inertia * x.qdd[0] - s.u(k, 0) - torque));
  }
  // Differences over h = 0.01 s leave ω²h²/12 of an acceleration, and ω²h²/6 of a velocity.
  CHECK(off < 1e-3 * most);
}

TEST_CASE("joint bench: what is of one instant and of the joint alone goes with it", "[identify]") {
  const Model model = arm();
  const FitLayout layout = servos(model);
  const std::vector<JointBench> benches = joint_benches(model, recorded(100, 0.01), layout, 0.1);
  REQUIRE(benches.size() == 2);
  const FitLayout& own = benches[1].layout();
  std::vector<std::string> effects;
  for (const BoundEffect& e : own.effects) {
    effects.push_back(e.info().name);
    CHECK(e.where == "elbow");
    CHECK(e.joints == std::vector<int>{0});
  }
  std::ranges::sort(effects);
  // Friction that follows the load is not: on the bench the links' torque is another.
  CHECK(effects == std::vector<std::string>{"armature", "coulomb_friction", "position_servo"});

  MotionBeginning of_robot{layout, VecX<double>::Ones(std::ssize(layout.linear)), layout.prior(),
                           {},     VecX<double>::Zero(std::ssize(layout.shape)),  0.0,
                           {}};
  MotionBeginning found{own, VecX<double>::Ones(std::ssize(own.linear)), own.prior(),
                        {},  VecX<double>::Zero(std::ssize(own.shape)),  0.0,
                        {}};
  for (std::size_t k = 0; k < own.linear.size(); ++k)
    if (own.linear[k].name == "elbow.position_servo.stiffness")
      found.start[static_cast<long>(k)] = 12.0;
  for (std::size_t k = 0; k < own.shape.size(); ++k)
    if (own.shape[k].name == "elbow.position_servo.reach") {
      found.layout.shape[k].fixed = true;
      found.shape[static_cast<long>(k)] = 0.4;
    }
  benches[1].put(found, of_robot);
  for (std::size_t k = 0; k < layout.linear.size(); ++k)
    CHECK(of_robot.start[static_cast<long>(k)] ==
          (layout.linear[k].name == "elbow.position_servo.stiffness" ? 12.0
                                                                     : layout.linear[k].prior));
  for (std::size_t k = 0; k < layout.shape.size(); ++k) {
    const bool is_it = layout.shape[k].name == "elbow.position_servo.reach";
    CHECK(of_robot.layout.shape[k].fixed == (is_it || layout.shape[k].fixed));
    CHECK(of_robot.shape[static_cast<long>(k)] == (is_it ? 0.4 : 0.0));
  }
}

TEST_CASE("joint bench: of one joint, or of one that nothing leads, there is none", "[identify]") {
  Model one = arm();
  one.links.pop_back();
  MotionData data = recorded(100, 0.01);
  data.train[0].q = data.train[0].q.leftCols(1).eval();
  data.train[0].u = data.train[0].u_end = data.train[0].u.leftCols(1).eval();
  CHECK(joint_benches(one, data, servos(one), 0.1).empty());

  const Model model = arm();
  FitChoice choice;
  choice.effects = {"position_servo@elbow"};
  choice.simulated = true;
  CHECK(joint_benches(model, recorded(100, 0.01), make_layout(model, choice, {0}), 0.1).empty());
}

}  // namespace diffnea::joint_bench_test
