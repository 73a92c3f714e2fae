/// A constraint of one's own: a bead that slides without friction on a wire, z = a x² in the plane
/// y = 0 of the world. Two equations, written once; all derivatives follow from them.
///
///     own_constraint

#include <cmath>
#include <cstdio>
#include <exception>

#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/dynamics/free_motion.hpp>

namespace {

using namespace diffnea;

/// Point P of the body lies on the wire. P: the scalar of the parameters, so that a Jet can move
/// them; T: the scalar of the poses.
template <class P>
struct OnWire {
  static constexpr int kBodies = 1, kRows = 2;
  static constexpr Relation kRelation = Relation::kEqual;
  Vec3<P> p_BP;   ///< [m]
  P curvature{};  ///< a [1/m]

  template <class T>
  std::array<T, 2> operator()(const std::array<Pose<T>, 1>& X) const {
    const Vec3<T> p = X[0].R * p_BP.template cast<T>() + X[0].p;
    return {p.y, p.z - T(curvature) * p.x * p.x};
  }
};

constexpr double kGravity = 9.81, kMass = 0.1, kCurvature = 2.0;

double energy(const BodyState<double>& s) {
  return kMass * (0.5 * dot(s.V.linear, s.V.linear) + kGravity * s.X_WB.p.z);
}

}  // namespace

int main() try {
  const OnWire<double> wire{{0, 0, 0}, kCurvature};
  const std::vector<FreeBody<double>> bodies{particle(kMass)};
  std::vector<BodyState<double>> states(1);  // at rest, 0.3 m aside
  states[0].X_WB.p = {0.3, 0, kCurvature * 0.3 * 0.3};
  const double before = energy(states[0]);

  const std::vector<Wrench<double>> applied(1, {{0, 0, 0}, {0, 0, 0}});
  const auto accelerations = [&](double, const std::vector<BodyState<double>>& at) {
    std::vector<ConstraintRow<double>> rows;
    append_rows(wire, "wire", {0}, at, rows);
    return constrained_acceleration<double>(bodies, at, applied, {}, rows, {0, 0, -kGravity},
                                            Stabilisation::within(0.05))
        .Vd;
  };
  MotionWorkspace<double> ws;
  for (int k = 0; k < 5000; ++k) step_bodies(accelerations, 1e-3, states, ws);  // 5 s

  const Vec3<double>& p = states[0].X_WB.p;
  const double off = std::abs(p.z - kCurvature * p.x * p.x),
               lost = std::abs(energy(states[0]) - before);
  std::printf("after 5 s: x = %.3f m, off the wire by %.1e m, energy changed by %.1e of %.3f J\n",
              p.x, off, lost, before);
  return off < 1e-9 && lost < 1e-6 ? 0 : 3;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
