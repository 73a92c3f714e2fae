#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/excite/fourier.hpp>

#include "core/constants.hpp"
#include "excite/loop_rows.hpp"
#include "model/falling.hpp"

namespace diffnea {
namespace {

/// q(t) = Σ a_k sin(kωt) + b_k (cos(kωt) − 1), with Σ k a_k = 0 (at rest) and Σ k² b_k = 0 (without
/// a jerk at the start and between periods).
struct Series {
  VecX<double> a, b;
};

Series random_series(int harmonics, Rng& rng) {
  Series s{VecX<double>(harmonics), VecX<double>(harmonics)};
  VecX<double> k(harmonics), k2(harmonics);
  for (int i = 0; i < harmonics; ++i) {
    k[i] = i + 1;
    k2[i] = k[i] * k[i];
    s.a[i] = rng.normal() / k[i];
    s.b[i] = rng.normal() / k[i];
  }
  s.a -= k * (k.dot(s.a) / k.squaredNorm());
  s.b -= k2 * (k2.dot(s.b) / k2.squaredNorm());
  return s;
}

void require(bool ok, const char* what) {
  if (!ok) throw Error(std::string("random_fourier: ") + what);
}

/// The motion scaled by `gain` about the middle posture, every `step`-th row.
MotionRows scaled_rows(const RowMatX<double>& q, const RowMatX<double>& qd,
                       const RowMatX<double>& qdd, const VecX<double>& middle, double gain,
                       long step) {
  const auto every = Eigen::seq(0, q.rows() - 1, step);
  MotionRows out;
  out.q =
      (gain * (q(every, Eigen::all).rowwise() - middle.transpose())).rowwise() + middle.transpose();
  out.qd = gain * qd(every, Eigen::all);
  out.qdd = gain * qdd(every, Eigen::all);
  return out;
}

/// Largest share of an effort limit that the motion needs; `gain` scales it about the middle
/// posture. Of a robot with loops that of its drives; infinite where the loops do not close.
double effort_share(const Tree<double>& tree, const LoopRows* loops,
                    const std::vector<JointRange>& ranges, const RowMatX<double>& q,
                    const RowMatX<double>& qd, const RowMatX<double>& qdd,
                    const VecX<double>& middle, double gain, long step) {
  RneaWorkspace<double, double> ws;
  double worst = 0.0;
  if (loops) {
    MotionRows rows = scaled_rows(q, qd, qdd, middle, gain, step);
    if (loops->complete(rows, middle) < 1.0) return kInfinity;
    for (long row = 0; row < rows.q.rows(); ++row) {
      const VecX<double> x = rows.q.row(row), v = rows.qd.row(row), a = rows.qdd.row(row);
      const VecX<double> tau = loops->loop().at_drives(
          x, rnea(tree, VecIn<double>(x), VecIn<double>(v), VecIn<double>(a), ws));
      for (int j = 0; j < tau.size(); ++j)
        worst = std::max(worst, std::abs(tau[j]) / ranges[static_cast<std::size_t>(j)].effort);
    }
    return worst;
  }
  for (long row = 0; row < q.rows(); row += step) {
    const VecX<double> x = middle + gain * (q.row(row).transpose() - middle);
    const VecX<double> v = gain * qd.row(row).transpose(), a = gain * qdd.row(row).transpose();
    const VecX<double>& tau = rnea(tree, VecIn<double>(x), VecIn<double>(v), VecIn<double>(a), ws);
    for (int j = 0; j < tau.size(); ++j)
      worst = std::max(worst, std::abs(tau[j]) / ranges[j].effort);
  }
  return worst;
}

}  // namespace

Trajectory random_fourier(const Model& model, const FourierOptions& o) {
  if (model.free_base) {
    require_no_constraints("excite of flights", model);
    return random_fourier(falling(model), o);
  }
  require(o.harmonics >= 3, "harmonics must be at least 3");
  require(o.period > 0 && o.duration > 0 && o.rate > 0,
          "period, duration and rate must be positive");
  require(o.rate * o.duration < 1e8, "more than 1e8 rows");
  require(o.rate * o.period > 4.0 * o.harmonics, "the rate is too low for the highest harmonic");

  const std::vector<int> moving = moving_links(model);
  const int n = static_cast<int>(moving.size());
  const Tree<double> tree = make_tree(model);
  const long periods = static_cast<long>(std::ceil(o.duration / o.period - 1e-9));
  const long per_period = std::lround(o.period * o.rate);
  const long rows = periods * per_period + 1;

  std::vector<JointRange> ranges;
  std::unique_ptr<LoopRows> loops;
  if (!model.constraints.empty()) {
    ranges = joint_ranges(model, o, {});
    loops = std::make_unique<LoopRows>(model, o, LimitOverrides{}, ranges);
  }
  VecX<double> middle = VecX<double>::Zero(n);
  std::vector<int> driven;
  bool may_move = false;
  RowMatX<double> q = RowMatX<double>::Zero(rows, n), qd = q, qdd = q;
  for (int j = 0; j < n; ++j) {
    const ModelLink& link = model.links[moving[j]];
    if (!loops) ranges.push_back(range_of(link, o));
    if (link.passive) {
      ranges[static_cast<std::size_t>(j)].effort = std::numeric_limits<double>::infinity();
      continue;
    }
    if (ranges[static_cast<std::size_t>(j)].follows) {
      driven.push_back(j);
      continue;
    }
    middle[j] = ranges[j].middle;
    driven.push_back(j);
    if (!(ranges[j].half > 0.0)) {
      q.col(j).setConstant(middle[j]);
      continue;
    }
    may_move = true;
    // A stream of its own: leaving out one joint does not change the others.
    Rng rng(o.seed * 1000003 + static_cast<std::uint64_t>(j));
    const Series s = random_series(o.harmonics, rng);
    const double w = 2.0 * std::numbers::pi / o.period;
    for (long row = 0; row < rows; ++row) {
      const double t =
          static_cast<double>(row % per_period) / static_cast<double>(per_period) * o.period;
      for (int i = 0; i < o.harmonics; ++i) {
        const double kw = w * (i + 1), sin = std::sin(kw * t), cos = std::cos(kw * t);
        q(row, j) += s.a[i] * sin + s.b[i] * (cos - 1.0);
        qd(row, j) += kw * (s.a[i] * cos - s.b[i] * sin);
        qdd(row, j) += -kw * kw * (s.a[i] * sin + s.b[i] * cos);
      }
    }
    // Centred in the range: the motion starts off its middle.
    const double centre = 0.5 * (q.col(j).maxCoeff() + q.col(j).minCoeff());
    q.col(j).array() -= centre;
    const double gain = std::min(ranges[j].half / q.col(j).cwiseAbs().maxCoeff(),
                                 ranges[j].velocity / qd.col(j).cwiseAbs().maxCoeff());
    q.col(j) = (gain * q.col(j)).array() + middle[j];
    qd.col(j) *= gain;
    qdd.col(j) *= gain;
  }
  if (driven.empty())
    throw ModelError(model.name + ": no joint has a motor; there is nothing to excite");

  if (!may_move)
    throw ModelError(model.name +
                     ": the limits of every joint with a motor leave no range, there is nothing to "
                     "excite; correct them, or leave them out");

  const long step = std::max(1L, per_period / 1000);
  if (effort_share(tree, loops.get(), ranges, q.topRows(1), qd.topRows(1), qdd.topRows(1), middle,
                   0.0, 1) > 1.0)
    throw ModelError(model.name +
                     ": holding the middle of the joint ranges exceeds an effort limit; "
                     "raise effort_share or the limit");
  double gain = 1.0;
  while (gain > 1e-3 &&
         effort_share(tree, loops.get(), ranges, q.topRows(per_period), qd.topRows(per_period),
                      qdd.topRows(per_period), middle, gain, step) > 1.0)
    gain *= 0.9;
  MotionRows whole = scaled_rows(q, qd, qdd, middle, gain, 1);
  if (loops && loops->complete(whole, middle) == 0.0)
    throw ModelError("excite: the loops of '" + model.name + "' do not close along the motion");

  Trajectory out;
  const long m = static_cast<long>(driven.size());
  out.time = VecX<double>::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / o.rate);
  out.q.resize(rows, m);
  out.qd.resize(rows, m);
  out.qdd.resize(rows, m);
  for (long c = 0; c < m; ++c) {
    const int j = driven[static_cast<std::size_t>(c)];
    out.joint_names.push_back(model.links[moving[j]].joint);
    out.q.col(c) = whole.q.col(j);
    out.qd.col(c) = whole.qd.col(j);
    out.qdd.col(c) = whole.qdd.col(j);
  }
  return out;
}

