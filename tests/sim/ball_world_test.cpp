/// The ball of a MuJoCo world: where the string says, as the model's equations have it, in the cup.

#include <cmath>
#include <cstdlib>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/identify/ball_fit.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/worlds/world.hpp>

#include "sim/mujoco_model.hpp"
#include "support/matrix_near.hpp"

namespace ball_world_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

namespace {

const std::string kFile = DIFFNEA_SOURCE_DIR "/models/wam4_ball.xml";
constexpr double kRate = 500.0;

WorldSpec world(const std::string& keys) { return parse_world("mujoco:" + kFile + keys); }

/// From rest at home to sines that swing the ball by 20° or so.
Trajectory swinging(double seconds) {
  const double home[4] = {0.0, 0.6, 0.0, 1.25}, size[4] = {0.15, 0.08, 0.4, 0.2},
               hertz[4] = {0.6, 0.3, 0.2, 0.45};
  Trajectory t;
  t.source = "swinging";
  t.joint_names = {"joint1", "joint2", "joint3", "joint4"};
  const long rows = std::lround(seconds * kRate) + 1;
  t.time.resize(rows);
  t.q.resize(rows, 4);
  t.qd.resize(rows, 4);
  t.qdd = RowMatX<double>::Zero(rows, 4);
  for (long k = 0; k < rows; ++k) {
    const double time = static_cast<double>(k) / kRate, grown = 1.0 - std::exp(-time * time);
    t.time[k] = time;
    for (int j = 0; j < 4; ++j) {
      const double w = 6.283185307179586 * hertz[j];
      t.q(k, j) = home[j] + size[j] * grown * std::sin(w * time);
      t.qd(k, j) = size[j] * (grown * w * std::cos(w * time) +
                              2.0 * time * (1.0 - grown) * std::sin(w * time));
    }
  }
  return t;
}

RecordOptions quiet() {
  RecordOptions o;
  o.scale_noise(0.0);
  return o;
}

WorldRecording record(const std::string& keys, double seconds, const RecordOptions& o = quiet()) {
  return record_in_world(world(keys), read_model(kFile), swinging(seconds), o, /*seed=*/1);
}

/// Distances of the ball from where its string is tied, of the rows that show it.
VecX<double> distances(const WorldRecording& made) {
  const Model& truth = made.truth;
  const Recording& r = made.result.recording;
  const Tree<double> tree = make_tree(truth);
  const TreeMap map = map_to_tree(truth);
  const StringSpec& string = *truth.ball->string;
  std::vector<double> out;
  for (long k = 0; k < r.rows(); ++k) {
    if (std::isnan(r.ball(k, 0))) continue;
    LinkKinematics<double> kinematics;
    const VecX<double> q = r.q.row(k);
    forward_kinematics<double, double>(tree, q, kinematics);
    const Pose<double> X_LS =
        map.X_LF[string.link] * Pose<double>{Mat3<double>::identity(), string.p_LS};
    const Vec3<double> off = Vec3<double>{r.ball(k, 0), r.ball(k, 1), r.ball(k, 2)} -
                             frame_pose(kinematics, map.dof[string.link], X_LS).p;
    out.push_back(std::sqrt(dot(off, off)));
  }
  return Eigen::Map<VecX<double>>(out.data(), static_cast<long>(out.size()));
}

}  // namespace

TEST_CASE("wam4_ball: the robot is wam4, with a ball of 24 g on 40 cm of string", "[world]") {
  const Model with = read_model(kFile), without = read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml");
  CHECK(inertial_parameters(make_tree(with)) == inertial_parameters(make_tree(without)));
  REQUIRE(with.ball);
  REQUIRE(with.ball->string);
  CHECK(with.ball->mass == 0.024);
  CHECK(with.ball->radius == 0.02);
  CHECK(with.ball->string->length == 0.4);
  CHECK(with.links[with.ball->string->link].name == "cup");
}

TEST_CASE("ball world: a tendon keeps its length, drawn with the robot or given", "[world]") {
  for (const std::string keys : {",perturb=A", ",perturb=none,string=0.36"}) {
    const WorldRecording made = record(keys, 4.0);
    CAPTURE(keys);
    REQUIRE(made.result.failure.empty());
    const double length = made.truth.ball->string->length;
    if (keys == ",perturb=A")
      CHECK((length != 0.4 && std::abs(length - 0.4) < 0.008));
    else
      CHECK(length == 0.36);
    // What the limit gives as the ball swings: 0.04 mm observed.
    const VecX<double> distance = distances(made);
    CHECK(distance.size() == 401);
    CHECK_THAT(distance, MatrixNear(VecX<double>::Constant(401, length), 1e-4));
  }
}

