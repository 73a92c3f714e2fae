#include "evidence.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include <Eigen/Eigenvalues>

namespace rigs {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPi = std::numbers::pi;
/// No torque is told from a position's noise beyond [Hz].
constexpr double kHighest = 100.0;

/// Orthonormal basis of what columns of norm 1 span, to a relative 1e-5.
MatrixXd basis_of(MatrixXd columns) {
  for (Index i = 0; i < columns.cols(); ++i)
    if (const double norm = columns.col(i).norm(); norm > 0.0) columns.col(i) /= norm;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(columns.transpose() * columns);
  const VectorXd& values = solver.eigenvalues();
  const double least = 1e-10 * values.tail(1)[0];
  Index first = 0;
  while (first < values.size() && values[first] < least) ++first;
  const Index rank = values.size() - first;
  return columns * solver.eigenvectors().rightCols(rank) *
         values.tail(rank).cwiseSqrt().cwiseInverse().asDiagonal();
}

/// Rest that a basis leaves; twice, since the basis is orthonormal to a few digits only.
MatrixXd rest(const MatrixXd& basis, MatrixXd x) {
  if (basis.cols() == 0) return x;
  for (int i = 0; i < 2; ++i) x -= basis * (basis.transpose() * x);
  return x;
}

double rest_of(const MatrixXd& columns, const VectorXd& x) {
  if (columns.cols() == 0 || columns.squaredNorm() == 0.0) return x.squaredNorm();
  return rest(basis_of(columns), x).squaredNorm();
}

/// In place, of a length that is a power of two.
void transform(std::vector<std::complex<double>>& x) {
  const std::size_t n = x.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1U;
    for (; (j & bit) != 0; bit >>= 1U) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(x[i], x[j]);
  }
  for (std::size_t length = 2; length <= n; length <<= 1U) {
    const std::complex<double> turn = std::polar(1.0, -2.0 * kPi / static_cast<double>(length));
    for (std::size_t i = 0; i < n; i += length) {
      std::complex<double> w = 1.0;
      for (std::size_t k = 0; k < length / 2; ++k, w *= turn) {
        const std::complex<double> a = x[i + k], b = w * x[i + k + length / 2];
        x[i + k] = a + b;
        x[i + k + length / 2] = a - b;
      }
    }
  }
}

/// Noise as variances of a mean over kBin at a frequency [Hz].
struct Noise {
  double sensor, corner, motor, band, moving;  ///< moving: of the positions at 1 rad/s
  double rate;

  double at(double hertz) const {
    const double own = sensor * colour(corner, hertz) + motor * colour(band, hertz);
    return own + moving * std::pow(2.0 * kPi * hertz, 4) / (kBin * rate);
  }

 private:
  /// One-sided density of a first-order process of variance 1, over that of white noise that has
  /// variance 1 in a mean over kBin; corner 0: white noise from row to row.
  double colour(double corner_hz, double hertz) const {
    if (corner_hz == 0.0) return 1.0 / (kBin * rate);
    const double white = 2.0 / rate;  // no process is whiter than its rows
    const double density = 2.0 / (kPi * corner_hz) / (1.0 + std::pow(hertz / corner_hz, 2));
    return std::max(density, hertz < corner_hz ? white : 0.0) / (2.0 * kBin);
  }
};

/// Σ over frequencies of |e|² over its noise.
double over_noise(const VectorXd& e, const Noise& noise) {
  std::size_t length = 1;
  while (length < static_cast<std::size_t>(e.size())) length <<= 1U;
  std::vector<std::complex<double>> x(length);
  for (Index i = 0; i < e.size(); ++i) x[static_cast<std::size_t>(i)] = e[i];
  transform(x);
  double out = 0.0;
  const double highest = std::min(kHighest, 0.5 * noise.rate);
  for (std::size_t k = 0; k <= length / 2; ++k) {
    const double hertz = static_cast<double>(k) / (static_cast<double>(length) * kBin);
    if (hertz > highest) break;
    out += (k == 0 || k == length / 2 ? 1.0 : 2.0) * std::norm(x[k]) / noise.at(hertz);
  }
  return out / static_cast<double>(length);
}

