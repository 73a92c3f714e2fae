#pragma once

#include <diffnea/dynamics/aba.hpp>

namespace diffnea {
namespace detail {

/// Paper, Algorithm 1 (corrected), on plain arrays of length n. First poses, twists and bias
/// forces, outward; what else acts on a link may then be taken from its f_b.
template <Scalar P, Scalar S>
void aba_outward(const Tree<P>& tree, const S* q, const S* qd, AbaStates<P, S>& ws) {
  using R = Prod<P, S>;
  const int n = tree.num_links();
  ws.links.resize(n);
  ws.articulated.resize(n);

  for (int i = 0; i < n; ++i) {
    const Link<P>& link = tree.links[i];
    auto& l = ws.links[i];
    auto& a = ws.articulated[i];
    with_axis(link, [&](const auto& s) {
      l.X_PL = joint_pose(link, s, q[i]);
      const Twist<R> V_P =
          link.parent < 0 ? zero_twist<R>() : to_child(l.X_PL, ws.links[link.parent].V);
      l.V = V_P + s * qd[i];  // v̄ = Ad v̄_λ + s q̇
      a.M = ArticulatedInertia<R>::from_rigid(link.inertia);
      a.f_b = minus_ad_star(l.V, link.inertia * l.V);  // f_b = −ad*_v M̄ v̄: own inertia
    });
  }
}

/// Then articulated inertias, inward, and accelerations, outward.
template <Scalar P, Scalar S>
void aba_accelerations(const Tree<P>& tree, const S* qd, const S* u, AbaStates<P, S>& ws,
                       Prod<P, S>* qdd) {
  using R = Prod<P, S>;
  const int n = tree.num_links();
  for (int i = n - 1; i >= 0; --i) {
    const Link<P>& link = tree.links[i];
    const auto& l = ws.links[i];
    auto& a = ws.articulated[i];
    with_axis(link, [&](const auto& s) {
      a.U = a.M * s;
      a.psi = R(1.0) / (dot(s, a.U) + link.armature);  // Ψ = (sᵀ M̂ s + I_r)⁻¹
      if (link.parent < 0) return;
      auto& p = ws.articulated[link.parent];
      const Wrench<R> f = a.f_b + a.M * (ad(l.V, s) * qd[i]);          // M̂η + f_b, η = ad_v s q̇
      const Wrench<R> f_out = f + a.U * (a.psi * (u[i] - dot(s, f)));  // f_b + β
      p.M = p.M + to_parent(l.X_PL, rank_one_down(a.M, a.U, a.psi));   // Σ Ad* Π Ad
      p.f_b = p.f_b + to_parent(l.X_PL, f_out);                        // Σ Ad* (f_b + β)
    });
  }
  const Twist<R> A0 = base_acceleration<P, R>(tree);
  for (int i = 0; i < n; ++i) {
    const Link<P>& link = tree.links[i];
    auto& l = ws.links[i];
    const auto& a = ws.articulated[i];
    with_axis(link, [&](const auto& s) {
      const Twist<R>& A_P = link.parent < 0 ? A0 : ws.links[link.parent].A;
      const Twist<R> A = to_child(l.X_PL, A_P) + ad(l.V, s) * qd[i];  // Ad ā_λ + η
      const Wrench<R> F = a.M * A + a.f_b;
      qdd[i] = a.psi * (u[i] - dot(s, F));  // q̈ = Ψ(u − sᵀ(M̂(Ad ā_λ + η) + f_b))
      l.A = A + s * qdd[i];
      l.F = F + a.U * qdd[i];  // f̄ = M̂ ā + f_b
    });
  }
}

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

/// Where joints follow others no joint's acceleration is its own matter: q̈ = M⁻¹(u − c) of the
/// coordinates, then Algorithm 2 for twists, accelerations and wrenches of the links. Not inlined:
/// the recursion of a plain tree shall not grow by it.
template <Scalar P, Scalar S>
[[gnu::noinline]] void aba_of_followers(const Tree<P>& tree, const S* y, const S* yd, const S* u,
                                        AbaStates<P, S>& ws, Prod<P, S>* ydd) {
  using R = Prod<P, S>;
  const Coordinates& c = tree.coordinates;
  const std::size_t links = tree.links.size();
  const S* q = c.of_joints(y, true, ws.joints.q);
  const S* qd = c.of_joints(yd, false, ws.joints.qd);
  ws.M.resize(static_cast<std::size_t>(c.count * c.count));
  mass_matrix(tree, y, ws.composite, ws.M.data());
  ws.joints.tau.assign(links, R(0.0));
  const std::vector<R> at_rest(links, R(0.0));
  rnea_of_joints(tree, q, qd, at_rest.data(), ws, ws.joints.tau.data());
  c.gather(ws.joints.tau.data(), ydd);
  for (int i = 0; i < c.count; ++i) ydd[i] = u[i] - ydd[i];
  solve_symmetric(c.count, ws.M.data(), ydd);
  rnea_of_joints(tree, q, qd, c.of_joints(ydd, false, ws.composite.joints.tau), ws,
                 ws.joints.tau.data());
}

template <Scalar P, Scalar S>
void aba(const Tree<P>& tree, const S* q, const S* qd, const S* u, AbaStates<P, S>& ws,
         Prod<P, S>* qdd) {
  if (!tree.coordinates.plain()) return aba_of_followers(tree, q, qd, u, ws, qdd);
  aba_outward(tree, q, qd, ws);
  aba_accelerations(tree, qd, u, ws, qdd);
}

}  // namespace detail

template <Scalar P, Scalar S>
const VecX<Prod<P, S>>& aba(const Tree<P>& tree, VecIn<S> q, VecIn<S> qd, VecIn<S> u,
                            AbaWorkspace<P, S>& ws) {
  const int n = tree.num_dofs();
  require_size("aba: q", q.size(), n, "joint");
  require_size("aba: qd", qd.size(), n, "joint");
  require_size("aba: u", u.size(), n, "joint");
  ws.qdd.resize(n);
  if (!tree.coordinates.plain()) {
    detail::aba_of_followers(tree, q.data(), qd.data(), u.data(), ws, ws.qdd.data());
    return ws.qdd;
  }
  call_inlined<Prod<P, S>>([&] {
    detail::aba_outward(tree, q.data(), qd.data(), ws);
    detail::aba_accelerations(tree, qd.data(), u.data(), ws, ws.qdd.data());
  });
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
