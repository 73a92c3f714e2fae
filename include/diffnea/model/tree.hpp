#pragma once
/// The link tree the recursions run on: numbers only, links in an order where a parent comes before
/// its children. Names, limits, frames and effects live in `Model` (model/model.hpp).

#include <vector>

#include <diffnea/lie/inertia.hpp>

namespace diffnea {

/// A joint of one degree of freedom.
enum class JointType { kRevolute, kPrismatic };

/// One moving link L and the joint J that moves it against its parent P: X_PL(q) = X_PJ · X_JL(q),
/// with X_JL(0) = 1. Joint and link frame coincide at q = 0.
template <Scalar P>
struct Link {
  int parent = -1;  ///< index of the parent link, −1 for the world; always below the own index
  JointType type = JointType::kRevolute;  ///< of J: it turns about `axis`, or slides along it
  Vec3<double> axis{0, 0, 1};             ///< unit vector, in L
  Pose<P> X_PJ = Pose<P>::identity();     ///< of J in P: the link's pose at q = 0
  SpatialInertia<P> inertia;              ///< about L's origin, in L
  P armature{};                           ///< reflected rotor inertia I_r [kg·m², kg]
};

/// Kinematic tree with one degree of freedom a joint; degree of freedom i moves link i.
template <Scalar P>
struct Tree {
  std::vector<Link<P>> links;                 ///< parents before their children
  Vec3<P> gravity{P(0.0), P(0.0), P(-9.81)};  ///< in W [m/s²]

  /// Number of joints that move.
  int num_dofs() const { return static_cast<int>(links.size()); }

  /// The same tree in another parameter scalar.
  template <class Q>
  Tree<Q> cast() const {
    Tree<Q> out;
    out.gravity = gravity.template cast<Q>();
    out.links.reserve(links.size());
    for (const Link<P>& l : links) {
      const SpatialInertia<P>& b = l.inertia;
      out.links.push_back({l.parent,
                           l.type,
                           l.axis,
                           l.X_PJ.template cast<Q>(),
                           {Q(b.m), b.h.template cast<Q>(), b.I.template cast<Q>()},
                           Q(l.armature)});
    }
    return out;
  }
};

/// The joint's motion subspace s, in L.
template <Scalar P>
Twist<double> joint_twist(const Link<P>& link) {
  const Vec3<double> zero{0, 0, 0};
  return link.type == JointType::kRevolute ? Twist<double>{link.axis, zero}
                                           : Twist<double>{zero, link.axis};
}

/// X_PL(q), q [rad] or [m].
template <Scalar P, Scalar S>
Pose<Prod<P, S>> joint_pose(const Link<P>& link, const S& q) {
  using std::cos;
  using std::sin;
  using R = Prod<P, S>;
  const Vec3<double>& a = link.axis;
  if (link.type == JointType::kPrismatic) {
    const Vec3<P> step = link.X_PJ.R * a;
    return {link.X_PJ.R.template cast<R>(), link.X_PJ.p + step * q};
  }
  // An axis along x, y or z mixes two columns of R_PJ; any other takes Rodrigues' formula.
  const int k = a.x == 1.0 ? 0 : a.y == 1.0 ? 1 : a.z == 1.0 ? 2 : -1;
  if (k < 0) return {link.X_PJ.R * rotation_about<S>(a, q), link.X_PJ.p.template cast<R>()};
  const S s = sin(q), c = cos(q);
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  const Mat3<P>& R0 = link.X_PJ.R;
  Pose<R> X;
  X.R.col[k] = R0.col[k].template cast<R>();
  X.R.col[i] = R0.col[i] * c + R0.col[j] * s;
  X.R.col[j] = R0.col[j] * c - R0.col[i] * s;
  X.p = link.X_PJ.p.template cast<R>();
  return X;
}

}  // namespace diffnea
