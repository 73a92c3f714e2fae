#include "ball_swing.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace hidden {
namespace {

// A string that does not give: twice the critical damping, so that becoming taut ends the ball's
// velocity along it (3 % come back).
constexpr double kStiffOmega = 700.0, kStiffDamping = 2.0;
// An elastic one, which swings a few times when plucked.
constexpr double kElasticDamping = 0.3;

Eigen::Vector3d acceleration(const BallWorld& w, const Anchor& s, const BallState& b) {
  const Eigen::Vector3d g{0.0, 0.0, -kGravity * (1.0 + w.gravity_excess)};
  const double speed = b.v.norm();
  Eigen::Vector3d a = w.wind - b.v * (w.linear_drag + w.quadratic_drag * speed);
  if (w.dry_drag > 0.0) a -= b.v * (w.dry_drag / std::hypot(speed, 5e-3));
  const double pull = tension(w, s, b);
  if (pull <= 0.0) return a + g;
  const Eigen::Vector3d delta = b.x - s.x, u = delta.normalized(), relative = b.v - s.v;
  a -= u * (pull / w.mass);
  const Eigen::Vector3d knot =
      -w.damping * relative - w.stiffness * w.length * Eigen::Vector3d::UnitZ();
  a += knot - u * u.dot(knot);
  const double mu = w.mass_ratio;
  return (a + (1.0 + mu / 2.0) * g - mu / 6.0 * s.a) / (1.0 + mu / 3.0);
}

}  // namespace

double give(const BallWorld& w) {
  return w.compliance + 1.0 / (w.mass * kStiffOmega * kStiffOmega);
}

double tension(const BallWorld& w, const Anchor& s, const BallState& b) {
  const Eigen::Vector3d delta = b.x - s.x;
  const double distance = delta.norm(), stretch = distance - w.length;
  if (stretch <= 0.0) return 0.0;
  const double k = 1.0 / give(w);
  const double ratio = w.compliance > 0.0 ? kElasticDamping : kStiffDamping;
  const double d = 2.0 * ratio * std::sqrt(k * w.mass);
  return std::max(0.0, k * stretch + d * delta.dot(b.v - s.v) / distance);
}

std::vector<BallState> swing(const BallWorld& w, const Hand* hands, long steps, BallState b) {
  std::vector<BallState> out{b};
  out.reserve(static_cast<std::size_t>(steps) + 1);
  const Eigen::Vector3d tied = w.attachment + w.attachment_off;
  constexpr double h = kSwingStep;
  Anchor now = anchor(hands[0], tied);
  for (long i = 0; i < steps; ++i) {
    const Anchor middle = anchor(hands[2 * i + 1], tied), next = anchor(hands[2 * i + 2], tied);
    const Eigen::Vector3d a1 = acceleration(w, now, b);
    const BallState b2{b.x + 0.5 * h * b.v, b.v + 0.5 * h * a1};
    const Eigen::Vector3d a2 = acceleration(w, middle, b2);
    const BallState b3{b.x + 0.5 * h * b2.v, b.v + 0.5 * h * a2};
    const Eigen::Vector3d a3 = acceleration(w, middle, b3);
    const BallState b4{b.x + h * b3.v, b.v + h * a3};
    const Eigen::Vector3d a4 = acceleration(w, next, b4);
    b.x += h / 6.0 * (b.v + 2.0 * b2.v + 2.0 * b3.v + b4.v);
    b.v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    out.push_back(b);
    now = next;
  }
  return out;
}

Eigen::Vector3d seen(const BallWorld& w, const std::vector<BallState>& path, double step) {
  const double at = std::clamp(step - w.camera_delay / kSwingStep, 0.0,
                               static_cast<double>(path.size() - 1) - 1e-9);
  const auto i = static_cast<std::size_t>(at);
  const double u = at - static_cast<double>(i);
  const BallState &a = path[i], &b = path[i + 1];
  // The cubic that has the velocities at both ends.
  const Eigen::Vector3d da = kSwingStep * a.v, db = kSwingStep * b.v, way = b.x - a.x;
  Eigen::Vector3d x = a.x + u * (da + u * (3.0 * way - 2.0 * da - db + u * (da + db - 2.0 * way)));
  x *= 1.0 + w.camera_excess;
  return x + w.camera_turn.cross(x) + w.camera_off;
}

}  // namespace hidden
