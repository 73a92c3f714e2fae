#include <algorithm>
#include <cmath>
#include <numeric>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/identify/torque_regression.hpp>

#include "core/decompositions.hpp"
#include "identify/constrained_rows.hpp"
#include "identify/passes.hpp"
#include "identify/state_rows.hpp"

namespace diffnea {
namespace {

/// Rows that are kept together or not at all [rows]: many times as long as residuals remember.
constexpr long kStretch = 1024;
/// Of these the first of all are kept in any case: plots show them.
constexpr long kFirstStretches = 4;
/// Beyond it the runs' beginnings alone are too many, and later ones are left out.
constexpr long kLargestStride = 1L << 20;

}  // namespace

TorqueRegression::TorqueRegression(const Model& model, const FitLayout& layout,
                                   const PreprocessPlan& plan, const RegressionPoint& at,
                                   const RegressionOptions& options)
    : model_(model), layout_(layout), at_(at), options_(options), effects_(layout.effects) {
  const int n = layout.num_dofs, rows = layout.num_rows();
  const int p = static_cast<int>(layout.linear.size());
  effect_column_.resize(effects_.size());
  for (int c = 0; c < p; ++c)
    if (layout.linear[c].effect >= 0) {
      effect_column_[layout.linear[c].effect].push_back(c);
      effects_[layout.linear[c].effect].parameters[layout.linear[c].index] = at.linear[c];
    }
  for (std::size_t s = 0; s < layout.shape.size(); ++s) {
    const FitParameter& shape = layout.shape[s];
    if (shape.kinematic < 0)
      effects_[shape.effect].parameters[shape.index] = at.shape[s];
    else if (shape.kinematic == 0 &&
             !std::all_of(layout.shape.begin() + s, layout.shape.begin() + s + 6,
                          [](const auto& k) { return k.fixed; }))
      moved_shape_.push_back(static_cast<int>(s));
    if (!shape.fixed) free_shapes_.push_back(static_cast<int>(s));
  }
  for (const BoundEffect& e : effects_)
    tree_of_run_ = tree_of_run_ || (!e.runs.empty() && e.info().port == Port::kModelParameter);
  if (!model.constraints.empty()) {
    const std::string here = "identify: '" + model.name + "' has constraints, beside which ";
    if (!moved_shape_.empty()) throw ModelError(here + "fixed transforms are not fitted");
    if (reads_links(layout))
      throw ModelError(here + "effects that follow the transmitted torque are not fitted");
    if (options.acceleration) throw ModelError(here + "the forward loss is not served");
    constraints_ = std::make_shared<ConstrainedRows>(model, &plan, options.leads);
  }
  enter_run(-1);
  full_ = RowMatX<double>::Zero(rows, p + static_cast<int>(free_shapes_.size()) + 1);
  links_.resize(n);
  for (int j = 0; j < rows; ++j) {
    std::vector<int> columns = layout.columns_of_row(tree_, j);
    for (std::size_t s = 0; s < free_shapes_.size(); ++s) {
      const FitParameter& shape = layout.shape[free_shapes_[s]];
      if (shape.kinematic >= 0 || j >= n ||
          effects_[shape.effect].info().port == Port::kModelParameter ||
          std::ranges::find(effects_[shape.effect].joints, j) !=
              effects_[shape.effect].joints.end())
        columns.push_back(p + static_cast<int>(s));
    }
    if (options.acceleration || constraints_) {  // M⁻¹, or D, mixes the joints
      columns.resize(full_.cols() - 1);
      std::iota(columns.begin(), columns.end(), 0);
    }
    double smoothing = 0.0;
    for (const BoundEffect& e : layout.effects)  // of the model: the same rows at every pass
      for (std::size_t k = 0; k < e.parameter_info.size(); ++k)
        if (e.parameter_info[k].name == "smoothing" &&
            std::ranges::find(e.joints, j) != e.joints.end())
          smoothing = std::max(smoothing, e.parameters[k]);
    joints_.push_back({.columns = columns,
                       .decimator = Decimator(plan.decimator),
                       .rest_speed = options.rest_speed * smoothing});
    factors_.push_back({columns, TriangularFactor(static_cast<int>(columns.size()))});
    kept_.push_back(
        {.width = static_cast<long>(columns.size()) + 1, .step = plan.dt * plan.decimator.factor});
  }
}

/// @param run  numbered as effects name it
void TorqueRegression::enter_run(int run) {
  if (run >= 0 && !tree_of_run_) return;
  run_of_effects_ = run;
  tree_ = extend(apply_fit(model_, layout_, at_.linear, at_.shape), {}, run).tree;
  moved_.clear();
  for (const int s : moved_shape_) add_moved_tree(s);
  changed_.clear();
  for (const int s : free_shapes_)
    if (layout_.shape[s].kinematic < 0) {
      const EffectInfo& info = effects_[layout_.shape[s].effect].info();
      if (info.port == Port::kModelParameter && !info.has(Trait::kGravity)) add_changed_tree(s);
    }
}

/// The tree with one parameter seeded of an effect that changes it in a way of its own.
void TorqueRegression::add_changed_tree(int shape) {
  const FitParameter& parameter = layout_.shape[shape];
  const BoundEffect& effect = effects_[parameter.effect];
  Model without = apply_fit(model_, layout_, at_.linear, at_.shape);
  std::erase_if(without.effects, [&](const EffectSpec& e) {
    return e.effect == effect.info().name && e.where == effect.where;
  });
  Tree<JetD> tree = extend(without, {}, run_of_effects_).tree.template cast<JetD>();
  std::vector<JetD> p(effect.parameters.begin(), effect.parameters.end());
  p[parameter.index].v[0] = parameter.logarithmic ? effect.parameters[parameter.index] : 1.0;
  add_to_tree(effect, p.data(), tree);
  changed_.insert_or_assign(shape, std::move(tree));
}

/// The tree with the six directions of one joint's fixed transform seeded.
void TorqueRegression::add_moved_tree(int first_shape) {
  VecX<double> still = at_.shape;
  std::vector<JetD> shape(static_cast<std::size_t>(still.size()));
  for (long s = 0; s < still.size(); ++s) {
    shape[s] = JetD(at_.shape[s]);
    if (layout_.shape[s].kinematic >= 0) still[s] = 0.0;
  }
  for (int k = 0; k < 6; ++k) shape[first_shape + k].v[k] = 1.0;
  Tree<JetD> tree = extend(apply_fit(model_, layout_, at_.linear, still), {}, run_of_effects_)
                        .tree.template cast<JetD>();
  move_joints(layout_, joint_carriers(model_), shape.data(), tree);
  moved_.push_back(std::move(tree));
}

void TorqueRegression::fill_row(const Preprocessed& block, const RowsOfState& states, long row) {
  const int n = layout_.num_dofs, base = layout_.base_rows;
  const VecX<double> q = states.q.row(row).transpose();
  VecX<double> v = states.v.row(row).transpose(), vd = states.vd.row(row).transpose();
  if (constraints_) constraints_->project(q, v, vd);
  const RowMatX<double>& Y = torque_regressor<double, double>(tree_, q, v, vd, ws_);
  const long links = Y.cols();  // inertial parameters come first in a layout
  full_.topLeftCorner(n, links) = Y.bottomRows(n);
  full_.bottomLeftCorner(base, links) = Y.topRows(base);
  links_.noalias() = full_.topLeftCorner(n, links) * at_.linear.head(links);
  JointSample<double> x;
  x.time = block.time[row] - run_start_;
  x.run = block.run + options_.first_run;
  x.q = block.q.row(row).data();
  x.qd = v.data() + base;
  x.qdd = vd.data() + base;
  x.tau = links_.data();
  for (std::size_t e = 0; e < effects_.size(); ++e) {  // payloads first: the links transmit them
    const BoundEffect& effect = effects_[e];
    if (effect.info().port != Port::kModelParameter) continue;
    for (std::size_t k = 0; k < effect_column_[e].size(); ++k) {
      const int c = effect_column_[e][k];
      full_.col(c).setZero();
      if (!effect.acts_in(x.run)) continue;
      full_.col(c) = full_.col(kThetaSize * effect.links.at(0) + static_cast<long>(k));
      links_ += at_.linear[c] * full_.col(c).head(n);
    }
  }
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    const BoundEffect& effect = effects_[e];
    const std::vector<int>& columns = effect_column_[e];
    if (!effect.acts_in(x.run)) {
      for (const int c : columns) full_.col(c).setZero();
    } else if (effect.info().port == Port::kJointTorque) {
      scratch_.resize(columns.size() * n);
      linear_columns(effect, x, scratch_.data());
      for (std::size_t k = 0; k < columns.size(); ++k)
        full_.col(columns[k]).head(n) = Eigen::Map<const VecX<double>>(scratch_.data() + k * n, n);
    }
  }
  add_shape_columns(x, q, v, vd);
  full_.col(full_.cols() - 1).head(n) = block.tau.row(row).transpose();
  if (base > 0) full_.col(full_.cols() - 1).tail(base) = block.base_wrench.row(row).transpose();
  if (constraints_) {
    constraints_->eliminate(tree_, q, block.time[row], full_);
    for (int r = 0; r < full_.rows(); ++r)  // rounding is no torque
      if (constraints_->is_zero(r)) full_(r, full_.cols() - 1) = 0.0;
  }
  if (options_.acceleration) linearise_acceleration(block.q.row(row).transpose(), x.run);
}

