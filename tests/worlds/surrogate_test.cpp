/// Surrogates: what their files draw, and what MuJoCo makes of elastic, sticking, late drives.

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/worlds/world.hpp>

#include "sim/mujoco_plant.hpp"
#include "support/add_effect.hpp"
#include "support/temporary_folder.hpp"

namespace surrogate_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

const std::string kCup = DIFFNEA_SOURCE_DIR "/models/wam4_ball_in_cup.xml";
const std::string kWam = DIFFNEA_SOURCE_DIR "/models/wam4.xml";

double value_of(const Model& model, const std::string& effect, const std::string& where,
                const std::string& parameter) {
  for (const EffectSpec& e : model.effects)
    if (e.effect == effect && e.where == where)
      for (const EffectParameter& p : e.parameters)
        if (p.name == parameter) return p.value;
  return std::nan("");
}

Trajectory swing(const Model& model, double seconds) {
  Trajectory t;
  t.joint_names = joint_names(model);
  const long rows = std::lround(seconds * 500.0) + 1;
  t.time = VecX<double>::LinSpaced(rows, 0.0, seconds);
  t.q.resize(rows, 4);
  t.qd.resize(rows, 4);
  t.qdd = RowMatX<double>::Zero(rows, 4);
  const Eigen::Vector4d home{0.0, 0.6, 0.0, 1.25};
  for (long k = 0; k < rows; ++k)
    for (int j = 0; j < 4; ++j) {
      const double pace = 5.0 + j;
      t.q(k, j) = home[j] + 0.2 * (1.0 - std::cos(pace * t.time[k]));
      t.qd(k, j) = 0.2 * pace * std::sin(pace * t.time[k]);
    }
  return t;
}

RecordOptions quiet() {
  RecordOptions o;
  o.scale_noise(0.0);
  o.camera_rate = 500.0;
  return o;
}

}  // namespace

TEST_CASE("surrogate: A and B draw what they drew when results were published", "[io]") {
  struct Drawn {
    Perturbation ranges;
    std::uint64_t seed;
    double mass1, mass2, length, viscous4;
  };
  // Of the release before the files, digit by digit.
  for (const Drawn& d : {Drawn{surrogate_a(), 1, 12.025548628045939, 4.5769846280563735,
                               0.40126334047183515, 0.85355991601483727},
                         Drawn{surrogate_a(), 3, 11.988514343735496, 4.2646434475415527,
                               0.39853531357442173, 0.92476521179115534},
                         Drawn{surrogate_b(), 1, 13.283409586091878, 5.2790316961127468,
                               0.40252668094367022, 1.7071198320296745},
                         Drawn{surrogate_b(), 2, 9.6609879982909757, 4.7315813461246945,
                               0.40705641123163272, 1.9220344543024979}}) {
    CAPTURE(d.seed);
    const Model truth = perturbed(read_model(kCup), d.ranges, d.seed);
    CHECK(truth.links[1].inertia.m == d.mass1);
    CHECK(truth.links[2].inertia.m == d.mass2);
    CHECK(truth.ball->string->length == d.length);
    CHECK(value_of(truth, "viscous_friction", "joint4", "viscous") == d.viscous4);
    CHECK(truth.effects.size() == 12);
  }
}

TEST_CASE("surrogate: C is the B of its seed, with drives as cable arms have them", "[io]") {
  const Model nominal = read_model(kCup);
  const Eigen::Vector4d home{0.0, 0.6, 0.0, 1.25};
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    CAPTURE(seed);
    const Model b = perturbed(nominal, surrogate_b(), seed),
                c = perturbed(nominal, surrogate_c(), seed);
    for (std::size_t i = 0; i < b.links.size(); ++i)
      CHECK(b.links[i].inertia.m == c.links[i].inertia.m);
    CHECK(b.ball->string->length == c.ball->string->length);
    Tree<double> tree = make_tree(c);
    for (Link<double>& link : tree.links) link.armature = 0.0;
    MassMatrixWorkspace<double, double> ws;
    const MatX<double> M = mass_matrix<double, double>(tree, VecX<double>(home), ws);
    VecX<double> K(4);
    for (int j = 1; j <= 4; ++j) {
      const std::string joint = "joint" + std::to_string(j);
      K[j - 1] = value_of(c, "joint_elasticity", joint, "stiffness");
      const double coulomb = value_of(c, "coulomb_friction", joint, "coulomb"),
                   more = value_of(c, "stribeck_friction", joint, "stiction_excess");
      CHECK(more >= 0.1 * coulomb);
      CHECK(more <= 0.3 * coulomb);
    }
    // With the rotors locked.
    const Eigen::GeneralizedSelfAdjointEigenSolver<MatX<double>> modes(MatX<double>(K.asDiagonal()),
                                                                       M);
    const VecX<double> hz = modes.eigenvalues().cwiseSqrt() / (2.0 * M_PI);
    CAPTURE(hz.transpose());
    CHECK(hz[0] > 7.0);
    CHECK(hz[0] < 14.0);
    CHECK(hz[2] < 30.0);
    const double delay = value_of(c, "actuator_delay", "all", "delay"),
                 camera = value_of(c, "camera_delay", "camera", "delay");
    CHECK((delay >= 1e-3 && delay <= 3e-3));
    CHECK((camera >= 5e-3 && camera <= 15e-3));
  }
}

