/// MuJoCo as a policy's world: lanes that are worlds of their own, and move as recordings do.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <sys/wait.h>
#include <unistd.h>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>
#include <mujoco/mujoco.h>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/mujoco_simulator.hpp>
#include <diffnea/worlds/world.hpp>

#include "support/matrix_near.hpp"
#include "support/temporary_folder.hpp"

namespace mujoco_simulator_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

const std::string kFile = DIFFNEA_SOURCE_DIR "/models/wam4_ball.xml";
const Eigen::Vector4d kHome{0.0, 0.6, 0.0, 1.25};

std::unique_ptr<Simulator> world(const std::string& keys, const MujocoSimulatorOptions& options,
                                 Model* truth = nullptr) {
  return make_simulator(parse_world("mujoco:" + kFile + keys), read_model(kFile), options,
                        /*seed=*/1, truth);
}

Starts starts(const std::vector<std::uint64_t>& seeds) {
  return {kHome.replicate(1, static_cast<long>(seeds.size())), seeds};
}

/// Where lane `lane` should be at step k: a swing of joints 2 and 4, of its own in every lane.
struct Command {
  Lanes q, qd;
};
Command command(long k, const std::vector<double>& sizes) {
  const double t = static_cast<double>(k) / 500.0;
  Command c{kHome.replicate(1, static_cast<long>(sizes.size())),
            Lanes::Zero(4, static_cast<long>(sizes.size()))};
  for (std::size_t lane = 0; lane < sizes.size(); ++lane)
    for (const int j : {1, 3}) {
      c.q(j, static_cast<long>(lane)) += sizes[lane] * (1.0 - std::cos(6.0 * t));
      c.qd(j, static_cast<long>(lane)) = sizes[lane] * 6.0 * std::sin(6.0 * t);
    }
  return c;
}

/// Observations of one lane, a row each: at the start and after every step.
using Run = RowMatX<double>;
Run run(Simulator& simulator, const Starts& begin, const std::vector<double>& sizes, long steps,
        int lane) {
  simulator.reset(begin);
  Run out(steps + 1, static_cast<long>(simulator.channels().size()));
  out.row(0) = simulator.observe().col(lane).transpose();
  for (long k = 0; k < steps; ++k) {
    const Command c = command(k, sizes);
    simulator.step(c.q, c.qd);
    out.row(k + 1) = simulator.observe().col(lane).transpose();
  }
  CHECK(simulator.failures()[lane] == "");
  return out;
}

long channel(const Simulator& simulator, const std::string& name) {
  const auto it = std::ranges::find(simulator.channels(), name);
  REQUIRE(it != simulator.channels().end());
  return it - simulator.channels().begin();
}

Eigen::Vector3d triple(const Simulator& simulator, const Run& r, long row,
                       const std::string& first) {
  return r.row(row).segment(channel(simulator, first), 3).transpose();
}

}  // namespace

TEST_CASE("MuJoCo simulator: without a start it does not move", "[sim]") {
  const std::unique_ptr<Simulator> simulator = world("", {});
  const Command still = command(0, {0.0});
  CHECK_THROWS_WITH(simulator->step(still.q, still.qd), ContainsSubstring("reset"));
  simulator->reset(starts({0}));
  CHECK_THROWS_WITH(simulator->clone()->step(still.q, still.qd), ContainsSubstring("reset"));
}

TEST_CASE("mujoco: an error of its own ends the process, without a log file or a key", "[sim]") {
  const TemporaryFolder folder;
  const pid_t child = ::fork();
  if (child == 0) {
    const bool ready = ::chdir(folder.path().c_str()) == 0 && std::freopen("said", "w", stderr);
    if (ready) mju_error("the stack is full");
    std::_Exit(99);
  }
  int status = 0;
  REQUIRE(::waitpid(child, &status, 0) == child);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == EXIT_FAILURE);
  CHECK(read_text_file(folder.path() / "said") ==
        "error: MuJoCo cannot go on: the stack is full\n");
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
    left.push_back(entry.path().filename());
  CHECK(left == std::vector<std::string>{"said"});
}

