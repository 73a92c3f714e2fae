/// The Whipple bicycle as a tree on a free base, whose wheels touch and roll by constraints:
/// against the published benchmark.

#include <algorithm>
#include <cmath>
#include <complex>

#include <Eigen/Dense>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/dynamics/constrained_tree.hpp>
#include <diffnea/dynamics/constraint_projection.hpp>
#include <diffnea/dynamics/constraints.hpp>

namespace tree_bicycle_test {

using namespace diffnea;
using Catch::Matchers::WithinAbs;

namespace {

const Vec3<double> kZero{0, 0, 0};

/// The benchmark bicycle (Meijaard, Papadopoulos, Ruina and Schwab 2007, Table 1) as a tree: the
/// rear frame with its rider floats, and carries steering, front axle and rear axle. z up here,
/// down there.
struct TreeBicycle {
  static constexpr double kWheelbase = 1.02, kTrail = 0.08, kTilt = M_PI / 10, kRear = 0.3,
                          kFront = 0.35;
  enum : int { kHandlebar = 1, kFrontWheel, kRearWheel };  // links
  enum : int { kSteer = 6, kFrontSpin, kRearSpin };        // velocities

  TreeBicycle() {
    const auto body = [](double m, double x, double height, double Ixx, double Ixz, double Iyy,
                         double Izz) {  // products of inertia change sign with z
      return inertia_from_com<double>(m, {x, 0, height}, {Ixx, 0, -Ixz, Iyy, 0, Izz});
    };
    const auto disc = [](double m, double diametral, double axial) {
      return SpatialInertia<double>{m, kZero, {diametral, 0, 0, axial, 0, diametral}};
    };
    tree = free_base_tree<double>(body(85, 0.3, 0.9, 9.2, 2.4, 11, 2.8));
    // The steering axis, tilted back, meets the ground a trail ahead of the front contact.
    const Vec3<double> axis{-std::sin(kTilt), 0, std::cos(kTilt)};
    const Vec3<double> meets{kWheelbase + kTrail, 0, 0};
    const SpatialInertia<double> bar = body(4, 0.9, 0.7, 0.05892, -0.00756, 0.06, 0.00708);
    add_link(tree, {.parent = 0,
                    .axis = axis,
                    .X_PJ = Pose<double>::translation(meets),
                    .inertia = to_parent(Pose<double>::translation(meets * -1.0), bar)});
    add_link(tree, {.parent = kHandlebar,
                    .axis = {0, 1, 0},
                    .X_PJ = Pose<double>::translation(Vec3<double>{kWheelbase, 0, kFront} - meets),
                    .inertia = disc(3, 0.1405, 0.28)});
    add_link(tree, {.parent = 0,
                    .axis = {0, 1, 0},
                    .X_PJ = Pose<double>::translation({0, 0, kRear}),
                    .inertia = disc(2, 0.0603, 0.12)});
  }

  template <class Links, class Rows>
  void operator()(const Links& links, Rows& rows) const {
    for (const auto& [wheel, radius] :
         {std::pair<int, double>{kRearWheel, kRear}, std::pair<int, double>{kFrontWheel, kFront}}) {
      append_rows(WheelContact<double>{kZero, {0, 1, 0}, radius}, "contact", {wheel}, links, rows);
      append_rows(RollingWheel<double>{kZero, {0, 1, 0}, radius}, "rolling", {wheel}, links, rows);
    }
  }

