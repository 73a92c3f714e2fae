#include "dynamics/loop_motion.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/dynamics/driven_torques.hpp>
#include <diffnea/model/lock.hpp>

#include "core/decompositions.hpp"
#include "core/number_text.hpp"
#include "dynamics/closed_posture.hpp"

namespace diffnea {
namespace {

/// Way of a follower from where it was expected that is a jump to another assembly [rad, m].
constexpr double kJump = 0.5;
constexpr double kStride = 0.05;  ///< largest way of a leading joint between two postures [rad, m]
/// Firmness of a posture that counts as held at all: followers a thousand times as fast.
constexpr double kDeadPoint = 1e-3;
/// Share of the largest column of Nᵀ from which a joint adds a motion.
constexpr double kAddsMotion = 1e-6;

double largest(const VecX<double>& x) { return x.size() > 0 ? x.cwiseAbs().maxCoeff() : 0.0; }

}  // namespace

LoopMotion::LoopMotion(std::string where, const Model& model)
    : where_(std::move(where)),
      name_(model.name),
      joints_(joint_names(model)),
      tree_(make_tree(model)),
      constraints_(tree_constraints(model)) {
  require_fixed_base(where_.c_str(), model);
  for (const ConstraintSpec& c : model.constraints)
    if (c.kind == ConstraintKind::kRolling)
      throw ModelError(where_ + ": wheel '" + c.name + "' of '" + name_ +
                       "' rolls: its place depends on the way there, not on the driven joints, and "
                       "is not simulated here; --open-loops (open_loops=True) reads the tree "
                       "without constraints");
  drives_ = driven_joints(model);
  find_home(model);
  choose_leads();
}

bool LoopMotion::leads(int joint) const { return std::ranges::find(leads_, joint) != leads_.end(); }

MatX<double> LoopMotion::jacobian(const VecX<double>& q) const {
  const VecX<double> still = VecX<double>::Zero(num_joints());
  return tree_rows(tree_, constraints_, q, still).J;
}

void LoopMotion::find_home(const Model& model) {
  VecX<double> rest(num_joints());
  for (int j = 0; j < num_joints(); ++j)
    rest[j] = resting_position(model, joints_[static_cast<std::size_t>(j)]);
  const ClosedPosture found = closed_posture(model, tree_, constraints_, rest);
  if (!found.closes)
    throw ModelError(where_ + ": no posture near where the joints of '" + name_ +
                     "' rest closes its loops: " + gap_text(found.q) +
                     "; expected lengths that close, or a `home` near a closed posture (`diffnea "
                     "info` shows every constraint's gap)");
  home_ = found.q;
}

void LoopMotion::choose_leads() {
  const MatX<double> N = constraint_null_space(jacobian(home_));
  const Eigen::Index motions = N.cols();
  if (motions > 0 && !drives_.empty()) {
    const Eigen::ColPivHouseholderQR<MatX<double>> qr(
        MatX<double>(N(drives_, Eigen::all).transpose()));
    const VecX<double> sizes = qr.matrixQR().diagonal().cwiseAbs();
    for (Eigen::Index k = 0; k < sizes.size(); ++k)
      if (sizes[k] > kAddsMotion)
        leads_.push_back(drives_[static_cast<std::size_t>(qr.colsPermutation().indices()[k])]);
    std::ranges::sort(leads_);
  }
  if (motions > 0 && static_cast<Eigen::Index>(leads_.size()) == motions) return;
  std::vector<std::string> driven;
  for (const int j : drives_) driven.push_back(joints_[static_cast<std::size_t>(j)]);
  std::vector<std::string> home;
  for (int j = 0; j < num_joints(); ++j)
    home.push_back(joints_[static_cast<std::size_t>(j)] + " = " + detail::number_text(home_[j], 4));
  // More than elsewhere, where a linkage is stretched.
  throw ModelError(
      where_ + ": constraints leave " + std::to_string(motions) + " of " +
      std::to_string(num_joints()) + " motions of '" + name_ + "' at " + detail::join(home) +
      (motions == 0
           ? ", so that nothing can move"
           : ", and joints with a drive hold " + std::to_string(leads_.size()) + " of them (" +
                 detail::join_or_none(driven) + "); expected as many drives as motions"));
}

bool LoopMotion::close(const VecX<double>& y, VecX<double>& q) const {
  VecX<double> at = q;
  at(leads_) = y;
  const ProjectedPositions found = project_positions(tree_, constraints_, at, closing(leads_));
  if (!(found.residual <= kClosedLoop) || largest(found.q - at) > kJump) return false;
  q = found.q;
  return true;
}

bool LoopMotion::move(const VecX<double>& y, VecX<double>& q) const {
  const VecX<double> from = positions_of_leads(q);
  const int steps = std::max(1, static_cast<int>(std::ceil(largest(y - from) / kStride)));
  MatX<double> S;
  for (int k = 1; k <= steps; ++k) {
    if (!(slopes(q, S) > kDeadPoint)) return false;
    const VecX<double> to = from + (static_cast<double>(k) / steps) * (y - from);
    VecX<double> next = q + S * (to - positions_of_leads(q));
    if (!close(to, next)) return false;
    q = next;
  }
  return slopes(q, S) > kDeadPoint;
}

bool LoopMotion::hold(VecX<double>& q, VecX<double>& qd) const {
  const ProjectedPositions found = project_positions(tree_, constraints_, q, closing({}));
  q = found.q;
  qd = project_velocities(tree_, constraints_, q, qd);
  return found.residual <= kClosedLoop;
}

double LoopMotion::slopes(const VecX<double>& q, MatX<double>& S) const {
  const MatX<double> N = constraint_null_space(jacobian(q));
  if (N.cols() != static_cast<Eigen::Index>(leads_.size())) return 0.0;
  const MatX<double> N_y = N(leads_, Eigen::all);
  const Eigen::JacobiSVD<MatX<double>> svd(N_y, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const VecX<double>& s = svd.singularValues();
  if (!(s[s.size() - 1] > kDeadPoint)) return 0.0;
  S = N * (svd.matrixV() * s.cwiseInverse().asDiagonal() * svd.matrixU().transpose());
  return s[s.size() - 1];
}

double LoopMotion::follow(const VecX<double>& q, VecX<double>& qd, VecX<double>& qdd) const {
  MatX<double> S;
  return follow(q, qd, qdd, S);
}

double LoopMotion::follow(const VecX<double>& q, VecX<double>& qd, VecX<double>& qdd,
                          MatX<double>& S) const {
  const double firm = slopes(q, S);
  if (!(firm > 0.0)) return 0.0;
  qd = S * VecX<double>(qd(leads_));
  qdd = project_accelerations(tree_, constraints_, q, qd, S * VecX<double>(qdd(leads_)), leads_);
  return firm;
}

long LoopMotion::follow(RowMatX<double>& q, RowMatX<double>& qd, RowMatX<double>& qdd,
                        VecX<double>& posture, double least) const {
  MatX<double> S;
  VecX<double> v, a;
  if (!(slopes(posture, S) > 0.0)) return 0;
  for (long k = 0; k < q.rows(); ++k) {  // S is that of the posture
    const VecX<double> y = q.row(k)(leads_).transpose();
    const VecX<double> step = y - positions_of_leads(posture);
    if (largest(step) > kStride) {
      if (!move(y, posture)) return k;
    } else {
      VecX<double> next = posture + S * step;
      if (!close(y, next)) return k;
      posture = next;
    }
    v = qd.row(k).transpose();
    a = qdd.row(k).transpose();
    if (!(follow(posture, v, a, S) >= least)) return k;
    q.row(k) = posture.transpose();
    qd.row(k) = v.transpose();
    qdd.row(k) = a.transpose();
  }
  return q.rows();
}

MatX<double> LoopMotion::torque_map(const VecX<double>& q) const {
  return driven_map(jacobian(q), drives_);
}

MatX<double> LoopMotion::lead_map(const VecX<double>& q) const {
  return driven_map(jacobian(q), leads_);
}

VecX<double> LoopMotion::at_drives(const VecX<double>& q, const VecX<double>& tau) const {
  const MatX<double> D = torque_map(q);
  if (D.rows() == 0) return {};
  VecX<double> out = VecX<double>::Zero(num_joints());
  out(drives_) = D * tau;
  return out;
}

VecX<double> loop_mobility(const Tree<double>& tree, const TreeConstraints<double>& constraints,
                           const VecX<double>& q, const MatX<double>& M) {
  const VecX<double> still = VecX<double>::Zero(tree.num_velocities());
  const MatX<double> N = constraint_null_space(tree_rows(tree, constraints, q, still).J);
  const Eigen::LDLT<MatX<double>> inertia(MatX<double>(N.transpose() * M * N));
  return (N * inertia.solve(MatX<double>(N.transpose()))).diagonal();
}

std::string LoopMotion::gap_text(const VecX<double>& q) const {
  const VecX<double> still = VecX<double>::Zero(num_joints());
  const TreeRows<double> at = tree_rows(tree_, constraints_, q, still);
  std::string name;
  double worst = -1.0;
  for (const ConstraintRow<double>& row : at.rows)
    if (std::abs(row.g) > worst) {
      worst = std::abs(row.g);
      name = row.name;
    }
  return "'" + name + "' is apart by " + detail::number_text(worst, 4) + " m or rad";
}

std::string LoopMotion::leads_text(const VecX<double>& q) const {
  std::string out;
  for (const int j : leads_)
    out += (out.empty() ? "" : ", ") + joints_[static_cast<std::size_t>(j)] + " = " +
           detail::number_text(q[j], 4);
  return out;
}

}  // namespace diffnea
