#pragma once
/// Where the links are and how they move: poses, twists, accelerations, and any frame F fixed to a
/// link.

#include <diffnea/dynamics/rnea.hpp>

namespace diffnea {

/// Motion of every link, T the product of parameter and state scalar. Gravity is not in it.
template <Scalar T>
struct LinkKinematics {
  /// Pose, twist and acceleration of a link.
  struct LinkMotion {
    Pose<T> X_WL;  ///< pose of the link in W
    Twist<T> V;    ///< twist of L against W, in L
    Twist<T> A;    ///< its spatial acceleration, in L; the linear part is not ẍ of the origin (see
                   ///< FrameMotion)
  };
  std::vector<LinkMotion> links;  ///< one per link of the tree
};

/// Motion of a frame F against W in the terms of a measurement: everything expressed in W.
template <Scalar T>
struct FrameMotion {
  Pose<T> X_WF;                  ///< pose of F in W
  Vec3<T> angular_velocity;      ///< ω [rad/s]
  Vec3<T> velocity;              ///< ẋ of F's origin [m/s]
  Vec3<T> angular_acceleration;  ///< α [rad/s²]
  Vec3<T> acceleration;          ///< ẍ of F's origin, classical: a_spatial + ω×ẋ [m/s²]
};

/// Poses, twists and accelerations of all links.
/// @param q, qd, qdd  (n) position [rad], velocity [rad/s], acceleration [rad/s²]; [m …] if
/// prismatic; with a free base as for rnea
/// @param out  overwritten; no allocation once it has seen this tree
/// @throws as rnea
template <Scalar P, Scalar S>
void forward_kinematics(const Tree<P>& tree, VecIn<S> q, VecIn<S> qd, VecIn<S> qdd,
                        LinkKinematics<Prod<P, S>>& out);
/// Poses alone: V and A are left as they are.
template <Scalar P, Scalar S>
void forward_kinematics(const Tree<P>& tree, VecIn<S> q, LinkKinematics<Prod<P, S>>& out);

/// The same from the workspace that rnea or aba has just filled: the offset −g that their
/// accelerations carry is removed.
template <Scalar P, Scalar S>
void forward_kinematics(const Tree<P>& tree, const LinkStates<P, S>& states,
                        LinkKinematics<Prod<P, S>>& out);

/// X_WF, for a frame F with pose X_LF in link `link`; −1 is the world.
template <Scalar T, Scalar F>
Pose<Prod<T, F>> frame_pose(const LinkKinematics<T>& kinematics, int link, const Pose<F>& X_LF);
/// Pose and its first two derivatives in W.
template <Scalar T, Scalar F>
FrameMotion<Prod<T, F>> frame_motion(const LinkKinematics<T>& kinematics, int link,
                                     const Pose<F>& X_LF);

/// J, (6 × n), with [ω; ẋ_F] = J q̇ expressed in W: geometric Jacobian of F's origin. With a free
/// base (6 × (6 + n)): six columns of its twist lead.
/// @param kinematics  poses at q
/// @param J  overwritten, resized if need be
template <Scalar P, Scalar T, Scalar F>
void frame_jacobian(const Tree<P>& tree, const LinkKinematics<T>& kinematics, int link,
                    const Pose<F>& X_LF, MatX<Prod<T, F>>& J);

}  // namespace diffnea

#include <diffnea/dynamics/detail/kinematics_impl.hpp>
