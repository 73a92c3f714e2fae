#pragma once
/// The link tree the recursions run on: numbers only, links in an order where a parent comes before
/// its children. Names, limits, frames and effects live in `Model` (model/model.hpp).

#include <cmath>
#include <string>
#include <type_traits>
#include <vector>

#include <diffnea/core/error.hpp>
#include <diffnea/core/inlined.hpp>
#include <diffnea/lie/axis.hpp>
#include <diffnea/model/coordinates.hpp>

namespace diffnea {

/// A joint of one degree of freedom.
enum class JointType { kRevolute, kPrismatic };

/// One moving link L and the joint J that moves it against its parent P: X_PL(q) = X_PJ · X_JL(q),
/// with X_JL(0) = 1. Joint and link frame coincide at q = 0. Of a free base the inertia alone is
/// read.
template <Scalar P>
struct Link {
  int parent = -1;  ///< index of the parent link, −1 for the world; always below the own index
  JointType type = JointType::kRevolute;  ///< of J: it turns about `axis`, or slides along it
  Vec3<double> axis{0, 0, 1};             ///< unit vector, in L
  Pose<P> X_PJ = Pose<P>::identity();     ///< of J in P: the link's pose at q = 0
  SpatialInertia<P> inertia{};            ///< about L's origin, in L
  P armature{};                           ///< reflected rotor inertia I_r [kg·m², kg]
};

/// Numbers of a free base that lead positions q, [x y z qx qy qz qw], and velocities, [ω; v].
///@{
inline constexpr int kBasePositions = 7;
inline constexpr int kBaseVelocities = 6;
///@}

/// Kinematic tree with one joint a link. Degree of freedom i moves link i, unless joints follow
/// others: `coordinates` then says which coordinate moves which joint. State and torques are those
/// of the coordinates.
///
/// With a free base, link 0 is the base B and carries all others. Its pose and twist lead those of
/// the n joints (model/free_base.hpp):
///
///     q   = [x y z qx qy qz qw | joints]   (7 + n)   p_WB [m] and the unit quaternion of R_WB
///     v   = [ω; v | joints]                (6 + n)   twist of B against W, in B [rad/s, m/s]
///     v̇   = [ω̇; v̇ | joints]                (6 + n)   its derivative; v̇ is not ẍ of the origin
///     τ   = [τ_B; f_B | joints]            (6 + n)   wrench on B about its origin, in B [N·m, N]
template <Scalar P>
struct Tree {
  std::vector<Link<P>> links;                 ///< parents before their children
  Vec3<P> gravity{P(0.0), P(0.0), P(-9.81)};  ///< in W [m/s²]
  Coordinates coordinates{};                  ///< plain unless joints follow others
  bool free_base = false;  ///< links[0] floats, and only its inertia is read: no joint moves it

  /// Number of links.
  int num_links() const { return static_cast<int>(links.size()); }
  /// Index of the first link that a joint moves: 1 with a free base, else 0.
  int first_joint() const { return free_base ? 1 : 0; }
  /// Number of joints: one a link, but for a free base.
  int num_joints() const { return num_links() - first_joint(); }
  /// Number of coordinates of the joints, n.
  int num_dofs() const { return coordinates.plain() ? num_joints() : coordinates.count; }
  /// Length of q: n, and with a free base 7 more.
  int num_positions() const { return num_dofs() + (free_base ? kBasePositions : 0); }
  /// Length of velocities, accelerations and torques: n, and with a free base 6 more.
  int num_velocities() const { return num_dofs() + (free_base ? kBaseVelocities : 0); }

  /// How the joint of a link follows its coordinate, of n.
  JointDrive drive(int link) const {
    const int joint = link - first_joint();
    return coordinates.plain() ? JointDrive{joint, 1.0, 0.0} : coordinates.joints[joint];
  }

  /// Rotor inertia that a coordinate, of n, feels: Σ ratio² I_r of the joints that follow it.
  P armature(int dof) const {
    if (coordinates.plain()) return links[dof + first_joint()].armature;
    P sum(0.0);
    for (int i = first_joint(); i < num_links(); ++i) {
      const JointDrive d = drive(i);
      if (d.dof == dof) sum = sum + links[i].armature * (d.ratio * d.ratio);
    }
    return sum;
  }

