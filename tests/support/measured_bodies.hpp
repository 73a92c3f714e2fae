#pragma once
/// Motions of bodies under constraints, made without the library's equations of constraints:
/// Lagrange's equations or Newton's, written out in reduced coordinates, or MuJoCo; and what a
/// camera makes of them.

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string>
#include <support/temporary_folder.hpp>
#include <vector>

#include <Eigen/LU>
#include <mujoco/mujoco.h>

#include <diffnea/core/random.hpp>
#include <diffnea/identify/body_motion.hpp>

namespace diffnea::test {

constexpr double kFrameRate = 200.0;   ///< [Hz]
constexpr double kCameraNoise = 1e-3;  ///< [m]
constexpr double kTurnNoise = 5e-3;    ///< [rad]
constexpr double kGravity = 9.81;      ///< [m/s²]

/// Poses as a camera sees them. @param path  rows of one pose per body, at kFrameRate
inline std::vector<PosedRow> seen(const std::vector<std::vector<Pose<double>>>& path,
                                  unsigned seed) {
  Rng rng(seed);
  const auto three = [&rng](double size) {
    return Vec3<double>{size * rng.normal(), size * rng.normal(), size * rng.normal()};
  };
  std::vector<PosedRow> out;
  for (std::size_t k = 0; k < path.size(); ++k) {
    out.push_back({static_cast<double>(k) / kFrameRate, 0, path[k]});
    for (Pose<double>& X : out.back().X_WB) {
      X.p = X.p + three(kCameraNoise);
      X.R = X.R * exp(three(kTurnNoise));
    }
  }
  return out;
}

/// The same of particles, which show no turn.
inline std::vector<PosedRow> seen_particles(const std::vector<std::vector<Vec3<double>>>& path,
                                            unsigned seed) {
  std::vector<std::vector<Pose<double>>> poses;
  for (const auto& row : path) {
    poses.emplace_back();
    for (const Vec3<double>& p : row) poses.back().push_back(Pose<double>::translation(p));
  }
  std::vector<PosedRow> out = seen(poses, seed);
  for (PosedRow& row : out)
    for (Pose<double>& X : row.X_WB) X.R = Mat3<double>::identity();
  return out;
}

/// States of ẋ = f(t, x) at kFrameRate: Runge–Kutta of fourth order, ten steps a frame.
template <int N, class F>
std::vector<Eigen::Matrix<double, N, 1>> integrated(Eigen::Matrix<double, N, 1> x, double seconds,
                                                    const F& f) {
  constexpr int kSteps = 10;
  const double h = 1.0 / (kFrameRate * kSteps);
  std::vector<Eigen::Matrix<double, N, 1>> out;
  const long frames = std::lround(seconds * kFrameRate);
  for (long k = 0; k < frames; ++k) {
    out.push_back(x);
    for (int i = 0; i < kSteps; ++i) {
      const double t = (static_cast<double>(k * kSteps) + i) * h;
      using V = Eigen::Matrix<double, N, 1>;
      const V a = f(t, x), b = f(t + h / 2, V(x + h / 2 * a)), c = f(t + h / 2, V(x + h / 2 * b)),
              d = f(t + h, V(x + h * c));
      x += h / 6 * (a + 2 * b + 2 * c + d);
    }
  }
  return out;
}

/// A plane double pendulum of two particles on massless rods, from the origin.
struct DoublePendulum {
  double first = 0.5, second = 0.3;             ///< lengths [m]
  double first_mass = 0.4, second_mass = 0.25;  ///< [kg]
};
inline std::vector<std::vector<Vec3<double>>> path_of(const DoublePendulum& truth, double seconds) {
  using V = Eigen::Matrix<double, 4, 1>;
  const double m = truth.second_mass / (truth.first_mass + truth.second_mass), l = truth.first,
               r = truth.second;
  // Lagrange's equations over the sum of masses, angles from straight down.
  const auto f = [=](double, const V& x) {
    const double c = std::cos(x[0] - x[1]), s = std::sin(x[0] - x[1]);
    Eigen::Matrix2d M;
    M << l * l, m * l * r * c, m * l * r * c, m * r * r;
    const Eigen::Vector2d Q(-m * l * r * s * x[3] * x[3] - kGravity * l * std::sin(x[0]),
                            m * l * r * s * x[2] * x[2] - m * kGravity * r * std::sin(x[1]));
    V out;
    out << x[2], x[3], M.inverse() * Q;
    return out;
  };
  std::vector<std::vector<Vec3<double>>> out;
  for (const V& x : integrated<4>(V(0.9, -0.4, 0.0, 0.5), seconds, f)) {
    const Vec3<double> a{l * std::sin(x[0]), 0, -l * std::cos(x[0])};
    out.push_back({a, a + Vec3<double>{r * std::sin(x[1]), 0, -r * std::cos(x[1])}});
  }
  return out;
}

/// An upright disc that rolls along x on z = 0, down a slope and back by a torque about its axle.
struct RollingDisc {
  double radius = 0.15, mass = 1.2, axial = 0.02;                     ///< [m, kg, kg·m²]
  double slope = 0.5;                                                 ///< g sin α along x [m/s²]
  static double torque(double t) { return 0.9 * std::sin(2.1 * t); }  ///< about y [N·m]
};
inline std::vector<std::vector<Pose<double>>> path_of(const RollingDisc& truth, double seconds) {
  using V = Eigen::Matrix<double, 2, 1>;
  const auto f = [&truth](double t, const V& x) {
    return V(x[1], (RollingDisc::torque(t) / truth.radius + truth.mass * truth.slope) /
                       (truth.mass + truth.axial / (truth.radius * truth.radius)));
  };
  std::vector<std::vector<Pose<double>>> out;
  for (const V& x : integrated<2>(V(0.0, -0.6), seconds, f))
    out.push_back({{exp(Vec3<double>{0, x[0] / truth.radius, 0}), {x[0], 0, truth.radius}}});
  return out;
}

/// Chaplygin's sleigh: the blade is `behind` the centre of mass, a torque turns it.
struct Sleigh {
  double behind = 0.12, mass = 1.5, inertia = 0.06;                   ///< [m, kg, kg·m²]
  static double torque(double t) { return 0.5 * std::cos(3.0 * t); }  ///< [N·m]
};
inline std::vector<std::vector<Pose<double>>> path_of(const Sleigh& truth, double seconds) {
  using V = Eigen::Matrix<double, 5, 1>;  // heading, its rate, speed of the blade, its place
  const double a = truth.behind, m = truth.mass;
  const auto f = [&](double t, const V& x) {
    V out;
    out << x[1], (Sleigh::torque(t) - m * a * x[2] * x[1]) / (truth.inertia + m * a * a),
        a * x[1] * x[1], x[2] * std::cos(x[0]), x[2] * std::sin(x[0]);
    return out;
  };
  V start;
  start << 0.3, 0.0, 0.8, 0.0, 0.0;
  std::vector<std::vector<Pose<double>>> out;
  for (const V& x : integrated<5>(start, seconds, f))
    out.push_back({{exp(Vec3<double>{0, 0, x[0]}),
                    {x[3] + a * std::cos(x[0]), x[4] + a * std::sin(x[0]), 0}}});
  return out;
}

/// Two bodies that a hinge joins, thrown: MuJoCo's.
struct HingedPair {
  Vec3<double> p_AJ{0.21, 0.03, -0.02}, p_BJ{-0.14, 0.05, 0.04};  ///< hinge, axis y [m]
  double second_mass = 0.7;                                       ///< the first has 1 kg
};
inline std::vector<std::vector<Pose<double>>> path_of(const HingedPair& truth, double seconds) {
  const auto text = [](const Vec3<double>& v) {
    return std::to_string(v.x) + " " + std::to_string(v.y) + " " + std::to_string(v.z);
  };
  const TemporaryFolder folder;
  const auto file = folder.path() / "pair.xml";
  std::ofstream(file)
      << "<mujoco><option integrator='RK4' timestep='0.001' gravity='0 0 -9.81'/>"
         "<compiler inertiafromgeom='false'/><worldbody><body name='a'><freejoint/>"
         "<inertial pos='0 0 0' mass='1' diaginertia='0.01 0.02 0.015'/><body name='b' pos='"
      << text(truth.p_AJ + truth.p_BJ * -1.0) << "'><joint type='hinge' axis='0 1 0' pos='"
      << text(truth.p_BJ) << "'/><inertial pos='0 0 0' mass='" << truth.second_mass
      << "' diaginertia='0.006 0.008 0.007'/></body></body></worldbody></mujoco>";
  char error[500] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> model(
      mj_loadXML(file.c_str(), nullptr, error, sizeof error), mj_deleteModel);
  if (!model) throw std::runtime_error(error);
  const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  const double velocity[7] = {0.4, 0.1, 5.0, 1.5, -2.0, 1.0, 6.0};
  std::copy_n(velocity, 7, data->qvel);
  std::vector<std::vector<Pose<double>>> out;
  const long frames = std::lround(seconds * kFrameRate);
  const int steps = static_cast<int>(std::lround(1.0 / (kFrameRate * model->opt.timestep)));
  for (long k = 0; k < frames; ++k) {
    mj_kinematics(model.get(), data.get());
    out.emplace_back();
    for (int b = 1; b <= 2; ++b) {
      const mjtNum *p = data->xpos + 3 * b, *R = data->xmat + 9 * b;
      out.back().push_back(
          {{{{R[0], R[3], R[6]}, {R[1], R[4], R[7]}, {R[2], R[5], R[8]}}}, {p[0], p[1], p[2]}});
    }
    for (int i = 0; i < steps; ++i) mj_step(model.get(), data.get());
  }
  return out;
}

}  // namespace diffnea::test
