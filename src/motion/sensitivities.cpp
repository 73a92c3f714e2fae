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
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    of_effect_[e].off = effects_[e].parameters;
    for (const int k : effects_[e].linear_parameters())
      of_effect_[e].off[static_cast<std::size_t>(k)] = 0.0;
  }
  for (const MotionParameter& p : parameters)
    if (p.effect < 0 && (p.dof < 0 || p.theta < 0))
      throw ModelError("motion: a window has no derivative by a fixed transform");
  divide(parameters);
  const std::size_t n = static_cast<std::size_t>(n_);
  jet_q_.resize(n);
  jet_qd_.resize(n);
  jet_qdd_.resize(n);
  jet_load_.resize(n);
  jet_tau_.resize(n);
  scratch_.assign(n, 0.0);
}

/// Gives each parameter a column among those of the limb that it moves.
void JointWindows::divide(const std::vector<MotionParameter>& parameters) {
  std::vector<BoundEffect> all = effects_;
  for (OfRuns& m : models_) {
    const std::vector<BoundEffect>& of_model = m.path.dynamics().model().effects;
    all.insert(all.end(), of_model.begin(), of_model.end());
  }
  for (const Limb& limb : limbs(models_.front().path.dynamics().model(), all))
    parts_.emplace_back().limb = limb;
  const auto moves = [&](const MotionParameter& p, const Limb& limb) {
    int dof = p.dof;  // links of one limb have degrees of freedom of that limb
    if (p.effect >= 0) {
      const BoundEffect& e = effects_[static_cast<std::size_t>(p.effect)];
      dof = e.links.empty() ? e.joints.at(0) : models_.front().geometry.drive(e.links[0]).dof;
    } else if (dof >= 0) {
      dof = models_.front().geometry.drive(dof).dof;
    }
    return dof >= limb.first && dof < limb.first + limb.count;
  };
  int column = 1, next = 0;
  for (Part& part : parts_) {
    part.column = column;
    part.parameter = next;
    for (const int first : {0, n_})
      for (int j = 0; j < part.limb.count; ++j) part.to.push_back(first + part.limb.first + j);
    for (int k = 0; k < f_; ++k) {
      const MotionParameter& p = parameters[static_cast<std::size_t>(k)];
      if (!moves(p, part.limb)) continue;
      add_parameter(p, next++);
      part.to.push_back(2 * n_ + k);
      ++part.parameters;
    }
    column += part.width();
  }
}

