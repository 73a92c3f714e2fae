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

/// Pose and columns of a free base. @param q, v  its numbers lead
inline void base_pass(const double* q, const double* v, WorldStates& states) {
  WorldStates::State& l = states.links[0];
  l.X_WL = base_pose(q);
  l.V = to_parent(l.X_WL, base_twist(v));
  for (int k = 0; k < kBaseVelocities; ++k) {
    double unit[kBaseVelocities] = {};
    unit[k] = 1.0;
    WorldStates::BaseColumn& c = states.base[k];
    c.s = to_parent(l.X_WL, base_twist(unit));
    c.sd = ad(l.V, c.s);
  }
}

/// Poses, axes, twists, ψ̇, inertias and Coriolis terms of every link, in W; of a free base those
/// that base_pass has left.
template <class Floats>
void velocity_pass(Floats floats, const Tree<double>& tree, const double* q, const double* qd,
                   States& links) {
  const int first = floats ? 1 : 0;
  for (int i = 0; i < tree.num_links(); ++i) {
    const Link<double>& link = tree.links[i];
    WorldStates::State& l = links[i];
    if (i >= first) {
      with_axis(link, [&](const auto& s_L) {
        const Pose<double> X_PL = joint_pose(link, s_L, q[i - first]);
        l.X_WL = link.parent < 0 ? X_PL : links[link.parent].X_WL * X_PL;
        l.s = to_parent(l.X_WL, s_L);
      });
      const Twist<double> V_P = link.parent < 0 ? zero_twist<double>() : links[link.parent].V;
      l.psid = ad(V_P, l.s);
      l.V = V_P + l.s * qd[i - first];
    }
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

/// Accelerations under q̈, wrenches, and the torques that they need. A free base's A is there, and
/// the wrench on it is left in its F.
template <class Floats>
void force_pass(Floats floats, const Tree<double>& tree, const double* qd, const double* qdd,
                States& links, double* tau) {
  const int n = tree.num_links(), first = floats ? 1 : 0;
  const Twist<double> A0 = base_acceleration<double, double>(tree);
  for (int i = 0; i < n; ++i) {
    WorldStates::State& l = links[i];
    const int parent = tree.links[i].parent;
    if (i >= first)
      l.A = (parent < 0 ? A0 : links[parent].A) + l.psid * qd[i - first] + l.s * qdd[i - first];
    l.F = l.M * l.A + minus_ad_star(l.V, l.M * l.V);
  }
  for (int i = n - 1; i >= first; --i) {
    const Link<double>& link = tree.links[i];
    tau[i - first] = dot(links[i].s, links[i].F) + link.armature * qdd[i - first];
    if (link.parent >= 0) links[link.parent].F = links[link.parent].F + links[i].F;
  }
}

/// Sums inertias and Coriolis terms over subtrees; mass matrix of all joints, behind six rows of a
/// free base, (n × n) row-major.
template <class Floats>
void composite_pass(Floats floats, const Tree<double>& tree, WorldStates& states,
                    RowMatX<double>& M) {
  States& links = states.links;
  const int first = floats ? 1 : 0, shift = floats ? kBaseVelocities - 1 : 0;  // row against index
  const int n = tree.num_links();
  M.setZero(n + shift, n + shift);
  for (int i = 0; i < n; ++i) links[i].M_c = links[i].M;
  for (int i = n - 1; i >= first; --i) {
    const Link<double>& link = tree.links[i];
    WorldStates::State& l = links[i];
    l.U = l.M_c * l.s;
    M(i + shift, i + shift) = dot(l.s, l.U) + link.armature;
    for (int j = link.parent; j >= first; j = tree.links[j].parent)
      M(i + shift, j + shift) = M(j + shift, i + shift) = dot(links[j].s, l.U);
    if (floats)
      for (int k = 0; k < kBaseVelocities; ++k)
        M(i + shift, k) = M(k, i + shift) = dot(states.base[k].s, l.U);
    if (link.parent < 0) continue;
    WorldStates::State& p = links[link.parent];
    p.M_c = p.M_c + l.M_c;
    p.momentum = p.momentum + l.momentum;
    p.Gt = p.Gt + l.Gt;
  }
  if (!floats) return;
  for (int k = 0; k < kBaseVelocities; ++k) {
    const Wrench<double> U = links[0].M_c * states.base[k].s;
    for (int r = 0; r < kBaseVelocities; ++r) M(r, k) = dot(states.base[r].s, U);
  }
}

/// The four formulas of the header, and those of a free base.
template <class Floats>
void derivative_pass(Floats floats, const Tree<double>& tree, WorldStates& states,
                     RowMatX<double>& dtau_dq, RowMatX<double>& dtau_dqd) {
  States& links = states.links;
  const int first = floats ? 1 : 0, shift = floats ? kBaseVelocities - 1 : 0;  // row against index
  const int n = tree.num_links();
  const Twist<double> A0 = base_acceleration<double, double>(tree);
  dtau_dq.setZero(n + shift, n + shift);
  dtau_dqd.setZero(n + shift, n + shift);
  if (floats)
    for (WorldStates::BaseColumn& c : states.base) c.psidd = ad(A0, c.s);
  for (int i = first; i < n; ++i) {
    WorldStates::State& l = links[i];
    const int parent = tree.links[i].parent, row = i + shift;
    l.psidd = parent < 0 ? ad(A0, l.s) : ad(links[parent].A, l.s) + ad(links[parent].V, l.psid);

    const Wrench<double> dF_dq =
        times_B(l, l.psid.angular) * 2.0 + l.M_c * l.psidd + minus_ad_star(l.s, l.F);
    const Wrench<double> dF_dqd = (times_B(l, l.s.angular) + l.M_c * l.psid) * 2.0;
    const Vec3<double> Bt_s = transpose_times_B(l, l.s) * 2.0;
    dtau_dq(row, row) = dot(l.s, dF_dq);
    dtau_dqd(row, row) = dot(l.s, dF_dqd);
    for (int j = parent; j >= first; j = tree.links[j].parent) {
      const WorldStates::State& a = links[j];
      dtau_dq(j + shift, row) = dot(a.s, dF_dq);
      dtau_dqd(j + shift, row) = dot(a.s, dF_dqd);
      dtau_dq(row, j + shift) = dot(Bt_s, a.psid.angular) + dot(a.psidd, l.U);
      dtau_dqd(row, j + shift) = dot(Bt_s, a.s.angular) + 2.0 * dot(a.psid, l.U);
    }
    if (!floats) continue;
    for (int k = 0; k < kBaseVelocities; ++k) {
      const WorldStates::BaseColumn& c = states.base[k];
      dtau_dq(k, row) = dot(c.s, dF_dq);
      dtau_dqd(k, row) = dot(c.s, dF_dqd);
      dtau_dq(row, k) = dot(c.psidd, l.U);
      dtau_dqd(row, k) = dot(Bt_s, c.s.angular) + dot(c.sd, l.U);
    }
  }
  if (!floats) return;
  const WorldStates::State& l = links[0];
  for (int k = 0; k < kBaseVelocities; ++k) {
    const WorldStates::BaseColumn& c = states.base[k];
    const Wrench<double> dF_dq = l.M_c * c.psidd,
                         dF_dv = times_B(l, c.s.angular) * 2.0 + l.M_c * c.sd;
    for (int r = 0; r < kBaseVelocities; ++r) {
      dtau_dq(r, k) = dot(states.base[r].s, dF_dq);
      dtau_dqd(r, k) = dot(states.base[r].s, dF_dv);
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

/// Gᵀ A G, A with a row and a column a joint, behind those of a free base.
inline void project(const Tree<double>& tree, RowMatX<double>& A) {
  const Coordinates& c = tree.coordinates;
  if (c.plain()) return;
  const RowMatX<double> of_joints = A;
  const long base = tree.num_velocities() - tree.num_dofs();
  const auto drive = [&](long row) {  // rows of the base are coordinates of their own
    if (row < base) return JointDrive{static_cast<int>(row), 1.0, 0.0};
    const JointDrive d = c.joints[static_cast<std::size_t>(row - base)];
    return JointDrive{d.dof + static_cast<int>(base), d.ratio, d.offset};
  };
  A.setZero(tree.num_velocities(), tree.num_velocities());
  for (long i = 0; i < of_joints.rows(); ++i)
    for (long j = 0; j < of_joints.cols(); ++j) {
      const JointDrive a = drive(i), b = drive(j);
      A(a.dof, b.dof) += a.ratio * b.ratio * of_joints(i, j);
    }
}

/// Motion of base and joints, from that of the coordinates; poses and velocities in `states`.
template <class Floats>
class TreeMotion {
 public:
  TreeMotion(Floats floats, const Tree<double>& tree, const double* y, const double* yd,
             WorldStates& states)
      : floats_(floats), tree_(tree), states_(states) {
    const Coordinates& c = tree.coordinates;
    const double* q = c.of_joints(joints_in_positions(tree, y), true, states.joints.q);
    qd_ = c.of_joints(joints_in_velocities(tree, yd), false, states.joints.qd);
    states.links.resize(tree.links.size());
    if (floats) base_pass(y, yd, states);
    velocity_pass(floats, tree, q, qd_, states.links);
  }

  /// force_pass under accelerations of the coordinates, τ_y into `tau`.
  void forces(const double* ydd, double* tau) const {
    const Coordinates& c = tree_.coordinates;
    JointScratch<double, double>& scratch = states_.joints;
    WorldStates::State& base = states_.links[0];
    if (floats_)
      base.A = base_acceleration<double, double>(tree_) + to_parent(base.X_WL, base_twist(ydd));
    double* tau_y = joints_in_velocities(tree_, tau);
    force_pass(floats_, tree_, qd_,
               c.of_joints(joints_in_velocities(tree_, ydd), false, scratch.qdd), states_.links,
               scratch.torques(c, tau_y));
    if (!c.plain()) c.gather(scratch.tau.data(), tau_y);
    if (floats_)
      for (int k = 0; k < kBaseVelocities; ++k) tau[k] = dot(states_.base[k].s, base.F);
  }

 private:
  Floats floats_;
  const Tree<double>& tree_;
  WorldStates& states_;
  const double* qd_ = nullptr;
};

/// q̈ = M⁻¹(τ − c) after a velocity pass; leaves M's factor in `L`, and accelerations in `states`.
template <class Floats>
void solve_forward(Floats floats, const Tree<double>& tree, const TreeMotion<Floats>& motion,
                   const double* tau, WorldStates& states, RowMatX<double>& L, VecX<double>& qdd,
                   VecX<double>& bias) {
  const int n = tree.num_velocities();
  composite_pass(floats, tree, states, L);
  project(tree, L);
  qdd.setZero(n);
  bias.resize(n);
  motion.forces(qdd.data(), bias.data());
  for (int i = 0; i < n; ++i) qdd[i] = tau[i] - bias[i];
  factor_ltl(tree, L);
  solve_ltl(tree, L, qdd.data(), 1);
}

}  // namespace detail

DIFFNEA_INLINE void rnea_derivatives(const Tree<double>& tree, VecIn<double> q, VecIn<double> qd,
                                     VecIn<double> qdd, RneaDerivatives& out) {
  require_positions("rnea_derivatives: q", tree, q);
  require_velocities("rnea_derivatives: qd", tree, qd);
  require_velocities("rnea_derivatives: qdd", tree, qdd);
  out.tau.resize(tree.num_velocities());
  call_inlined<double>([&] {
    with_base<double>(tree, [&](auto floats) {
      const detail::TreeMotion motion(floats, tree, q.data(), qd.data(), out.scratch);
      motion.forces(qdd.data(), out.tau.data());
      detail::composite_pass(floats, tree, out.scratch, out.M);
      detail::derivative_pass(floats, tree, out.scratch, out.dtau_dq, out.dtau_dqd);
    });
  });
  for (RowMatX<double>* A : {&out.M, &out.dtau_dq, &out.dtau_dqd}) detail::project(tree, *A);
}

DIFFNEA_INLINE void aba_derivatives(const Tree<double>& tree, VecIn<double> q, VecIn<double> qd,
                                    VecIn<double> tau, AbaDerivatives& out) {
  const int n = tree.num_velocities();
  require_positions("aba_derivatives: q", tree, q);
  require_velocities("aba_derivatives: qd", tree, qd);
  require_velocities("aba_derivatives: tau", tree, tau);
  call_inlined<double>([&] {
    with_base<double>(tree, [&](auto floats) {
      const detail::TreeMotion motion(floats, tree, q.data(), qd.data(), out.scratch);
      detail::solve_forward(floats, tree, motion, tau.data(), out.scratch, out.L, out.qdd, out.tau);
      motion.forces(out.qdd.data(), out.tau.data());
      detail::derivative_pass(floats, tree, out.scratch, out.dtau_dq, out.dtau_dqd);
    });
  });
  for (RowMatX<double>* A : {&out.dtau_dq, &out.dtau_dqd}) detail::project(tree, *A);
  out.dqdd_dtau.setIdentity(n, n);
  detail::solve_ltl(tree, out.L, out.dqdd_dtau.data(), n);
  detail::minus_product(out.dqdd_dtau, out.dtau_dq, out.dqdd_dq);
  detail::minus_product(out.dqdd_dtau, out.dtau_dqd, out.dqdd_dqd);
}

DIFFNEA_INLINE const RowMatX<double>& forward_dynamics_parameter_jacobian(
    const Tree<double>& tree, VecIn<double> q, VecIn<double> qd, VecIn<double> tau,
    ParameterJacobianWorkspace& ws) {
  require_positions("forward_dynamics_parameter_jacobian: q", tree, q);
  require_velocities("forward_dynamics_parameter_jacobian: qd", tree, qd);
  require_velocities("forward_dynamics_parameter_jacobian: tau", tree, tau);
  const int columns = kThetaSize * tree.num_links();
  ws.dqdd_dpi.resize(tree.num_velocities(), columns);
  call_inlined<double>([&] {
    with_base<double>(tree, [&](auto floats) {
      const detail::TreeMotion motion(floats, tree, q.data(), qd.data(), ws.scratch);
      detail::solve_forward(floats, tree, motion, tau.data(), ws.scratch, ws.L, ws.qdd, ws.bias);
    });
    detail::torque_regressor(tree, q.data(), qd.data(), ws.qdd.data(), ws.motion,
                             ws.dqdd_dpi.data(), columns);
  });
  ws.dqdd_dpi *= -1.0;
  detail::solve_ltl(tree, ws.L, ws.dqdd_dpi.data(), columns);
  return ws.dqdd_dpi;
}

}  // namespace diffnea
