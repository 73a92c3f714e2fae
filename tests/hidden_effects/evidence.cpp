#include "evidence.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <Eigen/QR>

namespace hidden {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Joints' columns below each other, each divided by its noise.
VectorXd stacked(const MatrixXd& torque, const VectorXd& sigma) {
  const MatrixXd white = torque * sigma.cwiseInverse().asDiagonal();
  return white.reshaped();
}

struct Motion50 {
  MatrixXd q, qd, qdd;
  MatrixXd tau;  ///< without the hidden effects
};

/// Torque is linear in ten numbers a link: ten different bodies in the place of each link, all
/// other links without mass, span it.
MatrixXd base_columns(const Robot& robot, const Motion50& x, const VectorXd& sigma, double width) {
  Robot massless = robot;
  Inverse inverse(massless);
  mjModel& m = inverse.model();
  const int n = robot.num_joints();
  std::fill_n(m.body_mass, m.nbody, 0.0);
  std::fill_n(m.body_inertia, 3 * m.nbody, 0.0);
  std::fill_n(m.dof_armature, m.nv, 0.0);
  Rng rng(0);
  std::vector<VectorXd> columns;
  MatrixXd torque(x.q.rows(), n);
  for (int b = 1; b < m.nbody; ++b) {
    for (int i = 0; i < 10; ++i) {
      m.body_mass[b] = rng.uniform(0.5, 2.0);
      for (int k = 0; k < 3; ++k) {
        m.body_ipos[3 * b + k] = rng.uniform(-0.3, 0.3);
        m.body_inertia[3 * b + k] = rng.uniform(0.02, 0.03);
      }
      double norm = 0.0;
      for (int k = 0; k < 4; ++k) norm += std::pow(m.body_iquat[4 * b + k] = rng.normal(), 2);
      for (int k = 0; k < 4; ++k) m.body_iquat[4 * b + k] /= std::sqrt(norm);
      for (Index t = 0; t < torque.rows(); ++t)
        torque.row(t) = inverse.torque(x.q.row(t), x.qd.row(t), x.qdd.row(t));
      columns.push_back(stacked(torque, sigma));
    }
    m.body_mass[b] = 0.0;
    std::fill_n(m.body_inertia + 3 * b, 3, 0.0);
  }
  for (int j = 0; j < n; ++j) {
    const Link& link = robot.links[static_cast<std::size_t>(j)];
    const auto add = [&](const VectorXd& column) {
      torque.setZero();
      torque.col(j) = column;
      columns.push_back(stacked(torque, sigma));
    };
    if (link.armature > 0.0) add(x.qdd.col(j));
    if (link.damping > 0.0) add(x.qd.col(j));
    if (link.coulomb > 0.0) add((x.qd.col(j) / (width * (link.slide ? 0.1 : 1.0))).array().tanh());
  }
  MatrixXd out(columns[0].size(), static_cast<Index>(columns.size()));
  for (Index i = 0; i < out.cols(); ++i) out.col(i) = columns[static_cast<std::size_t>(i)];
  return out;
}

/// Projects out what it was built from.
class Projector {
 public:
  explicit Projector(const MatrixXd& columns) {
    const VectorXd norms = columns.colwise().norm().cwiseMax(1e-300);
    Eigen::ColPivHouseholderQR<MatrixXd> qr;
    qr.setThreshold(1e-9);  // rank of noise-free columns of norm 1
    qr.compute(columns * norms.cwiseInverse().asDiagonal());
    basis_ = qr.householderQ() * MatrixXd::Identity(columns.rows(), qr.rank());
  }
  MatrixXd rest(const MatrixXd& x) const { return x - basis_ * (basis_.transpose() * x); }

