#pragma once

#include <cstddef>

#include <diffnea/core/error.hpp>
#include <diffnea/core/inlined.hpp>
#include <diffnea/dynamics/regressor.hpp>

namespace diffnea {
namespace detail {

/// ∂f̄/∂θ of one body in its own frame, angular rows first: f̄ = [h×a + I α + ω×I ω; m a + α×h +
/// ω×(ω×h)], a = the classical acceleration of its origin minus gravity. Linear rows do not see I.
template <class T>
struct BodyRegressor {
  T angular[3][kThetaSize];
  T linear[3][4];

  BodyRegressor(const Twist<T>& V, const Twist<T>& A) {
    const Vec3<T>& w = V.angular;
    const Vec3<T>& al = A.angular;
    const Vec3<T> a = A.linear + cross(w, V.linear);
    const T o(0.0);
    const T xx = w.x * w.x, yy = w.y * w.y, zz = w.z * w.z;
    const T xy = w.x * w.y, xz = w.x * w.z, yz = w.y * w.z;
    const T rows[3][kThetaSize] = {{o, o, a.z, -a.y, al.x, al.y - xz, al.z + xy, -yz, yy - zz, yz},
                                   {o, -a.z, o, a.x, xz, al.x + yz, zz - xx, al.y, al.z - xy, -xz},
                                   {o, a.y, -a.x, o, -xy, xx - yy, al.x - yz, xy, al.y + xz, al.z}};
    const T forces[3][4] = {{a.x, -yy - zz, xy - al.z, xz + al.y},
                            {a.y, xy + al.z, -xx - zz, yz - al.x},
                            {a.z, xz - al.y, yz + al.x, -xx - yy}};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < kThetaSize; ++c) angular[r][c] = rows[r][c];
      for (int c = 0; c < 4; ++c) linear[r][c] = forces[r][c];
    }
  }

  /// sᵀ ∂f̄/∂θ, s in the body's frame.
  void project(const Twist<T>& s, T* y) const {
    const Vec3<T>& w = s.angular;
    const Vec3<T>& v = s.linear;
    T sum[kThetaSize];
    for (int c = 0; c < kThetaSize; ++c)
      sum[c] = w.x * angular[0][c] + w.y * angular[1][c] + w.z * angular[2][c];
    for (int c = 0; c < 4; ++c)
      sum[c] = sum[c] + (v.x * linear[0][c] + v.y * linear[1][c] + v.z * linear[2][c]);
    for (int c = 0; c < kThetaSize; ++c) y[c] = sum[c];
  }
};

/// Fills six rows, in which a free base feels one link: sᵀ ∂f̄/∂θ of its six twists s.
/// @param X_WB, X_WL  poses of base and link  @param column  where the link's ten numbers begin
template <class R>
void base_rows(const BodyRegressor<R>& body, const Pose<R>& X_WB, const Pose<R>& X_WL, R* column,
               std::ptrdiff_t row_stride) {
  const Vec3<R> p = transpose_times(X_WB.R, X_WL.p - X_WB.p);
  const Pose<R> X_BL{transpose(X_WB.R) * X_WL.R, p};
  for (int r = 0; r < kBaseVelocities; ++r) {
    R unit[kBaseVelocities] = {R(0.0), R(0.0), R(0.0), R(0.0), R(0.0), R(0.0)};
    unit[r] = R(1.0);
    body.project(to_child(X_BL, base_twist(unit)), column + r * row_stride);
  }
}

