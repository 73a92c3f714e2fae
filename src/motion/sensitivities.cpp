#include "motion/sensitivities.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"

namespace diffnea {

JointWindows::JointWindows(std::vector<ModelOfRuns> models, std::vector<BoundEffect> effects,
                           const std::vector<MotionParameter>& parameters,
                           const SteppingOptions& options)
    : acting_(effects.size(), 1),
      joints_(models.front().model.tree.num_dofs()),
      n_(joints_),
      f_(static_cast<int>(parameters.size())),
      effects_(std::move(effects)),
      of_effect_(effects_.size()) {
  for (ModelOfRuns& m : models) {
    MotionPath path(std::move(m.model), options);
    Tree<double> geometry = path.dynamics().model().tree;
    models_.push_back({std::move(m.runs), std::move(path), std::move(geometry)});
  }
  n_ = models_.front().path.rotors().dofs();
  for (const OfRuns& m : models_)
    if (m.path.rotors().joints_behind() != models_.front().path.rotors().joints_behind())
      throw ModelError("motion: a motor is hidden, or an error integrated, in some runs alone");
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    of_effect_[e].parts = models_.front().path.rotors().parts(effects_[e]);
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
  std::vector<BoundEffect> all;
  for (const OfEffect& of : of_effect_)
    for (const EffectPart& part : of.parts) all.push_back(part.effect);
  for (OfRuns& m : models_) {
    const std::vector<BoundEffect>& of_model = m.path.dynamics().model().effects;
    all.insert(all.end(), of_model.begin(), of_model.end());
  }
  for (Limb& limb : limbs(models_.front().path.dynamics().model(), rotors(), all)) {
    Part& part = parts_.emplace_back();
    part.dofs = limb.dofs();
    part.on_end = part.dofs.back() - part.dofs.front() == static_cast<int>(part.dofs.size()) - 1;
    part.limb = std::move(limb);
  }
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
    for (const int first : {0, joints_})
      for (int j = 0; j < part.limb.count; ++j) part.to.push_back(first + part.limb.first + j);
    for (int k = 0; k < f_; ++k) {
      const MotionParameter& p = parameters[static_cast<std::size_t>(k)];
      if (!moves(p, part.limb)) continue;
      add_parameter(p, next++);
      part.to.push_back(2 * joints_ + k);
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
  const ParameterInfo& info = effect.parameter_info[static_cast<std::size_t>(p.index)];
  if (hides_motor(effect) && !fits_of_gear(info))
    throw ModelError("motion: a window has no derivative by " + info.name + " of " +
                     effect.info().name + "; hold it");
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

/// Positions and velocities that encoders read, (2n), of all degrees of freedom.
VecX<double> JointWindows::read(const MatX<double>& z) const {
  VecX<double> out(2 * joints_);
  for (const int half : {0, 1})
    for (int j = 0; j < joints_; ++j)
      out[half * joints_ + j] = z(half * n_ + rotors().encoder(j), 0);
  return out;
}

/// First state of a window and its sensitivities. Hidden sides move as what encoders read does, but
/// for what gravity and the links' motion wind up.
void JointWindows::begin(const MotionStretch& stretch, const MotionWindow& window) {
  const VecX<double>& state = window.state;
  A_.setZero(2 * n_, 1 + 2 * joints_ + f_);
  for (const Part& part : parts_) {
    const auto [first, count] = std::pair{part.limb.first, part.limb.count};
    A_.block(first, part.column, count, count).setIdentity();
    A_.block(n_ + first, part.column + count, count, count).setIdentity();
    for (const int half : {0, 1})
      for (const HiddenRotor& r : rotors().rotors())
        if (std::ranges::find(part.limb.rotors, r.rotor) != part.limb.rotors.end())
          A_.row(half * n_ + r.rotor) = A_.row(half * n_ + r.joint);
  }
  A_.col(0) = models_[now_].path.first_state(stretch, window);
  begin_integrators(stretch, window);
  if (rotors().rotors().empty()) return;
  q_.resize(n_);
  qd_.resize(n_);
  for (int dof = 0; dof < n_; ++dof) {
    q_[dof] = state[rotors().joint_of(dof)];
    qd_[dof] = state[joints_ + rotors().joint_of(dof)];
  }
  const VecX<double> still = VecX<double>::Zero(n_);
  const Tree<double>& tree = models_[now_].path.dynamics().model().tree;
  rnea_derivatives(tree, q_, qd_, still, hanging_);
  torque_regressor<double, double>(models_[now_].geometry, q_, qd_, still, ws_);
  for (const Part& part : parts_)
    for (const HiddenRotor& r : rotors().rotors())
      if (std::ranges::find(part.limb.rotors, r.rotor) != part.limb.rotors.end())
        begin_hidden(r, part);
}

/// Sensitivities of what drives have summed up before a window, by the parameters of their laws.
void JointWindows::begin_integrators(const MotionStretch& stretch, const MotionWindow& window) {
  for (const DriveIntegrator& i : rotors().integrators()) {
    const JetD sum = models_[now_].path.summed_before(i, stretch, window);
    const auto acts = [&](const EffectPart& p) { return p.effect.joints.front() == i.dof; };
    const auto sets_rate = [&](const EffectPart& p) {
      return p.effect.info().has(Trait::kIntegrates) &&
             p.effect.joints.front() == rotors().drive(i.joint);
    };
    for (const Part& part : parts_)
      for (const OfEffect& of : of_effect_)
        for (const auto& [index, column] : of.shapes) {
          if (column < part.parameter || column >= part.parameter + part.parameters) continue;
          double& entry =
              A_(n_ + i.dof, part.column + 2 * part.limb.count + column - part.parameter);
          const bool by_factor = logarithmic_[static_cast<std::size_t>(column)] != 0;
          if (std::ranges::any_of(of.parts, acts))
            entry += sum.v[index] * (by_factor ? of.off[static_cast<std::size_t>(index)] : 1.0);
          else if (std::ranges::any_of(of.parts, sets_rate))
            entry += sum.v[6];
        }
  }
}

/// Adds what winds a gear up at the beginning to the sensitivities of its hidden side.
void JointWindows::begin_hidden(const HiddenRotor& r, const Part& part) {
  const double side = r.read ? -1.0 : 1.0;
  const auto [first, count] = std::pair{part.limb.first, part.limb.count};
  jet_p_.clear();
  for (std::size_t k = 0; k < r.gear.parameters.size(); ++k) {
    jet_p_.emplace_back(r.gear.parameters[k]);
    jet_p_.back().v[1 + static_cast<long>(k)] = 1.0;
  }
  JetD load(hanging_.tau[r.joint]);
  load.v[0] = 1.0;
  const JetD wound = deflection_at(r.gear, load, jet_p_.data());
  auto row = A_.row(r.hidden());
  const double by_load = side * wound.v[0];
  for (int j = 0; j < count; ++j)
    for (const int dof : part.dofs) {
      if (rotors().joint_of(dof) != first + j) continue;
      row[part.column + j] += by_load * hanging_.dtau_dq(r.joint, dof);
      row[part.column + count + j] += by_load * hanging_.dtau_dqd(r.joint, dof);
    }
  const auto column_of = [&](int of_parameters) {  // in A
    return part.column + 2 * count + of_parameters - part.parameter;
  };
  for (const OfLink& of : of_link_)
    if ((of.effect < 0 || acting_[static_cast<std::size_t>(of.effect)] != 0) &&
        of.free >= part.parameter && of.free < part.parameter + part.parameters)
      row[column_of(of.free)] += by_load * ws_.Y(r.joint, of.column);
  for (const OfEffect& of : of_effect_)
    for (const auto& [index, column] : of.shapes)
      if (std::ranges::any_of(of.parts, [&](const EffectPart& p) {
            return p.effect.is_gear && p.effect.joints.back() == r.rotor;
          }))
        row[column_of(column)] += side * wound.v[1 + index] *
                                  (logarithmic_[static_cast<std::size_t>(column)] != 0
                                       ? r.gear.parameters[static_cast<std::size_t>(index)]
                                       : 1.0);
}

bool JointWindows::linearise(const MotionStretch& stretch, const MotionWindow& window,
                             const VecX<double>& sigma, TriangularFactor& rows) {
  constexpr long kBlock = 256;  // rows of the stretch that are handed to the factor at once
  const int width = 2 * joints_ + f_;
  MotionPath& path = enter(stretch.run);
  begin(stretch, window);
  std::vector<TriangularFactor> factors;
  for (Part& part : parts_) {
    part.block.resize(kBlock * part.limb.count, part.width() + 1);
    part.filled = 0;
    factors.emplace_back(part.width());
  }
  const long reached = path.integrate(
      stretch, window, A_,
      [&](const VecX<double>& u, const MatX<double>& at, MatX<double>& d) {
        slope(stretch.run, u, at, d);
      },
      [&](long k, const MatX<double>& at) {
        for (std::size_t i = 0; i < parts_.size(); ++i) {
          Part& part = parts_[i];
          const auto [first, count] = std::pair{part.limb.first, part.limb.count};
          for (int j = first; j < first + count; ++j) {
            const double q = stretch.q(window.first + k, j);
            if (std::isnan(q)) continue;
            const int dof = rotors().encoder(j);
            auto row = part.block.row(part.filled++);
            row.head(part.width()) = at.row(dof).segment(part.column, part.width()) / sigma[j];
            row[part.width()] = (at(dof, 0) - q) / sigma[j];
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
  const long reached =
      enter(stretch.run).simulate(stretch, window, [&](long k, const MatX<double>& z) {
        for (int j = 0; j < joints_; ++j) {
          const double q = stretch.q(window.first + k, j);
          if (!std::isnan(q)) sum += 0.5 * std::pow((z(rotors().encoder(j), 0) - q) / sigma[j], 2);
        }
      });
  return reached == window.rows ? sum : kInfinity;
}

RowMatX<double> JointWindows::positions(const MotionStretch& stretch, const MotionWindow& window) {
  RowMatX<double> q = RowMatX<double>::Constant(window.rows, joints_, kNaN);
  enter(stretch.run).simulate(stretch, window, [&](long k, const MatX<double>& z) {
    q.row(k) = read(z).head(joints_).transpose();
  });
  return q;
}

bool JointWindows::state_at(const MotionStretch& stretch, const MotionWindow& window, long row,
                            VecX<double>& out) {
  MotionWindow until = window;
  until.rows = row + 1;
  return enter(stretch.run).simulate(stretch, until, [&](long k, const MatX<double>& z) {
    if (k == row) out = read(z);
  }) == row + 1;
}

VecX<double> JointWindows::torque_noise_reach(const MotionStretch& stretch,
                                              const MotionWindow& window,
                                              const VecX<double>& density) {
  MotionPath& path = enter(stretch.run);
  ForwardDynamics& dynamics = path.dynamics();
  MatX<double> P = MatX<double>::Zero(2 * n_, 2 * n_), F(2 * n_, 2 * n_), B(n_, n_);
  VecX<double> u(n_), at_drives(n_);
  path.rotors().at_drives(density, at_drives);
  path.simulate(stretch, window, [&](long k, const MatX<double>& z) {
    if (k + 1 >= window.rows) return;
    const std::size_t row = static_cast<std::size_t>(window.first + k);
    const double h = stretch.time[row + 1] - stretch.time[row];
    path.rotors().at_drives(stretch.u.row(window.first + k).transpose(), u);
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
    P.bottomRightCorner(n_, n_) += h * B * at_drives.asDiagonal() * B.transpose();
  });
  VecX<double> out(joints_);
  for (int j = 0; j < joints_; ++j) {
    const int dof = path.rotors().encoder(j);
    out[j] = std::sqrt(std::max(P(dof, dof), 0.0));
  }
  return out;
}

/// d/dt [z | Z]: Z̈_q = ∂q̈/∂q Z_q + ∂q̈/∂q̇ Z_q̇ − M⁻¹ C in the parameters' columns.
void JointWindows::slope(int run, const VecX<double>& u, const MatX<double>& A, MatX<double>& dA) {
  ForwardDynamics& dynamics = models_[now_].path.dynamics();
  dynamics.linearise(A.data(), A.data() + n_, u.data(), run);
  columns(run, A);
  dA.setZero(A.rows(), A.cols());
  dA.topRows(n_) = A.bottomRows(n_);
  for (const Part& part : parts_) {
    if (!part.on_end) {
      slope_of_dofs(part, A, dA);
      continue;
    }
    const auto [first, count] = std::pair{part.dofs.front(), static_cast<int>(part.dofs.size())};
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

/// The same of a limb whose degrees of freedom are not on end.
void JointWindows::slope_of_dofs(const Part& part, const MatX<double>& A, MatX<double>& dA) {
  const ForwardDynamics& dynamics = models_[now_].path.dynamics();
  const std::vector<int>& dofs = part.dofs;
  const auto columns = Eigen::seqN(part.column, part.width());
  std::vector<int> speeds;
  for (const int dof : dofs) speeds.push_back(n_ + dof);
  gathered_q_ = A(dofs, columns);
  gathered_qd_ = A(speeds, columns);
  slope_.noalias() = MatX<double>(dynamics.dqdd_dq()(dofs, dofs)).lazyProduct(gathered_q_);
  slope_.noalias() += MatX<double>(dynamics.dqdd_dqd()(dofs, dofs)).lazyProduct(gathered_qd_);
  slope_.rightCols(part.parameters).noalias() -=
      MatX<double>(dynamics.inverse_mass_matrix()(dofs, dofs))
          .lazyProduct(MatX<double>(C_(dofs, Eigen::seqN(part.parameter, part.parameters))));
  dA(speeds, columns) = slope_;
}

/// C = ∂τ/∂x at q̈, at the links (armature and friction over 1 + ε): ∂q̈/∂x = −M⁻¹ C, or −S⁻¹ C.
void JointWindows::columns(int run, const MatX<double>& A) {
  C_.setZero(n_, f_);
  if (f_ == 0) return;
  const ForwardDynamics& dynamics = models_[now_].path.dynamics();
  const VecX<double>& qdd = dynamics.qdd();
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
  for (std::size_t e = 0; e < effects_.size(); ++e)
    if (acting_[e] != 0) add_columns(e, x, jets);
}

/// Columns of one effect's parameters, where it acts.
void JointWindows::add_columns(std::size_t e, const JointSample<double>& x,
                               const JointSample<JetD>& jets) {
  const VecX<double>& gains = models_[now_].path.dynamics().gains();
  OfEffect& of = of_effect_[e];
  for (const auto& [effect, share, shapes_alone] : of.parts) {
    const bool by_jets = !of.shapes.empty();
    // The torque is homogeneous in the linear parameters: one of them 1, the others 0.
    for (const auto& [index, column] : of.linear) {
      if (shapes_alone || by_jets) continue;
      for (const int j : effect.joints) scratch_[static_cast<std::size_t>(j)] = 0.0;
      double& p = of.off[static_cast<std::size_t>(index)];
      p = 1.0;
      add_torque(effect, x, of.off.data(), scratch_.data());
      p = 0.0;
      for (const int j : effect.joints)
        C_(j, column) += share * scratch_[static_cast<std::size_t>(j)] / gains[j];
    }
    if (!by_jets) continue;
    jet_p_.clear();
    for (const double p : effect.parameters) jet_p_.emplace_back(p);
    // One evaluation has the columns of all parameters, as far as a Jet has directions.
    moved_ = of.shapes;
    if (!shapes_alone) moved_.insert(moved_.end(), of.linear.begin(), of.linear.end());
    for (std::size_t first = 0; first < moved_.size(); first += kJetWidth) {
      const std::size_t count = std::min<std::size_t>(moved_.size() - first, kJetWidth);
      for (std::size_t i = 0; i < count; ++i) {
        const auto& [index, k] = moved_[first + i];
        JetD& p = jet_p_[static_cast<std::size_t>(index)];
        p.v.setZero();
        p.v[static_cast<long>(i)] = logarithmic_[static_cast<std::size_t>(k)] != 0 ? p.a : 1.0;
      }
      for (const int j : effect.joints) jet_tau_[static_cast<std::size_t>(j)] = JetD(0.0);
      add_torque(effect, jets, jet_p_.data(), jet_tau_.data());
      for (std::size_t i = 0; i < count; ++i) {
        const auto& [index, k] = moved_[first + i];
        jet_p_[static_cast<std::size_t>(index)].v.setZero();
        for (const int j : effect.joints)
          C_(j, k) +=
              share * jet_tau_[static_cast<std::size_t>(j)].v[static_cast<long>(i)] / gains[j];
      }
    }
  }
}

}  // namespace diffnea