 private:
  MatrixXd basis_;
};

/// Squared norm of what the columns leave of x.
double left_over(const MatrixXd& columns, const VectorXd& x) {
  if (columns.cols() == 0) return x.squaredNorm();
  const VectorXd norms = columns.colwise().norm().cwiseMax(1e-300);
  const MatrixXd scaled = columns * norms.cwiseInverse().asDiagonal();
  return (x - scaled * scaled.colPivHouseholderQr().solve(x)).squaredNorm();
}

VectorXd derivative(const VectorXd& x) {
  VectorXd out = VectorXd::Zero(x.size());
  for (Index k = 1; k + 1 < x.size(); ++k) out[k] = 25.0 * (x[k + 1] - x[k - 1]);  // 50 Hz
  return out;
}

/// Column of a simple effect at joint j, in its usual shape.
VectorXd simple_column(const std::string& effect, int j, const Motion50& x, double v0) {
  const Eigen::ArrayXd q = x.q.col(j), qd = x.qd.col(j), s = (qd / v0).tanh();
  if (effect == "coulomb_friction") return s;
  if (effect == "viscous_friction") return qd;
  if (effect == "quadratic_friction") return qd * qd.abs();
  if (effect == "sublinear_friction") return s * qd.abs().sqrt();
  if (effect == "torque_offset") return VectorXd::Ones(q.size());
  if (effect == "joint_spring") return q;
  if (effect == "armature") return x.qdd.col(j);
  if (effect == "torque_gain") return x.tau.col(j);
  if (effect == "load_friction") return x.tau.col(j).array().abs() * s;
  return derivative(x.tau.col(j));  // actuator_lag, actuator_delay to first order
}

const std::vector<std::vector<std::string>> kRivals{{"coulomb_friction"},
                                                    {"viscous_friction"},
                                                    {"quadratic_friction"},
                                                    {"sublinear_friction"},
                                                    {"torque_offset"},
                                                    {"joint_spring", "torque_offset"},
                                                    {"armature"},
                                                    {"torque_gain"},
                                                    {"load_friction"},
                                                    {"actuator_lag"},
                                                    {"coulomb_friction", "viscous_friction"},
                                                    {"coulomb_friction", "torque_offset"},
                                                    {"viscous_friction", "quadratic_friction"}};

/// Variance at 50 Hz over that of the samples.
double noise_factor(const Case& c) {
  const auto every = static_cast<double>(std::max(1L, std::lround(c.rate / 50.0)));
  if (c.sensors.corner == 0.0) return 1.0 / every;
  const double a = std::exp(-2.0 * std::numbers::pi * c.sensors.corner / c.rate);
  return std::min(1.0, (1.0 + a) / (1.0 - a) / every);
}

/// Beyond, the positions' noise leaves nothing of a torque [Hz].
constexpr double kHighest = 100.0;

/// Variance of a row's torque per joint that the positions' noise, times ω², becomes at 1 rad/s, by
/// the inertia matrix midway.
VectorXd acceleration_noise(const Case& c, const MatrixXd& q) {
  const Index n = q.cols();
  Inverse inverse(c.world.robot);
  const VectorXd zero = VectorXd::Zero(n), middle = q.colwise().mean();
  const VectorXd still = inverse.torque(middle, zero, zero);
  const VectorXd variance =
      c.sensors.position_noise.cwiseAbs2() + c.sensors.position_step.cwiseAbs2() / 12.0;
  VectorXd out = VectorXd::Zero(n);
  for (Index k = 0; k < n; ++k)
    out += variance[k] * (inverse.torque(middle, zero, VectorXd::Unit(n, k)) - still).cwiseAbs2();
  return out;
}

/// Σ over frequencies of a joint's torque over its noise: at 50 Hz means of e would fold the
/// impulses of a gap down to where there is less noise.
/// @param e        (rows) [N·m], at `rate` [Hz]
/// @param own      variance of the torque's noise
/// @param moving   that of the positions', at 1 rad/s
double over_noise(const VectorXd& e, double rate, double own, double moving) {
  const Index rows = e.size();
  const double turn = 2.0 * std::numbers::pi / static_cast<double>(rows);
  std::vector<std::complex<double>> turns;
  for (Index t = 0; t < rows; ++t) turns.push_back(std::polar(1.0, turn * static_cast<double>(t)));
  double out = 0.0;
  for (Index k = 0; 2 * k <= rows; ++k) {
    const double w = turn * static_cast<double>(k) * rate;  // [rad/s]
    if (w > 2.0 * std::numbers::pi * kHighest) break;
    std::complex<double> sum = 0.0;
    for (Index t = 0, at = 0; t < rows; ++t, at = (at + k) % rows)
      sum += e[t] * turns[static_cast<std::size_t>(at)];
    const double both = k == 0 || 2 * k == rows ? 1.0 : 2.0;  // the negative frequency, too
    out += both * std::norm(sum) / (own + moving * std::pow(w, 4));
  }
  return out / static_cast<double>(rows);
}

}  // namespace

