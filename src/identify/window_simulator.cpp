#include "identify/window_simulator.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "identify/window_integrator.hpp"

namespace diffnea {
namespace {

VecX<double> shapes(const FitLayout& layout) {
  VecX<double> out(layout.shape.size());
  for (std::size_t s = 0; s < layout.shape.size(); ++s) out[s] = layout.shape[s].prior;
  return out;
}

}  // namespace

WindowSimulator::WindowSimulator(const Model& model, const FitLayout& layout, const VecX<double>& x,
                                 const std::vector<int>& free, const std::vector<int>& runs,
                                 const TrajectoryOptions& options)
    : options_(options),
      dynamics_(extend(apply_fit(model, layout, x, shapes(layout)), runs)),
      geometry_(dynamics_.model().tree),
      n_(layout.num_dofs),
      f_(static_cast<int>(free.size())) {
  effects_ = layout.effects;
  for (std::size_t c = 0; c < layout.linear.size(); ++c)
    if (layout.linear[c].effect >= 0)
      effects_[layout.linear[c].effect].parameters[layout.linear[c].index] =
          x[static_cast<long>(c)];
  slot_.assign(layout.linear.size(), -1);
  for (int k = 0; k < f_; ++k) slot_[free[k]] = k;
  effect_columns_.resize(effects_.size());
  for (std::size_t c = 0; c < layout.linear.size(); ++c)
    if (layout.linear[c].effect >= 0)
      effect_columns_[layout.linear[c].effect].push_back(static_cast<int>(c));
}

bool WindowSimulator::rows(const ShootingWindow& w, const VecX<double>& sigma,
                           RowMatX<double>& out) {
  const int width = 2 * n_ + f_;
  out.resize(static_cast<long>(w.time.size()) * n_, width + 1);
  MatX<double> A = MatX<double>::Zero(2 * n_, 1 + width);
  A.col(0) = w.state;
  A.middleCols(1, 2 * n_).setIdentity();
  long filled = 0;
  const bool finite = integrate(
      w, fastest_rate(dynamics_, w), options_.stepping.max_step, A,
      [&](const VecX<double>& u, const MatX<double>& at, MatX<double>& d) {
        sensitivity_slope(w.run, u, at, d);
      },
      [&](long k, const MatX<double>& at) {
        for (int j = 0; j < n_; ++j) {
          if (std::isnan(w.q(k, j))) continue;
          out.row(filled).head(width) = at.row(j).tail(width) / sigma[j];
          out(filled++, width) = (at(j, 0) - w.q(k, j)) / sigma[j];
        }
      });
  out.conservativeResize(filled, Eigen::NoChange);
  return finite;
}

double WindowSimulator::cost(const ShootingWindow& w, const VecX<double>& state,
                             const VecX<double>& sigma) {
  MatX<double> z = state;
  double sum = 0.0;
  const bool finite = integrate(w, fastest_rate(dynamics_, w), options_.stepping.max_step, z,
                                state_slope(dynamics_, w.run), [&](long k, const MatX<double>& at) {
                                  for (int j = 0; j < n_; ++j)
                                    if (!std::isnan(w.q(k, j)))
                                      sum += 0.5 * std::pow((at(j, 0) - w.q(k, j)) / sigma[j], 2);
                                });
  return finite ? sum : std::numeric_limits<double>::infinity();
}

void WindowSimulator::sensitivity_slope(int run, const VecX<double>& u, const MatX<double>& A,
                                        MatX<double>& dA) {
  dynamics_.linearise(A.data(), A.data() + n_, u.data(), run);
  columns(run, A.col(0), dynamics_.qdd());
  dA.resize(A.rows(), A.cols());
  dA.topRows(n_) = A.bottomRows(n_);
  dA.bottomRows(n_).noalias() = dynamics_.dqdd_dq() * A.topRows(n_);
  dA.bottomRows(n_).noalias() += dynamics_.dqdd_dqd() * A.bottomRows(n_);
  dA.bottomRows(n_).rightCols(f_).noalias() -= dynamics_.inverse_mass_matrix() * C_;
  dA.col(0).tail(n_) = dynamics_.qdd();
}

void WindowSimulator::columns(int run, const VecX<double>& z, const VecX<double>& qdd) {
  C_.setZero(n_, f_);
  const VecX<double> q = z.head(n_), qd = z.tail(n_);
  const RowMatX<double>& Y = torque_regressor<double, double>(geometry_, q, qd, qdd, ws_);
  for (int c = 0; c < kThetaSize * n_; ++c)
    if (slot_[c] >= 0) C_.col(slot_[c]) = Y.col(c);
  JointSample<double> x;
  x.run = run;
  x.q = q.data();
  x.qd = qd.data();
  x.qdd = qdd.data();
  x.tau = qdd.data();
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    const std::vector<int>& at = effect_columns_[e];
    if (at.empty() || std::ranges::all_of(at, [&](int c) { return slot_[c] < 0; })) continue;
    if (effects_[e].info().port == Port::kModelParameter) {
      for (std::size_t k = 0; k < at.size(); ++k)
        if (slot_[at[k]] >= 0)
          C_.col(slot_[at[k]]) =
              Y.col(kThetaSize * effects_[e].joints.at(0) + static_cast<long>(k));
      continue;
    }
    scratch_.resize(at.size() * n_);
    linear_columns(effects_[e], x, scratch_.data());
    for (std::size_t k = 0; k < at.size(); ++k)
      if (slot_[at[k]] >= 0)
        C_.col(slot_[at[k]]) = Eigen::Map<const VecX<double>>(scratch_.data() + k * n_, n_)
                                   .cwiseQuotient(dynamics_.gains());
  }
}

}  // namespace diffnea