TEST_CASE("ball world: the camera sees every fifth row, with noise of its own", "[world]") {
  RecordOptions o;
  const WorldRecording clean = record(",perturb=none", 2.0),
                       noisy = record(",perturb=none", 2.0, o);
  const RowMatX<double>&a = clean.result.recording.ball, &b = noisy.result.recording.ball;
  REQUIRE(a.rows() == 1001);
  double sum = 0.0;
  for (long k = 0; k < a.rows(); ++k) {
    CHECK(std::isfinite(a(k, 0)) == (k % 5 == 0));
    if (k % 5 == 0) sum += (b.row(k) - a.row(k)).squaredNorm() / 3.0;
  }
  // 603 numbers: 3 % of spread. The controller's noise moves the hand by 0.1 mm.
  CHECK_THAT(std::sqrt(sum / 201.0), WithinAbs(1.5e-3, 0.15e-3));
}

TEST_CASE("ball world: on a tendon the ball moves by the model's equations", "[world]") {
  const WorldRecording made = record(",perturb=A", 8.0);
  BallFitOptions options;
  BallData data = make_ball_data(made.truth, {made.result.recording}, options);
  const BallFit fit = fit_ball(made.truth, make_ball_layout(made.truth, {}), data, options);
  const StringSpec& string = *made.truth.ball->string;
  // Filtered joints and MuJoCo's steps leave some tenths of a millimetre.
  CHECK(fit.sigma < 3e-4);
  CHECK_THAT(fit.p[0], WithinAbs(string.length, 2e-3));
  const Vec3<double> found{fit.p[1], fit.p[2], fit.p[3]}, off = found - string.p_LS;
  CHECK(std::sqrt(dot(off, off)) < 3e-3);
}

TEST_CASE("ball world: a chain is a string with mass, at rest in the beginning", "[world]") {
  const WorldRecording tendon = record(",perturb=none", 3.0),
                       light = record(",perturb=none,ball=chain,rope=light", 3.0),
                       heavy = record(",perturb=none,rope=heavy", 3.0);
  for (const WorldRecording* made : {&light, &heavy}) {
    REQUIRE(made->result.failure.empty());
    const VecX<double> distance = distances(*made);
    CHECK(distance.maxCoeff() < 0.4 + 1e-6);  // links do not give
    CHECK(distance.minCoeff() > 0.395);       // and hang nearly straight
  }
  const auto apart = [&](const WorldRecording& other, long k) {
    return (tendon.result.recording.ball.row(k) - other.result.recording.ball.row(k)).norm();
  };
  CHECK(apart(heavy, 0) < 1e-4);
  CHECK(apart(light, 0) < 1e-4);
  // The rope's mass and stiff hinges are what a model with a massless string lacks.
  double far = 0.0, near = 0.0;
  for (long k = 0; k < tendon.result.recording.rows(); k += 5) {
    far = std::max(far, apart(heavy, k));
    near = std::max(near, apart(light, k));
  }
  CAPTURE(far, near);
  CHECK(far > 5e-3);
  CHECK(near < 0.7 * far);
}

TEST_CASE("ball world: a tilted cup turns about where the string is tied", "[world]") {
  const Model nominal = read_model(kFile);
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u}) {
    CAPTURE(seed);
    Perturbation upright = surrogate_b();
    upright.cup_tilt = 0.0;
    const Model straight = perturbed(nominal, upright, seed),
                tilted = perturbed(nominal, surrogate_b(), seed);
    const StringSpec &a = *straight.ball->string, &b = *tilted.ball->string;
    // Drawn last: the robots that seeds gave before are the same.
    CHECK(inertial_parameters(make_tree(straight)).head(30) ==
          inertial_parameters(make_tree(tilted)).head(30));
    CHECK(a.length == b.length);
    const Pose<double>&X = straight.links[a.link].X_PJ, &Y = tilted.links[b.link].X_PJ;
    const Vec3<double> moved = X.R * a.p_LS + X.p - (Y.R * b.p_LS + Y.p);
    CHECK(dot(moved, moved) < 1e-30);
    const double angle = std::acos(dot(X.R.col[2], Y.R.col[2]));
    CHECK((angle > 1e-3 && angle < 0.07));
  }
  CHECK(world(",tilt=0.01").perturbation.cup_tilt == 0.01);
  CHECK(world(",tilt=0.01,perturb=none").perturbation.cup_tilt == 0.01);
  CHECK(world("").perturbation.cup_tilt == 0.035);
  CHECK_THROWS_WITH(world(",tilt=-1"), ContainsSubstring("tilt must not be negative"));
}

