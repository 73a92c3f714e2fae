#pragma once
/// A ball on a string, and one in flight, as a camera sees them. Made without the library's
/// equations of either: Störmer–Verlet steps, the string a projection back onto its sphere (SHAKE;
/// Ryckaert, Ciccotti, Berendsen 1977), which is an impact where it becomes taut (without
/// restitution, unless one is asked for), and asks for positions of the anchor alone; or a stiff
/// spring with a damper. The arm's kinematics are written out.

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/model/model.hpp>
#include <diffnea/recording/recording.hpp>

namespace diffnea::test {

/// Three joints that swing a hand, about z, y and x; the ball is tied 0.28 m out.
inline Model swinging_arm() {
  Model model;
  model.name = "swinger";
  const Vec3<double> axes[3] = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}};
  for (int k = 0; k < 3; ++k) {
    ModelLink link;
    link.name = "link" + std::to_string(k);
    link.joint = "joint" + std::to_string(k);
    link.parent = k - 1;
    link.type = ModelJoint::kRevolute;
    link.axis = axes[k];
    link.X_PJ.p = {k == 0 ? 0.0 : 0.3, 0, k == 0 ? 1.0 : 0.0};
    link.inertia = inertia_from_com<double>(1.0, {0.1, 0, 0}, {0.01, 0, 0, 0.01, 0, 0.01});
    model.links.push_back(link);
  }
  model.ball = BallSpec{0.024, 0.02, StringSpec{2, {0.28, 0.02, 0.05}, 0.40}};
  return model;
}

struct SwingOptions {
  double seconds = 16.0;
  unsigned seed = 1;
  double noise = 1.5e-3;     ///< of the camera [m]
  double shake = 1.0;        ///< amplitude of the joints over 0.35, 0.35, 0.8 rad
  double pace = 1.0;         ///< of the joints' motion; another one is another motion
  double drag = 0.0;         ///< −c v [1/s]
  double compliance = 0.0;   ///< of the string [m/N]; its length is that under the ball's weight
  double restitution = 0.0;  ///< of the velocity along the string where it becomes taut
  /// A further acceleration at (t, x, v) [m/s²].
  std::function<Vec3<double>(double, const Vec3<double>&, const Vec3<double>&)> extra{};
};

inline double joint_angle(int joint, double t, const SwingOptions& o) {
  const double w[3] = {1.9, 2.6, 3.3}, A[3] = {0.35, 0.35, 0.8};
  return o.shake * A[joint] * std::sin(o.pace * w[joint] * t + 0.4 * joint);
}

/// Where the string is tied, by the arm's geometry.
inline Vec3<double> anchor_of(const Vec3<double>& p_LS, const std::array<double, 3>& q) {
  Vec3<double> p = p_LS;
  p = {p.x + 0.3, p.y * std::cos(q[2]) - p.z * std::sin(q[2]),
       p.y * std::sin(q[2]) + p.z * std::cos(q[2])};
  p = {p.x * std::cos(q[1]) + p.z * std::sin(q[1]) + 0.3, p.y,
       -p.x * std::sin(q[1]) + p.z * std::cos(q[1])};
  return {p.x * std::cos(q[0]) - p.y * std::sin(q[0]), p.x * std::sin(q[0]) + p.y * std::cos(q[0]),
          p.z + 1.0};
}
inline Vec3<double> anchor_at(const Vec3<double>& p_LS, double t, const SwingOptions& o) {
  return anchor_of(p_LS, {joint_angle(0, t, o), joint_angle(1, t, o), joint_angle(2, t, o)});
}

