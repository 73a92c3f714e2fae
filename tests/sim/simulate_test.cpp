/// Simulated recordings: MuJoCo and the model agree where they are the same robot, and differ as
/// drawn.

#include <algorithm>
#include <cstdlib>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/trajectory_file.hpp>
#include <diffnea/model/physical.hpp>
#include <diffnea/worlds/world.hpp>

#include "support/matrix_near.hpp"
#include "support/temporary_folder.hpp"

namespace simulate_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

const std::string kWam = DIFFNEA_SOURCE_DIR "/models/wam4.xml";

RecordOptions without_noise() {
  RecordOptions o;
  o.scale_noise(0.0);
  return o;
}

Trajectory motion(const Model& model, double duration, std::uint64_t seed = 0) {
  FourierOptions o;
  o.duration = o.period = duration;
  o.seed = seed;
  return random_fourier(model, o);
}

Perturbation without_coulomb() {
  Perturbation p = surrogate_a();
  p.coulomb_low = p.coulomb_high = 0.0;
  return p;
}

}  // namespace

TEST_CASE("record: MuJoCo with the truth written over it moves as the truth's own equations",
          "[sim]") {
  const Model nominal = read_model(kWam);
  Model truth = perturbed(nominal, without_coulomb(), 3);
  truth.effects.push_back(
      {"joint_spring", "joint2", {{"stiffness", 8, "N*m/rad"}, {"rest", 0.3, "rad"}}});
  truth.effects.push_back({"quadratic_friction", "joint1", {{"quadratic", 2, "N*m*s^2/rad^2"}}});
  RecordOptions o = without_noise();
  const Trajectory t = motion(nominal, 5);
  const SimulatedRecording ours = record_model(truth, nominal, t, o);
  // MuJoCo integrates with order 1: the difference halves with the step.
  double previous = 0.0;
  for (const double step : {1e-3, 5e-4, 2.5e-4}) {
    o.physics_step = step;
    const SimulatedRecording theirs = record_in_mujoco(read_mjcf(kWam), truth, nominal, t, o);
    CHECK(theirs.failure.empty());
    const double off = (theirs.recording.q - ours.recording.q).cwiseAbs().maxCoeff();
    CAPTURE(step, off);
    CHECK(off < step);  // [rad]; 0.7 · step observed
    if (previous > 0.0) CHECK(off < 0.6 * previous);
    previous = off;
  }
}

TEST_CASE("record: servos that a document draws do not pull in its world", "[sim]") {
  const TemporaryFolder folder;
  const auto recorded = [&](const std::string& drive) {
    const std::filesystem::path file = folder.path() / "arm.xml";
    write_file_atomically(file,
                          "<mujoco><worldbody><body><joint name='j' axis='0 1 0' damping='.1'/>"
                          "<geom size='.1' pos='0 0 .3'/></body></worldbody><actuator>" +
                              drive + "</actuator></mujoco>");
    const Model model = read_model(file);
    return record_in_mujoco(read_mjcf(file), model, model, motion(model, 1), without_noise())
        .recording.q;
  };
  CHECK(recorded("<position joint='j' kp='100' kv='3'/>") == recorded("<motor joint='j'/>"));
}

TEST_CASE("record: the recorded torques are those the truth needs for the recorded motion",
          "[sim]") {
  const Model nominal = read_model(kWam);
  const Model truth = perturbed(nominal, surrogate_a(), 1);
  const Recording r =
      record_in_mujoco(read_mjcf(kWam), truth, nominal, motion(nominal, 10), without_noise())
          .recording;
  const long n = r.rows() - 2;
  const double dt = r.time[1] - r.time[0];
  const RowMatX<double> q = r.q.middleRows(1, n),
                        qd = (r.q.bottomRows(n) - r.q.topRows(n)) / (2 * dt);
  const RowMatX<double> qdd = (r.q.bottomRows(n) - 2 * q + r.q.topRows(n)) / (dt * dt);
  // The torque is held: at the row's instant the mean of before and after acts.
  const RowMatX<double> tau = 0.5 * (r.tau.topRows(n) + r.tau.middleRows(1, n));
  const auto rms = [&](const Model& model) {
    const RowMatX<double> error = tau - inverse_dynamics(extend(model), q, qd, qdd);
    double sum = 0.0;
    long count = 0;
    for (long i = 0; i < n; ++i)
      for (int j = 0; j < 4; ++j)
        if (std::abs(qd(i, j)) > 0.1) {  // below, MuJoCo's dry friction sticks, tanh creeps
          sum += error(i, j) * error(i, j);
          ++count;
        }
    return std::sqrt(sum / static_cast<double>(count));
  };
  CHECK(rms(truth) < 0.05);   // [N·m]; second differences of the motion leave 0.02
  CHECK(rms(nominal) > 1.0);  // the task that identification has
}