/// Fills one row a joint with ten numbers a link, row i beginning at Y + i·row_stride, and six of a
/// free base from Y_base on. `links` is scratch; a free base has been moved there.
template <Scalar P, Scalar S>
void regressor_of_joints(const Tree<P>& tree, const S* q, const S* qd, const S* qdd,
                         std::vector<RegressorLinkMotion<Prod<P, S>>>& links, Prod<P, S>* Y,
                         std::ptrdiff_t row_stride, Prod<P, S>* Y_base,
                         std::ptrdiff_t base_stride) {
  using R = Prod<P, S>;
  const int n = tree.num_links(), first = tree.first_joint();
  links.resize(n);
  const Twist<R> A0 = base_acceleration<P, R>(tree);
  for (int k = 0; k < n; ++k) {
    const Link<P>& link = tree.links[k];
    const int x = k - first;
    auto& l = links[k];
    if (k >= first)
      with_axis(link, [&](const auto& s) {
        const Pose<R> X_PL = joint_pose(link, s, q[x]);
        const bool root = link.parent < 0;
        const Twist<R> V_P = root ? zero_twist<R>() : to_child(X_PL, links[link.parent].V);
        const Twist<R> A_P = to_child(X_PL, root ? A0 : links[link.parent].A);
        l.X_WL = root ? X_PL : links[link.parent].X_WL * X_PL;
        l.V = V_P + s * qd[x];
        l.A = A_P + ad(l.V, s) * qd[x] + s * qdd[x];
        l.s_W = to_parent(l.X_WL, s);
      });
    const BodyRegressor<R> body(l.V, l.A);
    R* column = Y + kThetaSize * k;
    const auto clear_rows = [&](int begin, int end) {
      for (int i = begin; i < end; ++i)
        for (int c = 0; c < kThetaSize; ++c) column[i * row_stride + c] = R(0.0);
    };
    clear_rows(x + 1, n - first);
    for (int i = k; i >= first;) {  // every joint that carries link k
      body.project(to_child(l.X_WL, links[i].s_W), column + (i - first) * row_stride);
      const int parent = tree.links[i].parent;
      clear_rows(parent + 1 - first, i - first);
      i = parent;
    }
    if (tree.free_base)
      base_rows(body, links[0].X_WL, l.X_WL, Y_base + kThetaSize * k, base_stride);
  }
}

/// The same with one row a coordinate, Gᵀ times the rows of the joints, behind those of the base.
template <Scalar P, Scalar S>
void torque_regressor(const Tree<P>& tree, const S* y, const S* yd, const S* ydd,
                      std::vector<RegressorLinkMotion<Prod<P, S>>>& links, Prod<P, S>* Y,
                      std::ptrdiff_t row_stride) {
  using R = Prod<P, S>;
  const Coordinates& c = tree.coordinates;
  const int columns = kThetaSize * tree.num_links();
  JointScratch<S, R> joints;
  if (!c.plain()) joints.tau.resize(static_cast<std::size_t>(columns * tree.num_joints()));
  if (tree.free_base) {
    links.resize(tree.num_links());
    const BaseMotion<R> base = base_motion(tree, y, yd, ydd);
    links[0].X_WL = base.X_WB;
    links[0].V = base.V;
    links[0].A = base.A;
  }
  R* Y_joints = Y + (tree.free_base ? kBaseVelocities * row_stride : 0);
  regressor_of_joints(tree, c.of_joints(joints_in_positions(tree, y), true, joints.q),
                      c.of_joints(joints_in_velocities(tree, yd), false, joints.qd),
                      c.of_joints(joints_in_velocities(tree, ydd), false, joints.qdd), links,
                      c.plain() ? Y_joints : joints.tau.data(), c.plain() ? row_stride : columns, Y,
                      row_stride);
  if (c.plain()) return;
  for (int row = 0; row < c.count; ++row)
    for (int k = 0; k < columns; ++k) Y_joints[row * row_stride + k] = R(0.0);
  for (int i = 0; i < tree.num_joints(); ++i) {
    const JointDrive d = c.joints[i];
    R* row = Y_joints + d.dof * row_stride;
    const R* of_joint = joints.tau.data() + i * columns;
    for (int k = 0; k < columns; ++k) row[k] = row[k] + of_joint[k] * d.ratio;
  }
}

}  // namespace detail

template <Scalar P, Scalar S>
const RowMatX<Prod<P, S>>& torque_regressor(const Tree<P>& tree, VecIn<S> q, VecIn<S> qd,
                                            VecIn<S> qdd, RegressorWorkspace<P, S>& ws) {
  require_positions("torque_regressor: q", tree, q);
  require_velocities("torque_regressor: qd", tree, qd);
  require_velocities("torque_regressor: qdd", tree, qdd);
  ws.Y.resize(tree.num_velocities(), kThetaSize * tree.num_links());
  call_inlined<Prod<P, S>>([&] {
    detail::torque_regressor(tree, q.data(), qd.data(), qdd.data(), ws.links, ws.Y.data(),
                             ws.Y.outerStride());
  });
  return ws.Y;
}

#ifdef DIFFNEA_COMPILED
#define DIFFNEA_EXTERN(P, S)                                         \
  extern template const RowMatX<Prod<P, S>>& torque_regressor<P, S>( \
      const Tree<P>&, VecIn<S>, VecIn<S>, VecIn<S>, RegressorWorkspace<P, S>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_EXTERN)
#undef DIFFNEA_EXTERN
#endif

}  // namespace diffnea