/// [∂τ̂/∂x | τ] becomes [J | J x − r] at the present x: r = M⁻¹(τ̂ − τ) = q̈ − f̂(x) is the error of
/// the forward dynamics (paper, eq. 2), J = ∂r/∂x = M⁻¹(∂τ̂/∂x − ∂M/∂x r), where ∂M/∂x r is the
/// regressor of the acceleration r at rest without gravity.
void TorqueRegression::linearise_acceleration(const VecX<double>& q, int run) {
  const int n = layout_.num_dofs, p = static_cast<int>(layout_.linear.size());
  const auto M = mass_matrix<double, double>(tree_, q, mass_ws_).llt();
  const VecX<double> r =
      M.solve(full_.leftCols(p) * at_.linear - full_.col(full_.cols() - 1)).eval();
  const Vec3<double> gravity = tree_.gravity;
  tree_.gravity = {0, 0, 0};
  const RowMatX<double>& Y =
      torque_regressor<double, double>(tree_, q, VecX<double>::Zero(n), r, ws_);
  tree_.gravity = gravity;
  full_.leftCols(Y.cols()) -= Y;
  for (std::size_t e = 0; e < effects_.size(); ++e) {
    const BoundEffect& effect = effects_[e];
    if (!effect.acts_in(run)) continue;
    for (std::size_t k = 0; k < effect_column_[e].size(); ++k) {
      const int c = effect_column_[e][k];
      if (effect.info().port == Port::kModelParameter)
        full_.col(c) -= Y.col(kThetaSize * effect.links.at(0) + static_cast<long>(k));
      else if (effect.info().has(Trait::kRotor)) {
        const double ratio = effect.follows.empty() ? 1.0 : effect.follows[0].ratio;
        full_(effect.joints.at(0), c) -= ratio * ratio * r[effect.joints.at(0)];
      }
    }
  }
  full_ = M.solve(full_).eval();
  full_.col(full_.cols() - 1) = full_.leftCols(p) * at_.linear - r;
}

