/// Recordings that differ in which joints' torques they know.

#include <limits>
#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/dynamics/rnea.hpp>

namespace diffnea::joints_test {
namespace {

using Catch::Matchers::ContainsSubstring;

constexpr int kShoulder = 0, kElbow = 1;

const Model& arm() {
  static const Model kOne = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  return kOne;
}

/// @param without  joint whose torque is not recorded; -1: all are
Recording swing(unsigned seed, int without = -1) {
  Recording r = test::swinging(arm(), 20.0, false, seed);
  if (without < 0) return r;
  r.tau.col(without).setConstant(std::numeric_limits<double>::quiet_NaN());
  r.has_tau[static_cast<std::size_t>(without)] = false;
  return r;
}

/// The same with the torques of the arm, and little noise.
Recording driven(unsigned seed) {
  Recording r = swing(seed);
  const Tree<double> tree = make_tree(arm());
  RneaWorkspace<double, double> ws;
  for (long i = 1; i + 1 < r.rows(); ++i) {
    const double h = r.time[i + 1] - r.time[i];
    const VecX<double> q = r.q.row(i).transpose(), after = r.q.row(i + 1).transpose(),
                       before = r.q.row(i - 1).transpose();
    r.tau.row(i) = 0.1 * r.tau.row(i) +
                   rnea<double, double>(tree, q, (after - before) / (2.0 * h),
                                        (after - 2.0 * q + before) / (h * h), ws)
                       .transpose();
  }
  return r;
}

/// A simulation without noise, of an arm whose shoulder has viscous friction.
Recording simulated(double viscous, double phase) {
  constexpr double kStep = 0.005, kSeconds = 30.0;
  Recording r;
  r.source = "simulated";
  r.joint_names = joint_names(arm());
  r.has_tau = {true, true};
  r.info.torque_sampling = TorqueSampling::kInstant;
  const long rows = std::lround(kSeconds / kStep);
  r.time = VecX<double>::LinSpaced(rows, 0.0, kStep * static_cast<double>(rows - 1));
  r.q = r.tau = RowMatX<double>::Zero(rows, 2);
  const Tree<double> tree = make_tree(arm());
  RneaWorkspace<double, double> ws;
  for (long i = 0; i < rows; ++i) {
    VecX<double> q = VecX<double>::Zero(2), qd = q, qdd = q;
    for (int j = 0; j < 2; ++j)
      for (const auto& [size, w] : {std::pair{0.7, 1.6}, {0.4, 2.2}, {0.2, 7.9}}) {
        const double at = w * r.time[i] + phase + j;
        q[j] += size * std::sin(at);
        qd[j] += size * w * std::cos(at);
        qdd[j] -= size * w * w * std::sin(at);
      }
    r.q.row(i) = q.transpose();
    r.tau.row(i) = rnea<double, double>(tree, q, qd, qdd, ws).transpose();
    r.tau(i, kShoulder) += viscous * qd[kShoulder];
  }
  return r;
}

/// The shoulder swings with dry friction; the elbow stands, in an encoder of steps of 0.1 mrad,
/// held by a friction that takes some of what would move it.
Recording one_joint_moves(unsigned seed) {
  Recording r = swing(seed);
  Rng rng(seed + 100);
  const VecX<double> noise = r.tau.col(0);
  for (long i = 0; i < r.rows(); ++i) r.q(i, kElbow) = 0.3 + 1e-4 * std::round(0.4 * rng.normal());
  const Tree<double> tree = make_tree(arm());
  RneaWorkspace<double, double> ws;
  for (long i = 1; i + 1 < r.rows(); ++i) {
    const double h = r.time[i + 1] - r.time[i];
    VecX<double> q = r.q.row(i).transpose(), qd = VecX<double>::Zero(2), qdd = qd;
    q[kElbow] = 0.3;
    const VecX<double> shoulder = r.q.col(kShoulder).segment(i - 1, 3);
    qd[kShoulder] = (shoulder[2] - shoulder[0]) / (2.0 * h);
    qdd[kShoulder] = (shoulder[2] - 2.0 * shoulder[1] + shoulder[0]) / (h * h);
    r.tau.row(i) = rnea<double, double>(tree, q, qd, qdd, ws).transpose();
    r.tau(i, kShoulder) += 0.3 * std::tanh(qd[kShoulder] / 0.01) + 0.01 * noise[i];
    r.tau(i, kElbow) = 0.6 * r.tau(i, kElbow) + 0.05 * std::tanh(qd[kShoulder]) + 0.01 * noise[i];
  }
  r.q.row(0) = r.q.row(1), r.tau.row(0) = r.tau.row(1);
  r.tau.bottomRows(1) = r.tau.row(r.rows() - 2);
  return r;
}

}  // namespace

TEST_CASE("diagnose: held-out recordings know the torques of the fitted ones' joints",
          "[diagnose]") {
  for (const auto& [fitted, held] :
       {std::pair{-1, kShoulder}, {kShoulder, -1}, {kElbow, kShoulder}})
    CHECK_THROWS_WITH(diagnose(arm(), {swing(1, fitted)}, {swing(2, held)}),
                      ContainsSubstring("the held-out torques are those of"));
  // A joint without torque is another one where nobody says that it is passive.
  Recording loose = swing(1);
  loose.tau.col(kElbow).setZero();
  loose.info.passive = {"elbow"};
  CHECK_THROWS_WITH(
      diagnose(arm(), {loose}, {swing(2, kElbow)}),
      ContainsSubstring("of shoulder, expected") && ContainsSubstring("shoulder, elbow;"));
}

TEST_CASE("diagnose: fitted recordings know the torques of the same joints", "[diagnose]") {
  const std::string expected = "is known in some of the recordings alone";
  for (const auto& [first, second] : {std::pair{-1, kElbow}, {kElbow, kShoulder}})
    CHECK_THROWS_WITH(diagnose(arm(), {swing(1, first), swing(3, second)}, {swing(2)}),
                      ContainsSubstring(expected));
  Recording silent = swing(3, kShoulder);
  silent.tau.col(kElbow) = silent.tau.col(kShoulder);
  silent.has_tau[kElbow] = false;
  CHECK_THROWS_WITH(diagnose(arm(), {swing(1, kElbow), silent}, {swing(2, kElbow)}),
                    ContainsSubstring(expected));
}

TEST_CASE("diagnose: where nothing could be tried, nothing is said of the recording",
          "[diagnose]") {
  DiagnoseOptions options;
  options.effects = {"backlash"};  // needs two paths
  const Recording fitted = driven(1);
  options.preprocess.filter_hz = 0.24 / (fitted.time[1] - fitted.time[0]);  // too high for them
  const Finding finding = diagnose(arm(), {fitted}, {driven(2)}, options);
  CHECK_THAT(finding.sentence, ContainsSubstring("Nothing was tried: backlash needs a log"));
  CHECK(finding.lack_of_fit_p == 1.0);
}

TEST_CASE("diagnose: what holds a joint that stands still is no evidence", "[diagnose]") {
  const Finding f = diagnose(arm(), {one_joint_moves(1)}, {one_joint_moves(2)});
  const std::string elbow = joint_names(arm())[kElbow], shoulder = joint_names(arm())[kShoulder];
  CHECK(std::ranges::any_of(
      f.notes, [&](const std::string& note) { return note.starts_with(elbow + " stands still"); }));
  REQUIRE_FALSE(f.causes.empty());
  CHECK(f.causes.front().effect == "coulomb_friction");
  for (const Cause& c : f.causes) CHECK(c.where == shoulder);
  for (const CandidateScore& c : f.candidates) CHECK(c.where.find(elbow) == std::string::npos);
  // A simulation holds it, too, as no torque would.
  REQUIRE(f.simulated.joints.size() == 1);
  CHECK(f.simulated.joints.front().joint == shoulder);
  CHECK(f.simulated.extended_follows > 2.0 * f.simulated.base_follows);
}

TEST_CASE("diagnose: what is smaller than the noise that is assumed is not named", "[diagnose]") {
  const Model& model = arm();
  const double torque = std::sqrt(simulated(0.0, 0.0).tau.col(kShoulder).array().square().mean());
  // Without noise, 0.01 % of the torque are assumed. Half of that would be told from it in 6000
  // rows if it were white, and the errors of an integrator are not.
  for (const auto& [share, found] : {std::pair{5e-5, false}, {5e-3, true}}) {
    const double viscous = share * torque / 1.5;  // RMS velocity
    const Finding f = diagnose(model, {simulated(viscous, 0.0)}, {simulated(viscous, 2.0)});
    CAPTURE(share, f.sentence);
    CHECK(f.causes.empty() != found);
  }
}

}  // namespace diffnea::joints_test
