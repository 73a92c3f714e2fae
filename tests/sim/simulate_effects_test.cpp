/// Simulated recordings of models with every effect of the catalogue: the log is what inverse
/// dynamics and series_torque say it must be for the recorded motion, which knows nothing of the
/// integrator.

#include <cmath>
#include <support/bump_table.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/series.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/mujoco_world.hpp>
#include <diffnea/sim/record.hpp>

namespace simulate_effects_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;

namespace {

Model wam() {
  Model m = read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml");
  m.effects = {{"armature", "joint2", {{"armature", 0.2, ""}}},
               {"viscous_friction", "joint2", {{"viscous", 2.0, ""}}},
               {"viscous_friction", "joint1", {{"viscous", 2.0, ""}}},
               {"viscous_friction", "joint3", {{"viscous", 1.0, ""}}},
               {"viscous_friction", "joint4", {{"viscous", 1.0, ""}}}};
  return m;
}

RecordOptions quiet() {
  RecordOptions o;
  o.scale_noise(0.0);
  return o;
}

SimulatedRecording recorded(const Model& robot, const Model& controller, double seconds = 6.0,
                            RecordOptions options = quiet()) {
  FourierOptions f;
  f.duration = f.period = seconds;
  return record_model(robot, controller, random_fourier(controller, f), options);
}

/// Central differences of the recorded motion, the torque that acted (or was asked for) at those
/// rows.
JointSeries series_of(const Recording& r) {
  const long n = r.rows() - 2;
  JointSeries x;
  x.dt = r.time[1] - r.time[0];
  x.start = r.time[1];
  x.q = r.q.middleRows(1, n);
  if (r.qd.size() > 0) {
    x.qd = r.qd.middleRows(1, n);
    x.qdd = (r.qd.bottomRows(n) - r.qd.topRows(n)) / (2 * x.dt);
  } else {
    x.qd = (r.q.bottomRows(n) - r.q.topRows(n)) / (2 * x.dt);
    x.qdd = (r.q.bottomRows(n) - 2 * x.q + r.q.topRows(n)) / (x.dt * x.dt);
  }
  x.logged = 0.5 * (r.tau.topRows(n) + r.tau.middleRows(1, n));  // held: the mean acts at the row
  return x;
}

double rms(const RowMatX<double>& m) {
  const long from = 250, rows = m.rows() - 2 * from;  // half a second of transients at both ends
  return std::sqrt(m.middleRows(from, rows).squaredNorm() / static_cast<double>(rows));
}

/// Differences of motion under held torques leave 4e-5 to 2e-4 N·m (observed); a limit, which cuts
/// each held torque and not the mean of two, 1e-3.
constexpr double kUnexplained = 2e-3;  // [N·m]

}  // namespace