TEST_CASE("MuJoCo simulator: channels are joints, ball, cup and phase, as far as there are any",
          "[mujoco_simulator]") {
  const std::unique_ptr<Simulator> with = world(",perturb=none", {});
  CHECK(with->joints() == std::vector<std::string>{"joint1", "joint2", "joint3", "joint4"});
  CHECK(with->channels() ==
        std::vector<std::string>{
            "q_joint1",  "q_joint2", "q_joint3", "q_joint4", "qd_joint1", "qd_joint2", "qd_joint3",
            "qd_joint4", "ball_x",   "ball_y",   "ball_z",   "ball_vx",   "ball_vy",   "ball_vz",
            "cup_x",     "cup_y",    "cup_z",    "axis_x",   "axis_y",    "axis_z",    "phase"});
  CHECK(with->period() == 0.002);
  const std::string pole = DIFFNEA_SOURCE_DIR "/models/cart_pole.xml";
  const Model model = read_model(pole);
  MujocoSimulator without(read_mjcf(pole), model, model, {});
  CHECK(without.joints() == std::vector<std::string>{"cart"});  // nobody drives the pole
  CHECK(without.channels() == std::vector<std::string>{"q_cart", "q_pole", "qd_cart", "qd_pole"});
  without.reset({Lanes::Constant(1, 1, 0.1), {0}});
  CHECK(std::abs(without.observe()(0, 0) - 0.1) < 1e-3);  // held while it settles
}

TEST_CASE("MuJoCo simulator: a lane depends on its start, seed and commands alone",
          "[mujoco_simulator]") {
  const MujocoSimulatorOptions one{
      .settle_time = 0.05, .position_noise = 1e-4, .torque_noise = 0.05, .encoder_noise = 1e-3};
  MujocoSimulatorOptions three = one;
  three.lanes = 3;
  for (const std::string keys : {",perturb=A", ",perturb=A,ball=chain", ",perturb=C,ball=chain"}) {
    CAPTURE(keys);
    const std::unique_ptr<Simulator> alone = world(keys, one), among = world(keys, three);
    const std::unique_ptr<Simulator> other = among->clone();
    const Run first = run(*alone, starts({7}), {0.2}, 100, 0);
    // Bit by bit: the same numbers, not near ones.
    CHECK(run(*alone, starts({7}), {0.2}, 100, 0) == first);
    CHECK(run(*among, starts({5, 7, 6}), {-0.1, 0.2, 0.3}, 100, 1) == first);
    CHECK(run(*other, starts({5, 7}), {0.3, 0.2}, 100, 1) == first);
    CHECK(run(*among, starts({7}), {0.2, 0.2, 0.2}, 100, 0) == first);
    CHECK(run(*alone, starts({8}), {0.2}, 100, 0) != first);
  }
}

TEST_CASE("MuJoCo simulator: the robot moves as record_in_world has it", "[mujoco_simulator]") {
  Trajectory t;
  t.source = "swing";
  t.joint_names = {"joint1", "joint2", "joint3", "joint4"};
  const long rows = 501;
  t.time = VecX<double>::LinSpaced(rows, 0.0, 1.0);
  t.q.resize(rows, 4);
  t.qd.resize(rows, 4);
  t.qdd = RowMatX<double>::Zero(rows, 4);
  for (long k = 0; k < rows; ++k) {
    const Command c = command(k, {0.2});
    t.q.row(k) = c.q.col(0).transpose();
    t.qd.row(k) = c.qd.col(0).transpose();
  }
  RecordOptions quiet;
  quiet.scale_noise(0.0);
  quiet.camera_rate = 500.0;
  const WorldSpec spec = parse_world("mujoco:" + kFile + ",perturb=A");
  const Recording recorded =
      record_in_world(spec, read_model(kFile), t, quiet, /*seed=*/1).result.recording;
  const std::unique_ptr<Simulator> simulator = world(",perturb=A", {.settle_time = 0.0});
  const Run r = run(*simulator, starts({3}), {0.2}, rows - 1, 0);
  // The recording interpolates its commands: rounding, which the motion does not amplify much.
  CHECK_THAT(RowMatX<double>(r.leftCols(4)), MatrixNear(recorded.q, 1e-9));
  CHECK_THAT(RowMatX<double>(r.middleCols(channel(*simulator, "ball_x"), 3)),
             MatrixNear(recorded.ball, 1e-8));
}

