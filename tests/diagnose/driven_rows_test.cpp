/// Rows of a four-bar's drive, against closed forms of where its bars are: the pin lies where two
/// circles meet.

#include "diagnose/driven_rows.hpp"

#include <cmath>
#include <numbers>
#include <support/linkage.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/effects/series.hpp>
#include <diffnea/identify/layout.hpp>
#include <diffnea/identify/source.hpp>

#include "diagnose/evidence.hpp"

namespace diffnea::driven_rows_test {

using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;

namespace {

constexpr double kCrank = 0.3, kCoupler = 0.8, kRocker = 0.6, kGround = 0.9;

/// Joint angles of the four-bar of test::linkage at the crank's. A bar at angle a points along
/// (cos a, −sin a).
VecX<double> angles(double crank) {
  const double x = kCrank * std::cos(crank), y = kCrank * std::sin(crank);
  const double way_x = kGround - x, way_y = -y, d = std::hypot(way_x, way_y);
  const double along = (d * d + kCoupler * kCoupler - kRocker * kRocker) / (2.0 * d);
  // Angles are about y, so that the plane's second axis points down: the upper knee.
  const double to_pin = std::atan2(way_y, way_x);
  const double coupler = to_pin - std::acos(along / kCoupler);
  const double knee_x = x + kCoupler * std::cos(coupler), knee_y = y + kCoupler * std::sin(coupler);
  const double rocker = std::atan2(-knee_y, kGround - knee_x);
  return (VecX<double>(3) << crank, coupler - crank, rocker - coupler).finished();
}

/// Speed of every joint over the crank's.
VecX<double> ratios(double crank) {
  constexpr double kH = 1e-5;
  return (angles(crank + kH) - angles(crank - kH)) / (2.0 * kH);
}

/// Derivative of the ratios by the crank's angle.
VecX<double> bends(double crank) {
  constexpr double kH = 1e-4;
  return (angles(crank + kH) - 2.0 * angles(crank) + angles(crank - kH)) / (kH * kH);
}

struct Motion {
  double crank, speed, change;
};
Motion motion_at(double t) {
  const double w = 2.0 * std::numbers::pi / 4.0;
  return {-1.1 + 0.6 * std::sin(w * t) + 0.2 * std::sin(3.0 * w * t),
          w * (0.6 * std::cos(w * t) + 0.6 * std::cos(3.0 * w * t)),
          -w * w * (0.6 * std::sin(w * t) + 1.8 * std::sin(3.0 * w * t))};
}

JointSeries series(long rows, double dt) {
  JointSeries s;
  s.dt = dt;
  for (RowMatX<double>* m : {&s.q, &s.qd, &s.qdd}) m->resize(rows, 3);
  for (long k = 0; k < rows; ++k) {
    const Motion at = motion_at(dt * static_cast<double>(k));
    const VecX<double> S = ratios(at.crank);
    s.q.row(k) = angles(at.crank).transpose();
    s.qd.row(k) = at.speed * S.transpose();
    s.qdd.row(k) = (at.change * S + at.speed * at.speed * bends(at.crank)).transpose();
  }
  return s;
}

Preprocessed first_row(const JointSeries& s, std::vector<bool> has_torque = {true, false, false}) {
  Preprocessed out;
  out.source = "four-bar";
  out.has_tau = std::move(has_torque);
  out.q = s.q.topRows(1);
  out.qd = s.qd.topRows(1);
  out.qdd = s.qdd.topRows(1);
  out.tau = RowMatX<double>::Zero(1, 3);
  out.time = VecX<double>::Zero(1);
  return out;
}

/// Rows of the four-bar's crank along a motion.
DrivenRows rows_along(const Model& model, const JointSeries& s) {
  DrivenRows out(model, first_row(s), {});
  out.set_paths({s});
  return out;
}

}  // namespace

TEST_CASE("driven rows: a torque at any joint counts by its speed over the drive's", "[diagnose]") {
  const Model model = test::linkage(3);
  const JointSeries s = series(100, 0.04);
  const DrivenRows rows = rows_along(model, s);
  REQUIRE(rows.joints() == std::vector<int>{0});
  CHECK_FALSE(rows.shared());
  for (const int j : {0, 1, 2}) {
    CHECK(rows.reaches({j}, 0));
    const RowMatX<double> reached = rows.at(0, 0, {j}, [&](int of) -> RowMatX<double> {
      REQUIRE(of == j);
      return s.qd.col(of);
    });
    REQUIRE(reached.rows() == 100);
    for (long k = 0; k < reached.rows(); ++k) {
      const Motion at = motion_at(0.04 * static_cast<double>(k));
      CAPTURE(j, k);
      CHECK_THAT(reached(k, 0), WithinAbs(std::pow(ratios(at.crank)[j], 2) * at.speed, 1e-8));
    }
  }
}

TEST_CASE("driven rows: an open chain's torques are their own rows", "[diagnose]") {
  const DrivenRows rows;
  CHECK_FALSE(rows.closed());
  CHECK(rows.reaches({1, 2}, 2));
  CHECK_FALSE(rows.reaches({1, 2}, 0));
  const RowMatX<double> own = RowMatX<double>::Random(5, 2);
  CHECK(rows.at(0, 1, {0, 1}, [&](int j) {
    REQUIRE(j == 1);
    return own;
  }) == own);
}

TEST_CASE("driven rows: a second drive shares the motion, and the row may be asked for",
          "[diagnose]") {
  const Model model = test::linkage(3, {0, 2});
  const JointSeries s = series(2, 0.04);
  for (const int j : {0, 2}) {
    const DrivenRows rows(model, first_row(s, {true, false, true}), {j});
    CHECK(rows.joints() == std::vector<int>{j});
    CHECK(rows.shared());
  }
}

TEST_CASE("driven rows: inertia and stiffness are those of Lagrange's equation", "[diagnose]") {
  const Model model = test::linkage(3);
  const Tree<double> tree = make_tree(model);
  JointSeries s = series(3, 1.0);
  s.qd.setZero();  // at rest, so that the torque is gravity's
  s.qdd.setZero();
  const DrivenRows rows = rows_along(model, s);
  SignalNoise noise{VecX<double>::Constant(3, 1e-4), VecX<double>::Constant(3, 1e-12)};
  noise.density[0] = 2e-6;
  const std::vector<LoopEquation> found = rows.equations(tree, s, {0}, noise, 1);
  REQUIRE(found.size() == 1);
  const JointEquation& e = found[0].equation;
  for (long k = 0; k < 3; ++k) {
    CAPTURE(k);
    const double crank = motion_at(static_cast<double>(k)).crank;
    const VecX<double> q = angles(crank), S = ratios(crank);
    MassMatrixWorkspace<double, double> ws;
    const MatX<double> M = mass_matrix<double, double>(tree, q, ws);
    CHECK_THAT(e.inertia[k], WithinRel(S.dot(M * S), 1e-7));
    CHECK_THAT(rows.inertias(tree, q)[0], WithinRel(S.dot(M * S), 1e-7));
    const auto gravity = [&](double y) {  // dV/dy, of the potential that gravity's torques have
      RneaWorkspace<double, double> scratch;
      return ratios(y).dot(gravity_torques<double, double>(tree, angles(y), scratch));
    };
    CHECK_THAT(e.stiffness[k],
               WithinRel((gravity(crank + 1e-4) - gravity(crank - 1e-4)) / 2e-4, 1e-4));
    CHECK_THAT(e.damping[k], WithinAbs(0.0, 1e-6));  // velocities count by their squares
    // All joints move by S: what encoders show together is the crank's own way.
    CHECK_THAT(found[0].shown.row(k).dot(S), WithinRel(1.0, 1e-7));
    CHECK_THAT(e.variance[k], WithinRel(found[0].shown.row(k).squaredNorm() * 1e-8, 1e-12));
    CHECK_THAT(e.density[k], WithinRel(2e-6, 1e-4));
  }
}

TEST_CASE("driven rows: predicted torques are those of the drive, by virtual work", "[diagnose]") {
  const Model model = test::linkage(3);
  JointSeries s = series(40, 0.1), open = s;
  ExtendedTree base = extend(model);
  predict(base, open);
  base.loops = rows_along(model, s).loops();
  predict(base, s);
  for (long k = 0; k < s.rows(); ++k) {
    const VecX<double> S = ratios(motion_at(0.1 * static_cast<double>(k)).crank);
    CAPTURE(k);
    CHECK_THAT(s.total(k, 0), WithinAbs(open.total.row(k).dot(S), 1e-7));
    CHECK(s.total(k, 1) == 0.0);
    CHECK(s.total(k, 2) == 0.0);
  }
  // Once mapped, torques stay as they are.
  const std::vector<MatX<double>> D = base.loops->maps(base.tree, s.q);
  CHECK(base.loops->at_leads(D, s.total) == s.total);
}

TEST_CASE("diagnose: friction of a passive joint is in the drive's rows of evidence",
          "[diagnose]") {
  const Model model = test::linkage(3);
  Recording r;
  r.source = "four-bar";
  r.joint_names = joint_names(model);
  constexpr double kStep = 0.005;
  const JointSeries s = series(4000, kStep);
  r.time = VecX<double>::LinSpaced(s.rows(), 0.0, kStep * static_cast<double>(s.rows() - 1));
  r.q = s.q;
  r.tau = RowMatX<double>::Zero(s.rows(), 3);
  for (long k = 0; k < s.rows(); ++k) r.tau(k, 0) = std::sin(7.0 * r.time[k]);
  r.has_tau = {true, false, false};
  r.info.torque_sampling = TorqueSampling::kInstant;
  const std::unique_ptr<RecordingSource> source = recordings_in_memory(model, {r});
  FitChoice choice;
  choice.effects = std::vector<std::string>{};
  std::vector<std::string> notes;
  const FitLayout layout = layout_for(model, *source, nullptr, choice, notes);
  PreprocessOptions preprocess;
  preprocess.filter_hz = 8.0;
  preprocess.decimate_to_hz = 25.0;
  Evidence evidence(model, {model}, layout, *source, plan_preprocess(source->sample(), preprocess),
                    0.0, IdentifyOptions{});
  REQUIRE(evidence.joints() == std::vector<int>{0});
  CHECK_FALSE(evidence.is_passive(0));
  CHECK(evidence.is_passive(2));
  OwnCandidate closed_form;
  closed_form.name = "virtual work";
  closed_form.where = "j1";
  closed_form.parameters = {{.name = "viscous", .unit = "N*m*s/rad", .unit_prismatic = "N*s/m"}};
  closed_form.columns = [](const JointSeries& x) {
    RowMatX<double> out(x.rows(), 1);
    for (long k = 0; k < x.rows(); ++k) out(k, 0) = std::pow(ratios(x.q(k, 0))[2], 2) * x.qd(k, 0);
    return out;
  };
  std::vector<Candidate> own;
  add_own_candidates({closed_form}, model, own);
  evidence.evaluate(own[0].effect);
  const MatX<double> expected = evidence.columns(own[0].effect, {0});
  const Candidate friction =
      make_candidates(model, model, {"viscous_friction@j3"}, {0}, false).at(0);
  const MatX<double> found = evidence.columns(friction.effect, {0});
  REQUIRE(expected.norm() > 1.0);
  // Paths of the joints are smoothed one by one: 1e-4 of the column.
  CHECK((found - expected).norm() < 1e-3 * expected.norm());
}

TEST_CASE("driven rows: a joint whose torque nobody knows is refused by name", "[diagnose]") {
  const Model model = test::linkage(3);
  Preprocessed first = first_row(series(1, 0.1));
  first.tau(0, 2) = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_MATCHES(DrivenRows(model, first, {}), DataError,
                       Catch::Matchers::MessageMatches(
                           Catch::Matchers::ContainsSubstring("torque of joint 'j3' beside")));
}

}  // namespace diffnea::driven_rows_test
