#include "motion/sensitivities.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "core/constants.hpp"

namespace diffnea {

JointWindows::JointWindows(std::vector<ModelOfRuns> models, std::vector<BoundEffect> effects,
                           const std::vector<MotionParameter>& parameters,
                           const SteppingOptions& options)
    : acting_(effects.size(), 1),
      n_(models.front().model.tree.num_dofs()),
      f_(static_cast<int>(parameters.size())),
      effects_(std::move(effects)),
      of_effect_(effects_.size()) {
  for (ModelOfRuns& m : models) {
    MotionPath path(std::move(m.model), options);
    Tree<double> geometry = path.dynamics().model().tree;
    models_.push_back({std::move(m.runs), std::move(path), std::move(geometry)});
  }
  for (std::size_t e = 0; e < effects_.size(); ++e)
    of_effect_[e].slot.assign(effects_[e].linear_parameters().size(), -1);
  for (int k = 0; k < f_; ++k) {
    const MotionParameter& p = parameters[static_cast<std::size_t>(k)];
    logarithmic_.push_back(p.logarithmic ? 1 : 0);
    if (p.effect < 0) {
      if (p.dof < 0 || p.theta < 0)
        throw ModelError("motion: a window has no derivative by a fixed transform");
      of_link_.push_back({kThetaSize * p.dof + p.theta, k});
      continue;
    }
    const BoundEffect& effect = effects_[static_cast<std::size_t>(p.effect)];
    OfEffect& of = of_effect_[static_cast<std::size_t>(p.effect)];
    if (effect.info().port == Port::kModelParameter) {
      if (p.theta < 0)
        throw ModelError("motion: a window has no derivative by " + effect.info().name);
      of_link_.push_back({kThetaSize * effect.links.at(0) + p.theta, k, p.effect});
      continue;
    }
    const std::vector<int> linear = effect.linear_parameters();
    const auto at = std::ranges::find(linear, p.index);
    if (at == linear.end()) {
      of.shapes.emplace_back(p.index, k);
    } else {
      of.slot[static_cast<std::size_t>(at - linear.begin())] = k;
      of.linear = true;
    }
  }
  const std::size_t n = static_cast<std::size_t>(n_);
  jet_q_.resize(n);
  jet_qd_.resize(n);
  jet_qdd_.resize(n);
  jet_load_.resize(n);
  jet_tau_.resize(n);
}

MotionPath& JointWindows::enter(int run) {
  const auto at = std::ranges::find_if(models_, [run](const OfRuns& m) {
    return std::ranges::find(m.runs, run) != m.runs.end();
  });
  const auto rest = std::ranges::find_if(models_, [](const OfRuns& m) { return m.runs.empty(); });
  now_ = static_cast<std::size_t>((at != models_.end() ? at : rest) - models_.begin());
  if (now_ == models_.size())
    throw ModelError("motion: there is no model of run " + std::to_string(run));
  for (std::size_t e = 0; e < effects_.size(); ++e) acting_[e] = effects_[e].acts_in(run) ? 1 : 0;
  return models_[now_].path;
}

bool JointWindows::linearise(const MotionStretch& stretch, const MotionWindow& window,
                             const VecX<double>& sigma, TriangularFactor& rows) {
  constexpr long kBlock = 256;  // rows of the stretch that are handed to the factor at once
  const int width = 2 * n_ + f_;
  A_.setZero(2 * n_, 1 + width);
  A_.col(0) = window.state;
  A_.middleCols(1, 2 * n_).setIdentity();
  block_.resize(kBlock * n_, width + 1);
  long filled = 0;
  const long reached = enter(stretch.run).integrate(
      stretch, window, A_,
      [&](const VecX<double>& u, const MatX<double>& at, MatX<double>& d) {
        slope(stretch.run, u, at, d);
      },
      [&](long k, const MatX<double>& at) {
        for (int j = 0; j < n_; ++j) {
          const double q = stretch.q(window.first + k, j);
          if (std::isnan(q)) continue;
          block_.row(filled).head(width) = at.row(j).tail(width) / sigma[j];
          block_(filled++, width) = (at(j, 0) - q) / sigma[j];
        }
        if (filled + n_ > block_.rows()) {
          rows.add(block_.topRows(filled));
          filled = 0;
        }
      });
  rows.add(block_.topRows(filled));
  return reached == window.rows;
}

double JointWindows::cost(const MotionStretch& stretch, const MotionWindow& window,
                          const VecX<double>& sigma) {
  double sum = 0.0;
  const long reached = enter(stretch.run).simulate(stretch, window, [&](long k, const MatX<double>& z) {
    for (int j = 0; j < n_; ++j) {
      const double q = stretch.q(window.first + k, j);
      if (!std::isnan(q)) sum += 0.5 * std::pow((z(j, 0) - q) / sigma[j], 2);
    }
  });
  return reached == window.rows ? sum : kInfinity;
}

RowMatX<double> JointWindows::positions(const MotionStretch& stretch, const MotionWindow& window) {
  RowMatX<double> q = RowMatX<double>::Constant(window.rows, n_, kNaN);
  enter(stretch.run).simulate(stretch, window, [&](long k, const MatX<double>& z) {
    q.row(k) = z.col(0).head(n_).transpose();
  });
  return q;
}

bool JointWindows::state_at(const MotionStretch& stretch, const MotionWindow& window, long row,
                            VecX<double>& out) {
  MotionWindow until = window;
  until.rows = row + 1;
  return enter(stretch.run).simulate(stretch, until, [&](long k, const MatX<double>& z) {
    if (k == row) out = z.col(0);
  }) == row + 1;
}

VecX<double> JointWindows::torque_noise_reach(const MotionStretch& stretch,
                                              const MotionWindow& window,
                                              const VecX<double>& density) {
  MotionPath& path = enter(stretch.run);
  ForwardDynamics& dynamics = path.dynamics();
  MatX<double> P = MatX<double>::Zero(2 * n_, 2 * n_), F(2 * n_, 2 * n_), B(n_, n_);
  VecX<double> u(n_);
  path.simulate(stretch, window, [&](long k, const MatX<double>& z) {
    if (k + 1 >= window.rows) return;
    const std::size_t row = static_cast<std::size_t>(window.first + k);
    const double h = stretch.time[row + 1] - stretch.time[row];
    u = stretch.u.row(window.first + k).transpose();
    dynamics.linearise(z.data(), z.data() + n_, u.data(), stretch.run);
    // Steep friction forgets within the row: backward Euler in the velocities.
    const MatX<double> W = MatX<double>::Identity(n_, n_) - h * dynamics.dqdd_dqd();
    const Eigen::PartialPivLU<MatX<double>> lu(W);
    const MatX<double> velocity = lu.solve(MatX<double>(MatX<double>::Identity(n_, n_)));
    B = velocity * dynamics.inverse_mass_matrix() * dynamics.gains().cwiseInverse().asDiagonal();
    F.bottomLeftCorner(n_, n_) = h * velocity * dynamics.dqdd_dq();
    F.bottomRightCorner(n_, n_) = velocity;
    F.topLeftCorner(n_, n_) = MatX<double>::Identity(n_, n_) + h * F.bottomLeftCorner(n_, n_);
    F.topRightCorner(n_, n_) = h * velocity;
    P = F * P * F.transpose();
    P.bottomRightCorner(n_, n_) += h * B * density.asDiagonal() * B.transpose();
  });
  return P.diagonal().head(n_).cwiseMax(0.0).cwiseSqrt();
}

/// d/dt [z | Z]: Z̈_q = ∂q̈/∂q Z_q + ∂q̈/∂q̇ Z_q̇ − M⁻¹ C in the parameters' columns.
void JointWindows::slope(int run, const VecX<double>& u, const MatX<double>& A, MatX<double>& dA) {
  ForwardDynamics& dynamics = models_[now_].path.dynamics();
  dynamics.linearise(A.data(), A.data() + n_, u.data(), run);
  columns(run, A);
  dA.resize(A.rows(), A.cols());
  dA.topRows(n_) = A.bottomRows(n_);
  dA.bottomRows(n_).noalias() = dynamics.dqdd_dq() * A.topRows(n_);
  dA.bottomRows(n_).noalias() += dynamics.dqdd_dqd() * A.bottomRows(n_);
  dA.bottomRows(n_).rightCols(f_).noalias() -= dynamics.inverse_mass_matrix() * C_;
  dA.col(0).tail(n_) = dynamics.qdd();
}

/// C = ∂τ/∂x at q̈, at the links (armature and friction over 1 + ε): ∂q̈/∂x = −M⁻¹ C, or −S⁻¹ C.
void JointWindows::columns(int run, const MatX<double>& A) {
  C_.setZero(n_, f_);
  if (f_ == 0) return;
  const ForwardDynamics& dynamics = models_[now_].path.dynamics();
  const VecX<double>& qdd = dynamics.qdd();
  const VecX<double>& gains = dynamics.gains();
  q_ = A.col(0).head(n_);
  qd_ = A.col(0).tail(n_);
  if (!of_link_.empty()) {
    const RowMatX<double>& Y = torque_regressor<double, double>(models_[now_].geometry, q_, qd_, qdd, ws_);
    for (const OfLink& of : of_link_)
      if (of.effect < 0 || acting_[static_cast<std::size_t>(of.effect)] != 0)
        C_.col(of.free) = Y.col(of.column);
    if (dynamics.is_implicit()) C_ = (dynamics.link_share() * C_).eval();
  }
  JointSample<double> x;
  x.time = dynamics.time();
  x.command = dynamics.command();
  x.run = run;
  x.q = q_.data();
  x.qd = qd_.data();
  x.qdd = qdd.data();
  x.tau = dynamics.is_implicit() ? dynamics.transmitted().data() : qdd.data();  // else unread
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    const OfEffect& of = of_effect_[e];
    if (acting_[e] == 0) continue;
    if (of.linear) {
      scratch_.resize(of.slot.size() * static_cast<std::size_t>(n_));
      linear_columns(effects_[e], x, scratch_.data());
      for (std::size_t k = 0; k < of.slot.size(); ++k)
        if (of.slot[k] >= 0)
          C_.col(of.slot[k]) =
              Eigen::Map<const VecX<double>>(scratch_.data() + k * static_cast<std::size_t>(n_), n_)
                  .cwiseQuotient(gains);
    }
    if (of.shapes.empty()) continue;
    for (std::size_t j = 0; j < jet_q_.size(); ++j) {
      jet_q_[j] = JetD(q_[static_cast<long>(j)]);
      jet_qd_[j] = JetD(qd_[static_cast<long>(j)]);
      jet_qdd_[j] = JetD(qdd[static_cast<long>(j)]);
      jet_load_[j] = JetD(x.tau[j]);
    }
    jet_p_.clear();
    for (const double p : effects_[e].parameters) jet_p_.emplace_back(p);
    JointSample<JetD> jets;
    jets.time = x.time;
    jets.command = x.command;
    jets.run = run;
    jets.q = jet_q_.data();
    jets.qd = jet_qd_.data();
    jets.qdd = jet_qdd_.data();
    jets.tau = jet_load_.data();
    // Directions of a Jet may be fewer than a table has shapes.
    for (std::size_t first = 0; first < of.shapes.size(); first += kJetWidth) {
      const std::size_t count = std::min<std::size_t>(of.shapes.size() - first, kJetWidth);
      for (std::size_t i = 0; i < count; ++i) {
        const auto& [index, k] = of.shapes[first + i];
        JetD& p = jet_p_[static_cast<std::size_t>(index)];
        p.v.setZero();
        p.v[static_cast<long>(i)] = logarithmic_[static_cast<std::size_t>(k)] != 0 ? p.a : 1.0;
      }
      std::ranges::fill(jet_tau_, JetD(0.0));
      add_torque(effects_[e], jets, jet_p_.data(), jet_tau_.data());
      for (std::size_t i = 0; i < count; ++i) {
        const auto& [index, k] = of.shapes[first + i];
        jet_p_[static_cast<std::size_t>(index)].v.setZero();
        for (int j = 0; j < n_; ++j)
          C_(j, k) = jet_tau_[static_cast<std::size_t>(j)].v[static_cast<long>(i)] / gains[j];
      }
    }
  }
}

}  // namespace diffnea