TEST_CASE("world: how it differs from its description is listed", "[io]") {
  using Clauses = std::vector<std::string>;
  const std::string name = "mujoco:" + kCup;
  CHECK(differences(parse_world(name + ",perturb=none,rope=none")).empty());
  CHECK(differences(parse_world(name + ",perturb=none,rope=heavy")) ==
        Clauses{"a rope of 2.25 g in place of a massless string"});
  CHECK(differences(parse_world(name + ",perturb=none,effect=joint_spring@joint4:stiffness=2")) ==
        Clauses{"joint_spring at joint4"});
  CHECK(differences(parse_world(kBallInCupWorld)) ==
        Clauses{"masses -8…+20 %", "inertias +10…+20 %", "centres of mass up to 15 mm off",
                "Coulomb friction +0.6…1.5 N·m", "viscous friction +0.5…1.2 N·m·s/rad",
                "rotor inertias +0.03…0.1 kg·m²", "string tied up to 12 mm elsewhere",
                "string length up to 8 mm off", "cup tilted by up to 2°",
                "a rope of 1.2 g in place of a massless string"});
  const Clauses c = differences(parse_world(name + ",perturb=C,string=0.4"));
  for (const char* clause :
       {"elastic drives, 40…55 mrad at the effort limit", "stiction 10…30 % above Coulomb",
        "drives 1…3 ms late", "torque noise of 0.05 N·m", "camera 5…15 ms late"})
    CHECK(std::ranges::count(c, clause) == 1);
  CHECK(std::ranges::count(c, "string length up to 16 mm off") == 0);  // given, not drawn
}

TEST_CASE("surrogate: what is wrong in a file is named", "[io]") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "mine.json";
  const auto read = [&](const std::string& rest) {
    write_file_atomically(path, R"({"schema": "diffnea/surrogate/1")" + rest + "}");
    return read_surrogate(path);
  };
  CHECK(read(R"(, "mass": [-0.1, 0.2], "com": 0.01)").ranges.mass_high == 0.2);
  CHECK_THROWS_WITH(read(R"(, "mas": [0, 1])"),
                    ContainsSubstring("mas") && ContainsSubstring("mass"));
  CHECK_THROWS_WITH(read(R"(, "coulomb": [2, 1])"),
                    ContainsSubstring("coulomb: got [2,1], expected [low, high]"));
  CHECK_THROWS_WITH(read(R"(, "mass": [-1.5, 0])"), ContainsSubstring("none below"));
  CHECK_THROWS_WITH(read(R"(, "viscous": 1)"), ContainsSubstring("viscous"));
  CHECK_THROWS_WITH(read(R"(, "stiction": [0.1, 0.2])"), ContainsSubstring("stribeck_velocity"));
  CHECK_THROWS_WITH(read(R"(, "com": -1)"), ContainsSubstring("0 or more"));
  write_file_atomically(path, R"({"schema": "diffnea/model/1"})");
  CHECK_THROWS_WITH(read_surrogate(path), ContainsSubstring("diffnea/surrogate/1"));
  read(R"(, "com": 0.25)");
  CHECK(parse_world("mujoco:" + kWam + ",perturb=" + path.string()).perturbation.com == 0.25);
  CHECK(parse_world("mujoco:" + kWam + ",perturb=C").perturbation.stiction_high == 0.3);
  CHECK_THROWS_WITH(parse_world("mujoco:" + kWam + ",perturb=D"),
                    ContainsSubstring("choices: none, A, B, C, or the path"));
  read(R"(, "string": 5)");
  CHECK_THROWS_WITH(perturbed(read_model(kCup), find_surrogate(path.string()), 1),
                    ContainsSubstring("cannot become up to 5"));
  CHECK_THAT(worlds_text(), ContainsSubstring("C: B with cables"));
}