  /// The same tree in another parameter scalar.
  template <class Q>
  Tree<Q> cast() const {
    Tree<Q> out;
    out.gravity = gravity.template cast<Q>();
    out.coordinates = coordinates;
    out.free_base = free_base;
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

/// Appends a link to a tree in which no joint follows another; the next degree of freedom moves it.
///
///     Tree<double> tree;
///     const int upper = add_link(tree, {.axis = {0, 1, 0}, .inertia = body});
///     add_link(tree, {.parent = upper, .axis = {0, 1, 0}, .X_PJ = ..., .inertia = body});
///
/// @return its index, for the `parent` of what hangs on it
/// @throws ModelError if the parent is not there or the axis is not a unit vector
template <Scalar P>
int add_link(Tree<P>& tree, const std::type_identity_t<Link<P>>& link) {
  const int index = tree.num_links();
  const std::string here = "add_link: link " + std::to_string(index);
  const int first = tree.free_base ? 0 : -1;
  if (link.parent < first || link.parent >= index)
    throw ModelError(here + ": got the parent " + std::to_string(link.parent) + ", expected " +
                     (tree.free_base ? "0 (the base)" : "-1 (the world)") +
                     " or a link that is there, below " + std::to_string(index));
  const double squared = dot(link.axis, link.axis);
  if (!(std::abs(squared - 1.0) < 2e-9))
    throw ModelError(here + ": axis has length " + std::to_string(std::sqrt(squared)) +
                     ", expected 1");
  tree.links.push_back(link);
  return index;
}

/// A tree of a free base alone, for add_link to hang links on: their parents are 0, the base, or
/// links that are there.
/// @param base  its inertia about B's origin, in B
template <Scalar P>
Tree<P> free_base_tree(const SpatialInertia<P>& base) {
  Tree<P> tree;
  tree.free_base = true;
  tree.links.push_back({.inertia = base});
  return tree;
}

namespace detail {
template <class R, class F>
[[gnu::noinline]] void call_apart(const F& f) {
  call_inlined<R>([&] { f(std::true_type{}); });
}
}  // namespace detail

/// Calls f(floats), floats telling whether the base is free: a recursion over both is one text. For
/// numbers and packs it is a constant, and that of a free base a function of its own: of a fixed
/// base the code is as fast as it would be alone. For Jets, whose code is large, it is a bool.
/// @tparam R  scalar of the results
template <class R, Scalar P, class F>
void with_base(const Tree<P>& tree, const F& f) {
  if constexpr (kIsJet<R>)
    f(tree.free_base);
  else if (tree.free_base)
    detail::call_apart<R>(f);
  else
    f(std::false_type{});
}

/// The joint's motion subspace s, in L.
template <Scalar P>
Twist<double> joint_twist(const Link<P>& link) {
  const Vec3<double> zero{0, 0, 0};
  return link.type == JointType::kRevolute ? Twist<double>{link.axis, zero}
                                           : Twist<double>{zero, link.axis};
}

/// Calls f(s) with the joint's motion subspace as a type that knows its zeros where it can: a
/// RevoluteAxis where the joint turns about +x, +y or +z of its link, else a Twist.
template <Scalar P, class F>
decltype(auto) with_axis(const Link<P>& link, const F& f) {
  if (link.type == JointType::kRevolute) {
    if (link.axis.z == 1.0) return f(RevoluteAxis<2>{});
    if (link.axis.y == 1.0) return f(RevoluteAxis<1>{});
    if (link.axis.x == 1.0) return f(RevoluteAxis<0>{});
  }
  return f(joint_twist(link));
}

/// X_PL(q) of a turn about a coordinate axis: it mixes two columns of R_PJ. @param q  [rad]
template <int K, Scalar P, Scalar S>
Pose<Prod<P, S>> joint_pose(const Link<P>& link, RevoluteAxis<K>, const S& q) {
  using std::cos;
  using std::sin;
  using R = Prod<P, S>;
  constexpr int i = (K + 1) % 3, j = (K + 2) % 3;
  const S s = sin(q), c = cos(q);
  const Mat3<P>& R0 = link.X_PJ.R;
  Pose<R> X;
  X.R.col[K] = R0.col[K].template cast<R>();
  X.R.col[i] = R0.col[i] * c + R0.col[j] * s;
  X.R.col[j] = R0.col[j] * c - R0.col[i] * s;
  X.p = link.X_PJ.p.template cast<R>();
  return X;
}
/// X_PL(q) along or about any axis, that of `link`. @param q  [rad] or [m]
template <Scalar P, Scalar S>
Pose<Prod<P, S>> joint_pose(const Link<P>& link, const Twist<double>&, const S& q) {
  using R = Prod<P, S>;
  if (link.type == JointType::kPrismatic) {
    const Vec3<P> step = link.X_PJ.R * link.axis;
    return {link.X_PJ.R.template cast<R>(), link.X_PJ.p + step * q};
  }
  return {link.X_PJ.R * rotation_about<S>(link.axis, q), link.X_PJ.p.template cast<R>()};
}
/// X_PL(q), q [rad] or [m].
template <Scalar P, Scalar S>
Pose<Prod<P, S>> joint_pose(const Link<P>& link, const S& q) {
  return with_axis(link, [&](const auto& s) { return joint_pose(link, s, q); });
}

}  // namespace diffnea
