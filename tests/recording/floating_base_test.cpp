#include "recording/floating_base.hpp"

#include <cmath>

#include <Eigen/Geometry>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>

#include "support/matrix_near.hpp"

using Catch::Matchers::ContainsSubstring;

namespace diffnea::test::floating_base_test {
namespace {

constexpr double kStep = 0.002;
/// Rows at either end that the filter's ends touch [rows].
constexpr long kEnds = 300;
/// The filter at 30 Hz takes (f/30)⁸ of motion at f: 1e-7 of that at 4 Hz, the quaternion's
/// fastest line of a tenth of its size. Accelerations are of order 50.
constexpr double kFilterTol = 2e-4;

/// A base that spins about z of the world by a(t) = 2 sin t and tilts about its own x by b(t) =
/// sin 2t, on a path of sines: everything about it in closed form.
struct Tumbling {
  explicit Tumbling(long rows) : r(), twist(rows, 6), acceleration(rows, 6) {
    r.source = "tumbling";
    r.time.resize(rows);
    r.base.resize(rows, 7);
    r.q.resize(rows, 1);
    r.tau.resize(rows, 1);
    r.joint_names = {"a"};
    r.has_tau = {true};
    r.info.torque_sampling = TorqueSampling::kInstant;
    for (long k = 0; k < rows; ++k) {
      const double t = kStep * static_cast<double>(k), s = std::sin(2 * t), c = std::cos(2 * t);
      const double a = 2 * std::sin(t), ad = 2 * std::cos(t), add = -2 * std::sin(t);
      const double b = s, bd = 2 * c, bdd = -4 * s;
      const Eigen::Quaterniond q = Eigen::AngleAxisd(a, Eigen::Vector3d::UnitZ()) *
                                   Eigen::AngleAxisd(b, Eigen::Vector3d::UnitX());
      const Eigen::Matrix3d R = q.toRotationMatrix();
      const Eigen::Vector3d p(s, c, 0.3 * t * t), pd(2 * c, -2 * s, 0.6 * t),
          pdd(-4 * s, -4 * c, 0.6);
      r.time[k] = t;
      r.base.row(k) << p.transpose(), q.coeffs().transpose();
      r.q(k, 0) = s;
      r.tau(k, 0) = c;
      // ω in the base: ẋ b about x, and a about the world's z seen from there.
      const Eigen::Vector3d omega(bd, ad * std::sin(b), ad * std::cos(b));
      const Eigen::Vector3d turning(bdd, add * std::sin(b) + ad * bd * std::cos(b),
                                    add * std::cos(b) - ad * bd * std::sin(b));
      const Eigen::Vector3d v = R.transpose() * pd;
      twist.row(k) << omega.transpose(), v.transpose();
      acceleration.row(k) << turning.transpose(),
          (R.transpose() * pdd - omega.cross(v)).transpose();
    }
  }

