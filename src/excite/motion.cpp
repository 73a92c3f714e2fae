#include "excite/motion.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <diffnea/core/error.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "excite/loop_rows.hpp"
#include "model/falling.hpp"

namespace diffnea {
namespace {

constexpr double kFineStep = 1e-3;        ///< of torques [s]
constexpr long kMostSteps = 20000;        ///< in a period
constexpr double kLeastAmplitude = 0.05;  ///< of what the other limits allow

/// Largest |x(t)| between equal samples: that of the nearest two, and twice the error of a straight
/// line, h²/8 |ẍ|, with ẍ from second differences.
double largest_between(const Eigen::Ref<const VecX<double>>& x) {
  const long n = x.size();
  const auto bend = [&](long i) {
    return i > 0 && i + 1 < n ? std::abs(x[i - 1] - 2.0 * x[i] + x[i + 1]) : 0.0;
  };
  double out = 0.0;
  for (long i = 0; i + 1 < n; ++i)
    out = std::max(out, std::max(std::abs(x[i]), std::abs(x[i + 1])) +
                            2.0 / 8.0 * std::max(bend(i), bend(i + 1)));
  return out;
}

}  // namespace

HarmonicTable::HarmonicTable(int harmonics, long count)
    : sin_(count, harmonics),
      cos_(count, harmonics),
      overshoot_(1.0 / std::cos(std::numbers::pi * harmonics / static_cast<double>(count))) {
  for (long i = 0; i < count; ++i)
    for (int k = 0; k < harmonics; ++k) {
      const double angle =
          2.0 * std::numbers::pi * (k + 1) * static_cast<double>(i) / static_cast<double>(count);
      sin_(i, k) = std::sin(angle);
      cos_(i, k) = std::cos(angle);
    }
}

MotionRows HarmonicTable::sample(const FourierMotion& motion) const {
  const long h = sin_.cols();
  const VecX<double> w = 2.0 * std::numbers::pi / motion.period *
                         VecX<double>::LinSpaced(h, 1.0, static_cast<double>(h));
  const VecX<double> w2 = w.cwiseAbs2();
  MotionRows out;
  out.q = sin_ * motion.a.transpose() + cos_ * motion.b.transpose();
  out.q.rowwise() += motion.centre.transpose();
  out.qd = cos_ * (motion.a * w.asDiagonal()).transpose() -
           sin_ * (motion.b * w.asDiagonal()).transpose();
  out.qdd = -sin_ * (motion.a * w2.asDiagonal()).transpose() -
            cos_ * (motion.b * w2.asDiagonal()).transpose();
  return out;
}

RestBasis::RestBasis(int harmonics) {
  const VecX<double> k = VecX<double>::LinSpaced(harmonics, 1.0, harmonics);
  const auto complement = [&](const VecX<double>& normal) -> MatX<double> {
    const Eigen::HouseholderQR<MatX<double>> qr(normal);
    return MatX<double>(qr.householderQ()).rightCols(harmonics - 1);
  };
  a = complement(k);
  b = complement(k.cwiseAbs2());
}

void draw_series(const RestBasis& basis, Rng& rng, Eigen::Ref<VecX<double>> a,
                 Eigen::Ref<VecX<double>> b) {
  for (long k = 0; k < a.size(); ++k) {
    a[k] = rng.normal() / static_cast<double>(k + 1);
    b[k] = rng.normal() / static_cast<double>(k + 1);
  }
  a = basis.a * (basis.a.transpose() * a).eval();
  b = basis.b * (basis.b.transpose() * b).eval();
}

void fill_ranges(const std::vector<JointRange>& ranges, const HarmonicTable& table,
                 const VecX<double>& share, const VecX<double>& place, FourierMotion& motion) {
  const long n = static_cast<long>(ranges.size());
  motion.centre = VecX<double>::Zero(n);
  const MotionRows rows = table.sample(motion);
  for (long j = 0; j < n; ++j) {
    const JointRange& r = ranges[static_cast<std::size_t>(j)];
    motion.centre[j] = r.middle;
    const double high = rows.q.col(j).maxCoeff(), low = rows.q.col(j).minCoeff();
    const double middle = 0.5 * (high + low), half = 0.5 * (high - low) * table.overshoot();
    if (!r.moves() || !(half > 0.0)) {
      motion.a.row(j).setZero();
      motion.b.row(j).setZero();
      continue;
    }
    const double gain =
        share[j] *
        std::min({r.half / half,
                  r.velocity / (rows.qd.col(j).cwiseAbs().maxCoeff() * table.overshoot()),
                  r.acceleration / (rows.qdd.col(j).cwiseAbs().maxCoeff() * table.overshoot())});
    motion.a.row(j) *= gain;
    motion.b.row(j) *= gain;
    motion.centre[j] += place[j] * (r.half - gain * half) - gain * middle;
  }
}

EffortBound::EffortBound(const Model& model, const LoopRows* loops)
    : model_(extend(falling(model))), loops_(loops) {
  for (const BoundEffect& e : model_.effects)
    if (loops_ && e.info().has(Trait::kReadsAcceleration))
      throw ModelError("excite: " + e.info().name + " at '" + e.where +
                       "' follows the torque that a joint transmits, which is not known in a loop; "
                       "leave it out of the model");
}

/// Torques along a motion of all joints; of loops those that the drives give.
RowMatX<double> EffortBound::drive_torques(JointSeries& x) const {
  predict(model_, x);
  RowMatX<double> out = x.drive();
  for (long k = 0; loops_ && k < out.rows(); ++k)
    out.row(k) =
        loops_->loop().at_drives(x.q.row(k).transpose(), out.row(k).transpose()).transpose();
  return out;
}

VecX<double> EffortBound::largest(const FourierMotion& motion, long count) const {
  if (count == 0)
    count = std::clamp(std::lround(std::ceil(motion.period / kFineStep)), 100L * motion.harmonics(),
                       std::max(kMostSteps, 100L * motion.harmonics()));
  MotionRows once = HarmonicTable(motion.harmonics(), count).sample(motion);
  if (loops_ && loops_->complete(once, motion.centre) < 1.0)
    return VecX<double>::Constant(once.q.cols(), kInfinity);
  JointSeries x;
  x.dt = motion.period / static_cast<double>(count);
  // What has a memory begins at rest and settles in the first period.
  const long periods = model_.series.empty() ? 1 : 2;
  x.q = once.q.replicate(periods, 1);
  x.qd = once.qd.replicate(periods, 1);
  x.qdd = once.qdd.replicate(periods, 1);
  const RowMatX<double> torque = drive_torques(x);
  VecX<double> out(torque.cols());
  VecX<double> closed(torque.rows() + 2);  // the last step leads to the first row again
  for (long j = 0; j < out.size(); ++j) {
    closed << torque.col(j), torque.col(j).tail(count).head(2);
    out[j] = largest_between(closed);
  }
  return out;
}

VecX<double> EffortBound::holding(const VecX<double>& q) const {
  JointSeries x;
  x.dt = 1.0;
  const VecX<double> posture = loops_ ? loops_->posture_at(q) : q;
  if (posture.size() == 0) return VecX<double>::Constant(q.size(), kInfinity);
  x.q = posture.transpose().replicate(5, 1);
  x.qd = x.qdd = RowMatX<double>::Zero(5, q.size());
  return drive_torques(x).row(4).transpose();
}

double fit_effort(const std::vector<JointRange>& ranges, const EffortBound& bound,
                  FourierMotion& motion, long count) {
  const auto excess = [&](double gain) {
    FourierMotion scaled = motion;
    scaled.a *= gain;
    scaled.b *= gain;
    const VecX<double> torque = bound.largest(scaled, count);
    double worst = 0.0;
    for (long j = 0; j < torque.size(); ++j)
      worst = std::max(worst, std::isinf(torque[j])
                                  ? kInfinity
                                  : torque[j] / ranges[static_cast<std::size_t>(j)].effort);
    return worst;
  };
  double gain = 1.0, now = excess(1.0);
  if (now > 1.0) {
    double low = kLeastAmplitude, high = 1.0;
    if (excess(low) > 1.0) return 0.0;
    while (high - low > 1e-3) {  // of the amplitude
      const double middle = 0.5 * (low + high);
      (excess(middle) > 1.0 ? high : low) = middle;
    }
    gain = low;
  }
  motion.a *= gain;
  motion.b *= gain;
  return gain;
}

Trajectory to_trajectory(const Model& model, const std::vector<JointRange>& ranges,
                         const FourierMotion& motion, double duration, double rate,
                         const LoopRows* loops) {
  const long periods = static_cast<long>(std::ceil(duration / motion.period - 1e-9));
  const long per_period = std::lround(motion.period * rate), rows = periods * per_period + 1;
  MotionRows once = HarmonicTable(motion.harmonics(), per_period).sample(motion);
  if (loops && loops->complete(once, motion.centre) == 0.0)
    throw ModelError("excite: the loops of '" + model.name + "' do not close along the motion");
  const std::vector<std::string> names = joint_names(model);
  Trajectory out;
  std::vector<int> driven;
  for (std::size_t j = 0; j < ranges.size(); ++j)
    if (ranges[j].driven) {
      driven.push_back(static_cast<int>(j));
      out.joint_names.push_back(names[j]);
    }
  out.time = VecX<double>::LinSpaced(rows, 0.0, motion.period * static_cast<double>(periods));
  for (const auto& [from, to] :
       {std::pair{&once.q, &out.q}, {&once.qd, &out.qd}, {&once.qdd, &out.qdd}}) {
    to->resize(rows, static_cast<long>(driven.size()));
    for (long i = 0; i < rows; ++i) to->row(i) = (*from)(i % per_period, driven);
  }
  return out;
}

}  // namespace diffnea
