#pragma once

#include <diffnea/core/compiled.hpp>
#include <diffnea/core/error.hpp>
#include <diffnea/core/inlined.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/detail/ltl.hpp>

namespace diffnea {
namespace detail {

using States = std::vector<WorldStates::State>;

/// [w] S as a matrix by columns, S symmetric.
inline Mat3<double> skew_times(const Vec3<double>& w, const Sym3<double>& s) {
  return {{cross(w, Vec3<double>{s.xx, s.xy, s.xz}), cross(w, Vec3<double>{s.xy, s.yy, s.yz}),
           cross(w, Vec3<double>{s.xz, s.yz, s.zz})}};
}

/// B̄ [w; u]: angular Σ m r×(w×ẋ) = (tr G) w − Gᵀ w, linear w × Σ m ẋ.
inline Wrench<double> times_B(const WorldStates::State& l, const Vec3<double>& w) {
  const double trace = l.Gt.col[0].x + l.Gt.col[1].y + l.Gt.col[2].z;
  return {w * trace - l.Gt * w, cross(w, l.momentum)};
}
/// Angular part of B̄ᵀ s; the linear part is zero.
inline Vec3<double> transpose_times_B(const WorldStates::State& l, const Twist<double>& s) {
  const double trace = l.Gt.col[0].x + l.Gt.col[1].y + l.Gt.col[2].z;
  return s.angular * trace - transpose_times(l.Gt, s.angular) + cross(l.momentum, s.linear);
}

/// Poses, axes, twists, ψ̇, inertias and Coriolis terms of every link, in W.
inline void velocity_pass(const Tree<double>& tree, const double* q, const double* qd,
                          States& links) {
  links.resize(tree.num_links());
  for (int i = 0; i < tree.num_links(); ++i) {
    const Link<double>& link = tree.links[i];
    WorldStates::State& l = links[i];
    with_axis(link, [&](const auto& s_L) {
      const Pose<double> X_PL = joint_pose(link, s_L, q[i]);
      l.X_WL = link.parent < 0 ? X_PL : links[link.parent].X_WL * X_PL;
      l.s = to_parent(l.X_WL, s_L);
    });
    const Twist<double> V_P = link.parent < 0 ? zero_twist<double>() : links[link.parent].V;
    l.psid = ad(V_P, l.s);
    l.V = V_P + l.s * qd[i];
    l.M = to_parent(l.X_WL, link.inertia);
    const double half_trace = 0.5 * (l.M.I.xx + l.M.I.yy + l.M.I.zz);
    const Sym3<double> second_moment{half_trace - l.M.I.xx, -l.M.I.xy, -l.M.I.xz,
                                     half_trace - l.M.I.yy, -l.M.I.yz, half_trace - l.M.I.zz};
    const Mat3<double> spin = skew_times(l.V.angular, second_moment);
    const Vec3<double>& v = l.V.linear;
    l.momentum = v * l.M.m + cross(l.V.angular, l.M.h);                 // Σ m (v + ω×r)
    l.Gt = Mat3<double>{v * l.M.h.x, v * l.M.h.y, v * l.M.h.z} + spin;  // Σ m (v + ω×r) rᵀ
  }
}

/// Accelerations under q̈, wrenches, and the torques that they need.
inline void force_pass(const Tree<double>& tree, const double* qd, const double* qdd, States& links,
                       double* tau) {
  const int n = tree.num_links();
  const Twist<double> A0 = base_acceleration<double, double>(tree);
  for (int i = 0; i < n; ++i) {
    WorldStates::State& l = links[i];
    const int parent = tree.links[i].parent;
    l.A = (parent < 0 ? A0 : links[parent].A) + l.psid * qd[i] + l.s * qdd[i];
    l.F = l.M * l.A + minus_ad_star(l.V, l.M * l.V);
  }
  for (int i = n - 1; i >= 0; --i) {
    const Link<double>& link = tree.links[i];
    tau[i] = dot(links[i].s, links[i].F) + link.armature * qdd[i];
    if (link.parent >= 0) links[link.parent].F = links[link.parent].F + links[i].F;
  }
}

/// Sums inertias and Coriolis terms over subtrees; mass matrix, (n × n) row-major.
inline void composite_pass(const Tree<double>& tree, States& links, RowMatX<double>& M) {
  const int n = tree.num_links();
  M.setZero(n, n);
  for (int i = 0; i < n; ++i) links[i].M_c = links[i].M;
  for (int i = n - 1; i >= 0; --i) {
    const Link<double>& link = tree.links[i];
    WorldStates::State& l = links[i];
    l.U = l.M_c * l.s;
    M(i, i) = dot(l.s, l.U) + link.armature;
    for (int j = link.parent; j >= 0; j = tree.links[j].parent)
      M(i, j) = M(j, i) = dot(links[j].s, l.U);
    if (link.parent < 0) continue;
    WorldStates::State& p = links[link.parent];
    p.M_c = p.M_c + l.M_c;
    p.momentum = p.momentum + l.momentum;
    p.Gt = p.Gt + l.Gt;
  }
}

/// The four formulas of the header.
inline void derivative_pass(const Tree<double>& tree, States& links, RowMatX<double>& dtau_dq,
                            RowMatX<double>& dtau_dqd) {
  const int n = tree.num_links();
  const Twist<double> A0 = base_acceleration<double, double>(tree);
  dtau_dq.setZero(n, n);
  dtau_dqd.setZero(n, n);
  for (int i = 0; i < n; ++i) {
    WorldStates::State& l = links[i];
    const int parent = tree.links[i].parent;
    l.psidd = parent < 0 ? ad(A0, l.s) : ad(links[parent].A, l.s) + ad(links[parent].V, l.psid);

    const Wrench<double> dF_dq =
        times_B(l, l.psid.angular) * 2.0 + l.M_c * l.psidd + minus_ad_star(l.s, l.F);
    const Wrench<double> dF_dqd = (times_B(l, l.s.angular) + l.M_c * l.psid) * 2.0;
    const Vec3<double> Bt_s = transpose_times_B(l, l.s) * 2.0;
    dtau_dq(i, i) = dot(l.s, dF_dq);
    dtau_dqd(i, i) = dot(l.s, dF_dqd);
    for (int j = parent; j >= 0; j = tree.links[j].parent) {
      const WorldStates::State& a = links[j];
      dtau_dq(j, i) = dot(a.s, dF_dq);
      dtau_dqd(j, i) = dot(a.s, dF_dqd);
      dtau_dq(i, j) = dot(Bt_s, a.psid.angular) + dot(a.psidd, l.U);
      dtau_dqd(i, j) = dot(Bt_s, a.s.angular) + 2.0 * dot(a.psid, l.U);
    }
  }
}

/// out = −A B, all (n × n): at this size a plain loop over rows beats a general product.
inline void minus_product(const RowMatX<double>& A, const RowMatX<double>& B,
                          RowMatX<double>& out) {
  const Eigen::Index n = A.rows();
  out.setZero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    double* __restrict row = out.data() + i * n;
    for (Eigen::Index k = 0; k < n; ++k) {
      const double* __restrict b = B.data() + k * n;
      const double a = A(i, k);
      for (Eigen::Index j = 0; j < n; ++j) row[j] -= a * b[j];
    }
  }
}

/// Gᵀ A G, A with a row and a column a joint.
inline void project(const Coordinates& c, RowMatX<double>& A) {
  if (c.plain()) return;
  const RowMatX<double> of_joints = A;
  A.setZero(c.count, c.count);
  for (std::size_t i = 0; i < c.joints.size(); ++i)
    for (std::size_t j = 0; j < c.joints.size(); ++j)
      A(c.joints[i].dof, c.joints[j].dof) += c.joints[i].ratio * c.joints[j].ratio *
                                             of_joints(static_cast<long>(i), static_cast<long>(j));
}

/// Motion of all joints, from that of the coordinates.
class JointMotion {
 public:
  JointMotion(const Tree<double>& tree, const double* y, const double* yd,
              JointScratch<double, double>& scratch)
      : c_(tree.coordinates),
        scratch_(scratch),
        q_(c_.of_joints(y, true, scratch.q)),
        qd_(c_.of_joints(yd, false, scratch.qd)) {}
  const double* q() const { return q_; }
  const double* qd() const { return qd_; }