std::vector<Evidence> evidence(const Case& c, const Series& s) {
  const int n = c.world.robot.num_joints();
  // Where there is no noise the figures are those of a noise of 1e-6.
  const VectorXd sigma =
      std::sqrt(noise_factor(c)) * std::max(c.sensors.torque_noise, 1e-6) * rms(s.tau);
  const Motion50 x{decimate(s.mean_q, c.rate), decimate(s.mean_qd, c.rate),
                   decimate(s.mean_qdd, c.rate), decimate(s.needed, c.rate)};
  const MatrixXd effect = decimate(effect_torque(c.world, s), c.rate);
  const VectorXd share = effect_share(c.world, s, c.rate);
  MatrixXd base = base_columns(c.world.robot, x, sigma, c.world.coulomb_width);
  if (c.base == "fixed") base = MatrixXd::Zero(base.rows(), 1);
  const Projector projector(base);

  const std::size_t count = c.world.hidden.size();
  std::vector<Evidence> out(count);
  MatrixXd each(base.rows(), static_cast<Index>(count));
  for (std::size_t i = 0; i < count; ++i) {
    MatrixXd own = MatrixXd::Zero(effect.rows(), n);
    for (const int j : c.world.hidden[i].joints) {
      own.col(j) = effect.col(j);
      out[i].size = std::max(out[i].size, share[j]);
    }
    each.col(static_cast<Index>(i)) = stacked(own, sigma);
    out[i].raw_lm = each.col(static_cast<Index>(i)).squaredNorm();
  }
  const MatrixXd visible = projector.rest(each);
  const VectorXd moving = acceleration_noise(c, x.q);
  const MatrixXd rows = effect_torque(c.world, s).middleRows(kPad, s.tau.rows() - 2 * kPad);
  const double every = static_cast<double>(std::max(1L, std::lround(c.rate / 50.0)));
  for (std::size_t i = 0; i < count; ++i) {
    const VectorXd own = visible.col(static_cast<Index>(i));
    MatrixXd others(own.size(), static_cast<Index>(count) - 1);
    for (Index k = 0, col = 0; k < static_cast<Index>(count); ++k)
      if (k != static_cast<Index>(i)) others.col(col++) = visible.col(k);
    Evidence& e = out[i];
    e.expected_lm = left_over(others, own);
    e.visible_share = e.raw_lm > 1e-9 ? std::sqrt(e.expected_lm / e.raw_lm) : 0.0;
    const std::vector<int>& joints = c.world.hidden[i].joints;
    for (const int j : joints)
      e.reachable_lm += e.visible_share * e.visible_share *
                        over_noise(rows.col(j), c.rate, every * sigma[j] * sigma[j], moving[j]);
    if (joints.size() > 2 || (n <= 2 && joints.size() > 1)) continue;  // not a joint's effect
    for (const std::vector<std::string>& names : kRivals) {
      MatrixXd with = others;
      for (const std::string& name : names)
        for (const int j : joints) {
          MatrixXd torque = MatrixXd::Zero(effect.rows(), n);
          const bool slide = c.world.robot.links[static_cast<std::size_t>(j)].slide;
          torque.col(j) = simple_column(name, j, x, slide ? 0.001 : 0.01);
          with.conservativeResize(Eigen::NoChange, with.cols() + 1);
          with.rightCols(1) = projector.rest(stacked(torque, sigma));
        }
      e.rivals.push_back({names, left_over(with, own)});
    }
  }
  return out;
}

}  // namespace hidden