VectorXd stacked(const MatrixXd& torque, const VectorXd& sigma) {
  const MatrixXd white = torque * sigma.cwiseInverse().asDiagonal();
  return white.reshaped();
}

struct Motion50 {
  MatrixXd q, qd, qdd, needed, dry, tau;
};

MatrixXd base_columns(const Arm& arm, const Motion50& x, const VectorXd& sigma) {
  const Index n = arm.size(), rows = x.q.rows();
  MatrixXd out(rows * n, 10 * n);
  for (Index k = 0; k < rows; ++k) {
    const MatrixXd Y = regressor(arm, x.q.row(k), x.qd.row(k), x.qdd.row(k));
    for (Index j = 0; j < n; ++j) out.row(j * rows + k) = Y.row(j) / sigma[j];
  }
  for (Index j = 0; j < n; ++j) {
    const Joint& joint = arm.joints[static_cast<std::size_t>(j)];
    const auto add = [&](const VectorXd& column) {
      out.conservativeResize(Eigen::NoChange, out.cols() + 1);
      out.rightCols(1).setZero();
      out.rightCols(1).middleRows(j * rows, rows) = column / sigma[j];
    };
    if (joint.rotor > 0.0) add(x.qdd.col(j));
    if (joint.viscous > 0.0) add(x.qd.col(j));
    if (joint.coulomb > 0.0) add(x.dry.col(j));
  }
  return out;
}

/// Torque of a simple effect at its joint; the sign turns within a hundredth of the usual speed.
VectorXd simple(const std::string& effect, Index j, const Motion50& x) {
  const Eigen::ArrayXd v = x.qd.col(j), tau = x.needed.col(j);
  const double width = 0.01 * std::sqrt(v.square().mean()) + 1e-9;
  const Eigen::ArrayXd sign = v / (v.square() + width * width).sqrt();
  if (effect == "coulomb_friction") return sign;
  if (effect == "viscous_friction") return v;
  if (effect == "quadratic_friction") return v * v.abs();
  if (effect == "sublinear_friction") return sign * v.abs().sqrt();
  if (effect == "torque_offset") return VectorXd::Ones(v.size());
  if (effect == "joint_spring") return x.q.col(j);
  if (effect == "armature") return x.qdd.col(j);
  if (effect == "torque_gain") return tau;
  if (effect == "load_friction") return tau.abs() * sign;
  VectorXd rate = VectorXd::Zero(v.size());  // torque's rate: a lag's, a delay's
  for (Index k = 1; k + 1 < rate.size(); ++k) rate[k] = (tau[k + 1] - tau[k - 1]) / 0.04;
  return rate;
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
                                                    {"viscous_friction", "torque_offset"},
                                                    {"sublinear_friction", "viscous_friction"},
                                                    {"viscous_friction", "quadratic_friction"}};

std::vector<Noise> noises(const Case& c, const Recording& recording) {
  const Index n = c.rig.arm.size();
  const Sensors& s = c.sensors;
  const VectorXd torque = root_mean_square(at_50_hz(recording, &Track::mean_tau));
  const MatrixXd q = at_50_hz(recording, &Track::mean_q);
  VectorXd alias = VectorXd::Zero(n);
  for (const Track& t : recording.tracks)
    alias += t.alias / static_cast<double>(recording.tracks.size());
  const VectorXd variance = s.position_noise.cwiseAbs2() + s.position_step.cwiseAbs2() / 12.0;
  Rigid rigid(c.rig.arm);
  rigid.evaluate(q.colwise().mean(), VectorXd::Zero(n));
  const VectorXd moving = rigid.inertia().cwiseAbs2() * variance;
  std::vector<Noise> out;
  for (Index j = 0; j < n; ++j) {
    const bool passive = c.rig.arm.joints[static_cast<std::size_t>(j)].passive;
    const double sensor = s.torque_noise * torque[j];
    // Where no torque is measured there is that of what the links are not.
    const double floor = passive ? 2e-3 * c.usual.torque[j] : 1e-6 * torque[j];
    Noise noise{sensor * sensor,        s.corner,  std::pow(c.rig.motor_noise[j], 2),
                c.rig.motor_noise_band, moving[j], c.rate};
    noise.sensor += floor * floor;
    if (s.corner == 0.0) noise.sensor += alias[j];
    out.push_back(noise);
  }
  return out;
}

}  // namespace

