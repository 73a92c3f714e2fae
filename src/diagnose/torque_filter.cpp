#include "diagnose/torque_filter.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include <diffnea/dynamics/mass_matrix.hpp>

#include "recording/path_smoother.hpp"

namespace diffnea {
namespace {


/// Change of the innovations' size over four rows that is the joint's inertia's.
constexpr double kSettled = 0.01;

/// First state's variance over the noise's, which says nothing of it.
constexpr double kUnknown = 1e6;

/// How an acceleration's variance exceeds that amid the path, (N) [1/s⁴].
VecX<double> at_ends(long rows, double path_hz, double dt) {
  const detail::PathSmoother path(path_hz, 1.0 / dt);
  const VecX<double> variance = path.acceleration_variance(rows);
  const double amid = detail::PathSmoother(path_hz, 1.0 / dt)
                          .acceleration_variance(2 * path.memory(1e-3) + 1)[path.memory(1e-3)];
  return (variance.array() - amid).max(0.0);
}

/// ∂τ/∂q of the links, and ∂τ/∂q̇ − 2 Ṁ: what errors δq of the path leave of M δq̈ + D δq̇ once both
/// are integrated twice, beside M δq, (n × n) each.
struct Slopes {
  Slopes(const Tree<double>& tree, const VecX<double>& q, const VecX<double>& qd,
         const VecX<double>& qdd)
      : by_q(q.size(), q.size()), by_qd(q.size(), q.size()) {
    RneaWorkspace<double, double> ws;
    for (long i = 0; i < q.size(); ++i) {
      const VecX<double> step = kLinkStep * VecX<double>::Unit(q.size(), i);
      const VecX<double> more = rnea<double, double>(tree, q + step, qd, qdd, ws);
      by_q.col(i) = (more - rnea<double, double>(tree, q - step, qd, qdd, ws)) / (2.0 * kLinkStep);
      const VecX<double> faster = rnea<double, double>(tree, q, qd + step, qdd, ws);
      by_qd.col(i) =
          (faster - rnea<double, double>(tree, q, qd - step, qdd, ws)) / (2.0 * kLinkStep);
    }
    MassMatrixWorkspace<double, double> mass;
    by_qd -= mass_matrix<double, double>(tree, q + kLinkStep * qd, mass) / kLinkStep;
    by_qd += mass_matrix<double, double>(tree, q - kLinkStep * qd, mass) / kLinkStep;
  }
  MatX<double> by_q, by_qd;
};

/// Density of the torque by which noise of the other positions drifts a coordinate j of a floating
/// base: nothing else moves it, so that its rows would remember the whole run. White noise δq_i
/// enters as M_ji δq̈_i + D_ji δq̇_i + K_ji δq_i. The middle is a random walk of q_j, of the rate
/// s² dt/M² with s² the variance of Σ D_ji δq_i, from which the position's own noise R tells q_j
/// up to ω = s/(M √R); at ω it has the density s² ω² dt.
double drift(const Slopes& slopes, int j, double inertia, double variance, const SignalNoise& noise,
             const VecX<double>& q, double dt) {
  VecX<double> K = slopes.by_q.row(j).transpose(), D = slopes.by_qd.row(j).transpose();
  K[j] = D[j] = 0.0;  // these the equation has
  const double s2 = noise.variance(D, q);
  return dt * (noise.variance(K, q) + s2 * s2 / (inertia * inertia * variance));
}

}  // namespace

/// Angles α of the hinges turn by δ = E δα, so that their covariance is σ² (EᵀE)⁻¹: the outer and
/// the inner axis meet at the cosine −sin α_middle.
double SignalNoise::variance(const VecX<double>& w, const VecX<double>& q) const {
  double out = w.cwiseProduct(position).squaredNorm();
  if (hinges < 0) return out;
  const VecX<double> of_hinges = w.segment(hinges, 3);
  out -= of_hinges.cwiseProduct(position.segment(hinges, 3)).squaredNorm();
  const double sine = std::sin(q[hinges + 1]), outer = of_hinges[0], inner = of_hinges[2];
  return out +
         std::pow(position[hinges + 1], 2) *
             (of_hinges[1] * of_hinges[1] +
              (outer * outer + inner * inner + 2.0 * sine * outer * inner) / (1.0 - sine * sine));
}

std::vector<JointEquation> joint_equations(const Tree<double>& tree, const JointSeries& path,
                                           const std::vector<int>& joints, const SignalNoise& noise,
                                           double path_hz, int every) {
  const long rows = path.rows(), n = path.q.cols();
  std::vector<JointEquation> out(joints.size(), JointEquation(rows));
  // White noise of the same power up to the path's cut-off.
  const VecX<double> ends = at_ends(rows, path_hz, path.dt) / (2.0 * path_hz);
  MassMatrixWorkspace<double, double> mass;
  RneaWorkspace<double, double> ws;
  for (long begin = 0; begin < rows; begin += every) {
    const long count = std::min<long>(every, rows - begin), at = begin + count / 2;
    const VecX<double> q = path.q.row(at).transpose(), qd = path.qd.row(at).transpose(),
                       qdd = path.qdd.row(at).transpose();
    const MatX<double>& M = mass_matrix<double, double>(tree, q, mass);
    std::optional<Slopes> slopes;
    if (noise.hinges >= 0) slopes.emplace(tree, q, qd, qdd);
    for (std::size_t k = 0; k < joints.size(); ++k) {
      const int j = joints[k];
      const auto slope = [&](const VecX<double>& by_q, const VecX<double>& by_qd) {
        const double more = rnea<double, double>(tree, q + by_q, qd + by_qd, qdd, ws)[j];
        return (more - rnea<double, double>(tree, q - by_q, qd - by_qd, qdd, ws)[j]) /
               (2.0 * kLinkStep);
      };
      const VecX<double> step = kLinkStep * VecX<double>::Unit(n, j), none = VecX<double>::Zero(n);
      VecX<double> of_others = M.row(j).transpose();
      of_others[j] = 0.0;
      const double coupled = noise.variance(of_others, q);
      JointEquation& e = out[k];
      e.inertia.segment(begin, count).setConstant(M(j, j));
      e.stiffness.segment(begin, count).setConstant(slope(step, none));
      e.damping.segment(begin, count).setConstant(slope(none, step));
      e.variance.segment(begin, count)
          .setConstant(noise.variance(M.row(j).transpose() / M(j, j), q));
      e.density.segment(begin, count) =
          (noise.density[j] + coupled * ends.segment(begin, count).array()).matrix();
      if (slopes && j < noise.hinges + 3)
        e.density.segment(begin, count).array() +=
            drift(*slopes, j, M(j, j), e.variance[begin], noise, q, path.dt);
    }
  }
  return out;
}

TorqueFilter::TorqueFilter(const JointEquation& e, double dt, int every) : every_(every) {
  const long rows = e.inertia.size();
  gain_.reserve(rows);
  Eigen::Matrix2d P = Eigen::Vector2d(1.0, 1.0 / (dt * dt)).asDiagonal();
  P *= kUnknown * e.variance[0];
  for (long k = 0; k < rows; ++k) {
    const double m = e.inertia[k], w = dt / m, s = e.stiffness[k] * w, d = e.damping[k] * w;
    const double innovation = P(0, 0) + e.variance[k];
    const Eigen::Vector2d K = P.col(0) / innovation;
    Eigen::Matrix2d F, Q;
    F << 1.0 - 0.5 * s * dt, dt * (1.0 - 0.5 * d), -s, 1.0 - d;
    Q << dt * dt / 3.0, dt / 2.0, dt / 2.0, 1.0;
    Q *= e.density[k] * dt / (m * m);
    const Eigen::Vector2d update = F * K;
    gain_.push_back({F(0, 0) - update[0], F(1, 0) - update[1], F(0, 1), F(1, 1), dt * w / 3.0,
                     dt * w / 6.0, 0.5 * w, update[0], update[1],
                     1.0 / std::sqrt(innovation * static_cast<double>(every))});
    // Joseph's form: first states that are not known cost digits.
    Eigen::Matrix2d left;
    left << 1.0 - K[0], 0.0, -K[1], 1.0;
    P = left * P * left.transpose() + e.variance[k] * K * K.transpose();
    P = F * P * F.transpose() + Q;
  }
}

long TorqueFilter::settled() const {
  // Innovations vary slowly with the joint's inertia, and fast as first states become known.
  const std::size_t last = gain_.size() - 1;
  std::size_t i = 0;
  for (; i < last; ++i) {
    const double later = gain_[std::min(last, i + static_cast<std::size_t>(4 * every_))].weight;
    if (std::abs(later / gain_[i].weight - 1.0) < kSettled) break;
  }
  return std::min(rows(), static_cast<long>(2 * i) / every_ + 1);
}

void TorqueFilter::push(const Eigen::Ref<const RowMatX<double>>& torque, const double* next,
                        State& state, Eigen::Ref<MatX<double>> out) const {
  const long count = torque.rows(), width = torque.cols();
  if (state.sample == 0) {
    state.x = MatX<double>::Zero(width, 2);
    state.sum = VecX<double>::Zero(width);
  }
  auto q = state.x.col(0).array(), v = state.x.col(1).array();
  VecX<double> before(width);
  for (long i = 0; i < count; ++i) {
    const Gain& g = gain_[state.sample];
    const auto now = torque.row(i).transpose().array();
    const Eigen::Map<const VecX<double>> after(
        i + 1 < count ? torque.row(i + 1).data() : next ? next : torque.row(i).data(), width);
    before = q;
    state.sum.array() += g.weight * before.array();
    q = g.a00 * before.array() + g.f01 * v + g.now * now + g.next * after.array();
    v = g.a10 * before.array() + g.f11 * v + g.speed * (now + after.array());
    if (++state.sample % every_ == 0) {
      out.row(state.sample / every_ - 1) = state.sum.transpose();
      state.sum.setZero();
    }
  }
}

MatX<double> TorqueFilter::operator()(const Eigen::Ref<const RowMatX<double>>& torque) const {
  MatX<double> out(rows(), torque.cols());
  State state;
  push(torque, nullptr, state, out);
  return out;
}

VecX<double> TorqueFilter::shown(const VecX<double>& positions) const {
  VecX<double> out(rows());
  double q = 0.0, v = 0.0, sum = 0.0;
  for (long i = 0; i < positions.size(); ++i) {
    const Gain& g = gain_[i];
    const double before = q, y = positions[i];
    sum += g.weight * (before - y);
    q = g.a00 * before + g.f01 * v + g.update0 * y;
    v = g.a10 * before + g.f11 * v + g.update1 * y;
    if ((i + 1) % every_ == 0) {
      out[(i + 1) / every_ - 1] = sum;
      sum = 0.0;
    }
  }
  return out;
}

}  // namespace diffnea