TEST_CASE("record: the log holds what series_torque says the effect adds", "[sim]") {
  const EffectSpec spec = GENERATE(
      EffectSpec{"actuator_lag", "joint2", {{"time_constant", 0.02, ""}}},
      EffectSpec{"actuator_delay", "joint2", {{"delay", 0.015, ""}}},
      EffectSpec{"saturation", "joint2", {{"limit", 20.0, ""}}},
      EffectSpec{"presliding_dahl", "joint2", {{"coulomb", 3.0, ""}, {"presliding", 0.05, ""}}},
      EffectSpec{"presliding_lugre",
                 "joint2",
                 {{"stiffness", 60.0, ""},
                  {"damping", 0.5, ""},
                  {"coulomb", 3.0, ""},
                  {"stiction", 4.0, ""},
                  {"stribeck_velocity", 0.2, ""}}},
      EffectSpec{"joint_elasticity",
                 "joint2",
                 {{"stiffness", 400.0, ""}, {"damping", 4.0, ""}, {"motor_inertia", 0.2, ""}}},
      EffectSpec{"joint_elasticity",
                 "joint2",
                 {{"stiffness", 2000.0, ""}, {"damping", 40.0, ""}, {"encoder_side", 1.0, ""}}},
      EffectSpec{"load_friction",
                 "joint2",
                 {{"mu", 0.15, ""}, {"braking_ratio", 0.6, ""}, {"smoothing", 0.2, ""}}},
      EffectSpec{"transmission_coupling",
                 "joint2,joint3",
                 {{"armature", 0.3, ""},
                  {"viscous", 1.0, ""},
                  {"coulomb", 1.0, ""},
                  {"smoothing", 0.2, ""}}},
      EffectSpec{"torque_gain", "joint2", {{"gain_error", 0.1, ""}}},
      EffectSpec{
          "cogging", "joint2", {{"sine", 1.0, ""}, {"cosine", 0.5, ""}, {"cycles", 10.0, ""}}},
      EffectSpec{"warm_up", "joint2", {{"viscous", 3.0, ""}, {"time_constant", 3.0, ""}}},
      EffectSpec{"encoder_offset", "joint2", {{"offset", 0.1, ""}}},
      EffectSpec{"encoder_scale", "joint2", {{"scale_error", 0.05, ""}}},
      EffectSpec{"velocity_filter_lag", "joint2", {{"lag", 0.02, ""}}},
      EffectSpec{"time_shift", "all", {{"shift", 0.02, ""}}},
      EffectSpec{"base_tilt", "base", {{"gravity_x", 0.5, ""}, {"gravity_y", -0.3, ""}}},
      EffectSpec{
          "tip_force", "tip", {{"force_x", 3.0, ""}, {"force_y", 1.0, ""}, {"force_z", -2.0, ""}}});
  CAPTURE(spec.effect);
  const Model nominal = wam();
  Model robot = nominal;
  robot.effects.push_back(spec);
  const SimulatedRecording r = recorded(robot, nominal, 6.0, quiet());
  REQUIRE(r.failure.empty());
  REQUIRE(r.recording.rows() == 3001);
  JointSeries x = series_of(r.recording);
  const ExtendedTree base = extend(nominal);
  predict(base, x);
  const RowMatX<double> without = x.logged - x.total;
  const BoundEffect effect = bind(spec, nominal);
  // What the drive gives is what the log asked for less the effect: the series of the command.
  const RowMatX<double> added = series_torque(effect, base, x, effect.parameters.data());
  const double before = rms(without), after = rms(without - added);
  CAPTURE(before, after);
  CHECK(before > 0.1);  // [N·m]: there is something to explain
  CHECK(after < kUnexplained);
}

TEST_CASE("record: friction on either side of a spring is where series_torque takes it to be",
          "[sim]") {
  const double share = GENERATE(0.0, 0.3, 1.0);
  CAPTURE(share);
  Model nominal = wam();
  nominal.effects.push_back(
      {"coulomb_friction", "all", {{"coulomb", 4.0, ""}, {"smoothing", 0.4, ""}}});
  nominal.effects.push_back({"quadratic_friction", "joint2", {{"quadratic", 3.0, ""}}});
  const auto elastic = [](double at_motor) {
    return EffectSpec{"joint_elasticity",
                      "joint2",
                      {{"stiffness", 250.0, ""},
                       {"damping", 2.0, ""},
                       {"motor_inertia", 0.2, ""},
                       {"friction_share", at_motor, ""}}};
  };
  Model robot = nominal;
  robot.effects.push_back(elastic(share));
  const SimulatedRecording r = recorded(robot, nominal, 6.0, quiet());
  REQUIRE(r.failure.empty());
  JointSeries x = series_of(r.recording);
  const ExtendedTree base = extend(nominal);
  predict(base, x);
  const auto left = [&](double at_motor) {
    const BoundEffect e = bind(elastic(at_motor), nominal);
    return rms(x.logged - x.total - series_torque(e, base, x, e.parameters.data()));
  };
  CHECK(left(share) < kUnexplained);
  CHECK(left(share > 0.5 ? 0.0 : 1.0) > 10.0 * kUnexplained);
}