/// The ball's path, every `dt` from 0 on.
inline std::vector<Vec3<double>> swung_path(const Model& truth, double dt, long rows,
                                            const SwingOptions& o) {
  const StringSpec& s = *truth.ball->string;
  const Vec3<double> g = truth.gravity;
  // Verlet's error at 2e-4 s is (ωh)²/24 of a swing at ω = 10/s: 2e-7. A spring of ω = 100/s takes
  // a tenth of the step.
  const bool spring = o.compliance > 0.0;
  const long fine = std::lround(dt / (spring ? 2e-5 : 2e-4));
  const double h = dt / static_cast<double>(fine), m = truth.ball->mass;
  const double stiffness = spring ? 1.0 / (o.compliance * m) : 0.0,
               free_length = s.length - (spring ? 9.81 / stiffness : 0.0);
  const double damping = 2.0 * 0.5 * std::sqrt(stiffness);  // half the critical
  Vec3<double> S = anchor_at(s.p_LS, 0.0, o);
  Vec3<double> v = (anchor_at(s.p_LS, h, o) - anchor_at(s.p_LS, -h, o)) * (0.5 / h);
  Vec3<double> x = S + Vec3<double>{0, 0, -s.length}, before = x - v * h, earlier = x - v * (2 * h);
  bool taut = true;
  std::vector<Vec3<double>> out;
  for (long k = 0; k < rows; ++k) {
    out.push_back(x);
    for (long i = 0; i < fine; ++i) {
      const double t = static_cast<double>(k * fine + i) * h;
      v = (x * 3.0 - before * 4.0 + earlier) * (0.5 / h);  // one-sided, second order
      Vec3<double> a = g - v * o.drag;
      if (o.extra) a = a + o.extra(t, x, v);
      const Vec3<double> delta = x - S, S_next = anchor_at(s.p_LS, t + h, o);
      if (spring) {
        const double length = std::sqrt(dot(delta, delta));
        const Vec3<double> u = delta * (1.0 / length);
        const double pull =
            stiffness * (length - free_length) + damping * dot(u, v - (S_next - S) * (1.0 / h));
        if (length > free_length && pull > 0.0) a = a - u * pull;
      }
      Vec3<double> next = x * 2.0 - before + a * (h * h);
      if (!spring) {
        const Vec3<double> e = next - S_next;
        const double over = dot(e, e) - s.length * s.length;
        if (over > 0.0) {  // back along Δ, by as much as puts it on the sphere
          const double b = dot(e, delta), c = dot(delta, delta);
          next = next - delta * ((b - std::sqrt(std::max(0.0, b * b - c * over))) / c);
          if (!taut && o.restitution > 0.0) {  // inside again, by as much as it flew out
            const Vec3<double> u = delta * (1.0 / std::sqrt(c));
            const double outward = std::max(0.0, dot(u, v - (S_next - S) * (1.0 / h)));
            next = next - u * (s.length - std::sqrt(c) + o.restitution * outward * h);
          }
        }
        taut = over > 0.0;
      }
      earlier = before;
      before = x;
      x = next;
      S = S_next;
    }
  }
  return out;
}

/// A recording at 200 Hz in which every second row shows the ball; the joints' torque is not
/// measured.
inline Recording record_swing(const Model& truth, const SwingOptions& o) {
  constexpr double kStep = 5e-3;
  Rng rng(o.seed);
  Recording r;
  r.source = "made-" + std::to_string(o.seed);
  for (const ModelLink& l : truth.links) r.joint_names.push_back(l.joint);
  const long rows = std::lround(o.seconds / kStep);
  r.time.resize(rows);
  r.q.resize(rows, 3);
  r.tau = RowMatX<double>::Constant(rows, 3, std::numeric_limits<double>::quiet_NaN());
  r.has_tau.assign(3, false);
  r.ball = r.tau;
  const std::vector<Vec3<double>> path = swung_path(truth, kStep, rows, o);
  for (long k = 0; k < rows; ++k) {
    r.time[k] = static_cast<double>(k) * kStep;
    for (int j = 0; j < 3; ++j) r.q(k, j) = joint_angle(j, r.time[k], o);
    if (k % 2 != 0) continue;
    const Vec3<double>& x = path[static_cast<std::size_t>(k)];
    r.ball.row(k) << x.x + o.noise * rng.normal(), x.y + o.noise * rng.normal(),
        x.z + o.noise * rng.normal();
  }
  return r;
}

