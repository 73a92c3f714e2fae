#include "diagnose/unfolded_base.hpp"

#include <Eigen/Geometry>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/model/free_base.hpp>

#include "support/matrix_near.hpp"

namespace unfolded_base_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// The same torques of order 100 in another order: rounding leaves 1e-13 (observed).
constexpr double kRoundingTol = 1e-10;
/// Central differences at steps of 1 ms of a motion with ω = 20 rad/s: ω³ h²/6 = 1.3e-3, twice.
constexpr double kSlopeTol = 5e-3;

ModelLink link(const std::string& name, int parent, ModelJoint type, Vec3<double> at, double mass) {
  ModelLink out;
  out.name = name;
  out.joint = parent < 0 ? "" : "j_" + name;
  out.parent = parent;
  out.type = type;
  out.axis = {0, 1, 0};
  out.X_PJ.p = at;
  out.inertia = inertia_from_com<double>(mass, {0.02, -0.05, 0.1}, {0.02, 0.001, 0, 0.03, 0, 0.01});
  return out;
}

/// A trunk, a box that is fixed to it, and a leg of two joints.
Model walker() {
  Model out;
  out.name = "walker";
  out.links = {link("trunk", -1, ModelJoint::kFixed, {0, 0, 0}, 5.0),
               link("box", 0, ModelJoint::kFixed, {0.1, 0, 0.2}, 1.0),
               link("thigh", 0, ModelJoint::kRevolute, {0.2, 0.1, 0}, 1.5),
               link("shank", 2, ModelJoint::kPrismatic, {0, 0, -0.3}, 0.7)};
  out.frames = {{"foot", 3, {Mat3<double>::identity(), {0, 0, -0.2}}}};
  out.effects = {{"payload", "base", {{"mass", 0.5, "kg"}, {"hz", 0.05, "kg*m"}}}};
  out.free_base = true;
  return out;
}

/// Poses, twists and joints along a smooth path that tilts by up to `tilt` [rad] about the line
/// `about`, and turns on without end about the world's vertical; every pose is held by `wrench`.
Recording held(const Model& model, double tilt, const Eigen::Vector3d& about) {
  const Tree<double> tree = make_tree(model);
  const long rows = 400;
  Recording out;
  out.joint_names = joint_names(model);
  out.time = VecX<double>::LinSpaced(rows, 0.0, 0.399);
  out.q.resize(rows, 2);
  out.base.resize(rows, 7);
  out.base_wrench.resize(rows, 6);
  out.tau.resize(rows, 2);
  out.has_tau = {true, true};
  RneaWorkspace<double, double> ws;
  for (long k = 0; k < rows; ++k) {
    const double t = out.time[k];
    const Eigen::Quaterniond R(Eigen::AngleAxisd(20.0 * t, Eigen::Vector3d::UnitZ()) *
                               Eigen::AngleAxisd(tilt * std::sin(8.0 * t), about) *
                               Eigen::AngleAxisd(0.3 * t, Eigen::Vector3d::UnitX()));
    out.q.row(k) << std::sin(5.0 * t), 0.1 * std::cos(4.0 * t);
    out.base.row(k) << 0.3 * t, std::sin(3.0 * t), -t * t, R.coeffs().transpose();
    VecX<double> q(9);
    q << out.base.row(k).transpose(), out.q.row(k).transpose();
    const VecX<double> still = VecX<double>::Zero(8);
    const VecX<double> tau = rnea<double, double>(tree, q, still, still, ws);
    out.base_wrench.row(k) = tau.head(6).transpose();
    out.tau.row(k) = tau.tail(2).transpose();
  }
  out.qd = RowMatX<double>::Zero(rows, 2);
  out.base_twist = RowMatX<double>::Zero(rows, 6);
  for (long k = 1; k + 1 < rows; ++k) {
    const auto state = [&](long i) {
      VecX<double> q(9);
      q << out.base.row(i).transpose(), out.q.row(i).transpose();
      return q;
    };
    const VecX<double> v = (difference<double, double>(tree, state(k), state(k + 1)) -
                            difference<double, double>(tree, state(k), state(k - 1))) /
                           0.002;
    out.base_twist.row(k) = v.head(6).transpose();
    out.qd.row(k) = v.tail(2).transpose();
  }
  out.info.torque_sampling = TorqueSampling::kInstant;
  return out;
}

}  // namespace

