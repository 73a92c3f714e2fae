#include "plant.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "controller.hpp"

namespace rigs {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Time step [s]; periods of control, log and means are multiples of it.
constexpr double kStep = 2.5e-4;
constexpr double kRunIn = 1.0;  ///< before a recording [s]
/// Way from the desired position that no controller of these machines leaves [rad, m].
constexpr double kLost = 1.0;
/// Closed loop of a fresh gap: share of its penetration that a step takes back.
constexpr double kCorrection = 0.2;

/// λ ∈ [low, high] along `row`, until the velocity along it is `target`.
struct Bound {
  int a = 0, b = -1;  ///< degrees of freedom; b: none
  double gear = 0.0;  ///< ratio of b
  double low = 0.0, high = 0.0, target = 0.0, lambda = 0.0;
  int dry_joint = -1;  ///< whose dry friction it is
  double along(const VectorXd& v) const { return v[a] + (b < 0 ? 0.0 : gear * v[b]); }
};

/// Projected Gauss–Seidel on v = free + h M⁻¹ Jᵀλ.
void solve(std::vector<Bound>& bounds, const MatrixXd& inverse, double h, VectorXd& v) {
  const auto pull = [&](const Bound& c, double by) {
    v += h * by * inverse.col(c.a);
    if (c.b >= 0) v += h * by * c.gear * inverse.col(c.b);
  };
  for (const Bound& c : bounds)
    if (c.lambda != 0.0) pull(c, c.lambda);
  for (int pass = 0; pass < 60; ++pass) {
    double worst = 0.0;
    for (Bound& c : bounds) {
      double own = inverse(c.a, c.a);
      if (c.b >= 0) own += 2.0 * c.gear * inverse(c.a, c.b) + c.gear * c.gear * inverse(c.b, c.b);
      const double wanted = c.lambda - (c.along(v) - c.target) / (h * own);
      const double next = std::clamp(wanted, c.low, c.high);
      const double by = next - c.lambda;
      c.lambda = next;
      if (by != 0.0) pull(c, by);
      worst = std::max(worst, std::abs(by) * h * own);
    }
    if (worst < 1e-10) break;  // [rad/s]
  }
}

/// Series with a step every kStep, read a time ago, between its values.
class Past {
 public:
  Past(double longest, Index n)
      : size_(static_cast<Index>(longest / kStep) + 3), values_(n, size_) {}
  void push(const VectorXd& x) {
    if (count_ == 0) values_.colwise() = x;
    values_.col(count_++ % size_) = x;
  }
  double ago(Index j, double time) const {
    const double steps = time / kStep;
    const auto whole = static_cast<Index>(steps);
    const double part = steps - static_cast<double>(whole);
    return (1.0 - part) * at(j, whole) + part * at(j, whole + 1);
  }

 private:
  double at(Index j, Index back) const {
    return values_(j, (count_ - 1 - std::min(back, count_ - 1)) % size_);
  }
  Index size_, count_ = 0;
  MatrixXd values_;
};

double sign(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0; }

Arm changed(const Rig& rig) {
  Arm out = rig.arm;
  out.gravity += rig.physics.more_gravity;
  out.joints.back().pseudo += rig.physics.payload;
  return out;
}

/// Friction that needs no bound.
double smooth_friction(const Physics& p, Index j, double v, double time) {
  const double viscous = v > 0.0 ? p.viscous_plus[j] : p.viscous_minus[j];
  const double warm = p.warm[j] * std::exp(-time / p.warm_time[j]);
  return (viscous + warm) * v;
}

}  // namespace

Physics::Physics(int n) {
  for (VectorXd* x :
       {&coulomb_plus,   &coulomb_minus, &sublinear,    &load,  &stribeck, &viscous_plus,
        &viscous_minus,  &quadratic,     &warm,         &rotor, &spring,   &rest,
        &ripple_sine,    &ripple_cosine, &offset,       &gain,  &delay,    &lag,
        &encoder_offset, &wobble,        &wobble_phase, &late})
    x->setZero(n);
  for (VectorXd* x : {&load_braking, &stribeck_speed, &warm_time, &ripple_cycles, &encoder_scale})
    x->setOnes(n);
  limit.setConstant(n, std::numeric_limits<double>::infinity());
}