  /// φ̈, δ̈ of x = φ, δ (to the right) and their rates at a forward speed.
  Eigen::Vector2d second_rates(double speed, const Eigen::Vector4d& x) const {
    VecX<double> q = VecX<double>::Zero(tree.num_positions());
    q[3] = std::sin(x[0] / 2);
    q[6] = std::cos(x[0] / 2);
    q[7] = -x[1];
    // The wheels' heights are of second order in φ and δ: pitch and height of the frame mend them.
    q = project_positions(tree, *this, q, {.held = {0, 2, 3, 4, kSteer, kFrontSpin, kRearSpin}}).q;
    VecX<double> v = VecX<double>::Zero(tree.num_velocities());
    v[0] = x[2];
    v[kSteer] = -x[3];
    v[kRearSpin] = speed / kRear;
    v = project_velocities(tree, *this, q, v, {0, kSteer, kRearSpin});
    REQUIRE(std::abs(v[0] - x[2]) + std::abs(v[kRearSpin] - speed / kRear) < 1e-12);
    ConstrainedTreeWorkspace<double, double> ws;
    const VecX<double> none = VecX<double>::Zero(tree.num_velocities());
    const VecX<double> vd =
        constrained_forward_dynamics<double, double>(tree, *this, q, v, none, {}, ws);
    return {vd[0], -vd[kSteer]};
  }

  std::vector<std::complex<double>> eigenvalues(double speed) const {
    Eigen::Matrix4d F = Eigen::Matrix4d::Zero();
    F(0, 2) = F(1, 3) = 1.0;
    const double h = 1e-5;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector4d x = h * Eigen::Vector4d::Unit(k);
      F.block<2, 1>(2, k) = (second_rates(speed, x) - second_rates(speed, -x)) / (2 * h);
    }
    const Eigen::Vector4cd e = F.eigenvalues();
    std::vector<std::complex<double>> out(e.data(), e.data() + 4);
    std::ranges::sort(out, {}, [](const auto& a) { return a.real(); });
    return out;
  }

  /// Largest real part of the oscillating eigenvalues (weave), or of the real ones (capsize).
  double growth(double speed, bool oscillates) const {
    double largest = -1e9;
    for (const std::complex<double>& e : eigenvalues(speed))
      if ((std::abs(e.imag()) > 1e-3) == oscillates) largest = std::max(largest, e.real());
    return largest;
  }

  Tree<double> tree;
};

double speed_of_change(const TreeBicycle& bicycle, double low, double high, bool oscillates) {
  const bool rises = bicycle.growth(high, oscillates) > 0;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    ((bicycle.growth(middle, oscillates) > 0) == rises ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

TEST_CASE("tree bicycle: the benchmark bicycle has the published eigenvalues",
          "[constraints][loops]") {
  const TreeBicycle bicycle;
  // Meijaard et al. 2007, Table 2 [1/s]. Central differences of h = 1e-5 on accelerations of order
  // 10: 1e-9 (rounding) and 1e-9 (curvature), sixteen entries of a badly scaled matrix.
  struct Published {
    double speed, castering, capsize, weave_real, weave_imaginary;
  };
  const auto p = GENERATE(
      Published{5, -14.07838969279822, -0.32286642900409, -0.77534188219585, 4.46486771378823},
      Published{6, -16.08537123098026, -0.00406690076970, -1.52644486584142, 5.87673060598709},
      Published{7, -18.15788466125262, 0.10268170574766, -2.13875644258362, 7.19525913329805});
  CAPTURE(p.speed);
  const std::vector<std::complex<double>> found = bicycle.eigenvalues(p.speed);
  CHECK_THAT(found[0].real(), WithinAbs(p.castering, 1e-6));
  for (std::size_t i = 1; i < 4; ++i) {
    if (std::abs(found[i].imag()) < 1e-6) {
      CHECK_THAT(found[i].real(), WithinAbs(p.capsize, 1e-6));
    } else {
      CHECK_THAT(found[i].real(), WithinAbs(p.weave_real, 1e-6));
      CHECK_THAT(std::abs(found[i].imag()), WithinAbs(p.weave_imaginary, 1e-6));
    }
  }
}

TEST_CASE("tree bicycle: the benchmark bicycle is stable from 4.292 to 6.024 m/s",
          "[constraints][loops]") {
  const TreeBicycle bicycle;
  CHECK_THAT(speed_of_change(bicycle, 4.0, 5.0, true), WithinAbs(4.29238253634111, 1e-5));
  CHECK_THAT(speed_of_change(bicycle, 5.0, 7.0, false), WithinAbs(6.02426201538837, 1e-5));
}

}  // namespace tree_bicycle_test
