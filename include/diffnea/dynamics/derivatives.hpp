#pragma once
/// Analytic derivatives of inverse and forward dynamics, for `double`.
///
/// All vectors live in the world frame at its origin, where the derivative of everything that hangs
/// on joint j with respect to q_j is one Lie bracket with s_j (Singh, Russell, Wensing 2022,
/// "Efficient Analytical Derivatives of Rigid-Body Dynamics using Spatial Vector Algebra").
/// With
///   ψ̇_j = v̄_λ × s_j,   ψ̈_j = ā_λ × s_j + v̄_λ × ψ̇_j   (λ the parent, ā₀ = [0; −g])
/// and M̄ᶜ, B̄ᶜ, f̄ᶜ summed over the subtree of i, for j ≤ i:
///   ∂τ_i/∂q_j = s_iᵀ(2B̄ᶜ_i ψ̇_j + M̄ᶜ_i ψ̈_j)
///   ∂τ_j/∂q_i = s_jᵀ(2B̄ᶜ_i ψ̇_i + M̄ᶜ_i ψ̈_i + s_i ×* f̄ᶜ_i)
///   ∂τ_i/∂q̇_j = 2s_iᵀ(B̄ᶜ_i s_j + M̄ᶜ_i ψ̇_j)
///   ∂τ_j/∂q̇_i = 2s_jᵀ(B̄ᶜ_i s_i + M̄ᶜ_i ψ̇_i)
/// Theirs is a 6×6 B̄. Summed over the points r of a body, which move at ẋ, it is the map
///   B̄ [w; u] = Σ m [r×(w×ẋ); w×ẋ],
/// which does not see u and holds 12 numbers: the momentum Σ m ẋ and G = Σ m r ẋᵀ.
///
/// A free base has six columns s, those of its twist in W. Derivatives by its pose are those by the
/// v of q ⊕ v (model/free_base.hpp), six as well. There ψ̇ = 0, ψ̈ = ā₀ × s, s moves with all else
/// (no s ×* f̄ᶜ), and in the derivatives by its twist ṡ = v̄ × s stands in place of 2ψ̇.

#include <diffnea/dynamics/regressor.hpp>

namespace diffnea {

/// Scratch of the world-frame recursions.
struct WorldStates {
  /// What the passes leave at a link, in the world frame.
  struct State {
    Pose<double> X_WL;         ///< pose of the link in W
    Twist<double> s,           ///< joint axis
        V,                     ///< twist of L against W
        A;                     ///< acceleration minus gravity
    Twist<double> psid,        ///< ψ̇
        psidd;                 ///< ψ̈
    SpatialInertia<double> M,  ///< M̄ of the link
        M_c;                   ///< of its subtree, M̄ᶜ
    Vec3<double> momentum;     ///< Σ m ẋ, of the link, then of its subtree
    Mat3<double> Gt;           ///< Gᵀ = Σ m ẋ rᵀ, of the link, then of its subtree
    Wrench<double> F;          ///< of the link, then of its subtree, f̄ᶜ
    Wrench<double> U;          ///< M̄ᶜ s
  };
  /// A column of a free base.
  struct BaseColumn {
    Twist<double> s,  ///< Ad_{X_WB} e
        sd,           ///< ṡ
        psidd;        ///< ψ̈
  };
  std::vector<State> links;             ///< one per link
  BaseColumn base[kBaseVelocities];     ///< columns of a free base, else unused
  JointScratch<double, double> joints;  ///< where joints follow others, else unused
};

/// Derivatives of inverse dynamics, and the scratch they are made in.
struct RneaDerivatives {
  VecX<double> tau;          ///< (n) [N·m]; n is tree.num_velocities() here and below
  RowMatX<double> dtau_dq;   ///< (n × n) [N·m/rad], row: torque, column: joint
  RowMatX<double> dtau_dqd;  ///< (n × n) [N·m·s/rad]
  RowMatX<double> M;         ///< (n × n) ∂τ/∂q̈, rotor inertia included
  WorldStates scratch;       ///< of all links, at q̈
};

/// τ and its derivatives with respect to q, q̇, q̈.
/// @param q, qd, qdd  (n) position [rad], velocity [rad/s], acceleration [rad/s²]; [m …] if
/// prismatic
/// @param out  overwritten; no allocation once it has seen this tree
/// @throws as rnea
void rnea_derivatives(const Tree<double>& tree, VecIn<double> q, VecIn<double> qd,
                      VecIn<double> qdd, RneaDerivatives& out);

/// Derivatives of forward dynamics, and the scratch they are made in.
struct AbaDerivatives {
  VecX<double> qdd;           ///< (n) [rad/s²]
  RowMatX<double> dqdd_dq;    ///< (n × n) −M⁻¹ ∂τ/∂q
  RowMatX<double> dqdd_dqd;   ///< (n × n) −M⁻¹ ∂τ/∂q̇
  RowMatX<double> dqdd_dtau;  ///< (n × n) M⁻¹
  RowMatX<double> dtau_dq,    ///< (n × n) ∂τ/∂q of inverse dynamics at q̈ [N·m/rad]
      dtau_dqd;               ///< (n × n) ∂τ/∂q̇ [N·m·s/rad]
  RowMatX<double> L;    ///< (n × n) factor of M = LᵀL in its lower triangle, 1/L_ii on the diagonal
  VecX<double> tau;     ///< inverse dynamics of q̈: the given torque, to rounding
  WorldStates scratch;  ///< of all links, at q̈
};

/// q̈ under torques tau and its derivatives with respect to q, q̇, tau. q̈ = M⁻¹(τ − c): equals aba.
/// @param q, qd, tau  (n) position [rad], velocity [rad/s], joint torque [N·m]; [m …] if prismatic
/// @param out  overwritten; no allocation once it has seen this tree
/// @throws as rnea
void aba_derivatives(const Tree<double>& tree, VecIn<double> q, VecIn<double> qd, VecIn<double> tau,
                     AbaDerivatives& out);

/// Scratch and result of the derivatives by parameters.
struct ParameterJacobianWorkspace {
  VecX<double> qdd;                                 ///< (n) [rad/s²]
  RowMatX<double> dqdd_dpi;                         ///< (n × 10 links)
  RowMatX<double> L;                                ///< (n × n) as in AbaDerivatives
  VecX<double> bias;                                ///< c(q, q̇), torque at q̈ = 0
  WorldStates scratch;                              ///< of all links, at q̈ = 0; ψ̈ is not set
  std::vector<RegressorLinkMotion<double>> motion;  ///< (n), one per link, at q̈
};

/// ∂q̈/∂π = −M⁻¹ Y(q, q̇, q̈), (n × 10 links), at q̈ = aba(q, q̇, tau): exact, because τ = Y π + I_r q̈
/// is linear in the inertial parameters π.
/// @param q, qd, tau  (n) position [rad], velocity [rad/s], joint torque [N·m]; [m …] if prismatic
/// @param ws  scratch, overwritten; no allocation once it has seen this tree
/// @return ws.dqdd_dpi, order of π as in torque_regressor
/// @throws as rnea
const RowMatX<double>& forward_dynamics_parameter_jacobian(const Tree<double>& tree,
                                                           VecIn<double> q, VecIn<double> qd,
                                                           VecIn<double> tau,
                                                           ParameterJacobianWorkspace& ws);

}  // namespace diffnea

#ifndef DIFFNEA_COMPILED
#include <diffnea/dynamics/detail/derivatives_impl.hpp>
#endif