std::vector<std::string> fourier_notes(const Model& model, const FourierOptions& o) {
  std::vector<std::string> out;
  for (const int i : moving_links(model)) {
    const ModelLink& link = model.links[i];
    if (link.passive) continue;
    const bool turns = link.type == ModelJoint::kRevolute;
    const JointLimits& l = link.limits;
    const JointRange r = range_of(link, o);
    const std::string unit = turns ? " rad" : " m";
    if (!(r.half > 0.0))
      out.push_back(link.joint + ": its limits leave no range, it is held at " +
                    short_number(r.middle) + unit);
    else if (!std::isfinite(l.lower) && !std::isfinite(l.upper))
      out.push_back(link.joint + ": no position limits, it moves within " +
                    short_number(r.middle - r.half) + " to " + short_number(r.middle + r.half) +
                    unit);
    if (!is_given(l.velocity))
      out.push_back(link.joint + ": no velocity limit" + (l.velocity == 0.0 ? " (0)" : "") +
                    ", it moves at up to " + short_number(r.velocity) + unit + "/s");
    if (!is_given(l.effort))
      out.push_back(link.joint + ": no effort limit" + (l.effort == 0.0 ? " (0)" : "") +
                    ", its torque is not looked at");
  }
  return out;
}

}  // namespace diffnea