TEST_CASE("ball world: repetitions are averaged, row by row", "[world]") {
  RecordOptions o;
  const WorldRecording once = record(",perturb=none", 1.0, o),
                       often = record(",perturb=none,repetitions=5", 1.0, o),
                       clean = record(",perturb=none", 1.0);
  const auto noise = [&](const WorldRecording& made, RowMatX<double> Recording::* channel) {
    const RowMatX<double> off = made.result.recording.*channel - clean.result.recording.*channel;
    double sum = 0.0;
    for (long i = 0; i < off.size(); ++i)
      if (std::isfinite(off.data()[i])) sum += off.data()[i] * off.data()[i];
    return std::sqrt(sum);
  };
  // 1/√5 = 0.45
  for (const auto channel : {&Recording::q, &Recording::tau, &Recording::ball})
    CHECK_THAT(noise(often, channel) / noise(once, channel), WithinAbs(0.45, 0.06));
  CHECK_THAT(often.result.recording.qcmd, MatrixNear(clean.result.recording.qcmd, 1e-15));
  CHECK_THROWS_AS(averaged({}), DataError);
}

TEST_CASE("ball world: a ball in the cup rests 34.5 mm above where the string is tied", "[world]") {
  sim::MujocoFiles files;
  const sim::MujocoModel model = sim::compile_mujoco(read_mjcf(kFile), files, kFile);
  mjModel& m = *model;
  // An arm that stays where it is, with the cup's axis upright.
  std::fill_n(m.dof_damping, 4, 1e9);
  const sim::MujocoData data(mj_makeData(&m));
  mjData& d = *data;
  d.qpos[1] = 0.6;
  d.qpos[3] = 1.5707963267948966 - 0.6;
  mj_kinematics(&m, &d);
  const int cup = mj_name2id(&m, mjOBJ_SITE, "cup"), ball = mj_name2id(&m, mjOBJ_BODY, "ball");
  mjtNum* start = d.qpos + m.jnt_qposadr[m.body_jntadr[ball]];
  for (int i = 0; i < 3; ++i)
    start[i] = d.site_xpos[3 * cup + i] + 0.08 * d.site_xmat[9 * cup + 3 * i + 2];
  start[0] += 0.01;  // beside the middle
  for (int k = 0; k < 4000; ++k) mj_step(&m, &d);
  double height = 0.0, square = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double off = d.xipos[3 * ball + i] - d.site_xpos[3 * cup + i];
    height += off * d.site_xmat[9 * cup + 3 * i + 2];
    square += off * off;
  }
  CHECK_THAT(height, WithinAbs(0.0345, 5e-4));          // contacts give a little
  CHECK(std::sqrt(square - height * height) < 0.0205);  // within the walls
}

TEST_CASE("ball world: what cannot be is refused with what can", "[world]") {
  CHECK_THROWS_WITH(world(",ball=rubber"), ContainsSubstring("choices: tendon, chain"));
  CHECK_THROWS_WITH(world(",rope=steel"), ContainsSubstring("choices: heavy, mid, light, none"));
  CHECK_THROWS_WITH(world(",ball=tendon,rope=mid"), ContainsSubstring("a chain has a rope"));
  CHECK_THROWS_WITH(world(",string=-1"), ContainsSubstring("positive"));
  CHECK_THROWS_WITH(world(",repetitions=0"), ContainsSubstring("1 or more"));
  CHECK(world(",ball=chain").rope->mass == 1.2e-3);
  CHECK_FALSE(world(",rope=none").rope);
  const std::string bare = DIFFNEA_SOURCE_DIR "/models/wam4.xml";
  CHECK_THROWS_WITH(record_in_world(parse_world("mujoco:" + bare + ",ball=chain"), read_model(bare),
                                    swinging(0.1), {}, 0),
                    ContainsSubstring("no ball on a string"));
  CHECK_THROWS_WITH(record(",ball=chain,string=0.015", 0.1), ContainsSubstring("within the ball"));
}

}  // namespace ball_world_test
