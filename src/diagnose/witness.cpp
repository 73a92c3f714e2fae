#include "diagnose/witness.hpp"

#include <algorithm>
#include <cmath>

#include "core/decompositions.hpp"
#include "diagnose/hats.hpp"
#include "diagnose/inexact.hpp"

namespace diffnea {
namespace {

constexpr int kKnotsAlone = 16, kKnotsPair = 6;
/// Functions of a joint that are tried on held-out data.
constexpr std::size_t kHeldOut = 8;

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

/// A function that fits what is left.
struct Promise {
  Basis basis;
  VecX<double> weights;
  double gain, delta_bic;
};

std::vector<Basis> bases(const Evidence& e, long of, const std::vector<std::string>& names) {
  const int joint = e.joints()[of];
  std::vector<Variable> single;
  for (int j = 0; j < e.num_dofs(); ++j) {
    single.push_back({"q_" + names[j], 0, j});
    single.push_back({"qd_" + names[j], 1, j});
  }
  single.push_back({"time", 2, -1});
  std::vector<Basis> out;
  for (const Variable& v : single) out.push_back({{v}, {knots(values(e, of, v), kKnotsAlone)}});
  const auto pair = [&](const Variable& a, const Variable& b) {
    out.push_back({{a, b}, {knots(values(e, of, a), kKnotsPair), knots(values(e, of, b), kKnotsPair)}});
  };
  const Variable q = single[2 * joint], qd = single[2 * joint + 1];
  pair(q, qd);
  for (int j = 0; j < e.num_dofs(); ++j)
    if (j != joint) {
      pair(q, single[2 * j]);
      pair(qd, single[2 * j + 1]);
    }
  return out;
}

/// Columns of terms, and what they leave where their linear parameters are 0, whitened, beside the
/// base.
struct Columns {
  MatX<double> S;
  VecX<double> left;
};

Columns columns_of(const Projection& projection, const std::vector<Term>& terms) {
  Columns out{MatX<double>(projection.residual().size(), 0), projection.residual()};
  for (const Term& t : terms) {
    out.S.conservativeResize(Eigen::NoChange, out.S.cols() + t.width());
    const MatX<double> columns = projection.expanded(t.beside);
    out.S.rightCols(t.width()) = columns.leftCols(t.width());
    if (t.has_offset()) out.left -= columns.col(t.width());
  }
  return out;
}

/// The terms as they fit beside another torque: an offset takes up what is constant in a function
/// of the time. @param torque  whitened, (rows())
std::vector<Term> beside(const Search& search, std::vector<Term> terms,
                         const VecX<double>& torque) {
  constexpr int kRounds = 4;  // enough for a spring, whose stiffness and rest are factors
  if (terms.empty()) return terms;
  const bool linear = std::ranges::none_of(terms, &Term::has_offset);
  for (int step = 0; step < (linear ? 1 : kRounds); ++step) {
    Columns of = columns_of(search.projection(), terms);
    of.left.head(torque.size()) -= torque;
    const VecX<double> x = Eigen::HouseholderQR<MatX<double>>(of.S).solve(of.left);
    long at = 0;
    for (Term& t : terms) {
      for (const int k : t.linear) t.effect.parameters[k] = x[at++];
      if (t.has_offset()) search.set_columns(t);
    }
  }
  return terms;
}

}  // namespace

std::vector<WitnessScore> find_witnesses(const Search& search, const std::vector<Term>& terms,
                                         const HeldOut& held_out,
                                         const std::vector<std::string>& names, double accept) {
  const Evidence& evidence = search.evidence();
  const Projection& projection = search.projection();
  const double n = static_cast<double>(search.rows());
  // The terms' columns are projected out too.
  const auto [S, left] = columns_of(projection, terms);
  const Eigen::HouseholderQR<MatX<double>> qr(S);
  const MatX<double> Q = columns_of_q(qr.householderQ(), S.rows(), S.cols());
  const VecX<double> r = left - Q * (Q.transpose() * left);
  const double chi2 = r.squaredNorm();
  const VecX<double> inexact = inexact_friction(search, terms, true);
  const Prediction before = held_out.predicted(search, terms);
  std::vector<WitnessScore> out;
  for (std::size_t k = 0; k < evidence.joints().size(); ++k) {
    const long own = k, m = evidence.times();
    // Rows of this joint in an orthonormal basis of all that is fitted: no other meets its torque.
    MatX<double> fitted(m, projection.rank() + Q.cols());
    fitted << projection.basis().middleRows(own * m, m), Q.middleRows(own * m, m);
    const double joint_chi2 = r.segment(own * m, m).squaredNorm();
    std::vector<Promise> promises;
    for (Basis& basis : bases(evidence, own, names)) {
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
      if (delta > accept && gain >= inexact[own])
        promises.push_back({std::move(basis), psi, gain, delta});
    }
    std::ranges::stable_sort(promises, std::greater<>{}, &Promise::delta_bic);
    WitnessScore best;
    best.joint = evidence.joints()[k];
    // Held out: the base gives way to the function on the fitted rows as it did above. A function
    // of two variables may fit best what one of another explains elsewhere.
    for (std::size_t i = 0; i < promises.size() && i < kHeldOut; ++i) {
      const Promise& p = promises[i];
      const VecX<double> there = p.basis.torque(evidence, own, p.weights);
      const VecX<double> here = p.basis.torque(held_out.evidence(), own, p.weights);
      VecX<double> torque = VecX<double>::Zero(evidence.rows());
      torque.segment(own * m, m) = search.whitener().joint(own, there.segment(own * m, m));
      const std::vector<Term> moved = beside(search, terms, torque);
      const HeldOutChange change = held_out.compare(
          before, held_out.predicted(search, held_out.errors_with(search, moved, there, here)));
      if (!change.helps() || (!best.variables.empty() && change.after >= best.held_out.after))
        continue;
      best.held_out = change;
      best.delta_bic = p.delta_bic;
      best.share = joint_chi2 > 0.0 ? std::min(p.gain / joint_chi2, 1.0) : 0.0;
      best.variables.clear();
      for (const Variable& v : p.basis.variables) best.variables.push_back(v.name);
    }
    if (!best.variables.empty()) out.push_back(best);
  }
  std::ranges::sort(out, std::greater<>{}, &WitnessScore::delta_bic);
  return out;
}

}  // namespace diffnea