  Recording r;
  RowMatX<double> twist, acceleration;
};

PreprocessPlan plan_of(bool measured_velocity = false) {
  PreprocessPlan plan;
  plan.dt = kStep;
  plan.filter_hz = 30.0;
  plan.measured_velocity = measured_velocity;
  return plan;
}

RowMatX<double> inner(const RowMatX<double>& m) {
  return m.middleRows(kEnds, m.rows() - 2 * kEnds);
}

Recording rows_of(const Recording& r, long from, long count) {
  Recording out = r;
  out.time = VecX<double>(r.time.segment(from, count));
  for (const auto member : kSeries)
    if ((r.*member).size() > 0) out.*member = RowMatX<double>((r.*member).middleRows(from, count));
  return out;
}

}  // namespace

TEST_CASE("floating base: twist and acceleration of a pose are those of its path",
          "[recording][floating]") {
  const bool measured = GENERATE(false, true);
  CAPTURE(measured);
  Tumbling x(3000);
  if (measured) {
    x.r.base_twist = x.twist;
    x.r.qd = (2.0 * (2.0 * x.r.time).array().cos()).matrix();
  }
  const Preprocessed p = preprocess(x.r, plan_of(measured));
  REQUIRE(p.rows() == 3000);
  CHECK_THAT(inner(p.base), MatrixNear(inner(x.r.base), kFilterTol));
  CHECK_THAT(inner(p.base_twist), MatrixNear(inner(x.twist), kFilterTol));
  CHECK_THAT(inner(p.base_acceleration), MatrixNear(inner(x.acceleration), kFilterTol));
  CHECK(p.q.cols() == 1);
  CHECK(p.joint_names == std::vector<std::string>{"a"});
  CHECK(p.has_tau == std::vector<bool>{true});
  CHECK(!p.has_base_wrench);
  CHECK(p.base_wrench.isZero());
}

TEST_CASE("floating base: signs of quaternions are no motion, across blocks of rows",
          "[recording][floating]") {
  const Tumbling x(3000);
  Recording flipped = x.r;
  for (long k = 0; k < flipped.rows(); ++k)
    if (k % 7 < 3) flipped.base.row(k).tail<4>() *= -1.0;
  const Preprocessed whole = preprocess(x.r, plan_of()), same = preprocess(flipped, plan_of());
  CHECK_THAT(same.base_twist, MatrixNear(whole.base_twist, 1e-12));
  REQUIRE(same.notes.size() == 1);
  CHECK_THAT(same.notes[0], ContainsSubstring("changes its sign 857 times"));
  Preprocessor stream(plan_of(), 500);
  RowMatX<double> acceleration(3000, 6);
  long at = 0;
  const auto take = [&](const Preprocessed& rows) {
    acceleration.middleRows(at, rows.rows()) = rows.base_acceleration;
    at += rows.rows();
  };
  for (long from = 0; from < 3000; from += 250) take(stream.push(rows_of(flipped, from, 250)));
  take(stream.finish());
  REQUIRE(at == 3000);
  // A block's end leaves 1e-9 of q̈ (Preprocessor); accelerations are of order 50.
  CHECK_THAT(acceleration, MatrixNear(whole.base_acceleration, 1e-6));
}

TEST_CASE("floating base: quaternions that are no rotation are told from short ones",
          "[recording][floating]") {
  CHECK(detail::reason_against_quaternion(0, 0, 0, 1).empty());
  CHECK(detail::reason_against_quaternion(0, 0.6, 0.8, 0.01).empty());
  CHECK(detail::reason_against_quaternion(0, 0, 0.99, 0).empty());
  CHECK_THAT(detail::reason_against_quaternion(0, 0, 0, 0), ContainsSubstring("norm 0"));
  CHECK_THAT(detail::reason_against_quaternion(1, 1, 0, 0), ContainsSubstring("norm 1.41421"));
  Tumbling x(3000);
  x.r.base.row(5).tail<4>().setZero();
  std::vector<Recording> few{x.r};
  const std::vector<std::string> said = detail::blank_impossible_poses(few);
  REQUIRE(said.size() == 1);
  CHECK_THAT(said[0], ContainsSubstring("at 0.01 s") && ContainsSubstring("1 such row is a gap"));
  CHECK(few[0].base.row(5).array().isNaN().all());
  x.r.base.rightCols<4>() *= 2.0;
  std::vector<Recording> many{x.r};
  CHECK_THROWS_WITH(detail::blank_impossible_poses(many),
                    ContainsSubstring("3000 of 3000 rows") && ContainsSubstring("x y z w"));
}

TEST_CASE("floating base: a robot that floats needs its pose, one that does not leaves it out",
          "[recording][floating]") {
  const Tumbling x(10);
  std::vector<Recording> logged{x.r};
  std::string note;
  detail::match_base("trunk", logged, &note);
  CHECK(note.empty());
  CHECK(logged[0].base.rows() == 10);
  detail::match_base("", logged, &note);
  CHECK_THAT(note, ContainsSubstring("--free-base"));
  CHECK(logged[0].base.size() == 0);
  CHECK_THROWS_WITH(detail::match_base("trunk", logged), ContainsSubstring("'trunk'") &&
                                                             ContainsSubstring("base_qw") &&
                                                             ContainsSubstring("--fix-base"));
}

}  // namespace diffnea::test::floating_base_test