bool Physics::false_positions() const {
  return !encoder_offset.isZero() || !encoder_scale.isOnes() || !wobble.isZero() || !late.isZero();
}

Track simulate(const Rig& rig, const Motion& motion, int run, double begin, double seconds,
               const Sampling& sampling, Draw draw) {
  const Physics& p = rig.physics;
  const Transmission& gear = p.transmission;
  const Index n = rig.arm.size();
  const Index extra = gear.joint >= 0 ? 1 : 0, all = n + extra;
  const auto motor = [&](Index j) { return j == gear.joint ? n : j; };
  const auto joint = [&](Index j) -> const Joint& {
    return rig.arm.joints[static_cast<std::size_t>(j)];
  };

  Rigid links(changed(rig)), innocent(rig.arm);
  const bool apart = p.other_bodies() || p.false_positions() || extra > 0;
  const auto ticks = std::lround(1.0 / (rig.control.rate * kStep));
  const auto bin_steps = std::lround(kBin / kStep);
  const Index before = std::lround(kRunIn / kStep);
  const Index bins = std::lround(seconds / kBin);
  const Index steps =
      before + bins * bin_steps + 2 * ticks + std::lround(sampling.period / kStep) + 2;
  const auto rows = static_cast<Index>(sampling.times.size());

  Track out;
  for (MatrixXd* x : {&out.q, &out.qd, &out.tau, &out.qcmd}) x->setZero(rows, n);
  for (MatrixXd* x : {&out.mean_q, &out.mean_qd, &out.mean_qdd, &out.needed, &out.hidden, &out.dry,
                      &out.mean_tau})
    x->setZero(bins, n);

  Desired wanted = motion.at(begin - kRunIn);
  VectorXd q(all), half(all), a = VectorXd::Zero(all);
  q.head(n) = wanted.q;
  half.head(n) = wanted.qd;
  if (extra > 0) q[n] = q[gear.joint], half[n] = half[gear.joint];
  Controller controller(rig, motion.at(begin + 0.5 * seconds).q);

  const double colour = std::exp(-2.0 * std::numbers::pi * rig.motor_noise_band * kStep);
  VectorXd noise(n), command = VectorXd::Zero(n), held = command, lagged = command;
  for (Index j = 0; j < n; ++j) noise[j] = draw.normal();
  Past commands(p.delay.maxCoeff(), n), logged(p.torque_late, n);
  Past past_q(p.late.maxCoeff(), n), past_v(p.late.maxCoeff(), n), past_a(p.late.maxCoeff(), n);
  MatrixXd torque_log(steps, n);
  VectorXd bristle = VectorXd::Zero(n), transmitted = VectorXd::Zero(n);
  double z = 0.0;  // bend of the presliding bristles [rad]
  std::vector<double> previous(static_cast<std::size_t>(2 * n + 8), 0.0);
  std::vector<Bound> bounds;
  VectorXd applied(n), needed(n), mass_bias(n), reported(n), reported_v(n), reported_a(n);
  Index next_row = 0;

  for (Index k = 0; k < steps; ++k) {
    const double time = static_cast<double>(k - before) * kStep;  // since the recording began
    if (k % ticks == 0) {
      wanted = motion.at(begin + time);
      VectorXd seen = q.head(n);
      if (extra > 0) seen[gear.joint] = q[n];
      seen = seen.cwiseProduct(p.encoder_scale) + p.encoder_offset;
      command = controller.torque(seen, wanted);
      if (k == 0) held = lagged = command;
      if ((q.head(n) - wanted.q).cwiseAbs().maxCoeff() > kLost && !joint(n - 1).passive)
        throw std::runtime_error("the machine does not follow its motion");
      if (!q.allFinite()) throw std::runtime_error("the machine's motion is not finite");
    }
    // Velocities of the instant, from those of the half step.
    const VectorXd v = half + 0.5 * kStep * a;
    const VectorXd link_q = q.head(n), link_v = v.head(n);
    links.evaluate(link_q, link_v);

    // The drive: a kick at this instant stands for half a step before and half a step after.
    const VectorXd kick_command = 0.5 * (held + command);
    held = command;
    commands.push(kick_command);
    logged.push(kick_command);
    for (Index j = 0; j < n; ++j) {
      noise[j] = colour * noise[j] + std::sqrt(1.0 - colour * colour) * draw.normal();
      double u = p.delay[j] > 0.0 ? commands.ago(j, p.delay[j]) : kick_command[j];
      u = std::clamp(u, -p.limit[j], p.limit[j]);
      if (p.lag[j] > 0.0) {
        const double kick = lagged[j];
        lagged[j] += (1.0 - std::exp(-kStep / p.lag[j])) * (u - lagged[j]);
        u = 0.5 * (kick + lagged[j]);
      }
      if (!joint(j).passive) u = u / (1.0 + p.gain[j]) + rig.motor_noise[j] * noise[j];
      const double offset =
          p.offset[j] + (p.session.empty() ? 0.0 : p.session[static_cast<std::size_t>(run)][j]);
      applied[j] = u - offset;
    }

    // Forces, by degree of freedom.
    VectorXd f = VectorXd::Zero(all);
    MatrixXd mass = MatrixXd::Zero(all, all);
    mass.topLeftCorner(n, n) = links.inertia();
    f.head(n) = -links.bias();
    if (!p.tip_force.isZero()) f.head(n) += links.pulled(p.tip_force, rig.arm.tip);
    VectorXd declared = VectorXd::Zero(n);  // friction that the model knows
    bounds.clear();
    for (Index j = 0; j < n; ++j) {
      const Index m = motor(j);
      mass(m, m) += joint(j).rotor + p.rotor[j];
      f[m] += applied[j] - smooth_friction(p, j, v[m], time) - joint(j).viscous * v[m] -
              p.ripple_sine[j] * std::sin(p.ripple_cycles[j] * q[m]) -
              p.ripple_cosine[j] * std::cos(p.ripple_cycles[j] * q[m]);
      declared[j] = joint(j).viscous * v[m];
      f[j] -= p.spring[j] * (q[j] - p.rest[j]) + p.quadratic[j] * v[j] * std::abs(v[j]);
      const double hill = p.stribeck[j] * std::exp(-std::pow(v[m] / p.stribeck_speed[j], 2));
      const double load = p.load[j] * std::abs(transmitted[j]) *
                          (transmitted[j] * v[m] < 0.0 ? p.load_braking[j] : 1.0);
      const double both =
          joint(j).coulomb + hill + load + p.sublinear[j] * std::sqrt(std::abs(v[m]));
      const double plus = both + p.coulomb_plus[j], minus = both + p.coulomb_minus[j];
      if (plus == 0.0 && minus == 0.0) continue;
      if (p.bristle_width > 0.0) {
        const double size = bristle[j] > 0.0 ? plus : minus, w = p.bristle_width;
        const double bend = (v[m] - std::abs(v[m]) * bristle[j]) / w;
        const double damp = std::sqrt(size * w * mass(m, m));
        const double force = size * bristle[j] + damp * bend;
        f[m] -= force;
        declared[j] += size > 0.0 ? joint(j).coulomb / size * force : 0.0;
        continue;
      }
      Bound c;
      c.a = static_cast<int>(m);
      c.low = -plus, c.high = minus;
      c.dry_joint = static_cast<int>(j);
      bounds.push_back(c);
    }
    if (p.bristles.joint >= 0) {
      const Bristles& b = p.bristles;
      const Index m = motor(b.joint);
      const double g =
          b.coulomb + (b.stiction - b.coulomb) * std::exp(-std::pow(v[m] / b.speed, 2));
      const double bend = v[m] - b.stiffness * std::abs(v[m]) * z / g;
      f[m] -= b.stiffness * z + b.damping * bend;
    }
    for (const Shaft& s : p.shafts) {
      const double w = v[s.first] + s.ratio * v[s.second];
      f[s.first] -= s.viscous * w;
      f[s.second] -= s.ratio * s.viscous * w;
      mass(s.first, s.first) += s.inertia;
      mass(s.second, s.second) += s.ratio * s.ratio * s.inertia;
      mass(s.first, s.second) += s.ratio * s.inertia;
      mass(s.second, s.first) += s.ratio * s.inertia;
      Bound c;
      c.a = s.first, c.b = s.second, c.gear = s.ratio;
      c.low = -s.coulomb, c.high = s.coulomb;
      if (s.coulomb > 0.0) bounds.push_back(c);
    }
    if (p.outside) f[p.outside_joint] -= p.outside(time, link_q, link_v);
    if (extra > 0) {
      const Index j = gear.joint;
      const double twist = q[n] - q[j], slip = v[n] - v[j];
      if (!gear.gap) {
        const double torque = gear.stiffness * twist + gear.damping * slip;
        f[n] -= torque;
        f[j] += torque;
      } else {
        // A flank that the next half step would reach pushes, and throws back what arrived.
        for (const double side : {1.0, -1.0}) {
          const double room = 0.5 * gear.width - side * twist;
          const double closing = side * (half[n] - half[j]);
          Bound c;
          c.a = static_cast<int>(n), c.b = static_cast<int>(j), c.gear = -1.0;
          // The velocity along the row is side · closing; it may not exceed the room that is left.
          if (room > std::max(closing, 0.0) * kStep + 1e-3 * gear.width) continue;
          const double most = room > 0.0 ? room / kStep : kCorrection * room / kStep;
          const double back = closing > 0.02 ? -gear.restitution * closing : most;
          c.target = side * std::min(most, back);
          c.low = side > 0.0 ? -1e9 : 0.0;
          c.high = side > 0.0 ? 0.0 : 1e9;
          bounds.push_back(c);
        }
      }
    }

    const Eigen::LLT<MatrixXd> factor(mass);
    const MatrixXd inverse = factor.solve(MatrixXd::Identity(all, all));
    VectorXd next = half + kStep * (inverse * f);
    for (Bound& c : bounds)
      if (c.dry_joint >= 0)
        c.lambda = std::clamp(previous[static_cast<std::size_t>(c.dry_joint)], c.low, c.high);
    solve(bounds, inverse, kStep, next);
    for (const Bound& c : bounds) {
      if (c.dry_joint < 0) continue;
      const Index j = c.dry_joint;
      previous[static_cast<std::size_t>(j)] = c.lambda;
      const double size = c.lambda < 0.0 ? -c.low : c.high;
      if (size > 0.0) declared[j] -= c.lambda * joint(j).coulomb / size;
    }
    a = (next - half) / kStep;
    const VectorXd now = half + 0.5 * kStep * a;  // v without the extrapolation

    // Motion as the encoders report it.
    transmitted = links.inertia() * a.head(n) + links.bias();
    reported = link_q, reported_v = now.head(n), reported_a = a.head(n);
    if (extra > 0 && rig.motor_encoder) {
      reported[gear.joint] = q[n], reported_v[gear.joint] = now[n], reported_a[gear.joint] = a[n];
    }
    for (Index j = 0; j < n; ++j) {
      if (p.wobble[j] != 0.0) {
        const double x = reported[j] + p.wobble_phase[j], s = std::sin(x), c = std::cos(x);
        reported_a[j] += p.wobble[j] * (c * reported_a[j] - s * reported_v[j] * reported_v[j]);
        reported_v[j] += p.wobble[j] * c * reported_v[j];
        reported[j] += p.wobble[j] * s;
      }
      reported[j] = p.encoder_scale[j] * reported[j] + p.encoder_offset[j];
      reported_v[j] *= p.encoder_scale[j];
      reported_a[j] *= p.encoder_scale[j];
    }
    if (!p.late.isZero()) {
      past_q.push(reported), past_v.push(reported_v), past_a.push(reported_a);
      for (Index j = 0; j < n; ++j) {
        reported[j] = past_q.ago(j, p.late[j]);
        reported_v[j] = past_v.ago(j, p.late[j]);
        reported_a[j] = past_a.ago(j, p.late[j]);
      }
    }
    const Index bin = (k - before) / bin_steps;
    if (k >= before && bin < bins) {
      if (apart)
        needed = innocent.torque(reported, reported_v, reported_a);
      else
        needed = transmitted;
      for (Index j = 0; j < n; ++j) {
        const double said = p.torque_late > 0.0 ? logged.ago(j, p.torque_late) : kick_command[j];
        needed[j] += joint(j).rotor * reported_a[j] + declared[j];
        const double acted = joint(j).passive ? 0.0 : said + rig.motor_noise[j] * noise[j];
        out.hidden(bin, j) += acted - needed[j];
        out.mean_tau(bin, j) += said;
        out.dry(bin, j) += sign(now[motor(j)]);
      }
      out.needed.row(bin) += needed;
      out.mean_q.row(bin) += reported;
      out.mean_qd.row(bin) += reported_v;
      out.mean_qdd.row(bin) += reported_a;
    }
    torque_log.row(k) = command;
    for (;
         next_row < rows && sampling.times[static_cast<std::size_t>(next_row)] < time + 0.5 * kStep;
         ++next_row) {
      const double by = sampling.times[static_cast<std::size_t>(next_row)] - time;
      out.q.row(next_row) = reported + by * reported_v + 0.5 * by * by * reported_a;
      out.qd.row(next_row) = reported_v + by * reported_a;
      out.qcmd.row(next_row) = wanted.q;
    }

    // The bristles of the way from here to the next instant.
    const VectorXd way = kStep * next;
    if (p.bristle_width > 0.0)
      for (Index j = 0; j < n; ++j) {
        const double s = sign(way[motor(j)]);
        bristle[j] = s + (bristle[j] - s) * std::exp(-std::abs(way[motor(j)]) / p.bristle_width);
      }
    if (p.bristles.joint >= 0) {
      const Bristles& b = p.bristles;
      const double w = way[motor(b.joint)], s = sign(w);
      const double g =
          b.coulomb + (b.stiction - b.coulomb) * std::exp(-std::pow(w / kStep / b.speed, 2));
      z = s * g / b.stiffness +
          (z - s * g / b.stiffness) * std::exp(-std::abs(w) * b.stiffness / g);
    }
    q += way;
    half = next;
  }

  const auto count = static_cast<double>(bin_steps);
  for (MatrixXd* x : {&out.mean_q, &out.mean_qd, &out.mean_qdd, &out.needed, &out.hidden, &out.dry,
                      &out.mean_tau})
    *x /= count;

  // Torques of the rows, and what they miss of their interval's mean.
  MatrixXd total(steps + 1, n);
  total.row(0).setZero();
  for (Index k = 0; k < steps; ++k) total.row(k + 1) = total.row(k) + torque_log.row(k);
  const Index length = std::lround(sampling.period / kStep);
  out.alias.setZero(n);
  for (Index r = 0; r < rows; ++r) {
    const double shift = (sampling.middle ? 0.5 * sampling.period : 0.0) - p.torque_late;
    const double exact =
        (static_cast<double>(r) * sampling.period + shift) / kStep + static_cast<double>(before);
    const Index at = std::clamp<Index>(static_cast<Index>(std::floor(exact + 1e-6)), 1, steps - 1);
    out.tau.row(r) = sampling.centred
                         ? Eigen::RowVectorXd(0.5 * (torque_log.row(at) + torque_log.row(at - 1)))
                         : Eigen::RowVectorXd(torque_log.row(at));
    const Index from = std::clamp<Index>(sampling.centred || sampling.middle ? at - length / 2 : at,
                                         0, steps - length);
    const Eigen::RowVectorXd mean =
        (total.row(from + length) - total.row(from)) / static_cast<double>(length);
    out.alias += (out.tau.row(r) - mean).cwiseAbs2().transpose() / static_cast<double>(rows);
  }
  return out;
}

}  // namespace rigs