TEST_CASE("MuJoCo world: rotors of its own move links as the reference plant's motors do",
          "[sim][mujoco]") {
  // Without dry friction, which MuJoCo softens: viscous friction on the rotors, springs, a delay.
  const double encoder = GENERATE(0.0, 1.0);
  const Model nominal = read_model(kWam);
  Model truth = nominal;
  const double stiffness[] = {3000.0, 2500.0, 900.0, 1400.0};
  for (int j = 1; j <= 4; ++j) {
    const std::string joint = "joint" + std::to_string(j);
    add(truth, "viscous_friction", joint, {{"viscous", 1.5}});
    add(truth, "torque_offset", joint, {{"offset", 0.3}});
    add(truth, "joint_elasticity", joint,
        {{"stiffness", stiffness[j - 1]},
         {"damping", 1.5e-3 * stiffness[j - 1]},
         {"motor_inertia", value_of(nominal, "armature", joint, "armature")},
         {"friction_share", 0.7},
         {"encoder_side", encoder}});
  }
  add(truth, "actuator_delay", "all", {{"delay", 2.5e-3}});
  const Trajectory t = swing(nominal, 1.5);
  const std::string document = read_mjcf(kWam);
  CHECK_THROWS_WITH(record_in_mujoco(document, truth, nominal, t, quiet()),
                    ContainsSubstring("with_rotors"));
  const SimulatedRecording theirs =
      record_in_mujoco(with_rotors(document, truth), truth, nominal, t, quiet());
  const SimulatedRecording ours = record_model(truth, nominal, t, quiet());
  REQUIRE(theirs.failure.empty());
  // Two integrations of order four of one equation.
  CHECK((theirs.recording.q - ours.recording.q).cwiseAbs().maxCoeff() < 1e-6);
  Model rigid = truth;
  std::erase_if(rigid.effects, [](const EffectSpec& e) { return e.effect == "joint_elasticity"; });
  const SimulatedRecording without = record_model(rigid, nominal, t, quiet());
  CHECK((theirs.recording.q - without.recording.q).cwiseAbs().maxCoeff() > 5e-4);
}

TEST_CASE("MuJoCo world: a drive sticks up to F_c + F_s, and slides with less", "[sim][mujoco]") {
  const std::string wheel =
      "<mujoco model='wheel'><compiler angle='radian'/><worldbody><body name='wheel'>"
      "<joint name='hub' axis='0 0 1'/><inertial pos='0 0 0' mass='1' diaginertia='0.1 0.1 0.1'/>"
      "</body></worldbody></mujoco>";
  const TemporaryFolder folder;
  write_file_atomically(folder.path() / "wheel.xml", wheel);
  Model truth = read_model(folder.path() / "wheel.xml");
  add(truth, "armature", "hub", {{"armature", 0.05}});
  add(truth, "coulomb_friction", "hub", {{"coulomb", 1.0}});
  add(truth, "stribeck_friction", "hub", {{"stiction_excess", 0.5}, {"stribeck_velocity", 0.05}});
  add(truth, "joint_elasticity", "hub",
      {{"stiffness", 500.0}, {"damping", 1.0}, {"motor_inertia", 0.05}, {"friction_share", 1.0}});
  const auto robot = std::make_shared<const sim::MujocoRobot>(
      with_rotors(read_mjcf(folder.path() / "wheel.xml"), truth), truth, 500.0, 5e-4);
  const auto pushed = [&](sim::MujocoPlant& plant, double torque, double seconds) {
    for (long k = 0; k < std::lround(seconds * 500.0); ++k)
      REQUIRE(plant.step(VecX<double>::Constant(1, torque)) == "");
    return plant.qd()[0];
  };
  sim::MujocoPlant stuck(robot), slides(robot);
  stuck.reset(VecX<double>::Zero(1));
  slides.reset(VecX<double>::Zero(1));
  pushed(stuck, 1.4, 2.0);
  CHECK(std::abs(stuck.q()[0]) < 2e-3);  // MuJoCo's friction creeps, 0.1 mrad/s
  CHECK(pushed(slides, 1.6, 1.0) > 1.0);
  // Once it slides, Coulomb's friction is left: 1.2 N·m accelerate it, (1.2 − 1)/0.15 rad/s².
  const double before = slides.qd()[0];
  CHECK(std::abs((pushed(slides, 1.2, 0.5) - before) - 0.5 * 0.2 / 0.15) < 0.02);
}