TEST_CASE("record: the same seed gives the same bits, another seed another robot and noise",
          "[sim]") {
  const Model nominal = read_model(kWam);
  const Trajectory t = motion(nominal, 1);
  const std::string mjcf = read_mjcf(kWam);
  const auto run = [&](std::uint64_t seed) {
    RecordOptions o;
    o.seed = seed;
    return record_in_mujoco(mjcf, perturbed(nominal, surrogate_a(), seed), nominal, t, o).recording;
  };
  const Recording a = run(1), b = run(1), c = run(2);
  CHECK(a.q == b.q);
  CHECK(a.tau == b.tau);
  CHECK(a.q != c.q);
  CHECK(a.info.passive.empty());
  CHECK(a.joint_names == joint_names(nominal));
  CHECK(a.rows() == 501);
}

TEST_CASE("record: noise on the recorded positions has the size asked for", "[sim]") {
  const Model nominal = read_model(kWam);
  const Trajectory t = motion(nominal, 4);
  RecordOptions o;
  o.kp = o.kd = VecX<double>::Zero(4);  // the controller does not react to its own noise
  o.gravity_compensation = false;
  Model still = nominal;
  still.gravity = {0, 0, 0};
  const Recording r = record_model(still, still, t, o).recording;
  const auto std_of = [&](const RowMatX<double>& m, int j) {
    const VecX<double> x = m.col(j).array() - m.col(j).mean();
    return std::sqrt(x.squaredNorm() / static_cast<double>(x.size()));
  };
  for (int j = 0; j < 4; ++j) {  // 2001 samples: the estimate scatters by 1.6 %
    CHECK(std::abs(std_of(r.q, j) / o.position_noise - 1.0) < 0.08);
    CHECK(std::abs(std_of(r.tau, j) / o.torque_noise - 1.0) < 0.08);
  }
}

TEST_CASE("perturbed: stays within its ranges and physically possible", "[sim]") {
  const Model nominal = read_model(kWam);
  const Perturbation p = surrogate_a();
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    CAPTURE(seed);
    const Model truth = perturbed(nominal, p, seed);
    CHECK(check_model(truth).empty());
    CHECK(truth.links[0].inertia.m == nominal.links[0].inertia.m);  // the base does not move
    for (std::size_t i = 1; i < truth.links.size(); ++i) {
      const SpatialInertia<double>&a = nominal.links[i].inertia, &b = truth.links[i].inertia;
      CHECK(b.m / a.m >= 1.0 + p.mass_low);
      CHECK(b.m / a.m <= 1.0 + p.mass_high);
      const Vec3<double> shift = b.h * (1.0 / b.m) - a.h * (1.0 / a.m);
      CHECK(dot(shift, shift) <= p.com * p.com * (1 + 1e-9));
    }
    for (const EffectSpec& e : truth.effects)
      if (e.effect == "coulomb_friction") {
        CHECK(e.parameters[0].value >= p.coulomb_low);
        CHECK(e.parameters[0].value <= p.coulomb_high);
      }
  }
}

