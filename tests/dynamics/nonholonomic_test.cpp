/// Constraints on velocities: rolling disc, sleigh and bicycle against their known motions.

#include <array>
#include <cmath>
#include <complex>

#include <Eigen/Dense>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/dynamics/constraints.hpp>
#include <diffnea/dynamics/free_motion.hpp>

namespace nonholonomic_test {

using namespace diffnea;
using Catch::Matchers::WithinAbs;
using Catch::Matchers::WithinRel;
using Rows = std::vector<ConstraintRow<double>>;
using States = std::vector<BodyState<double>>;

namespace {

const Vec3<double> kZero{0, 0, 0};
constexpr double kGravity = 9.81;

/// Bodies under constraints that `rows` lists at a state, without other forces.
template <class RowsAt>
std::vector<Twist<double>> accelerations(const std::vector<FreeBody<double>>& bodies,
                                         const States& states, const RowsAt& rows,
                                         const Vec3<double>& gravity,
                                         const Stabilisation& stabilisation = {}) {
  const std::vector<Wrench<double>> none(bodies.size(), {kZero, kZero});
  return constrained_acceleration<double>(bodies, states, none, {}, rows(states), gravity,
                                          stabilisation)
      .Vd;
}

template <class RowsAt>
void simulate(const std::vector<FreeBody<double>>& bodies, States& states, const RowsAt& rows,
              const Vec3<double>& gravity, double seconds, double h) {
  MotionWorkspace<double> ws;
  const auto f = [&](double, const States& s) { return accelerations(bodies, s, rows, gravity); };
  for (long k = 0; k < std::lround(seconds / h); ++k) step_bodies(f, h, states, ws);
}

/// A thin disc that turns about its y axis, radius r: diametral and axial inertia.
FreeBody<double> disc(double mass, double diametral, double axial) {
  return {BodyKind::kRigid, {mass, kZero, {diametral, 0, 0, axial, 0, diametral}}};
}

}  // namespace

TEST_CASE("nonholonomic: a sleigh on a slope draws a cycloid", "[constraints]") {
  // Knife edge through the centre of mass, g sin α along x, released at rest with spin ω about z:
  // x = a sin²(ωt), y = a (ωt − ½ sin 2ωt), a = g sin α/(2ω²) (Neimark and Fufaev 1972, ch. III).
  const double omega = 1.3, slope = 4.0, seconds = 3.0;
  const std::vector<FreeBody<double>> bodies{
      {BodyKind::kRigid, {2.0, kZero, {0.1, 0, 0, 0.2, 0, 0.25}}}};
  States states{{Pose<double>::identity(), {{0, 0, omega}, kZero}}};
  const Skate<double> blade{kZero, {0, 1, 0}};
  const auto rows = [&](const States& s) {
    Rows out;
    append_rows(blade, "blade", {0}, s, out);
    return out;
  };
  simulate(bodies, states, rows, {slope, 0, 0}, seconds, 1e-3);
  const double a = slope / (2 * omega * omega), turned = omega * seconds;
  // RK4 at 1 ms over 3000 steps: 1e-12 (observed 1e-11).
  CHECK_THAT(states[0].X_WB.p.x, WithinAbs(a * std::pow(std::sin(turned), 2), 1e-9));
  CHECK_THAT(states[0].X_WB.p.y, WithinAbs(a * (turned - 0.5 * std::sin(2 * turned)), 1e-9));
}

TEST_CASE("nonholonomic: a disc rolls in a circle at the lean that its speed needs",
          "[constraints]") {
  // Disc of radius r, its plane leaning by β from the vertical toward the centre of its circle. The
  // spin is solved for at which the lean has no acceleration; Routh's formula must hold there, and
  // the centre then stays at its height and on its circle.
  const double m = 1.4, r = 0.3, A = 0.25 * m * r * r, C = 2 * A, lean = 0.35, precession = 1.1;
  const std::vector<FreeBody<double>> bodies{disc(m, A, C)};
  const WheelContact<double> contact{kZero, {0, 1, 0}, r};
  const RollingWheel<double> rolling{kZero, {0, 1, 0}, r};
  const auto rows = [&](const States& s) {
    Rows out;
    append_rows(contact, "contact", {0}, s, out);
    append_rows(rolling, "rolling", {0}, s, out);
    return out;
  };
  // Heading along x, leaning about x by −β: the axle is R e_y.
  const Mat3<double> R = rotation_about<double>({1, 0, 0}, -lean);
  const auto with_spin = [&](double spin) {
    BodyState<double> s;
    s.X_WB = {R, {0, 0, r * std::cos(lean)}};
    const Vec3<double> w_W = Vec3<double>{0, 0, precession} + R.col[1] * spin;
    const Vec3<double> arm = lowest_of_wheel(R.col[1], r) * -1.0;  // contact → centre
    s.V = {transpose_times(R, w_W), transpose_times(R, cross(w_W, arm))};
    return s;
  };
  // α about the heading beyond that of steady precession.
  const auto lean_acceleration = [&](double spin) {
    const States s{with_spin(spin)};
    const Twist<double> Vd = accelerations(bodies, s, rows, {0, 0, -kGravity})[0];
    // In steady motion ω_W only turns with the precession: α_W = Ω e_z × ω_W.
    const Vec3<double> alpha = R * Vd.angular;
    return alpha.x - cross(Vec3<double>{0, 0, precession}, R * s[0].V.angular).x;
  };
  // It is linear in the spin.
  const double f0 = lean_acceleration(0.0), f1 = lean_acceleration(1.0), spin = -f0 / (f1 - f0);
  const double sb = std::sin(lean), cb = std::cos(lean);
  // Moments about the contact, n the total spin about the axle (Routh 1884):
  // |(C + m r²) n Ω cos β ± A Ω² sin β cos β| = m g r sin β, the sign by the side it leans to.
  const double n = spin + precession * R.col[1].z;
  CHECK_THAT(std::abs((C + m * r * r) * n * precession * cb +
                      A * precession * precession * sb * cb * (R.col[1].z < 0 ? 1.0 : -1.0)),
             WithinRel(m * kGravity * r * sb, 1e-9));

  States states{with_spin(spin)};
  const Vec3<double> v = R * states[0].V.linear;
  const double radius = std::abs(v.x / precession);
  const Vec3<double> middle{0, v.x / precession, states[0].X_WB.p.z};
  simulate(bodies, states, rows, {0, 0, -kGravity}, 2.0, 1e-3);
  CHECK_THAT(states[0].X_WB.p.z, WithinAbs(r * cb, 1e-8));
  const Vec3<double> arm = states[0].X_WB.p - middle;
  CHECK_THAT(std::sqrt(dot(arm, arm)), WithinAbs(radius, 1e-7));
}

namespace {

/// The benchmark bicycle (Meijaard, Papadopoulos, Ruina and Schwab 2007, Table 1); z up here, down
/// there. Bodies: rear frame with rider, handlebar, rear wheel, front wheel.
struct Bicycle {
  static constexpr double kWheelbase = 1.02, kTrail = 0.08, kTilt = M_PI / 10, kRear = 0.3,
                          kFront = 0.35;

