#include "excite/information.hpp"

#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>

#include "core/decompositions.hpp"

namespace diffnea {
namespace {

constexpr int kStates = 200;  ///< random states that show what depends on what
constexpr int kMostDrawn = 10 * kStates;  ///< tries of a loop, which need not close at all
/// A column that others reproduce but for this share of its size depends on them; rounding leaves
/// 1e-14, real dependence of states that nearly coincide 1e-4.
constexpr double kDependent = 1e-9;

/// The model but for effects that no fit of torques has columns of: they tell nothing of the base.
Model fitted_part(Model model) {
  std::erase_if(model.effects, [](const EffectSpec& e) {
    const Port port = find_effect(e.effect).port;
    return port != Port::kJointTorque && port != Port::kModelParameter;
  });
  return model;
}

}  // namespace

Information::Information(const Model& model, const std::vector<JointRange>& ranges, Rng& rng,
                         const LoopRows* loops)
    : tree_(extend(model).tree),
      layout_(make_layout(fitted_part(model), FitChoice{}, {0})),
      loops_(loops) {
  const long n = layout_.num_dofs, p = static_cast<long>(layout_.linear.size());
  links_ = inertial_parameters(tree_);
  prior_ = layout_.prior();
  noise_ = VecX<double>::Ones(n + layout_.base_rows);
  if (tree_.free_base) {
    tree_.gravity = {0.0, 0.0, 0.0};  // free fall
    recoil_.emplace(tree_);
  }
  effect_columns_.resize(layout_.effects.size());
  for (long c = 0; c < p; ++c)
    if (const int e = layout_.linear[static_cast<std::size_t>(c)].effect; e >= 0)
      effect_columns_[static_cast<std::size_t>(e)].push_back(static_cast<int>(c));
  for (std::size_t j = 0; j < ranges.size(); ++j)
    if (ranges[j].driven && !ranges[j].follows) measured_.push_back(static_cast<int>(j));
  for (int j = 0; j < layout_.base_rows; ++j) measured_.push_back(static_cast<int>(n) + j);

  const long m = static_cast<long>(measured_.size());
  MatX<double> all(kStates * m, p);
  RowMatX<double> F(num_rows(), p);
  VecX<double> q = VecX<double>::Zero(n), qd = q, qdd = q, torque(num_rows());
  for (long i = 0, drawn = 0; i < kStates; ++i, ++drawn) {
    for (long j = 0; j < n; ++j) {
      const JointRange& r = ranges[static_cast<std::size_t>(j)];
      const double moves = r.moves() ? 1.0 : 0.0;
      if (r.follows) continue;
      q[j] = r.middle + moves * rng.uniform(-r.half, r.half);
      qd[j] = moves * rng.uniform(-r.velocity, r.velocity);
      qdd[j] = moves * rng.uniform(-r.acceleration, r.acceleration);
    }
    if (loops_ && !loops_->complete(q, qd, qdd)) {
      if (drawn > kMostDrawn)
        throw ModelError("excite: the loops of '" + model.name +
                         "' close at few of the postures that were drawn; narrow the ranges "
                         "(--position-limit)");
      --i;
      continue;
    }
    fill(q.data(), qd.data(), qdd.data(), F, torque);
    all.middleRows(i * m, m) = F(measured_, Eigen::all);
  }
  scale_ = (all.colwise().norm() / std::sqrt(static_cast<double>(kStates))).transpose();
  const double largest = scale_.maxCoeff();
  for (double& s : scale_) s = s > kDependent * largest ? 1.0 / s : 0.0;
  for (long c = 0; c < p; ++c)
    if (layout_.linear[static_cast<std::size_t>(c)].fixed) scale_[c] = 0.0;
  Eigen::ColPivHouseholderQR<MatX<double>> qr;
  qr.setThreshold(kDependent);
  qr.compute(all * scale_.asDiagonal());
  for (long k = 0; k < qr.rank(); ++k) base_.push_back(qr.colsPermutation().indices()[k]);
}

void Information::fill(const double* q, const double* qd, const double* qdd, RowMatX<double>& F,
                       VecX<double>& torque) {
  const long n = layout_.num_dofs;
  using Map = Eigen::Map<const VecX<double>>;
  F.setZero();
  if (recoil_) {
    recoil_->at(q, qd, qdd);
    const RowMatX<double>& Y = torque_regressor<double, double>(tree_, VecIn<double>(recoil_->q),
                                                                VecIn<double>(recoil_->v),
                                                                VecIn<double>(recoil_->vd), ws_);
    F.leftCols(Y.cols()) << Y.bottomRows(n), Y.topRows(kBaseVelocities);
    torque << Y.bottomRows(n) * links_, recoil_->reaction;
  } else {
    const RowMatX<double>& Y =
        torque_regressor<double, double>(tree_, Map(q, n), Map(qd, n), Map(qdd, n), ws_);
    F.leftCols(Y.cols()) = Y;
    torque.noalias() = Y * links_;
  }
  const VecX<double> transmitted = torque.head(n);
  JointSample<double> x;
  x.q = q;
  x.qd = qd;
  x.qdd = qdd;
  x.tau = transmitted.data();
  for (std::size_t e = 0; e < layout_.effects.size(); ++e) {
    const BoundEffect& effect = layout_.effects[e];
    const std::vector<int>& columns = effect_columns_[e];
    if (effect.info().port != Port::kJointTorque || columns.empty()) continue;
    scratch_.resize(columns.size() * static_cast<std::size_t>(n));
    linear_columns(effect, x, scratch_.data());
    for (std::size_t k = 0; k < columns.size(); ++k) {
      F.col(columns[k]).head(n) = Map(scratch_.data() + static_cast<long>(k) * n, n);
      torque.head(n) += prior_[columns[k]] * F.col(columns[k]).head(n);
    }
  }
  if (!loops_) return;
  const LoopMotion& loop = loops_->loop();
  const MatX<double> D = loop.lead_map(Map(q, n));
  const RowMatX<double> of_leads = D * F;
  F.setZero();
  F(loop.leads(), Eigen::all) = of_leads;
  if (loop.drives() == loop.leads()) {
    const VecX<double> tau = D * torque;
    torque.setZero();
    torque(loop.leads()) = tau;
  } else {
    torque = loop.at_drives(Map(q, n), torque);
  }
}

Information::Rows Information::rows(const MotionRows& motion) {
  const long count = motion.q.rows(), m = static_cast<long>(measured_.size());
  Rows out{RowMatX<double>(count * m, num_parameters()), RowMatX<double>(count, num_rows())};
  RowMatX<double> F(num_rows(), static_cast<long>(layout_.linear.size()));
  VecX<double> torque(num_rows());
  for (long i = 0; i < count; ++i) {
    fill(motion.q.row(i).data(), motion.qd.row(i).data(), motion.qdd.row(i).data(), F, torque);
    out.torque.row(i) = torque.transpose();
    for (long r = 0; r < m; ++r) {
      const int j = measured_[static_cast<std::size_t>(r)];
      for (std::size_t c = 0; c < base_.size(); ++c)
        out.columns(i * m + r, static_cast<long>(c)) =
            F(j, base_[c]) * scale_[base_[c]] / noise_[j];
    }
  }
  return out;
}

double log_det(const RowMatX<double>& columns) {
  MatX<double> G = MatX<double>::Zero(columns.cols(), columns.cols());
  G.selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose());
  const Eigen::LLT<MatX<double>> llt(G);
  const VecX<double> diagonal = MatX<double>(llt.matrixL()).diagonal();
  if (llt.info() != Eigen::Success || !(diagonal.minCoeff() > 1e-12 * diagonal.maxCoeff()))
    return -std::numeric_limits<double>::infinity();
  return 2.0 * diagonal.array().log().sum();
}

double condition_number(const RowMatX<double>& columns) {
  // The triangular factor has the singular values of the columns, and is square.
  const Eigen::HouseholderQR<MatX<double>> qr(columns);
  const long p = columns.cols();
  const VecX<double> s = Eigen::JacobiSVD<MatX<double>, Eigen::NoQRPreconditioner>(
                             MatX<double>(qr.matrixQR().topRows(p).triangularView<Eigen::Upper>()))
                             .singularValues();
  return s[s.size() - 1] > 0.0 ? s[0] / s[s.size() - 1] : std::numeric_limits<double>::infinity();
}

VecX<double> standard_errors(const RowMatX<double>& columns) {
  const Eigen::HouseholderQR<MatX<double>> qr(columns);
  const long p = columns.cols();
  const MatX<double> inverse =
      qr.matrixQR().topRows(p).triangularView<Eigen::Upper>().solve(MatX<double>::Identity(p, p));
  return inverse.rowwise().norm();
}

}  // namespace diffnea