TEST_CASE("record: a free pendulum keeps its energy", "[sim]") {
  const Model pendulum = read_model(DIFFNEA_SOURCE_DIR "/models/pendulum.json");
  Trajectory t;
  t.joint_names = {"pendulum"};
  t.time = VecX<double>::LinSpaced(2, 0, 20);
  t.q = RowMatX<double>::Constant(2, 1, 2.0);
  t.qd = t.qdd = RowMatX<double>::Zero(2, 1);
  RecordOptions o = without_noise();
  const SimulatedRecording r = record_model(pendulum, pendulum, t, o);
  CHECK(r.failure.empty());
  CHECK_FALSE(r.recording.has_tau[0]);
  CHECK(r.recording.info.passive == std::vector<std::string>{"pendulum"});
  // It swings between ±2 rad for ever: RK4 at 0.5 ms leaves 1e-11.
  CHECK(std::abs(r.recording.q.col(0).minCoeff() + 2.0) <
        1e-4);  // rows every 2 ms may miss the turn
  CHECK(r.recording.q.col(0).maxCoeff() <= 2.0 + 1e-9);
}

TEST_CASE("excite: within limits, at rest at both ends, periodic, and the same for a seed",
          "[excite]") {
  const std::string file =
      GENERATE("wam4.xml", "panda.urdf", "emps.urdf", "cart_pole.xml", "furuta.xml");
  const std::uint64_t seed = GENERATE(0u, 1u, 2u);
  CAPTURE(file, seed);
  const Model model = read_model(DIFFNEA_SOURCE_DIR "/models/" + file);
  FourierOptions o;
  o.seed = seed;
  o.rate = 200;
  const Trajectory t = random_fourier(model, o);
  REQUIRE(t.rows() == 4001);
  const Trajectory again = random_fourier(model, o);
  CHECK(t.q == again.q);
  for (int j = 0; j < t.num_joints(); ++j) {
    const ModelLink& link = model.links[moving_links(model)[find_joint(model, t.joint_names[j])]];
    CHECK_FALSE(link.passive);
    CHECK(t.q.col(j).minCoeff() >= link.limits.lower);
    CHECK(t.q.col(j).maxCoeff() <= link.limits.upper);
    CHECK(t.qd.col(j).cwiseAbs().maxCoeff() <= link.limits.velocity);
    CHECK(t.qd.col(j).cwiseAbs().maxCoeff() > 0.01);
  }
  constexpr double kRest = 1e-9;
  for (const long row : {0L, 2000L, 4000L}) {
    CHECK(t.qd.row(row).cwiseAbs().maxCoeff() < kRest);
    CHECK(t.qdd.row(row).cwiseAbs().maxCoeff() < kRest);
  }
  CHECK_THAT(t.q.topRows(2000), MatrixNear(t.q.middleRows(2000, 2000), 1e-12));
  // Derivatives are those of the positions: second order in the step of 5 ms.
  const RowMatX<double> slope = (t.q.bottomRows(3999) - t.q.topRows(3999)) / 0.01;
  CHECK_THAT(t.qd.middleRows(1, 3999), MatrixNear(slope, 1e-3));
}

TEST_CASE("excite: nothing to excite, or no strength to hold the arm, is said", "[excite]") {
  CHECK_THROWS_AS(random_fourier(read_model(DIFFNEA_SOURCE_DIR "/models/pendulum.json"), {}),
                  ModelError);
  Model weak = read_model(kWam);
  weak.links[2].limits.effort = 0.1;
  CHECK_THROWS_AS(random_fourier(weak, {}), ModelError);
  FourierOptions few;
  few.harmonics = 2;
  CHECK_THROWS_AS(random_fourier(weak, few), Error);
}

TEST_CASE("excite: limits that are inverted, empty or missing", "[excite]") {
  Model model = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  const auto elbow = std::ranges::find(model.links, "elbow", &ModelLink::joint);
  REQUIRE(elbow != model.links.end());
  elbow->limits.lower = 1.0;
  elbow->limits.upper = -1.0;
  CHECK_THROWS_WITH(
      random_fourier(model, {}),
      Catch::Matchers::ContainsSubstring("joint 'elbow' are inverted: lower 1, upper -1"));
  elbow->limits.upper = 1.0;                            // no range: held there
  elbow->limits.effort = elbow->limits.velocity = 0.0;  // not given
  const Trajectory held = random_fourier(model, {});
  CHECK(held.q.col(1).isConstant(1.0, 0.0));
  CHECK(held.qd.col(1).isZero(0.0));
  CHECK(held.q.col(0).maxCoeff() - held.q.col(0).minCoeff() > 0.5);  // [rad] the other one moves
  std::string notes;
  for (const std::string& note : fourier_notes(model, {})) notes += note + "\n";
  for (const char* text : {"shoulder: no position limits, it moves within -1 to 1 rad",
                           "elbow: its limits leave no range, it is held at 1 rad",
                           "elbow: no velocity limit (0)", "elbow: no effort limit (0)"})
    CHECK_THAT(notes, Catch::Matchers::ContainsSubstring(text));
  for (ModelLink& link : model.links) link.limits.lower = link.limits.upper = 0.0;
  CHECK_THROWS_AS(random_fourier(model, {}), ModelError);
}

