#include "motion/limb_windows.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"

namespace diffnea {

LimbWindows::LimbWindows(const Limb& limb, std::vector<ModelOfRuns> models,
                         std::vector<BoundEffect> effects,
                         const std::vector<MotionParameter>& parameters,
                         const SteppingOptions& options)
    : acting_(effects.size(), 1),
      first_(limb.first),
      joints_(limb.count),
      n_(joints_),
      f_(static_cast<int>(parameters.size())),
      effects_(std::move(effects)),
      of_effect_(effects_.size()) {
  for (ModelOfRuns& m : models) {
    MotionPath path(std::move(m.model), options, first_);
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
  for (int k = 0; k < f_; ++k) add_parameter(parameters[static_cast<std::size_t>(k)], k);
  const std::size_t n = static_cast<std::size_t>(n_);
  jet_q_.resize(n);
  jet_qd_.resize(n);
  jet_qdd_.resize(n);
  jet_load_.resize(n);
  jet_tau_.resize(n);
  scratch_.assign(n, 0.0);
}

/// @param column  of C
void LimbWindows::add_parameter(const MotionParameter& p, int column) {
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

MotionPath& LimbWindows::enter(int run) {
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

/// First state of a window and its sensitivities. Hidden sides move as what encoders read does, but
/// for what gravity and the links' motion wind up.
void LimbWindows::begin(const MotionStretch& stretch, const MotionWindow& window) {
  A_.setZero(2 * n_, 1 + 2 * joints_ + f_);
  for (const int half : {0, 1}) {
    A_.block(half * n_, 1 + half * joints_, joints_, joints_).setIdentity();
    for (const HiddenRotor& r : rotors().rotors())
      A_.row(half * n_ + r.rotor) = A_.row(half * n_ + r.joint);
  }
  A_.col(0) = models_[now_].path.first_state(stretch, window);
  begin_integrators(stretch, window);
  if (rotors().rotors().empty()) return;
  const VecX<double> state = models_[now_].path.own_state(window);
  q_.resize(n_);
  qd_.resize(n_);
  for (int dof = 0; dof < n_; ++dof) {
    q_[dof] = state[rotors().joint_of(dof)];
    qd_[dof] = state[joints_ + rotors().joint_of(dof)];
  }
  const VecX<double> still = VecX<double>::Zero(n_);
  const Tree<double>& tree = models_[now_].path.dynamics().model().tree;
  rnea_derivatives(tree, q_, qd_, still, hanging_);
  hanging_.tau.head(joints_) -= models_[now_].path.pushes(stretch, window.first);
  torque_regressor<double, double>(models_[now_].geometry, q_, qd_, still, ws_);
  for (const HiddenRotor& r : rotors().rotors()) begin_hidden(r);
}

/// Sensitivities of what drives have summed up before a window, by the parameters of their laws.
void LimbWindows::begin_integrators(const MotionStretch& stretch, const MotionWindow& window) {
  for (const DriveIntegrator& i : rotors().integrators()) {
    const JetD sum = models_[now_].path.summed_before(i, stretch, window);
    const auto acts = [&](const EffectPart& p) { return p.effect.joints.front() == i.dof; };
    const auto sets_rate = [&](const EffectPart& p) {
      return p.effect.info().has(Trait::kIntegrates) &&
             p.effect.joints.front() == rotors().drive(i.joint);
    };
    for (const OfEffect& of : of_effect_)
      for (const auto& [index, column] : of.shapes) {
        double& entry = A_(n_ + i.dof, 1 + 2 * joints_ + column);
        const bool by_factor = logarithmic_[static_cast<std::size_t>(column)] != 0;
        if (std::ranges::any_of(of.parts, acts))
          entry += sum.v[index] * (by_factor ? of.off[static_cast<std::size_t>(index)] : 1.0);
        else if (std::ranges::any_of(of.parts, sets_rate))
          entry += sum.v[7];
      }
  }
}

/// Adds what winds a gear up at the beginning to the sensitivities of its hidden side.
void LimbWindows::begin_hidden(const HiddenRotor& r) {
  const double side = r.read ? -1.0 : 1.0;
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
  for (int dof = 0; dof < n_; ++dof) {
    const int j = rotors().joint_of(dof);
    row[1 + j] += by_load * hanging_.dtau_dq(r.joint, dof);
    row[1 + joints_ + j] += by_load * hanging_.dtau_dqd(r.joint, dof);
  }
  auto by_parameter = row.tail(f_);
  for (const OfLink& of : of_link_)
    if (of.effect < 0 || acting_[static_cast<std::size_t>(of.effect)] != 0)
      by_parameter[of.free] += by_load * ws_.Y(r.joint, of.column);
  for (const OfEffect& of : of_effect_)
    for (const auto& [index, column] : of.shapes)
      if (std::ranges::any_of(of.parts, [&](const EffectPart& p) {
            return p.effect.is_gear && p.effect.joints.back() == r.rotor;
          }))
        by_parameter[column] += side * wound.v[1 + index] *
                                (logarithmic_[static_cast<std::size_t>(column)] != 0
                                     ? r.gear.parameters[static_cast<std::size_t>(index)]
                                     : 1.0);
}

bool LimbWindows::linearise(const MotionStretch& stretch, const MotionWindow& window,
                            const VecX<double>& sigma, std::span<TriangularFactor> rows) {
  constexpr long kBlock = 256;  // rows of the stretch that are handed to the factor at once
  const int width = 2 * joints_ + f_;
  MotionPath& path = enter(stretch.run);
  begin(stretch, window);
  block_.resize(kBlock * joints_, width + 1);
  long filled = 0;
  std::size_t part = 0;
  const auto hand_on = [&] {
    rows[part].add(block_.topRows(filled));
    filled = 0;
  };
  const long reached = path.integrate(
      stretch, window, A_,
      [&](const VecX<double>& u, const MatX<double>& at, MatX<double>& d) {
        slope(stretch.run, u, at, d);
      },
      [&](long k, const MatX<double>& at) {
        const std::size_t now =
            static_cast<std::size_t>(k) * rows.size() / static_cast<std::size_t>(window.rows);
        if (now != part || filled + joints_ > block_.rows()) hand_on();
        part = now;
        for (int j = 0; j < joints_; ++j) {
          const double q = stretch.q(window.first + k, first_ + j);
          if (std::isnan(q)) continue;
          const int dof = rotors().encoder(j);
          const double noise = sigma[first_ + j];
          auto row = block_.row(filled++);
          row.head(width) = at.row(dof).tail(width) / noise;
          row[width] = (at(dof, 0) - q) / noise;
        }
      });
  hand_on();
  return reached == window.rows;
}

double LimbWindows::cost(const MotionStretch& stretch, const MotionWindow& window,
                         const VecX<double>& sigma) {
  double sum = 0.0;
  const long reached =
      enter(stretch.run).simulate(stretch, window, [&](long k, const MatX<double>& z) {
        for (int j = 0; j < joints_; ++j) {
          const double q = stretch.q(window.first + k, first_ + j);
          if (!std::isnan(q))
            sum += 0.5 * std::pow((z(rotors().encoder(j), 0) - q) / sigma[first_ + j], 2);
        }
      });
  return reached == window.rows ? sum : kInfinity;
}

void LimbWindows::positions(const MotionStretch& stretch, const MotionWindow& window,
                            RowMatX<double>& q) {
  enter(stretch.run).simulate(stretch, window, [&](long k, const MatX<double>& z) {
    for (int j = 0; j < joints_; ++j) q(k, first_ + j) = z(rotors().encoder(j), 0);
  });
}

bool LimbWindows::state_at(const MotionStretch& stretch, const MotionWindow& window, long row,
                           VecX<double>& out) {
  MotionWindow until = window;
  until.rows = row + 1;
  const long half = out.size() / 2;
  return enter(stretch.run).simulate(stretch, until, [&](long k, const MatX<double>& z) {
    for (int j = 0; j < joints_ && k == row; ++j)
      for (const int order : {0, 1})
        out[order * half + first_ + j] = z(order * n_ + rotors().encoder(j), 0);
  }) == row + 1;
}

void LimbWindows::torque_noise_reach(const MotionStretch& stretch, const MotionWindow& window,
                                     const VecX<double>& density, VecX<double>& out) {
  MotionPath& path = enter(stretch.run);
  ForwardDynamics& dynamics = path.dynamics();
  MatX<double> P = MatX<double>::Zero(2 * n_, 2 * n_), F(2 * n_, 2 * n_), B(n_, n_);
  VecX<double> u(n_), at_drives(n_);
  path.rotors().at_drives(density.segment(first_, joints_), at_drives);
  path.simulate(stretch, window, [&](long k, const MatX<double>& z) {
    if (k + 1 >= window.rows) return;
    const std::size_t row = static_cast<std::size_t>(window.first + k);
    const double h = stretch.time[row + 1] - stretch.time[row];
    path.act(stretch, path.logged(stretch, window.first + k), u);
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
  for (int j = 0; j < joints_; ++j) {
    const int dof = path.rotors().encoder(j);
    out[first_ + j] = std::sqrt(std::max(P(dof, dof), 0.0));
  }
}

/// d/dt [z | Z]: Z̈_q = ∂q̈/∂q Z_q + ∂q̈/∂q̇ Z_q̇ − M⁻¹ C in the parameters' columns.
void LimbWindows::slope(int run, const VecX<double>& u, const MatX<double>& A, MatX<double>& dA) {
  ForwardDynamics& dynamics = models_[now_].path.dynamics();
  dynamics.linearise(A.data(), A.data() + n_, u.data(), run);
  columns(run, A);
  dA.setZero(A.rows(), A.cols());
  dA.topRows(n_) = A.bottomRows(n_);
  auto out = dA.bottomRightCorner(n_, 2 * joints_ + f_);
  const auto columns_of = [&](const auto& rows) { return rows.rightCols(2 * joints_ + f_); };
  // Few rows: Eigen's blocked products would spend their time on packing.
  out.noalias() = dynamics.dqdd_dq().lazyProduct(columns_of(A.topRows(n_)));
  out.noalias() += dynamics.dqdd_dqd().lazyProduct(columns_of(A.bottomRows(n_)));
  out.rightCols(f_).noalias() -= dynamics.inverse_mass_matrix().lazyProduct(C_);
  dA.col(0).tail(n_) = dynamics.qdd();
}

/// C = ∂τ/∂x at q̈, at the links (armature and friction over 1 + ε): ∂q̈/∂x = −M⁻¹ C, or −S⁻¹ C.
void LimbWindows::columns(int run, const MatX<double>& A) {
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
void LimbWindows::add_columns(std::size_t e, const JointSample<double>& x,
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