/// The torques of the arm's links, of the ball's pull, of viscous friction [N·m·s/rad] and of dry
/// friction of joint1 [N·m].
inline void add_torque(const Model& arm, const SwingOptions& o, Recording& r, double viscous = 0.3,
                       double coulomb = 0.0) {
  const Tree<double> tree = make_tree(arm);
  RneaWorkspace<double, double> workspace;
  Rng rng(o.seed + 100);
  r.has_tau.assign(3, true);
  const double dt = r.time[1] - r.time[0], h = 1e-4;
  const std::vector<Vec3<double>> path = swung_path(arm, dt, r.rows() + 1, o);
  for (long k = 0; k < r.rows(); ++k) {
    const double t = r.time[k];
    VecX<double> q(3), qd(3), qdd(3);
    for (int j = 0; j < 3; ++j) {
      const double now = joint_angle(j, t, o), late = joint_angle(j, t + h, o),
                   early = joint_angle(j, t - h, o);
      q[j] = now;
      qd[j] = (late - early) / (2 * h);
      qdd[j] = (late - 2 * now + early) / (h * h);
    }
    const VecX<double> tau = rnea<double, double>(tree, q, qd, qdd, workspace);
    // The string pulls the hand by what the ball lacks of falling freely: m (g − c v − ẍ).
    const auto i = static_cast<std::size_t>(std::max(1L, k));
    const Vec3<double> v = (path[i + 1] - path[i - 1]) * (0.5 / dt),
                       a = (path[i + 1] - path[i] * 2.0 + path[i - 1]) * (1.0 / (dt * dt));
    const Vec3<double> pull = (arm.gravity - v * o.drag - a) * arm.ball->mass;
    for (int j = 0; j < 3; ++j) {
      std::array<double, 3> late{q[0], q[1], q[2]}, early = late;
      late[static_cast<std::size_t>(j)] += h;
      early[static_cast<std::size_t>(j)] -= h;
      const Vec3<double>& p_LS = arm.ball->string->p_LS;
      const Vec3<double> lever = (anchor_of(p_LS, late) - anchor_of(p_LS, early)) * (0.5 / h);
      r.tau(k, j) = tau[j] - dot(lever, pull) + viscous * qd[j] +
                    (j == 1 ? coulomb * std::tanh(qd[j] / 0.01) : 0.0) + 0.01 * rng.normal();
    }
  }
  r.info.torque_sampling = TorqueSampling::kInstant;
}

/// A ball alone, of table tennis.
inline Model flying_ball() {
  Model model;
  model.name = "ball";
  model.ball = BallSpec{2.7e-3, 0.02, std::nullopt};
  return model;
}

struct FlightsOptions {
  int flights = 40;
  double seconds = 0.6;  ///< of each
  double noise = 1.5e-3;
  double drag = 0.12;        ///< −c₂ |v| v [1/m]
  double lift = 0.0;         ///< ω × v [1]: C_M ρ A r/m
  double false_spins = 0.0;  ///< share of the flights whose spin has the wrong sign
  unsigned seed = 1;
};

/// Flights at 100 Hz with pauses of 0.4 s, in which nothing is seen.
/// @param false_at  times at which those with the wrong spin begin
inline Recording record_flights(const FlightsOptions& o, std::vector<double>* false_at = nullptr) {
  constexpr double kStep = 1e-2, kPause = 0.4;
  Rng rng(o.seed);
  Recording r;
  r.source = "flights-" + std::to_string(o.seed);
  const long flight = std::lround(o.seconds / kStep), pause = std::lround(kPause / kStep);
  const long rows = o.flights * (flight + pause);
  r.time.resize(rows);
  r.q.resize(rows, 0);
  r.tau.resize(rows, 0);
  r.ball = RowMatX<double>::Constant(rows, 3, std::numeric_limits<double>::quiet_NaN());
  r.spin = r.ball;
  for (long k = 0; k < rows; ++k) r.time[k] = static_cast<double>(k) * kStep;
  for (int f = 0; f < o.flights; ++f) {
    const double speed = rng.uniform(4.0, 8.0), side = rng.uniform(-0.6, 0.6);
    Vec3<double> x{0, 0, 1.0}, v{speed * std::cos(side), speed * std::sin(side), 2.5};
    const Vec3<double> spin{rng.uniform(-150, 150), rng.uniform(-150, 150), rng.uniform(-150, 150)};
    const bool wrong = rng.uniform() < o.false_spins;
    const long first = f * (flight + pause);
    if (wrong && false_at) false_at->push_back(r.time[first]);
    const auto a = [&](const Vec3<double>& w) {
      return Vec3<double>{0, 0, -9.81} - w * (o.drag * std::sqrt(dot(w, w))) +
             cross(spin, w) * o.lift;
    };
    for (long k = first; k < first + flight; ++k) {
      r.ball.row(k) << x.x + o.noise * rng.normal(), x.y + o.noise * rng.normal(),
          x.z + o.noise * rng.normal();
      const double sign = wrong ? -1.0 : 1.0;
      r.spin.row(k) << sign * spin.x, sign * spin.y, sign * spin.z;
      for (int i = 0; i < 10; ++i) {  // Heun's steps of 1 ms: off by 1e-8 m in 0.6 s
        const double h = kStep / 10;
        const Vec3<double> a1 = a(v), a2 = a(v + a1 * h);
        x = x + v * h + (a1 * 2.0 + a2) * (h * h / 6.0);
        v = v + (a1 + a2) * (0.5 * h);
      }
    }
  }
  return r;
}

}  // namespace diffnea::test