VectorXd torque_noise(const Case& c, const Recording& recording) {
  const std::vector<Noise> all = noises(c, recording);
  VectorXd out(static_cast<Index>(all.size()));
  for (Index j = 0; j < out.size(); ++j) {
    const Noise& noise = all[static_cast<std::size_t>(j)];
    out[j] = std::sqrt(noise.sensor + noise.motor);
  }
  return out;
}

std::vector<Evidence> evidence(const Case& c, const Recording& recording) {
  const Index n = c.rig.arm.size();
  const Motion50 x{at_50_hz(recording, &Track::mean_q),   at_50_hz(recording, &Track::mean_qd),
                   at_50_hz(recording, &Track::mean_qdd), at_50_hz(recording, &Track::needed),
                   at_50_hz(recording, &Track::dry),      at_50_hz(recording, &Track::mean_tau)};
  const MatrixXd hidden = at_50_hz(recording, &Track::hidden);
  const VectorXd share = effect_share(c, recording);
  const std::vector<Noise> noise = noises(c, recording);
  VectorXd sigma(n);  // deviation of means over 20 ms, by the density at low frequency
  for (Index j = 0; j < n; ++j) {
    const Noise& mine = noise[static_cast<std::size_t>(j)];
    const double low = mine.at(0.0) * kBin / 0.02;
    sigma[j] = std::sqrt(std::min(low, mine.sensor + mine.motor));
  }
  const MatrixXd base =
      c.base == "fixed" ? MatrixXd(hidden.size(), 0) : basis_of(base_columns(c.rig.arm, x, sigma));

  const std::size_t count = c.effects.size();
  std::vector<Evidence> out(count);
  MatrixXd each(hidden.size(), static_cast<Index>(count));
  for (std::size_t i = 0; i < count; ++i) {
    MatrixXd own = MatrixXd::Zero(hidden.rows(), n);
    for (const int j : c.effects[i].joints) {
      own.col(j) = hidden.col(j);
      out[i].size = std::max(out[i].size, share[j]);
    }
    each.col(static_cast<Index>(i)) = stacked(own, sigma);
    out[i].raw_lm = each.col(static_cast<Index>(i)).squaredNorm();
  }
  const MatrixXd visible = rest(base, each);
  for (std::size_t i = 0; i < count; ++i) {
    Evidence& e = out[i];
    const VectorXd own = visible.col(static_cast<Index>(i));
    MatrixXd others(own.size(), static_cast<Index>(count) - 1);
    for (Index k = 0, to = 0; k < static_cast<Index>(count); ++k)
      if (k != static_cast<Index>(i)) others.col(to++) = visible.col(k);
    e.expected_lm = rest_of(others, own);
    e.visible_share = e.raw_lm > 1e-9 ? std::sqrt(e.expected_lm / e.raw_lm) : 0.0;
    const std::vector<int>& joints = c.effects[i].joints;
    for (const int j : joints)
      for (const Track& track : recording.tracks)
        e.reachable_lm += e.visible_share * e.visible_share *
                          over_noise(track.hidden.col(j), noise[static_cast<std::size_t>(j)]);
    if (joints.size() > 2 || (n <= 2 && joints.size() > 1)) continue;  // no joint's own effect
    for (const std::vector<std::string>& names : kRivals) {
      MatrixXd with = others;
      for (const std::string& name : names)
        for (const int j : joints) {
          MatrixXd torque = MatrixXd::Zero(hidden.rows(), n);
          torque.col(j) = simple(name, j, x);
          with.conservativeResize(Eigen::NoChange, with.cols() + 1);
          with.rightCols(1) = rest(base, stacked(torque, sigma));
        }
      e.rivals.push_back({names, rest_of(with, own)});
    }
  }
  return out;
}

}  // namespace rigs