  Bicycle() {
    // Products of inertia change sign with z.
    const auto body = [](double m, double x, double height, double Ixx, double Ixz, double Iyy,
                         double Izz) {
      return FreeBody<double>{
          BodyKind::kRigid,
          inertia_from_com<double>(m, {x, 0, height}, {Ixx, 0, -Ixz, Iyy, 0, Izz})};
    };
    bodies = {body(85, 0.3, 0.9, 9.2, 2.4, 11, 2.8),
              body(4, 0.9, 0.7, 0.05892, -0.00756, 0.06, 0.00708), disc(2, 0.0603, 0.12),
              disc(3, 0.1405, 0.28)};
    // The steering axis, tilted back from the vertical, meets the ground a trail ahead of the
    // front contact.
    const Vec3<double> axis{-std::sin(kTilt), 0, std::cos(kTilt)};
    const Vec3<double> x{std::cos(kTilt), 0, std::sin(kTilt)};
    X_steer = {{{x, cross(axis, x), axis}}, {kWheelbase + kTrail, 0, 0}};
    // z of a wheel's hinge is the axle, y.
    const Mat3<double> axle{{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}}};
    X_axle = {axle, kZero};
    X_rear = {axle, {0, 0, kRear}};
    X_front = {axle, {kWheelbase, 0, kFront}};
  }