/// ∂τ/∂(ln η), or ∂τ/∂η where η may be 0, by Jets through the effect's own formula; ∂τ/∂x of fixed
/// transforms, and of effects that change the tree, by Jets through RNEA; ∂τ/∂g of the base's tilt,
/// in which torque is linear.
/// @param q, v, vd  the same instant with the base, where it floats
void TorqueRegression::add_shape_columns(const JointSample<double>& x, const VecX<double>& q,
                                         const VecX<double>& v, const VecX<double>& vd) {
  const int n = layout_.num_dofs;
  const int p = static_cast<int>(layout_.linear.size());
  for (std::size_t m = 0; m < moved_.size(); ++m) {
    const VecX<JetD>& tau = rnea<JetD, double>(moved_[m], q, v, vd, jet_ws_);
    for (std::size_t s = 0; s < free_shapes_.size(); ++s) {
      const int k = free_shapes_[s] - moved_shape_[m];
      if (k < 0 || k > 5) continue;
      for (int j = 0; j < full_.rows(); ++j)
        full_(j, p + static_cast<int>(s)) = tau[coordinate(j)].v[k];
    }
  }
  for (std::size_t s = 0; s < free_shapes_.size(); ++s) {
    const FitParameter& shape = layout_.shape[free_shapes_[s]];
    if (shape.kinematic >= 0) continue;
    const BoundEffect& effect = effects_[shape.effect];
    if (!effect.acts_in(x.run)) {
      full_.col(p + static_cast<long>(s)).setZero();
      continue;
    }
    if (effect.info().has(Trait::kGravity)) {
      full_.col(p + static_cast<long>(s)) = torque_of_gravity(shape.index, q);
      continue;
    }
    if (const auto changed = changed_.find(free_shapes_[s]); changed != changed_.end()) {
      const VecX<JetD>& tau = rnea<JetD, double>(changed->second, q, v, vd, jet_ws_);
      for (int j = 0; j < full_.rows(); ++j)
        full_(j, p + static_cast<int>(s)) = tau[coordinate(j)].v[0];
      continue;
    }
    std::vector<JetD> p_jet(effect.parameters.begin(), effect.parameters.end());
    p_jet[shape.index].v[0] = shape.logarithmic ? effect.parameters[shape.index] : 1.0;
    std::vector<JetD> state(4 * n), tau(n, JetD(0.0));
    for (int j = 0; j < n; ++j) {
      state[j] = JetD(x.q[j]);
      state[n + j] = JetD(x.qd[j]);
      state[2 * n + j] = JetD(x.qdd[j]);
      state[3 * n + j] = JetD(x.tau[j]);
    }
    const JointSample<JetD> xj{x.time, x.run, &state[0], &state[n], &state[2 * n], &state[3 * n]};
    add_torque(effect, xj, p_jet.data(), tau.data());
    for (int j = 0; j < n; ++j) full_(j, p + static_cast<int>(s)) = tau[j].v[0];
  }
}