TEST_CASE("record: bristles on the link's side of a spring bend with the link and wind it up",
          "[sim]") {
  const Model nominal = wam();
  const EffectSpec dahl{
      "presliding_dahl", "joint2", {{"coulomb", 3.0, ""}, {"presliding", 0.05, ""}}};
  const EffectSpec elastic{"joint_elasticity",
                           "joint2",
                           {{"stiffness", 250.0, ""},
                            {"damping", 2.0, ""},
                            {"motor_inertia", 0.2, ""},
                            {"friction_share", 0.0, ""}}};
  Model robot = nominal;
  robot.effects.push_back(dahl);
  robot.effects.push_back(elastic);
  const SimulatedRecording r = recorded(robot, nominal, 6.0, quiet());
  REQUIRE(r.failure.empty());
  JointSeries x = series_of(r.recording);
  const ExtendedTree base = extend(nominal);
  predict(base, x);
  const BoundEffect friction = bind(dahl, nominal), spring = bind(elastic, nominal);
  const RowMatX<double> bent = series_torque(friction, base, x, friction.parameters.data());
  const auto left = [&] {
    return rms(x.logged - x.total - bent -
               series_torque(spring, base, x, spring.parameters.data()));
  };
  const double without = left();
  x.tau += bent;  // the spring takes it as it takes what the links transmit
  CHECK(left() < kUnexplained);
  CHECK(without > 10.0 * kUnexplained);
}

TEST_CASE("record: what a motor behind a spring has of its load is of what the spring transmits",
          "[sim]") {
  const EffectSpec of_load =
      GENERATE(EffectSpec{"torque_gain", "joint2", {{"gain_error", 0.2, ""}}},
               EffectSpec{"load_friction", "joint2", {{"mu", 0.15, ""}, {"smoothing", 0.2, ""}}});
  CAPTURE(of_load.effect);
  const EffectSpec elastic{
      "joint_elasticity",
      "joint2",
      {{"stiffness", 2000.0, ""}, {"damping", 5.0, ""}, {"motor_inertia", 0.2, ""}}};
  const Model nominal = wam();
  Model robot = nominal;
  robot.effects.push_back(of_load);
  robot.effects.push_back(elastic);
  const SimulatedRecording r = recorded(robot, nominal, 6.0, quiet());
  REQUIRE(r.failure.empty());
  JointSeries x = series_of(r.recording);
  const ExtendedTree base = extend(nominal);
  predict(base, x);
  const BoundEffect spring = bind(elastic, nominal);
  const RowMatX<double> without =
      x.logged - x.total - series_torque(spring, base, x, spring.parameters.data());
  // The motor turns as fast as the link, but for how fast the spring winds up.
  const double wind_up = 1.0 / 2000.0;
  RowMatX<double> left = without;
  for (long k = 1; k + 1 < x.rows(); ++k) {
    const double load = x.tau(k, 1),
                 speed = x.qd(k, 1) + wind_up * (x.tau(k + 1, 1) - x.tau(k - 1, 1)) / (2 * x.dt);
    left(k, 1) -= of_load.effect == "torque_gain" ? 0.2 * load
                                                  : 0.15 * std::abs(load) * std::tanh(speed / 0.2);
  }
  CAPTURE(rms(without), rms(left));
  CHECK(rms(without) > 0.5);  // [N·m]: there is something to explain
  CHECK(rms(left) < 0.02 * rms(without));
}