TEST_CASE("trajectory file: comes back bit by bit; what is wrong is placed", "[io]") {
  const TemporaryFolder folder;
  const Trajectory t = motion(read_model(kWam), 1);
  const std::filesystem::path path = folder.path() / "t.csv";
  write_trajectory(t, path);
  const Trajectory back = read_trajectory(path);
  CHECK(back.joint_names == t.joint_names);
  CHECK(back.time == t.time);
  CHECK(back.q == t.q);
  CHECK(back.qd == t.qd);
  CHECK(back.qdd == t.qdd);

  struct Case {
    const char *text, *message;
  };
  const Case c = GENERATE(
      Case{"", "t.csv:1: there is no column 'time'"}, Case{"time\n0\n1\n", "qcmd_<joint>"},
      Case{"time,qcmd_a\n0,0\n", "two rows"}, Case{"time,qcmd_a\n0,0\n0,0\n", "t.csv:3: time"},
      Case{"time,qcmd_a\n0,x\n", "t.csv:2: column 'qcmd_a' holds 'x'"},
      Case{"time,qcmd_a\n0,nan\n", "finite"}, Case{"time,qcmd_a\n0\n", "has 1 cells"});
  CAPTURE(c.text);
  write_file_atomically(path, c.text);
  CHECK_THROWS_WITH(read_trajectory(path), ContainsSubstring(c.message));
}

TEST_CASE("trajectory file: velocities that are missing are differences", "[io]") {
  const TemporaryFolder folder;
  write_file_atomically(folder.path() / "t.csv", "time,qcmd_a,other\n0,1,x\n1,3,y\n2,5,z\n");
  const Trajectory t = read_trajectory(folder.path() / "t.csv");
  CHECK(t.qd == RowMatX<double>::Constant(3, 1, 2.0));
  CHECK(t.qdd == RowMatX<double>::Zero(3, 1));
}

TEST_CASE("world: names, keys, and what there is instead", "[io]") {
  const WorldSpec w = parse_world("mujoco:wam4,perturb=B,seed=7,noise=0.5");
  CHECK(w.mjcf.filename() == "wam4.xml");
  CHECK(w.perturbation.com == surrogate_b().com);
  CHECK(w.seed == 7u);
  CHECK(w.noise == 0.5);
  CHECK(parse_world("mujoco:" + kWam).perturbation.com == surrogate_a().com);
  CHECK_THROWS_WITH(parse_world("gazebo:wam4"), ContainsSubstring("expected mujoco:NAME"));
  CHECK_THROWS_WITH(parse_world("mujoco:wam"),
                    ContainsSubstring("cart_pole, furuta, wam4, wam4_ball"));
  CHECK_THROWS_WITH(parse_world("mujoco:wam4,colour=1"),
                    ContainsSubstring("keys: perturb, seed, noise, effect, repetitions"));
  CHECK_THROWS_WITH(parse_world("mujoco:wam4,seed=x"), ContainsSubstring("seed = 'x'"));
  CHECK_THROWS_WITH(parse_world("mujoco:wam4,noise=-1"), ContainsSubstring("negative"));
  CHECK_THROWS_WITH(parse_world("mujoco:wam4,noise=inf"), ContainsSubstring("infinite"));
  CHECK_THROWS_WITH(parse_world("mujoco:wam4,repetitions=100000000"),
                    ContainsSubstring("repetitions must be 1 or more, at most"));
  CHECK_THROWS_WITH(parse_world("mujoco:wam4,perturb=Q"),
                    ContainsSubstring("choices: none, A, B, C"));
}

}  // namespace simulate_test