/// What 1 m/s² of gravity more along the base's x (0) or y (1) asks of the joints.
VecX<double> TorqueRegression::torque_of_gravity(int axis, const VecX<double>& q) {
  const Vec3<double> present = tree_.gravity;
  tree_.gravity = axis == 0 ? Vec3<double>{1, 0, 0} : Vec3<double>{0, 1, 0};
  const VecX<double> tau = gravity_torques<double, double>(tree_, q, rnea_ws_);
  tree_.gravity = present;
  VecX<double> out(full_.rows());
  for (int j = 0; j < full_.rows(); ++j) out[j] = tau[coordinate(j)];
  return out;
}

/// Share of each of the row's columns in M_jj: the torque at rest, without gravity, per unit of
/// acceleration, of all that moves with it where constraints tie it.
VecX<double> TorqueRegression::inertia_columns(int j, const VecX<double>& q) {
  const int n = layout_.num_rows();
  const Vec3<double> gravity = tree_.gravity;
  tree_.gravity = {0, 0, 0};
  const VecX<double> still = VecX<double>::Zero(n);
  const VecX<double> unit = constraints_ ? constraints_->unit_acceleration(j, q)
                                         : VecX<double>(VecX<double>::Unit(n, coordinate(j)));
  const RowMatX<double>& Y = torque_regressor<double, double>(tree_, q, still, unit, ws_);
  tree_.gravity = gravity;
  const std::vector<int>& columns = factors_[static_cast<std::size_t>(j)].columns;
  VecX<double> out = VecX<double>::Zero(static_cast<long>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const int c = columns[k];
    if (c < Y.cols()) {
      out[static_cast<long>(k)] = unit.dot(Y.col(c));
    } else if (c < static_cast<int>(layout_.linear.size()) && layout_.linear[c].effect >= 0) {
      const BoundEffect& effect = effects_[layout_.linear[c].effect];
      for (const int moved : effect.joints)
        if (effect.info().has(Trait::kRotor))
          out[static_cast<long>(k)] += std::pow(unit[coordinate(moved)], 2);
    }
  }
  return out;
}