  /// force_pass under accelerations of the coordinates, τ_y into `tau`.
  void forces(const Tree<double>& tree, const double* ydd, States& links, double* tau) const {
    force_pass(tree, qd_, c_.of_joints(ydd, false, scratch_.qdd), links, scratch_.torques(c_, tau));
    if (!c_.plain()) c_.gather(scratch_.tau.data(), tau);
  }

 private:
  const Coordinates& c_;
  JointScratch<double, double>& scratch_;
  const double *q_, *qd_;
};

/// q̈ = M⁻¹(τ − c) after a velocity pass; leaves M's factor in `L`, and accelerations in `links`.
inline void solve_forward(const Tree<double>& tree, const JointMotion& motion, const double* tau,
                          States& links, RowMatX<double>& L, VecX<double>& qdd,
                          VecX<double>& bias) {
  const int n = tree.num_dofs();
  composite_pass(tree, links, L);
  project(tree.coordinates, L);
  qdd.setZero(n);
  bias.resize(n);
  motion.forces(tree, qdd.data(), links, bias.data());
  for (int i = 0; i < n; ++i) qdd[i] = tau[i] - bias[i];
  factor_ltl(tree, L);
  solve_ltl(tree, L, qdd.data(), 1);
}

}  // namespace detail

DIFFNEA_INLINE void rnea_derivatives(const Tree<double>& tree, VecIn<double> q, VecIn<double> qd,
                                     VecIn<double> qdd, RneaDerivatives& out) {
  const int n = tree.num_dofs();
  require_size("rnea_derivatives: q", q.size(), n, "joint");
  require_size("rnea_derivatives: qd", qd.size(), n, "joint");
  require_size("rnea_derivatives: qdd", qdd.size(), n, "joint");
  detail::States& links = out.scratch.links;
  out.tau.resize(n);
  call_inlined<double>([&] {
    const detail::JointMotion motion(tree, q.data(), qd.data(), out.scratch.joints);
    detail::velocity_pass(tree, motion.q(), motion.qd(), links);
    motion.forces(tree, qdd.data(), links, out.tau.data());
    detail::composite_pass(tree, links, out.M);
    detail::derivative_pass(tree, links, out.dtau_dq, out.dtau_dqd);
  });
  for (RowMatX<double>* A : {&out.M, &out.dtau_dq, &out.dtau_dqd})
    detail::project(tree.coordinates, *A);
}