TEST_CASE("MuJoCo simulator: at the start the ball hangs at rest below where it is tied",
          "[mujoco_simulator]") {
  for (const std::string keys : {",perturb=A", ",perturb=B,ball=chain"}) {
    CAPTURE(keys);
    Model truth;
    const std::unique_ptr<Simulator> simulator = world(keys, {}, &truth);
    const Run r = run(*simulator, starts({1}), {0.0}, 1, 0);
    const VecX<double> q = r.row(0).head(4);
    const StringSpec& string = *truth.ball->string;
    const TreeMap map = map_to_tree(truth);
    LinkKinematics<double> kinematics;
    forward_kinematics<double, double>(make_tree(truth), q, kinematics);
    const Pose<double> X_LS =
        map.X_LF[string.link] * Pose<double>{Mat3<double>::identity(), string.p_LS};
    const Eigen::Vector3d anchor = to_eigen(frame_pose(kinematics, map.dof[string.link], X_LS).p);
    // The tendon's limit starts where it ends; the chain is as long as it is.
    CHECK_THAT(triple(*simulator, r, 0, "ball_x"),
               MatrixNear(Eigen::Vector3d(anchor - Eigen::Vector3d(0, 0, string.length)), 1e-9));
    CHECK(triple(*simulator, r, 0, "ball_vx").norm() <
          5e-3);                       // that of the arm, which sags no more
    CHECK((q - kHome).norm() > 1e-4);  // the controller's gravity is not its own
    CHECK((q - kHome).norm() < 0.1);
  }
}

TEST_CASE("MuJoCo simulator: cup and axis are the truth's, tilt included", "[mujoco_simulator]") {
  Model truth;
  const std::unique_ptr<Simulator> simulator = world(",perturb=B", {.settle_time = 0.1}, &truth);
  const Run r = run(*simulator, starts({1}), {0.3}, 200, 0);
  const auto frame = std::ranges::find(truth.frames, "cup", &ModelFrame::name);
  const TreeMap map = map_to_tree(truth);
  LinkKinematics<double> kinematics;
  const VecX<double> q = r.row(200).head(4);
  forward_kinematics<double, double>(make_tree(truth), q, kinematics);
  const Pose<double> X_WC =
      frame_pose(kinematics, map.dof[frame->link], map.X_LF[frame->link] * frame->X_LF);
  CHECK_THAT(triple(*simulator, r, 200, "cup_x"), MatrixNear(to_eigen(X_WC.p), 1e-9));
  CHECK_THAT(triple(*simulator, r, 200, "axis_x"), MatrixNear(to_eigen(X_WC.R.col[2]), 1e-9));
}

TEST_CASE("MuJoCo simulator: the ball's velocity is the change of its position",
          "[mujoco_simulator]") {
  for (const std::string keys : {",perturb=none", ",perturb=none,ball=chain"}) {
    CAPTURE(keys);
    const std::unique_ptr<Simulator> simulator = world(keys, {.settle_time = 0.0});
    const Run r = run(*simulator, starts({1}), {0.2}, 250, 0);
    double fastest = 0.0;
    for (long k = 100; k < 250; ++k) {
      const Eigen::Vector3d v = triple(*simulator, r, k, "ball_vx"),
                            difference = (triple(*simulator, r, k + 1, "ball_x") -
                                          triple(*simulator, r, k - 1, "ball_x")) /
                                         (2.0 * simulator->period());
      fastest = std::max(fastest, v.norm());
      // A taut string jerks: h² times the jerk.
      CHECK_THAT(v, MatrixNear(difference, 2e-2));
    }
    CHECK(fastest > 0.5);
  }
}

