#include "diagnose/driven_rows.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/dynamics/constraint_projection.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

#include "identify/constrained_rows.hpp"

namespace diffnea {
DrivenRows::DrivenRows(const Model& model, const Preprocessed& first, const std::vector<int>& among)
    : tree_(make_tree(model)) {
  ConstrainedRows rows(model, nullptr, among);
  rows.choose(first, first.q.row(0).transpose());
  std::vector<int> leads = rows.chosen();
  std::ranges::sort(leads);
  shared_ = rows.mixes();
  loops_ = std::make_shared<LoopTorques>(tree_constraints(model), std::move(leads));
}

long DrivenRows::index_of(int row) const {
  return std::ranges::find(joints(), row) - joints().begin();
}

void DrivenRows::set_paths(const std::vector<JointSeries>& series) {
  maps_.clear();
  if (!closed()) return;
  for (const JointSeries& s : series) {
    std::vector<RowMatX<double>> of(joints().size(), RowMatX<double>(s.rows(), s.q.cols()));
    for (long k = 0; k < s.rows(); ++k) {
      const MatX<double> D = loops_->map(tree_, s.q.row(k).transpose());
      for (std::size_t i = 0; i < of.size(); ++i) of[i].row(k) = D.row(i);
    }
    maps_.push_back(std::move(of));
  }
}

bool DrivenRows::reaches(const std::vector<int>& joints, int row) const {
  if (!closed()) return std::ranges::find(joints, row) != joints.end();
  const std::size_t lead = static_cast<std::size_t>(index_of(row));
  return std::ranges::any_of(joints, [&](int j) {
    return std::ranges::any_of(maps_, [&](const std::vector<RowMatX<double>>& of) {
      return !of[lead].col(j).isZero(0.0);
    });
  });
}

RowMatX<double> DrivenRows::at(std::size_t stretch, int row, const std::vector<int>& joints,
                               const std::function<RowMatX<double>(int)>& of) const {
  if (!closed()) return of(row);
  const RowMatX<double>& D = maps_[stretch][index_of(row)];
  RowMatX<double> out;
  for (const int j : joints) {
    RowMatX<double> own = D.col(j).asDiagonal() * of(j);
    if (out.size() == 0)
      out = std::move(own);
    else
      out += own;
  }
  return out;
}

VecX<double> DrivenRows::inertias(const Tree<double>& tree, const VecX<double>& q) const {
  MassMatrixWorkspace<double, double> ws;
  const MatX<double>& M = mass_matrix<double, double>(tree, q, ws);
  VecX<double> out = M.diagonal();
  if (!closed()) return out;
  const MatX<double> D = loops_->map(tree, q);
  for (std::size_t i = 0; i < joints().size(); ++i) {
    const auto d = D.row(i);
    out[joints()[i]] = d * M * d.transpose();
  }
  return out;
}

/// With d = Dᵀ e_k the motion when lead k alone has the speed 1, the row of joint k lacks, of
/// errors δq of the path, dᵀM δq̈ = M_kk z̈ with M_kk = dᵀM d and z = dᵀM δq/M_kk. This z is what is
/// filtered, and what the encoders show together. Stiffness and damping are derivatives of the
/// lead's torque along the loop.
std::vector<LoopEquation> DrivenRows::equations(const Tree<double>& tree, const JointSeries& path,
                                                const std::vector<int>& leads,
                                                const SignalNoise& noise, int every) const {
  const long rows = path.rows(), n = path.q.cols();
  std::vector<LoopEquation> out(leads.size(), {JointEquation(rows), RowMatX<double>(rows, n)});
  const TreeConstraints<double>& constraints = loops_->constraints();
  MassMatrixWorkspace<double, double> mass;
  RneaWorkspace<double, double> ws;
  for (long begin = 0; begin < rows; begin += every) {
    const long count = std::min<long>(every, rows - begin), at = begin + count / 2;
    const VecX<double> q = path.q.row(at).transpose();
    const VecX<double> speed = path.qd.row(at)(joints()).transpose(),
                       change = path.qdd.row(at)(joints()).transpose();
    const MatX<double> M = mass_matrix<double, double>(tree, q, mass), D = loops_->map(tree, q);
    for (std::size_t k = 0; k < leads.size(); ++k) {
      const long lead = index_of(leads[k]);
      const VecX<double> d = D.row(lead).transpose(), Md = M * d;
      const double inertia = d.dot(Md);
      const auto torque = [&](double by_q, double by_speed) {
        const VecX<double> to = q + by_q * d;
        const MatX<double> D_to = loops_->map(tree, to);
        VecX<double> v = speed;
        v[lead] += by_speed;
        v = D_to.transpose() * v;
        const VecX<double> near = D_to.transpose() * change,
                           vd = project_accelerations(tree, constraints, to, v, near, joints());
        return D_to.row(lead).dot(rnea<double, double>(tree, to, v, vd, ws));
      };
      JointEquation& e = out[k].equation;
      const auto set = [&](VecX<double>& to, double value) {
        to.segment(begin, count).setConstant(value);
      };
      set(e.inertia, inertia);
      set(e.stiffness, (torque(kLinkStep, 0.0) - torque(-kLinkStep, 0.0)) / (2.0 * kLinkStep));
      set(e.damping, (torque(0.0, kLinkStep) - torque(0.0, -kLinkStep)) / (2.0 * kLinkStep));
      const VecX<double> weight = Md / inertia;
      set(e.variance, weight.cwiseProduct(noise.position).squaredNorm());
      set(e.density, d.cwiseAbs2().dot(noise.density));
      out[k].shown.middleRows(begin, count) = weight.transpose().replicate(count, 1);
    }
  }
  return out;
}

}  // namespace diffnea
