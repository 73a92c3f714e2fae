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

void check(const ExtendedTree& model, const JointSeries& x, const RowMatX<double>& torque,
           long begin, long end, const VecX<double>* first) {
  const long n = model.tree.num_dofs();
  for (const RowMatX<double>* m : {&x.q, &x.qd, &x.qdd, &torque}) {
    require_size("replay: columns", m->cols(), n, "joint");
    require_size("replay: rows", m->rows(), x.rows(), "row of q");
  }
  if (first) require_size("replay: first", first->size(), 2 * n, "q and q̇ of every joint");
  if (begin < 1 || end <= begin || end >= x.rows())
    throw ShapeError("replay: got rows " + std::to_string(begin) + " to " + std::to_string(end) +
                     ", expected at least one of the " + std::to_string(x.rows()) +
                     " rows before and behind them");
}

}  // namespace

RowMatX<double> replay(const ExtendedTree& model, const JointSeries& x,
                       const RowMatX<double>& torque, long begin, long end,
                       const VecX<double>* first, int run) {
  check(model, x, torque, begin, end, first);
  const long n = x.q.cols();
  const VecX<double> shift = clock_shifts(model);
  JointSeries truth = x;  // on the torque's clock
  for (long j = 0; j < n; ++j)
    if (shift[j] != 0.0)
      for (RowMatX<double>* m : {&truth.q, &truth.qd, &truth.qdd})
        m->col(j) = shifted(m->col(j), x.dt, shift[j]);
  if (first) {
    truth.q.row(begin) = first->head(n).transpose();
    truth.qd.row(begin) = first->tail(n).transpose();
  }
  sim::ModelPlant plant(model, x.dt, x.dt, run);
  plant.start(truth, torque, begin);
  RowMatX<double> out = RowMatX<double>::Constant(end - begin, n, kNaN);
  for (long k = begin; k < end; ++k) {
    const VecX<double> q = plant.q();
    if (!(q.cwiseAbs().maxCoeff() < kBlowUp)) break;
    out.row(k - begin) = q.transpose();
    if (!plant.step(torque.row(k).transpose()).empty()) break;
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