  Rows rows(const States& s) const {
    Rows out;
    append_rows(Hinge<double>{X_steer, X_steer}, "steering", {0, 1}, s, out);
    append_rows(Hinge<double>{X_rear, X_axle}, "rear axle", {0, 2}, s, out);
    append_rows(Hinge<double>{X_front, X_axle}, "front axle", {1, 3}, s, out);
    for (const auto& [body, radius] : {std::pair{2, kRear}, std::pair{3, kFront}}) {
      append_rows(WheelContact<double>{kZero, {0, 1, 0}, radius}, "contact", {body}, s, out);
      append_rows(RollingWheel<double>{kZero, {0, 1, 0}, radius}, "rolling", {body}, s, out);
    }
    return out;
  }

  /// Leaned by φ (to the right, about x) and steered by δ (to the right, about the axis down), at a
  /// forward speed: the state to first order in φ, δ and their rates; pitch is of second order.
  States state(double speed, double lean, double steer, double lean_rate, double steer_rate) const {
    States s(4);
    const Pose<double> X_WF{rotation_about<double>({1, 0, 0}, lean), kZero};
    const Pose<double> X_FS =
        X_steer * Pose<double>{rotation_about<double>({0, 0, 1}, -steer), kZero} * inverse(X_steer);
    s[0].X_WB = X_WF;
    s[1].X_WB = X_WF * X_FS;
    s[2].X_WB = X_WF * Pose<double>{Mat3<double>::identity(), X_rear.p};
    s[3].X_WB = s[1].X_WB * Pose<double>{Mat3<double>::identity(), X_front.p};
    // Twists: the null space of the constraints with these three rates (speed of the rear wheel's
    // spin): least squares on 6·4 unknowns, exact.
    const Rows all = rows(s);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(static_cast<long>(all.size()) + 3, 24);
    Eigen::VectorXd b = Eigen::VectorXd::Zero(J.rows());
    long i = 0;
    for (const ConstraintRow<double>& row : all) {
      for (std::size_t k = 0; k < kMostBodies; ++k)
        if (row.bodies[k] != kWorld)
          for (int c = 0; c < 6; ++c) {
            Wrench<double> W = row.J[k];
            J(i, 6 * row.bodies[k] + c) += detail::component(W, c);
          }
      ++i;
    }
    J(i, 0) = 1.0;  // ω_x of the frame
    b[i++] = lean_rate;
    for (int c = 0; c < 3; ++c) {  // of the handlebar against the frame, along the axis
      const Vec3<double> axis_H = X_steer.R.col[2];
      const double a = c == 0 ? axis_H.x : c == 1 ? axis_H.y : axis_H.z;
      J(i, 6 + c) = a;
      J(i, c) = -a;
    }
    b[i++] = -steer_rate;
    J(i, 12 + 1) = 1.0;  // spin of the rear wheel, rolling forward
    b[i++] = speed / kRear;
    const Eigen::VectorXd V = J.completeOrthogonalDecomposition().solve(b);
    REQUIRE((J * V - b).norm() < 1e-9);
    for (int k = 0; k < 4; ++k)
      for (int c = 0; c < 6; ++c) detail::component(s[k].V, c) = V[6 * k + c];
    return s;
  }

