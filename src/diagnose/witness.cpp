#include "diagnose/witness.hpp"

#include <algorithm>
#include <cmath>

#include "core/decompositions.hpp"
#include "diagnose/hats.hpp"
#include "diagnose/inexact.hpp"

namespace diffnea {
namespace {

constexpr int kKnotsAlone = 16, kKnotsPair = 6;

/// A channel that a residual may depend on.
struct Variable {
  std::string name;
  int kind;  ///< 0 q, 1 q̇, 2 time
  int joint;
};

/// @param of  whose rows the values go with, an index into the evidence's joints
VecX<double> values(const Evidence& e, long of, const Variable& v) {
  if (v.kind == 0) return e.q(of).col(v.joint);
  if (v.kind == 1) return e.qd(of).col(v.joint);
  return Eigen::Map<const VecX<double>>(e.time().data(), e.times());
}

/// A function of one or two variables in the torque of one joint.
struct Basis {
  std::vector<Variable> variables;
  std::vector<std::vector<double>> t;

  /// In the rows of that joint, (times(), functions).
  MatX<double> operator()(const Evidence& e, long joint_index) const {
    MatX<double> B = hats(values(e, joint_index, variables[0]), t[0]);
    if (variables.size() == 2) {
      const MatX<double> A = B, C = hats(values(e, joint_index, variables[1]), t[1]);
      B.resize(A.rows(), A.cols() * C.cols());
      for (long a = 0; a < A.cols(); ++a)
        for (long c = 0; c < C.cols(); ++c)
          B.col(a * C.cols() + c) = A.col(a).cwiseProduct(C.col(c));
    }
    return B;
  }
  /// The torque with these weights, (rows()).
  VecX<double> torque(const Evidence& e, long joint_index, const VecX<double>& weights) const {
    VecX<double> out = VecX<double>::Zero(e.rows());
    out.segment(joint_index * e.times(), e.times()) = (*this)(e, joint_index) * weights;
    return out;
  }
};

std::vector<Basis> bases(const Evidence& e, long of, const std::vector<std::string>& names) {
  const int joint = e.joints()[static_cast<std::size_t>(of)];
  std::vector<Variable> single;
  for (int j = 0; j < e.num_dofs(); ++j) {
    single.push_back({"q_" + names[static_cast<std::size_t>(j)], 0, j});
    single.push_back({"qd_" + names[static_cast<std::size_t>(j)], 1, j});
  }
  single.push_back({"time", 2, -1});
  std::vector<Basis> out;
  for (const Variable& v : single) out.push_back({{v}, {knots(values(e, of, v), kKnotsAlone)}});
  const auto pair = [&](const Variable& a, const Variable& b) {
    out.push_back({{a, b}, {knots(values(e, of, a), kKnotsPair), knots(values(e, of, b), kKnotsPair)}});
  };
  const Variable q = single[2 * static_cast<std::size_t>(joint)],
                 qd = single[2 * static_cast<std::size_t>(joint) + 1];
  pair(q, qd);
  for (int j = 0; j < e.num_dofs(); ++j)
    if (j != joint) {
      pair(q, single[2 * static_cast<std::size_t>(j)]);
      pair(qd, single[2 * static_cast<std::size_t>(j) + 1]);
    }
  return out;
}

}  // namespace

std::vector<WitnessScore> find_witnesses(const Evidence& evidence, const Search& search,
                                         const std::vector<Term>& terms, const HeldOut& held_out,
                                         const std::vector<std::string>& names, double accept) {
  const Projection& projection = search.projection();
  const double n = static_cast<double>(search.rows());
  // The terms' columns are projected out too.
  MatX<double> S(projection.residual().size(), 0);
  VecX<double> left = projection.residual();
  for (const Term& t : terms) {
    S.conservativeResize(Eigen::NoChange, S.cols() + t.width());
    const MatX<double> columns = projection.expanded(t.beside);
    S.rightCols(t.width()) = columns.leftCols(t.width());
    if (t.has_offset()) left -= columns.col(t.width());
  }
  const Eigen::HouseholderQR<MatX<double>> qr(S);
  const MatX<double> Q = columns_of_q(qr.householderQ(), S.rows(), S.cols());
  const VecX<double> r = left - Q * (Q.transpose() * left);
  const double chi2 = r.squaredNorm();
  const VecX<double> inexact = inexact_friction(search, terms, true);
  const Prediction before = held_out.predicted(search, terms);
  std::vector<WitnessScore> out;
  for (std::size_t k = 0; k < evidence.joints().size(); ++k) {
    const int joint = evidence.joints()[k];
    WitnessScore best;
    best.joint = joint;
    const Basis* best_basis = nullptr;
    double best_gain = 0.0;
    VecX<double> best_psi;
    const long own = static_cast<long>(k), m = evidence.times();
    // Rows of this joint in an orthonormal basis of all that is fitted: no other meets its torque.
    MatX<double> fitted(m, projection.rank() + Q.cols());
    fitted << projection.basis().middleRows(own * m, m), Q.middleRows(own * m, m);
    const std::vector<Basis> all = bases(evidence, own, names);
    for (const Basis& basis : all) {
      const MatX<double> B = search.whitener().joint(own, basis(evidence, own));
      const MatX<double> in_fitted = fitted.transpose() * B;
      MatX<double> K = B.transpose() * B - in_fitted.transpose() * in_fitted;
      const double ridge = 1e-6 * std::max(K.diagonal().maxCoeff(), 1e-300);
      K.diagonal().array() += ridge;
      const VecX<double> b = B.transpose() * r.segment(own * m, m);
      const VecX<double> psi = K.ldlt().solve(b);
      const double gain = 2.0 * b.dot(psi) - psi.dot(K * psi);
      const double delta = search.cost(chi2) - search.cost(chi2 - gain) -
                           static_cast<double>(b.size()) * std::log(n);
      if (best_basis && delta <= best.delta_bic) continue;
      best.delta_bic = delta;
      best_basis = &basis;
      best_gain = gain;
      best_psi = psi;
      const double joint_chi2 =
          r.segment(own * m, m).squaredNorm();
      best.share = joint_chi2 > 0.0 ? std::min(gain / joint_chi2, 1.0) : 0.0;
    }
    if (!best_basis || best.delta_bic <= accept || best_gain < inexact[own])
      continue;
    for (const Variable& v : best_basis->variables) best.variables.push_back(v.name);
    // Held out: the base gives way to the function on the fitted rows as it did above.
    const VecX<double> there = best_basis->torque(evidence, own, best_psi);
    const VecX<double> here = best_basis->torque(held_out.evidence(), own, best_psi);
    best.held_out = held_out.compare(
        before, held_out.predicted(search, held_out.errors_with(search, terms, there, here)));
    if (best.held_out.helps()) out.push_back(best);
  }
  std::ranges::sort(out, std::greater<>{}, &WitnessScore::delta_bic);
  return out;
}

}  // namespace diffnea
