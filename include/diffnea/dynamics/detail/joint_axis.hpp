#pragma once
/// The joint's motion subspace as the recursions want it: a type that knows its zeros where it can.

#include <diffnea/core/inlined.hpp>
#include <diffnea/lie/axis.hpp>
#include <diffnea/model/tree.hpp>

namespace diffnea::detail {

/// Calls f(s): s is a RevoluteAxis where the joint turns about +x, +y or +z of its link, else a
/// Twist.
template <Scalar P, class F>
void with_axis(const Link<P>& link, const F& f) {
  if (link.type == JointType::kRevolute) {
    if (link.axis.z == 1.0) return f(RevoluteAxis<2>{});
    if (link.axis.y == 1.0) return f(RevoluteAxis<1>{});
    if (link.axis.x == 1.0) return f(RevoluteAxis<0>{});
  }
  f(joint_twist(link));
}

/// X_PL(q): a turn about a coordinate axis mixes two columns of R_PJ.
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
template <Scalar P, Scalar S>
Pose<Prod<P, S>> joint_pose(const Link<P>& link, const Twist<double>&, const S& q) {
  return diffnea::joint_pose(link, q);
}

}  // namespace diffnea::detail