  /// φ̈, δ̈ at such a state.
  Eigen::Vector2d second_rates(double speed, const Eigen::Vector4d& x) const {
    const States s = state(speed, x[0], x[1], x[2], x[3]);
    const auto at = [this](const States& now) { return rows(now); };
    const std::vector<Twist<double>> Vd = accelerations(bodies, s, at, {0, 0, -kGravity});
    const Vec3<double> axis = X_steer.R.col[2];
    return {Vd[0].angular.x, -dot(axis, Vd[1].angular - Vd[0].angular)};
  }

  Eigen::Vector4cd eigenvalues(double speed) const {
    Eigen::Matrix4d F = Eigen::Matrix4d::Zero();
    F(0, 2) = F(1, 3) = 1.0;
    const double h = 1e-5;
    for (int k = 0; k < 4; ++k) {
      Eigen::Vector4d x = Eigen::Vector4d::Zero();
      x[k] = h;
      F.block<2, 1>(2, k) = (second_rates(speed, x) - second_rates(speed, -x)) / (2 * h);
    }
    return F.eigenvalues();
  }

  std::vector<FreeBody<double>> bodies;
  Pose<double> X_steer, X_axle, X_rear, X_front;
};

/// Largest real part among the oscillating (weave) or the real ones of the upright bicycle.
double stability(const Bicycle& bicycle, double speed, bool oscillating) {
  double largest = -1e9;
  for (const std::complex<double>& e : bicycle.eigenvalues(speed))
    if ((std::abs(e.imag()) > 1e-3) == oscillating) largest = std::max(largest, e.real());
  return largest;
}

double root(const Bicycle& bicycle, double low, double high, bool oscillating) {
  const bool rises = stability(bicycle, high, oscillating) > 0;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    ((stability(bicycle, middle, oscillating) > 0) == rises ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

TEST_CASE("nonholonomic: the benchmark bicycle has the published eigenvalues", "[constraints]") {
  const Bicycle bicycle;
  // Meijaard et al. 2007, Table 2: castering, capsize and weave, in 1/s. Central differences of
  // h = 1e-5 on accelerations of order 10: 1e-9 (rounding) and 1e-9 (curvature).
  struct Published {
    double speed, castering, capsize, weave_real, weave_imaginary;
  };
  const auto p = GENERATE(
      Published{5, -14.07838969279822, -0.32286642900409, -0.77534188219585, 4.46486771378823},
      Published{6, -16.08537123098026, -0.00406690076970, -1.52644486584142, 5.87673060598709},
      Published{7, -18.15788466125262, 0.10268170574766, -2.13875644258362, 7.19525913329805});
  CAPTURE(p.speed);
  std::vector<std::complex<double>> found;
  for (const std::complex<double>& e : bicycle.eigenvalues(p.speed)) found.push_back(e);
  std::sort(found.begin(), found.end(),
            [](const auto& a, const auto& b) { return a.real() < b.real(); });
  CHECK_THAT(found[0].real(), WithinAbs(p.castering, 1e-6));
  std::vector<double> real, imaginary;
  for (std::size_t i = 1; i < 4; ++i)
    if (std::abs(found[i].imag()) < 1e-6) {
      CHECK_THAT(found[i].real(), WithinAbs(p.capsize, 1e-6));
    } else {
      CHECK_THAT(found[i].real(), WithinAbs(p.weave_real, 1e-6));
      CHECK_THAT(std::abs(found[i].imag()), WithinAbs(p.weave_imaginary, 1e-6));
    }
}

TEST_CASE("nonholonomic: the benchmark bicycle is stable from 4.292 to 6.024 m/s",
          "[constraints]") {
  const Bicycle bicycle;
  CHECK_THAT(root(bicycle, 4.0, 5.0, true), WithinAbs(4.29238253634111, 1e-5));
  CHECK_THAT(root(bicycle, 5.0, 7.0, false), WithinAbs(6.02426201538837, 1e-5));
}

}  // namespace nonholonomic_test
