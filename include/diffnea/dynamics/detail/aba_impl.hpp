#pragma once

#include <diffnea/dynamics/aba.hpp>

namespace diffnea {
namespace detail {

/// x ← M⁻¹ x, M (n × n) symmetric and positive definite, overwritten: M = L D Lᵀ without roots.
template <class R>
void solve_symmetric(int n, R* M, R* x) {
  for (int j = 0; j < n; ++j) {
    for (int k = 0; k < j; ++k)
      M[j * n + j] = M[j * n + j] - M[j * n + k] * M[j * n + k] * M[k * n + k];
    for (int i = j + 1; i < n; ++i) {
      for (int k = 0; k < j; ++k)
        M[i * n + j] = M[i * n + j] - M[i * n + k] * M[j * n + k] * M[k * n + k];
      M[i * n + j] = M[i * n + j] / M[j * n + j];
    }
  }
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < i; ++k) x[i] = x[i] - M[i * n + k] * x[k];
  for (int i = n - 1; i >= 0; --i) {
    x[i] = x[i] / M[i * n + i];
    for (int k = i + 1; k < n; ++k) x[i] = x[i] - M[k * n + i] * x[k];
  }
}

/// A = M̂⁻¹ (F − f_b) of a free base: F, the wrench on it, is in its state.
template <Scalar P, Scalar S>
void accelerate_base(AbaStates<P, S>& ws) {
  using R = Prod<P, S>;
  const auto& [I, H, M] = ws.articulated[0].M;  // torque: I ω̇ + H v̇, force: Hᵀ ω̇ + M v̇
  const Mat3<R>&a = full(I), &d = full(M);
  R lower[36], x[6];  // [[I, H], [Hᵀ, M]], row-major; nothing above the diagonal is read
  for (int i = 0; i < 3; ++i) {
    const R rows[3][3] = {{a.col[i].x, a.col[i].y, a.col[i].z},
                          {H.col[i].x, H.col[i].y, H.col[i].z},
                          {d.col[i].x, d.col[i].y, d.col[i].z}};
    for (int j = 0; j < 3; ++j) {
      lower[6 * i + j] = rows[0][j];
      lower[6 * (i + 3) + j] = rows[1][j];
      lower[6 * (i + 3) + j + 3] = rows[2][j];
    }
  }
  const Wrench<R> F = ws.links[0].F - ws.articulated[0].f_b;
  write_base(F.torque, F.force, x);
  solve_symmetric(6, lower, x);
  ws.links[0].A = base_twist(x);
}

/// Beginning of the recursion at a free base: motion, own inertia, bias force, and the given
/// wrench in F.
template <Scalar P, Scalar S>
void aba_of_base(const Tree<P>& tree, const S* q, const S* v, const S* u, AbaStates<P, S>& ws) {
  using R = Prod<P, S>;
  const S at_rest[kBaseVelocities] = {S(0.0), S(0.0), S(0.0), S(0.0), S(0.0), S(0.0)};
  move_base(tree, q, v, at_rest, ws);
  ws.articulated.resize(tree.num_links());
  const SpatialInertia<P>& own = tree.links[0].inertia;
  const Twist<R>& V = ws.links[0].V;
  ws.articulated[0].M = ArticulatedInertia<R>::from_rigid(own);
  ws.articulated[0].f_b = minus_ad_star(V, own * V);
  const Twist<S> F = base_twist(u);
  ws.links[0].F = {F.angular.template cast<R>(), F.linear.template cast<R>()};
}
/// V̇ of a free base, without the gravity that its state's A holds.
template <Scalar P, Scalar S>
void write_base_acceleration(const Tree<P>& tree, const AbaStates<P, S>& ws, Prod<P, S>* vd) {
  const auto& l = ws.links[0];
  write_base(l.A.angular, l.A.linear + transpose_times(l.X_PL.R, tree.gravity), vd);
}

/// Paper, Algorithm 1 (corrected), on plain arrays of length n, behind the numbers of a free base.
/// First poses, twists and bias forces, outward; what else acts on a link may then be taken from
/// its f_b. A free base has been begun with (aba_of_base).
template <class Floats, Scalar P, Scalar S>
void aba_outward(Floats floats, const Tree<P>& tree, const S* q, const S* qd, AbaStates<P, S>& ws) {
  using R = Prod<P, S>;
  const int n = tree.num_links();
  const int first = floats ? 1 : 0;  // link that a joint moves
  ws.links.resize(n);
  ws.articulated.resize(n);

  for (int i = first; i < n; ++i) {
    const int j = i - first;
    const Link<P>& link = tree.links[i];
    auto& l = ws.links[i];
    auto& a = ws.articulated[i];
    with_axis(link, [&](const auto& s) {
      l.X_PL = joint_pose(link, s, q[j]);
      const Twist<R> V_P =
          link.parent < 0 ? zero_twist<R>() : to_child(l.X_PL, ws.links[link.parent].V);
      l.V = V_P + s * qd[j];  // v̄ = Ad v̄_λ + s q̇
      a.M = ArticulatedInertia<R>::from_rigid(link.inertia);
      a.f_b = minus_ad_star(l.V, link.inertia * l.V);  // f_b = −ad*_v M̄ v̄: own inertia
    });
  }
}

/// Then articulated inertias, inward, and accelerations, outward. The wrench on a free base is in
/// its state.
template <class Floats, Scalar P, Scalar S>
void aba_accelerations(Floats floats, const Tree<P>& tree, const S* qd, const S* u,
                       AbaStates<P, S>& ws, Prod<P, S>* qdd) {
  using R = Prod<P, S>;
  const int n = tree.num_links();
  const int first = floats ? 1 : 0;  // link that a joint moves
  for (int i = n - 1; i >= first; --i) {
    const Link<P>& link = tree.links[i];
    const int j = i - first;
    const auto& l = ws.links[i];
    auto& a = ws.articulated[i];
    with_axis(link, [&](const auto& s) {
      a.U = a.M * s;
      a.psi = R(1.0) / (dot(s, a.U) + link.armature);  // Ψ = (sᵀ M̂ s + I_r)⁻¹
      if (link.parent < 0) return;
      auto& p = ws.articulated[link.parent];
      const Wrench<R> f = a.f_b + a.M * (ad(l.V, s) * qd[j]);          // M̂η + f_b, η = ad_v s q̇
      const Wrench<R> f_out = f + a.U * (a.psi * (u[j] - dot(s, f)));  // f_b + β
      p.M = p.M + to_parent(l.X_PL, rank_one_down(a.M, a.U, a.psi));   // Σ Ad* Π Ad
      p.f_b = p.f_b + to_parent(l.X_PL, f_out);                        // Σ Ad* (f_b + β)
    });
  }
  const Twist<R> A0 = base_acceleration<P, R>(tree);
  if (floats) accelerate_base(ws);
  for (int i = first; i < n; ++i) {
    const Link<P>& link = tree.links[i];
    const int j = i - first;
    auto& l = ws.links[i];
    const auto& a = ws.articulated[i];
    with_axis(link, [&](const auto& s) {
      const Twist<R>& A_P = link.parent < 0 ? A0 : ws.links[link.parent].A;
      const Twist<R> A = to_child(l.X_PL, A_P) + ad(l.V, s) * qd[j];  // Ad ā_λ + η
      const Wrench<R> F = a.M * A + a.f_b;
      qdd[j] = a.psi * (u[j] - dot(s, F));  // q̈ = Ψ(u − sᵀ(M̂(Ad ā_λ + η) + f_b))
      l.A = A + s * qdd[j];
      l.F = F + a.U * qdd[j];  // f̄ = M̂ ā + f_b
    });
  }
}

/// Where joints follow others no joint's acceleration is its own matter: q̈ = M⁻¹(u − c) of the
/// coordinates, then Algorithm 2 for twists, accelerations and wrenches of the links. Not inlined:
/// the recursion of a plain tree shall not grow by it.
template <Scalar P, Scalar S>
[[gnu::noinline]] void aba_of_followers(const Tree<P>& tree, const S* y, const S* yd, const S* u,
                                        AbaStates<P, S>& ws, Prod<P, S>* ydd) {
  using R = Prod<P, S>;
  const Coordinates& c = tree.coordinates;
  const int n = tree.num_velocities();
  const S* q = c.of_joints(joints_in_positions(tree, y), true, ws.joints.q);
  const S* qd = c.of_joints(joints_in_velocities(tree, yd), false, ws.joints.qd);
  ws.M.resize(static_cast<std::size_t>(n * n));
  mass_matrix(tree, y, ws.composite, ws.M.data());
  ws.joints.tau.assign(c.joints.size(), R(0.0));
  const std::vector<R> at_rest(kBaseVelocities + c.joints.size(), R(0.0));
  R* ydd_joints = joints_in_velocities(tree, ydd);
  const auto torques = [&](const R* base, const R* joints) {
    if (tree.free_base) move_base(tree, y, yd, base, ws);
    rnea_of_joints(tree.free_base, tree, q, qd, joints, ws, ws.joints.tau.data());
  };
  torques(at_rest.data(), at_rest.data());
  c.gather(ws.joints.tau.data(), ydd_joints);
  if (tree.free_base) write_base(ws.links[0].F.torque, ws.links[0].F.force, ydd);
  for (int i = 0; i < n; ++i) ydd[i] = u[i] - ydd[i];
  solve_symmetric(n, ws.M.data(), ydd);
  torques(ydd, c.of_joints(ydd_joints, false, ws.composite.joints.tau));
}

template <Scalar P, Scalar S>
void aba(const Tree<P>& tree, const S* q, const S* qd, const S* u, AbaStates<P, S>& ws,
         Prod<P, S>* qdd) {
  if (!tree.coordinates.plain()) return aba_of_followers(tree, q, qd, u, ws, qdd);
  with_base<Prod<P, S>>(tree, [&](auto floats) {
    const int at = floats ? kBasePositions : 0, at_v = floats ? kBaseVelocities : 0;
    if (floats) aba_of_base(tree, q, qd, u, ws);
    aba_outward(floats, tree, q + at, qd + at_v, ws);
    aba_accelerations(floats, tree, qd + at_v, u + at_v, ws, qdd + at_v);
    if (floats) write_base_acceleration(tree, ws, qdd);
  });
}

}  // namespace detail

template <Scalar P, Scalar S>
const VecX<Prod<P, S>>& aba(const Tree<P>& tree, VecIn<S> q, VecIn<S> qd, VecIn<S> u,
                            AbaWorkspace<P, S>& ws) {
  require_positions("aba: q", tree, q);
  require_velocities("aba: qd", tree, qd);
  require_velocities("aba: u", tree, u);
  ws.qdd.resize(tree.num_velocities());
  call_inlined<Prod<P, S>>(
      [&] { detail::aba(tree, q.data(), qd.data(), u.data(), ws, ws.qdd.data()); });
  return ws.qdd;
}

#ifdef DIFFNEA_COMPILED
#define DIFFNEA_EXTERN(P, S)                                                                      \
  extern template const VecX<Prod<P, S>>& aba<P, S>(const Tree<P>&, VecIn<S>, VecIn<S>, VecIn<S>, \
                                                    AbaWorkspace<P, S>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_EXTERN)
#undef DIFFNEA_EXTERN
#endif

}  // namespace diffnea