TEST_CASE("unfolded base: six joints have the pose, the speed and the torques of the base",
          "[diagnose][floats]") {
  const Model model = walker();
  const auto logged = recordings_in_memory(model, {held(model, 0.8, Eigen::Vector3d::UnitY())});
  const UnfoldedBase base(model, *logged, nullptr);
  const Tree<double> tree = make_tree(base.model()), floats = make_tree(model);
  REQUIRE(tree.num_dofs() == kBaseJoints + 2);
  CHECK(joint_names(base.model())[5] == "base_roll");
  const Recording r = base.train().sample().front(), given = logged->sample().front();
  RneaWorkspace<double, double> ws;
  LinkKinematics<double> at;
  MassMatrixWorkspace<double, double> mass;
  for (long k = 1; k + 1 < r.rows(); k += 37) {
    CAPTURE(k);
    const VecX<double> q = r.q.row(k).transpose(), still = VecX<double>::Zero(q.size()),
                       qd = r.qd.row(k).transpose();
    forward_kinematics<double, double>(tree, q, qd, still, at);
    const Pose<double> X = base_pose(VecX<double>(given.base.row(k).transpose()).data());
    CHECK_THAT(to_eigen(at.links[5].X_WL.R), MatrixNear(to_eigen(X.R), kRoundingTol));
    CHECK_THAT(to_eigen(at.links[5].X_WL.p), MatrixNear(to_eigen(X.p), kRoundingTol));
    CHECK_THAT(
        to_eigen(at.links[5].V.angular),
        MatrixNear(VecX<double>(given.base_twist.row(k).head<3>().transpose()), kRoundingTol));
    CHECK_THAT(
        to_eigen(at.links[5].V.linear),
        MatrixNear(VecX<double>(given.base_twist.row(k).tail<3>().transpose()), kRoundingTol));
    const VecX<double> slope = (r.q.row(k + 1) - r.q.row(k - 1)).transpose() / 0.002;
    CHECK_THAT(qd, MatrixNear(slope, kSlopeTol));
    const VecX<double> holds = rnea<double, double>(tree, q, still, still, ws);
    CHECK_THAT(holds, MatrixNear(VecX<double>(r.tau.row(k).transpose()), kRoundingTol));
    // The energy of a motion is the same.
    VecX<double> free_q(9), free_v(8);
    free_q << given.base.row(k).transpose(), given.q.row(k).transpose();
    free_v << given.base_twist.row(k).transpose(), given.qd.row(k).transpose();
    const double of_six = qd.dot(mass_matrix<double, double>(tree, q, mass) * qd);
    MassMatrixWorkspace<double, double> own;
    CHECK(std::abs(of_six - free_v.dot(mass_matrix<double, double>(floats, free_q, own) * free_v)) <
          kRoundingTol * of_six);
  }
}

TEST_CASE("unfolded base: hinges keep away from the line about which a robot tumbles",
          "[diagnose][floats]") {
  const Model model = walker();
  for (const Eigen::Vector3d& about :
       {Eigen::Vector3d::UnitX().eval(), Eigen::Vector3d::UnitY().eval(),
        Eigen::Vector3d(1, 1, 0).normalized().eval()}) {
    Recording tumbles = held(model, 0.0, about);
    for (long k = 0; k < tumbles.rows(); ++k)  // a whole turn
      tumbles.base.row(k).tail<4>() =
          Eigen::Quaterniond(Eigen::AngleAxisd(16.0 * tumbles.time[k], about)).coeffs().transpose();
    const auto logged = recordings_in_memory(model, {tumbles});
    const UnfoldedBase base(model, *logged, nullptr);
    const RowMatX<double> q = base.train().sample().front().q;
    CHECK((q.bottomRows(q.rows() - 1) - q.topRows(q.rows() - 1)).cwiseAbs().maxCoeff() < 0.1);
  }
}

TEST_CASE("unfolded base: what turns through all directions is refused", "[diagnose][floats]") {
  const Model model = walker();
  Recording r = held(model, 0.0, Eigen::Vector3d::UnitX());
  Rng rng(1);
  for (long k = 0; k < r.rows(); ++k) {
    Eigen::Vector4d quaternion(rng.normal(), rng.normal(), rng.normal(), rng.normal());
    r.base.row(k).tail<4>() = quaternion.normalized().transpose();
  }
  r.source = "tumbling.csv";
  const auto logged = recordings_in_memory(model, {r});
  try {
    const UnfoldedBase base(model, *logged, nullptr);
    FAIL("expected a DataError");
  } catch (const DataError& error) {
    CHECK_THAT(error.what(), ContainsSubstring("tumbling.csv") &&
                                 ContainsSubstring("turns through all directions"));
  }
}

TEST_CASE("unfolded base: a finding is folded to the robot that floats", "[diagnose][floats]") {
  const Model model = walker();
  const auto logged = recordings_in_memory(model, {held(model, 0.4, Eigen::Vector3d::UnitY())});
  const UnfoldedBase base(model, *logged, nullptr);
  CHECK(base.model().effects.front().where == "base_roll");
  CHECK(base.model().frames.front().link == 8);
  DiagnoseOptions asked;
  asked.effects = {"payload@base", "viscous_friction@j_thigh"};
  CHECK(base.unfold(asked).effects ==
        std::vector<std::string>{"payload@base_roll", "viscous_friction@j_thigh"});
  Finding finding;
  finding.model = base.model();
  finding.model.links[5].inertia.m = 7.0;
  finding.model.links[8].inertia.m = 0.9;
  Cause cause;
  cause.effect = "payload";
  cause.where = "base_roll";
  finding.causes = {cause};
  finding.parameters = {{"base_x.mass", "kg", 0, 0, 0, false, true, false},
                        {"trunk.mass", "kg", 7, 0, 5, true, false, false}};
  base.fold(finding);
  CHECK(finding.causes.front().where == "base");
  CHECK(finding.parameters.size() == 1);
  CHECK(finding.model.free_base);
  CHECK(finding.model.links.size() == model.links.size());
  CHECK(finding.model.links[0].inertia.m == 7.0);
  CHECK(finding.model.links[3].inertia.m == 0.9);
  CHECK(finding.model.effects.front().where == "base");
  CHECK(make_tree(finding.model).free_base);
}

}  // namespace unfolded_base_test