/// Whether a joint's torque is known: measured, or passive and hence zero (a prescribed joint's is
/// NaN).
bool torque_known(const Preprocessed& block, int joint) {
  return block.has_tau[joint] || (block.rows() > 0 && !std::isnan(block.tau(0, joint)));
}

/// Index in the dynamics' velocities and torques, where the base leads.
int TorqueRegression::coordinate(int row) const {
  return row < layout_.num_dofs ? layout_.base_rows + row : row - layout_.num_dofs;
}

/// Tells whether a row is fitted: beside constraints those of the coordinates that were chosen. A
/// base's wrench is known: recorded, or zero.
bool TorqueRegression::is_fitted(const Preprocessed& block, int joint) const {
  if (constraints_) return constraints_->has(joint);
  return joint >= layout_.num_dofs || torque_known(block, joint);
}

void TorqueRegression::add(const Preprocessed& block) {
  const int n = layout_.num_dofs;
  long row = 0;
  dt_ = block.dt;
  for (int j = 0; options_.acceleration && j < n; ++j)
    if (!torque_known(block, j))
      throw DataError(block.source + ": the forward loss needs the torque of every joint, and " +
                      block.joint_names[static_cast<std::size_t>(j)] +
                      " has none; use the inverse loss, or declare the joint passive");
  const int rows = layout_.num_rows();
  const RowsOfState states(block);
  if (constraints_ && block.rows() > 0) constraints_->choose(block, states.q.row(0).transpose());
  if (constraints_ && constraints_->mixes())
    for (const BoundEffect& e : effects_)
      if (e.info().has(Trait::kGain))
        throw ModelError("identify: " + e.info().name + " at '" + e.where +
                         "' is not fitted where more joints are driven than constraints leave "
                         "motions; leave it out");
  const auto is_known_zero = [&](int j) {
    if (constraints_) return constraints_->is_zero(j);
    return j < n ? !block.has_tau[j] && torque_known(block, j) : !block.has_base_wrench;
  };
  for (int j = 0; !options_.acceleration && block.rows() > 0 && j < rows; ++j)
    if (is_known_zero(j) && factors_[j].inertia.size() == 0)
      factors_[j].inertia = inertia_columns(j, states.q.row(0).transpose());
  while (row < block.rows()) {
    const int segment = block.segment[row];
    if (segment != segment_ || block.run != run_) {
      for (Joint& j : joints_) {
        j.decimator.reset();
        j.emitted = 0;
      }
      if (block.run != run_) {
        for (Joint& j : joints_) j.of_run = 0;
        run_start_ = block.time[row];
        enter_run(block.run + options_.first_run);
      }
      segment_ = segment;
      run_ = block.run;
      segment_start_ = block.time[row];
    }
    long end = row;
    while (end < block.rows() && block.segment[end] == segment && end - row < 1024) ++end;
    for (int j = 0; j < rows; ++j)
      joints_[j].block.resize(end - row, static_cast<long>(joints_[j].columns.size()) + 3);
    for (long r = row; r < end; ++r) {
      fill_row(block, states, r);
      for (int j = 0; j < rows; ++j) {
        if (!is_fitted(block, j)) continue;
        Joint& joint = joints_[j];
        const long width = static_cast<long>(joint.columns.size());
        double* out = joint.block.row(r - row).data();
        for (long c = 0; c < width; ++c) out[c] = full_(j, joint.columns[c]);
        out[width] = full_(j, full_.cols() - 1);
        const double speed = states.v(r, coordinate(j));
        out[width + 1] = std::abs(speed) < joint.rest_speed ? 1.0 : 0.0;
        out[width + 2] = speed;
      }
    }
    for (int j = 0; j < rows; ++j)
      if (is_fitted(block, j)) flush(j, joints_[j].decimator.push(joints_[j].block));
    row = end;
  }
}