TEST_CASE("record: a rotor in a gap flies as series_torque says", "[sim]") {
  Model nominal = wam();
  nominal.effects.erase(nominal.effects.begin() +
                        1);  // the flight reckons friction at the link's speed
  const double armature = make_tree(nominal).links[1].armature;
  Model robot = nominal;
  robot.effects.push_back({"backlash",
                           "joint2",
                           {{"gap", 0.05, ""},
                            {"stiffness", 1e5, ""},
                            {"motor_inertia", armature, ""},
                            {"restitution", 0.2, ""}}});
  RecordOptions options = quiet();
  options.bandwidth = 5.0;  // a stiff loop around a gap rattles
  const SimulatedRecording r = recorded(robot, nominal, 6.0, options);
  REQUIRE(r.failure.empty());
  JointSeries x = series_of(r.recording);
  const ExtendedTree base = extend(nominal);
  predict(base, x);
  const BoundEffect effect = bind(robot.effects.back(), nominal);
  // Flanks that do not yield, against springs: alike below the springs' frequency, so as means of
  // 0.1 s.
  const auto means = [](const RowMatX<double>& m) {
    RowMatX<double> out(m.rows() / 50, m.cols());
    for (long k = 0; k < out.rows(); ++k) out.row(k) = m.middleRows(50 * k, 50).colwise().mean();
    return RowMatX<double>(out.middleRows(5, out.rows() - 10));
  };
  const RowMatX<double> without = means(x.logged - x.total);
  const RowMatX<double> added = means(series_torque(effect, base, x, effect.parameters.data()));
  CAPTURE(without.norm(), (without - added).norm());
  CHECK(without.norm() > 3.0);
  // 6 % observed: impacts that fall on either side of a mean's end.
  CHECK((without - added).norm() < 0.12 * without.norm());
}

TEST_CASE("record: every effect of joints in the catalogue can be simulated", "[sim]") {
  const Model nominal = wam();
  for (const EffectInfo& info : catalogue()) {
    if (acts_on_ball(info)) continue;
    CAPTURE(info.name);
    Model robot = nominal;
    EffectSpec spec{info.name, "joint3", {}};
    if (info.place == Place::kJointPair) spec.where = "joint2,joint3";
    if (info.place == Place::kTip) spec.where = "tip";
    if (info.place == Place::kBase) spec.where = "base";
    for (const ParameterInfo& p : info.parameters)
      if (p.linear) spec.parameters.push_back({p.per_run ? p.name + "_0" : p.name, 0.1, ""});
    if (info.name == "payload") spec.parameters.resize(1);
    if (info.name == "residual") spec.table = test::bump_table("joint3", "joint2");
    robot.effects.push_back(spec);
    const SimulatedRecording r = recorded(robot, nominal, 1.0);
    CHECK(r.failure == "");
    CHECK(r.recording.rows() == 501);
  }
}

TEST_CASE(
    "record: MuJoCo with drives, states, gains, encoders and a tilted base moves as the model",
    "[sim]") {
  const EffectSpec spec = GENERATE(
      EffectSpec{"actuator_lag", "joint2", {{"time_constant", 0.02, ""}}},
      EffectSpec{"actuator_delay", "joint2", {{"delay", 0.015, ""}}},
      EffectSpec{"saturation", "joint2", {{"limit", 20.0, ""}}},
      EffectSpec{"encoder_scale", "joint2", {{"scale_error", 0.05, ""}}},
      EffectSpec{"torque_gain", "joint2", {{"gain_error", 0.2, ""}}},
      EffectSpec{"base_tilt", "base", {{"gravity_x", 0.5, ""}, {"gravity_y", -0.3, ""}}},
      EffectSpec{"warm_up", "joint2", {{"viscous", 3.0, ""}, {"time_constant", 1.0, ""}}},
      EffectSpec{"presliding_dahl", "joint2", {{"coulomb", 3.0, ""}, {"presliding", 0.02, ""}}},
      EffectSpec{"presliding_lugre",
                 "joint2",
                 {{"stiffness", 150.0, ""},
                  {"damping", 1.0, ""},
                  {"coulomb", 3.0, ""},
                  {"stiction", 4.0, ""}}},
      EffectSpec{"time_shift", "all", {{"shift", 0.02, ""}}});
  CAPTURE(spec.effect);
  const std::string path = DIFFNEA_SOURCE_DIR "/models/wam4.xml";
  const Model nominal = wam();
  Model robot = nominal;
  robot.effects.push_back(spec);
  FourierOptions f;
  f.duration = f.period = 3.0;
  const Trajectory t = random_fourier(nominal, f);
  RecordOptions o = quiet();
  o.physics_step = 2.5e-4;
  const Recording ours = record_model(robot, nominal, t, o).recording;
  const Recording without = record_model(nominal, nominal, t, o).recording;
  const Recording theirs = record_in_mujoco(read_mjcf(path), robot, nominal, t, o).recording;
  const double off = (ours.q - theirs.q).cwiseAbs().maxCoeff();
  CAPTURE(off);
  CHECK(off < 1e-3);  // [rad]; MuJoCo integrates with order 1: 2e-4 to 3e-4 observed
  CHECK((ours.q - without.q).cwiseAbs().maxCoeff() > 5e-3);
}