TEST_CASE("MuJoCo simulator: noise makes runs differ, an encoder's offset stays in the posture",
          "[mujoco_simulator]") {
  const int lanes = 12;
  std::vector<std::uint64_t> seeds(lanes);
  for (int k = 0; k < lanes; ++k) seeds[k] = static_cast<std::uint64_t>(k);
  const std::vector<double> still(lanes, 0.0);
  const auto spread = [&](MujocoSimulatorOptions options) {  // of joint 3 in the end
    options.lanes = lanes;
    options.settle_time = 0.2;
    const std::unique_ptr<Simulator> simulator = world(",perturb=none", options);
    run(*simulator, starts(seeds), still, 150, 0);
    const VecX<double> q = simulator->observe().row(2);
    return std::sqrt((q.array() - q.mean()).square().sum() / (lanes - 1));
  };
  CHECK(spread({}) < 1e-15);
  CHECK(spread({.position_noise = 1e-4}) > 1e-6);
  CHECK(spread({.torque_noise = 0.05}) > 1e-6);
  // 12 draws: their deviation is within 50 % but once in 500; noise that is drawn anew every period
  // would leave a tenth.
  const double posture = spread({.encoder_noise = 2e-3});
  CHECK((posture > 1e-3 && posture < 3e-3));
}

TEST_CASE("MuJoCo simulator: with its own model computed torque follows more closely than PD",
          "[mujoco_simulator]") {
  const auto error = [&](ControlLaw law) {
    const std::unique_ptr<Simulator> simulator =
        world(",perturb=none", {.controller = {.law = law}});
    const Run r = run(*simulator, starts({1}), {0.3}, 400, 0);
    double worst = 0.0;
    for (long k = 0; k < r.rows(); ++k)
      worst = std::max(worst, (r.row(k).head(4).transpose() - command(k, {0.3}).q.col(0)).norm());
    return worst;
  };
  const double pd = error(ControlLaw::kPd), computed = error(ControlLaw::kComputedTorque);
  CAPTURE(pd, computed);
  CHECK(computed < 0.2 * pd);
}

TEST_CASE("MuJoCo simulator: a lane that diverges says so, keeps still, and the others go on",
          "[mujoco_simulator]") {
  const std::unique_ptr<Simulator> simulator =
      world(",perturb=none", {.lanes = 2, .settle_time = 0.0});
  simulator->reset(starts({1, 1}));
  Command c = command(0, {0.0, 0.0});
  simulator->step(c.q, c.qd);
  const VecX<double> before = simulator->observe().col(1);
  c.qd(2, 1) = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 3; ++k) simulator->step(c.q, c.qd);
  CHECK(simulator->failures()[0] == "");
  CHECK_THAT(simulator->failures()[1], ContainsSubstring("MuJoCo warns"));
  CHECK(simulator->observe().col(1) == before);
  CHECK(simulator->observe().allFinite());
  simulator->reset(starts({1, 1}));
  CHECK(simulator->failures() == std::vector<std::string>{"", ""});
  CHECK(simulator->observe().col(1) == simulator->observe().col(0));
}

TEST_CASE("MuJoCo simulator: what does not fit is refused", "[mujoco_simulator]") {
  const std::unique_ptr<Simulator> simulator = world(",perturb=none", {.lanes = 2});
  CHECK_THROWS_WITH(simulator->reset(starts({1, 2, 3})),
                    ContainsSubstring("got 3 starts, expected 1 to 2"));
  CHECK_THROWS_AS(simulator->reset(starts({})), ShapeError);
  CHECK_THROWS_WITH(simulator->reset({Lanes::Zero(3, 1), {1}}),
                    ContainsSubstring("got 3 values, expected 4 (one per driven joint)"));
  CHECK_THROWS_AS(simulator->reset({Lanes::Zero(4, 2), {1}}), ShapeError);
  simulator->reset(starts({1, 2}));
  CHECK_THROWS_AS(simulator->step(Lanes::Zero(4, 1), Lanes::Zero(4, 2)), ShapeError);
  CHECK_THROWS_AS(simulator->step(Lanes::Zero(4, 2), Lanes::Zero(3, 2)), ShapeError);
  CHECK_THROWS_AS(world("", {.lanes = 0}), Error);
  CHECK_THROWS_AS(world("", {.settle_time = -1.0}), Error);
  CHECK_THROWS_AS(world("", {.torque_noise = -1.0}), Error);
  const Model other = read_model(DIFFNEA_SOURCE_DIR "/models/furuta.xml");
  CHECK_THROWS_WITH(MujocoSimulator(read_mjcf(kFile), read_model(kFile), other, {}),
                    ContainsSubstring("its joints are not those of the robot"));
}

}  // namespace mujoco_simulator_test