void TorqueRegression::flush(int j, const RowMatX<double>& decimated) {
  Joint& joint = joints_[j];
  const long width = static_cast<long>(joint.columns.size());
  const long p = static_cast<long>(layout_.linear.size());
  RowMatX<double> rows(decimated.rows(), width + 1);
  long moving = 0;
  for (long k = 0; k < decimated.rows(); ++k) {
    if (decimated(k, width + 1) > options_.rest_share) continue;
    rows.row(moving++) = decimated.row(k).head(width + 1);
    keep(j, joint.of_run + k, decimated.row(k).data(),
         segment_start_ + dt_ * static_cast<double>(joint.decimator.center(joint.emitted + k)));
    if (!options_.weight) continue;
    auto row = rows.row(moving - 1);
    double residual = -row[width];
    for (long c = 0; c < width; ++c)
      if (joint.columns[c] < p) residual += row[c] * at_.linear[joint.columns[c]];
    row *= std::sqrt(options_.weight(j, residual));
  }
  joint.emitted += decimated.rows();
  joint.of_run += decimated.rows();
  joint.at_rest += decimated.rows() - moving;
  if (options_.factored) factors_[j].factor.add(rows.topRows(moving));
}

void TorqueRegression::forget() {
  kept_bytes_ = 0;
  for (std::size_t j = 0; j < kept_.size(); ++j) {
    kept_[j].time.clear();
    kept_[j].run.clear();
    kept_[j].velocity.clear();
    kept_[j].values.clear();
    joints_[j].number.clear();
  }
}

/// @param number  of the row within its run  @param row  [columns | τ | at rest | q̇]
void TorqueRegression::keep(int j, long number, const double* row, double time) {
  JointRows& kept = kept_[j];
  ++kept.factored[run_];
  if (!is_kept(j, run_, number)) return;
  const long bytes = kept.width * static_cast<long>(sizeof(double));
  while (kept_bytes_ + bytes > options_.keep_bytes && stride_ < kLargestStride) thin_out();
  if (kept_bytes_ + bytes > options_.keep_bytes || !is_kept(j, run_, number)) return;
  kept_bytes_ += bytes;
  kept.values.insert(kept.values.end(), row, row + kept.width);
  kept.run.push_back(run_);
  kept.velocity.push_back(row[kept.width + 1]);
  kept.time.push_back(time);
  joints_[j].number.push_back(number);
}

bool TorqueRegression::is_kept(int j, int run, long number) const {
  const long stretch = number / kStretch;
  const bool first = kept_[j].factored.begin()->first == run && stretch < kFirstStretches;
  return first || stretch % stride_ == 0;
}

/// Every second stretch of the kept ones goes, of all joints alike.
void TorqueRegression::thin_out() {
  stride_ *= 2;
  kept_bytes_ = 0;
  for (std::size_t j = 0; j < kept_.size(); ++j) {
    JointRows& kept = kept_[j];
    std::vector<long>& number = joints_[j].number;
    std::size_t left = 0;
    for (std::size_t k = 0; k < number.size(); ++k) {
      if (!is_kept(static_cast<int>(j), kept.run[k], number[k])) continue;
      std::copy_n(kept.values.begin() + static_cast<long>(k) * kept.width, kept.width,
                  kept.values.begin() + static_cast<long>(left) * kept.width);
      kept.time[left] = kept.time[k];
      kept.run[left] = kept.run[k];
      kept.velocity[left] = kept.velocity[k];
      number[left++] = number[k];
    }
    kept.values.resize(left * static_cast<std::size_t>(kept.width));
    kept.time.resize(left);
    kept.run.resize(left);
    kept.velocity.resize(left);
    number.resize(left);
    kept_bytes_ += static_cast<long>(left) * kept.width * static_cast<long>(sizeof(double));
  }
}

}  // namespace diffnea
