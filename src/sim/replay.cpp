#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/sim/replay.hpp>

#include "core/constants.hpp"
#include "sim/model_plant.hpp"

namespace diffnea {
namespace {

/// A position beyond this is a blow-up, whatever the robot [rad] or [m].
constexpr double kBlowUp = 1e6;

/// Per joint, by how much its motion is logged late [s].
VecX<double> clock_shifts(const ExtendedTree& model) {
  VecX<double> out = VecX<double>::Zero(model.tree.num_dofs());
  for (const BoundEffect& e : model.series)
    for (const int j : e.joints) out[j] += clock_shift(e);
  return out;
}

void check(const ExtendedTree& model, const JointSeries& x, long begin, long end) {
  const long n = model.tree.num_dofs();
  for (const RowMatX<double>* m : {&x.q, &x.qd, &x.qdd, &x.logged}) {
    require_size("replay: columns", m->cols(), n, "joint");
    require_size("replay: rows", m->rows(), x.rows(), "row of q");
  }
  if (begin < 1 || end <= begin || end >= x.rows())
    throw ShapeError("replay: got rows " + std::to_string(begin) + " to " + std::to_string(end) +
                     ", expected at least one of the " + std::to_string(x.rows()) +
                     " rows before and behind them");
}

}  // namespace

RowMatX<double> replay(const ExtendedTree& model, const JointSeries& x, long begin, long end,
                       const Feedback* feedback, int run) {
  check(model, x, begin, end);
  const long n = x.q.cols();
  const VecX<double> shift = clock_shifts(model);
  JointSeries truth = x;  // on the torque's clock
  for (long j = 0; j < n; ++j)
    if (shift[j] != 0.0)
      for (RowMatX<double>* m : {&truth.q, &truth.qd, &truth.qdd})
        m->col(j) = shifted(m->col(j), x.dt, shift[j]);
  RowMatX<double> torque(x.rows(), n);  // from row k to k+1
  torque.topRows(x.rows() - 1) =
      0.5 * (x.logged.topRows(x.rows() - 1) + x.logged.bottomRows(x.rows() - 1));
  torque.bottomRows(1) = x.logged.bottomRows(1);

  sim::ModelPlant plant(model, x.dt, x.dt, run);
  plant.start(truth, torque, begin);
  RowMatX<double> out = RowMatX<double>::Constant(end - begin, n, kNaN);
  VecX<double> u(n);
  for (long k = begin; k < end; ++k) {
    const VecX<double> q = plant.q();
    if (!(q.cwiseAbs().maxCoeff() < kBlowUp)) break;
    out.row(k - begin) = q.transpose();
    u = torque.row(k).transpose();
    if (feedback)
      u = (u + feedback->kp.cwiseProduct(truth.q.row(k).transpose() - q) +
           feedback->kd.cwiseProduct(truth.qd.row(k).transpose() - plant.qd()))
              .cwiseMin(feedback->limit)
              .cwiseMax(-feedback->limit);
    if (!plant.step(u).empty()) break;
  }
  for (long j = 0; j < n; ++j) {
    if (shift[j] == 0.0) continue;
    out.col(j) = shifted(out.col(j), x.dt, -shift[j]);
    const long lost = std::min(end - begin, std::lround(std::ceil(std::abs(shift[j]) / x.dt)));
    if (shift[j] > 0.0)
      out.col(j).head(lost).setConstant(kNaN);
    else
      out.col(j).tail(lost).setConstant(kNaN);
  }
  return out;
}

}  // namespace diffnea