DIFFNEA_INLINE void aba_derivatives(const Tree<double>& tree, VecIn<double> q, VecIn<double> qd,
                                    VecIn<double> tau, AbaDerivatives& out) {
  const int n = tree.num_dofs();
  require_size("aba_derivatives: q", q.size(), n, "joint");
  require_size("aba_derivatives: qd", qd.size(), n, "joint");
  require_size("aba_derivatives: tau", tau.size(), n, "joint");
  detail::States& links = out.scratch.links;
  call_inlined<double>([&] {
    const detail::JointMotion motion(tree, q.data(), qd.data(), out.scratch.joints);
    detail::velocity_pass(tree, motion.q(), motion.qd(), links);
    detail::solve_forward(tree, motion, tau.data(), links, out.L, out.qdd, out.tau);
    motion.forces(tree, out.qdd.data(), links, out.tau.data());
    detail::derivative_pass(tree, links, out.dtau_dq, out.dtau_dqd);
  });
  for (RowMatX<double>* A : {&out.dtau_dq, &out.dtau_dqd}) detail::project(tree.coordinates, *A);
  out.dqdd_dtau.setIdentity(n, n);
  detail::solve_ltl(tree, out.L, out.dqdd_dtau.data(), n);
  detail::minus_product(out.dqdd_dtau, out.dtau_dq, out.dqdd_dq);
  detail::minus_product(out.dqdd_dtau, out.dtau_dqd, out.dqdd_dqd);
}

DIFFNEA_INLINE const RowMatX<double>& forward_dynamics_parameter_jacobian(
    const Tree<double>& tree, VecIn<double> q, VecIn<double> qd, VecIn<double> tau,
    ParameterJacobianWorkspace& ws) {
  const int n = tree.num_dofs();
  require_size("forward_dynamics_parameter_jacobian: q", q.size(), n, "joint");
  require_size("forward_dynamics_parameter_jacobian: qd", qd.size(), n, "joint");
  require_size("forward_dynamics_parameter_jacobian: tau", tau.size(), n, "joint");
  const int columns = kThetaSize * tree.num_links();
  ws.dqdd_dpi.resize(n, columns);
  call_inlined<double>([&] {
    const detail::JointMotion motion(tree, q.data(), qd.data(), ws.scratch.joints);
    detail::velocity_pass(tree, motion.q(), motion.qd(), ws.scratch.links);
    detail::solve_forward(tree, motion, tau.data(), ws.scratch.links, ws.L, ws.qdd, ws.bias);
    detail::torque_regressor(tree, q.data(), qd.data(), ws.qdd.data(), ws.motion,
                             ws.dqdd_dpi.data(), columns);
  });
  ws.dqdd_dpi *= -1.0;
  detail::solve_ltl(tree, ws.L, ws.dqdd_dpi.data(), columns);
  return ws.dqdd_dpi;
}

}  // namespace diffnea