/// @param column  of C
void JointWindows::add_parameter(const MotionParameter& p, int column) {
  logarithmic_.push_back(p.logarithmic ? 1 : 0);
  if (p.effect < 0) {
    of_link_.push_back({kThetaSize * p.dof + p.theta, column});
    return;
  }
  const BoundEffect& effect = effects_[static_cast<std::size_t>(p.effect)];
  OfEffect& of = of_effect_[static_cast<std::size_t>(p.effect)];
  if (effect.info().port == Port::kModelParameter) {
    if (p.theta < 0)
      throw ModelError("motion: a window has no derivative by " + effect.info().name);
    of_link_.push_back({kThetaSize * effect.links.at(0) + p.theta, column, p.effect});
    return;
  }
  const std::vector<int> linear = effect.linear_parameters();
  const bool is_linear = std::ranges::find(linear, p.index) != linear.end();
  (is_linear ? of.linear : of.shapes).emplace_back(p.index, column);
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
  std::vector<TriangularFactor> factors;
  for (Part& part : parts_) {
    const auto [first, count] = part.limb;
    A_.block(first, part.column, count, count).setIdentity();
    A_.block(n_ + first, part.column + count, count, count).setIdentity();
    part.block.resize(kBlock * count, part.width() + 1);
    part.filled = 0;
    factors.emplace_back(part.width());
  }
  const long reached = enter(stretch.run).integrate(
      stretch, window, A_,
      [&](const VecX<double>& u, const MatX<double>& at, MatX<double>& d) {
        slope(stretch.run, u, at, d);
      },
      [&](long k, const MatX<double>& at) {
        for (std::size_t i = 0; i < parts_.size(); ++i) {
          Part& part = parts_[i];
          const auto [first, count] = part.limb;
          for (int j = first; j < first + count; ++j) {
            const double q = stretch.q(window.first + k, j);
            if (std::isnan(q)) continue;
            auto row = part.block.row(part.filled++);
            row.head(part.width()) = at.row(j).segment(part.column, part.width()) / sigma[j];
            row[part.width()] = (at(j, 0) - q) / sigma[j];
          }
          if (part.filled + count > part.block.rows()) {
            factors[i].add(part.block.topRows(part.filled));
            part.filled = 0;
          }
        }
      });
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Part& part = parts_[i];
    factors[i].add(part.block.topRows(part.filled));
    const MatX<double> R = factors[i].R();
    RowMatX<double> placed = RowMatX<double>::Zero(part.width() + 1, width + 1);
    for (int c = 0; c < part.width(); ++c)
      placed.col(part.to[static_cast<std::size_t>(c)]).head(part.width()) = R.col(c);
    placed.col(width).head(part.width()) = factors[i].d();
    placed(part.width(), width) = std::sqrt(factors[i].residual_sum_of_squares());
    rows.add(placed);
  }
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
  dA.setZero(A.rows(), A.cols());
  dA.topRows(n_) = A.bottomRows(n_);
  for (const Part& part : parts_) {
    const auto [first, count] = part.limb;
    const auto of_limb = [&](const auto& M) { return M.block(first, first, count, count); };
    auto out = dA.block(n_ + first, part.column, count, part.width());
    const auto rows_of = [&](const MatX<double>& M, int row) {
      return M.block(row, part.column, count, part.width());
    };
    // Few rows: Eigen's blocked products would spend their time on packing.
    out.noalias() = of_limb(dynamics.dqdd_dq()).lazyProduct(rows_of(A, first));
    out.noalias() += of_limb(dynamics.dqdd_dqd()).lazyProduct(rows_of(A, n_ + first));
    out.rightCols(part.parameters).noalias() -=
        of_limb(dynamics.inverse_mass_matrix())
            .lazyProduct(C_.block(first, part.parameter, count, part.parameters));
  }
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
  x.step = dynamics.step();
  x.run = run;
  x.q = q_.data();
  x.qd = qd_.data();
  x.qdd = qdd.data();
  x.tau = dynamics.is_implicit() ? dynamics.transmitted().data() : qdd.data();  // else unread
  JointSample<JetD> jets;
  jets.time = x.time;
  jets.command = x.command;
  jets.step = x.step;
  jets.run = run;
  jets.q = jet_q_.data();
  jets.qd = jet_qd_.data();
  jets.qdd = jet_qdd_.data();
  jets.tau = jet_load_.data();
  for (int j = 0; j < n_; ++j) {
    const std::size_t at = static_cast<std::size_t>(j);
    jet_q_[at] = JetD(q_[j]);
    jet_qd_[at] = JetD(qd_[j]);
    jet_qdd_[at] = JetD(qdd[j]);
    jet_load_[at] = JetD(x.tau[j]);
  }
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    OfEffect& of = of_effect_[e];
    const BoundEffect& effect = effects_[e];
    if (acting_[e] == 0) continue;
    // The torque is homogeneous in the linear parameters: one of them 1, the others 0.
    for (const auto& [index, column] : of.linear) {
      for (const int j : effect.joints) scratch_[static_cast<std::size_t>(j)] = 0.0;
      double& p = of.off[static_cast<std::size_t>(index)];
      p = 1.0;
      add_torque(effect, x, of.off.data(), scratch_.data());
      p = 0.0;
      for (const int j : effect.joints)
        C_(j, column) = scratch_[static_cast<std::size_t>(j)] / gains[j];
    }
    if (of.shapes.empty()) continue;
    jet_p_.clear();
    for (const double p : effect.parameters) jet_p_.emplace_back(p);
    // Directions of a Jet may be fewer than a table has shapes.
    for (std::size_t first = 0; first < of.shapes.size(); first += kJetWidth) {
      const std::size_t count = std::min<std::size_t>(of.shapes.size() - first, kJetWidth);
      for (std::size_t i = 0; i < count; ++i) {
        const auto& [index, k] = of.shapes[first + i];
        JetD& p = jet_p_[static_cast<std::size_t>(index)];
        p.v.setZero();
        p.v[static_cast<long>(i)] = logarithmic_[static_cast<std::size_t>(k)] != 0 ? p.a : 1.0;
      }
      for (const int j : effect.joints) jet_tau_[static_cast<std::size_t>(j)] = JetD(0.0);
      add_torque(effect, jets, jet_p_.data(), jet_tau_.data());
      for (std::size_t i = 0; i < count; ++i) {
        const auto& [index, k] = of.shapes[first + i];
        jet_p_[static_cast<std::size_t>(index)].v.setZero();
        for (const int j : effect.joints)
          C_(j, k) = jet_tau_[static_cast<std::size_t>(j)].v[static_cast<long>(i)] / gains[j];
      }
    }
  }
}

}  // namespace diffnea