TEST_CASE("record: a motor behind a spring swings at the frequency of two inertias", "[sim]") {
  // A cart of 2 kg, its rotor of 0.5 kg on K = 800 N/m: ω² = K (1/2 + 1/0.5). No friction, no
  // force.
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
  m.effects = {
      {"armature", "slide", {{"armature", 0.5, ""}}},
      {"joint_elasticity", "slide", {{"stiffness", 800.0, ""}, {"motor_inertia", 0.5, ""}}}};
  Trajectory t;
  t.joint_names = {"slide"};
  t.time = VecX<double>::LinSpaced(2, 0.0, 2.0);
  t.q = RowMatX<double>::Constant(2, 1, 1.0);
  t.qd = t.qdd = RowMatX<double>::Zero(2, 1);
  t.q(0, 0) = 0.0;  // starts at 0 and is pushed towards 1 by a weak spring of 1 N/m, hence nearly
                    // constantly
  RecordOptions o = quiet();
  o.kp = VecX<double>::Zero(1);
  o.kd = VecX<double>::Constant(1, 1.0);
  t.qd.setConstant(1.0);  // F = kd (1 − v)
  const SimulatedRecording r = record_model(m, m, t, o);
  REQUIRE(r.failure.empty());
  // Less its mean path, the cart's position swings; count the turns of its velocity's ripple.
  const long n = r.recording.rows();
  const VecX<double> q = r.recording.q.col(0);
  const double dt = o.control_rate > 0 ? 1.0 / o.control_rate : 0.0;
  VecX<double> a(n - 2);
  for (long k = 0; k + 2 < n; ++k) a[k] = (q[k] - 2 * q[k + 1] + q[k + 2]) / (dt * dt);
  // Acceleration: (F/M)(1 − cos ωt), F slowly falling. First minima after the start are periods
  // apart.
  const double w = std::sqrt(800.0 * (1 / 2.0 + 1 / 0.5)), period = 2 * 3.14159265358979 / w;
  std::vector<double> minima;
  for (long k = 1; k + 1 < a.size(); ++k)
    if (a[k] < a[k - 1] && a[k] <= a[k + 1]) minima.push_back(static_cast<double>(k + 1) * dt);
  REQUIRE(minima.size() > 5);
  CHECK(std::abs((minima[5] - minima[0]) / 5.0 - period) <
        1e-3);  // rows are 2 ms apart, over five periods
}

TEST_CASE("record: effects that cannot act together are refused, an unstable one is reported",
          "[sim]") {
  const Model nominal = wam();
  const EffectSpec elastic{"joint_elasticity", "joint2", {{"motor_inertia", 0.2, ""}}};
  const auto record = [&](std::vector<EffectSpec> effects) {
    Model robot = nominal;
    robot.effects.insert(robot.effects.end(), effects.begin(), effects.end());
    return recorded(robot, nominal, 1.0);
  };
  CHECK_THROWS_WITH(record({elastic, {"backlash", "joint2", {{"motor_inertia", 0.1, ""}}}}),
                    ContainsSubstring("hidden motor already"));
  CHECK_THROWS_WITH(
      record({elastic, {"transmission_coupling", "joint2,joint3", {{"armature", 0.1, ""}}}}),
      ContainsSubstring("transmission_coupling at 'joint2,joint3' cannot act at a joint with "
                        "elasticity"));
  const SimulatedRecording stiff = record(
      {{"joint_elasticity", "joint2", {{"stiffness", 1e12, ""}, {"motor_inertia", 1e-6, ""}}}});
  CHECK_THAT(stiff.failure, ContainsSubstring("unstable"));
}

}  // namespace simulate_effects_test