TEST_CASE("MuJoCo world: the camera is late, and shows the path that there was", "[sim][mujoco]") {
  const Model nominal = read_model(kCup);
  const Trajectory t = swing(nominal, 1.0);
  const auto balls = [&](double delay) {
    Model truth = nominal;
    if (delay > 0.0) add(truth, "camera_delay", "camera", {{"delay", delay}});
    return record_in_mujoco(read_mjcf(kCup), truth, nominal, t, quiet()).recording.ball;
  };
  Model early = nominal;
  add(early, "camera_delay", "camera", {{"delay", -10e-3}});
  CHECK_THROWS_WITH(record_in_mujoco(read_mjcf(kCup), early, nominal, t, quiet()),
                    ContainsSubstring("camera_delay"));
  const RowMatX<double> now = balls(0.0), late = balls(10e-3), between = balls(9e-3);
  const long rows = now.rows();
  CHECK((late.bottomRows(rows - 5) - now.topRows(rows - 5)).cwiseAbs().maxCoeff() < 1e-12);
  CHECK(late.row(3) == late.row(0));  // it hung there before
  // 9 ms are in the middle of two periods: a cubic, but for the impacts of the string.
  const RowMatX<double> middle =
      (9.0 * (now.middleRows(5, rows - 10) + now.middleRows(4, rows - 10)) -
       (now.middleRows(6, rows - 10) + now.middleRows(3, rows - 10))) /
      16.0;
  CHECK((between.middleRows(9, rows - 10) - middle).cwiseAbs().mean() < 1e-6);
}

TEST_CASE("MuJoCo world: surrogate C is the same for a seed, in recordings and in transfer",
          "[sim][mujoco]") {
  const Model nominal = read_model(kCup);
  const Trajectory t = swing(nominal, 0.3);
  const WorldSpec world = parse_world("mujoco:" + kCup + ",perturb=C,rope=mid,seed=2");
  const auto record = [&](std::uint64_t seed) {
    WorldSpec w = world;
    w.seed = seed;
    return record_in_world(w, nominal, t, quiet(), 0).result;
  };
  const SimulatedRecording once = record(2), again = record(2), other = record(3);
  REQUIRE(once.failure.empty());
  CHECK(once.recording.q == again.recording.q);
  CHECK(once.recording.ball == again.recording.ball);
  CHECK(once.recording.q != other.recording.q);
  // One robot's recordings by number: the drives' noise is that of each.
  const auto numbered = [&](std::uint64_t number) {
    return record_in_world(world, nominal, t, quiet(), 0, /*threads=*/1, number);
  };
  const WorldRecording first_of_it = numbered(0), second_of_it = numbered(1);
  CHECK(first_of_it.result.recording.q == once.recording.q);
  CHECK(second_of_it.result.recording.q != once.recording.q);
  CHECK(second_of_it.truth.ball->string->length == first_of_it.truth.ball->string->length);
  Model truth;
  MujocoSimulatorOptions options;
  options.lanes = 2;
  const std::unique_ptr<Simulator> simulator = make_simulator(world, nominal, options, 0, &truth);
  CHECK(std::isfinite(value_of(truth, "joint_elasticity", "joint1", "stiffness")));
  const Eigen::Vector4d home{0.0, 0.6, 0.0, 1.25};
  const auto last = [&](std::uint64_t seed) {
    simulator->reset({home.replicate(1, 2), {seed, 7}});
    for (long k = 0; k < 100; ++k)
      simulator->step(t.q.row(k).transpose().replicate(1, 2),
                      t.qd.row(k).transpose().replicate(1, 2));
    CHECK(simulator->failures()[0].empty());
    return Lanes(simulator->observe());
  };
  const Lanes first = last(7);
  CHECK(first.col(0) == first.col(1));
  CHECK(last(7) == first);
  CHECK(last(8).col(0) != first.col(0));  // the drives' noise is the seed's
  CHECK(last(8).col(1) == first.col(1));
}

}  // namespace surrogate_test
