#pragma once
/// Rotations: exponential and logarithm, about an axis, from roll–pitch–yaw, from a quaternion
/// (wxyz).

#include <diffnea/lie/taylor.hpp>
#include <diffnea/lie/vec3.hpp>

namespace diffnea {

/// exp([w]) = 1 + (sin θ/θ) [w] + ((1 − cos θ)/θ²) [w]², θ = |w|: the rotation by θ [rad] about w
/// (Rodrigues 1840; Murray, Li, Sastry 1994, eq. 2.14). Of a body that turns at ω in its own frame,
/// R exp(ω t) is where it turns to. Any scalar but packs, w = 0 included: nothing of it is
/// singular.
template <class T>
Mat3<T> exp(const Vec3<T>& w) {
  const T s = dot(w, w), a = sine_over_angle(s), b = versine_over_square(s);
  const auto turned = [&](const Vec3<T>& e) {
    const Vec3<T> first = cross(w, e);
    return e + first * a + cross(w, first) * b;
  };
  const Mat3<T> one = Mat3<T>::identity();
  return {{turned(one.col[0]), turned(one.col[1]), turned(one.col[2])}};
}

/// log R: the w with exp(w) = R and |w| ≤ π [rad]; at |w| = π one of the two. By the largest entry
/// of its unit quaternion (Shepperd 1978), so that it is exact to rounding at 0 and at π as well.
/// Of Jets, derivatives are right wherever it has them: everywhere below π.
/// @param R  a rotation; double or Jet
template <class T>
Vec3<T> log(const Mat3<T>& R) {
  using std::sqrt;
  const T &xx = R.col[0].x, &yy = R.col[1].y, &zz = R.col[2].z;
  const Vec3<T> odd{R.col[1].z - R.col[2].y, R.col[2].x - R.col[0].z, R.col[0].y - R.col[1].x};
  const T xy = R.col[1].x + R.col[0].y, xz = R.col[2].x + R.col[0].z, yz = R.col[2].y + R.col[1].z;
  const T traces[4] = {xx + yy + zz, xx - yy - zz, yy - xx - zz, zz - xx - yy};  // 4 (·)² − 1
  int k = 0;
  for (int i = 1; i < 4; ++i)
    if (value(traces[i]) > value(traces[k])) k = i;
  const T two = sqrt(T(1.0) + traces[k]), per = T(0.5) / two;  // twice the largest entry
  T c;                                                         // cos(θ/2)
  Vec3<T> axis;                                                // sin(θ/2) times the axis
  if (k == 0) {
    c = two * T(0.5);
    axis = odd * per;
  } else if (k == 1) {
    c = odd.x * per;
    axis = {two * T(0.5), xy * per, xz * per};
  } else if (k == 2) {
    c = odd.y * per;
    axis = {xy * per, two * T(0.5), yz * per};
  } else {
    c = odd.z * per;
    axis = {xz * per, yz * per, two * T(0.5)};
  }
  if (value(c) < 0.0) {
    c = -c;
    axis = -axis;
  }
  return axis * angle_over_half_sine(T(dot(axis, axis)), c);
}

/// exp(axis · angle) for a unit vector that is known: no square root, no series.
template <class T>
Mat3<T> rotation_about(const Vec3<double>& axis, const T& angle) {
  using std::cos;
  using std::sin;
  const T s = sin(angle), c = cos(angle), t = T(1.0) - c;
  const double x = axis.x, y = axis.y, z = axis.z;
  return {{{t * (x * x) + c, t * (x * y) + s * z, t * (x * z) - s * y},
           {t * (x * y) - s * z, t * (y * y) + c, t * (y * z) + s * x},
           {t * (x * z) + s * y, t * (y * z) - s * x, t * (z * z) + c}}};
}

/// R = R_z(yaw) R_y(pitch) R_x(roll), the paper's appendix ("Kinematic Transformation") and URDF.
template <class T>
Mat3<T> rotation_from_rpy(const Vec3<T>& rpy) {
  return rotation_about<T>({0, 0, 1}, rpy.z) * rotation_about<T>({0, 1, 0}, rpy.y) *
         rotation_about<T>({1, 0, 0}, rpy.x);
}

/// Inverse of rotation_from_rpy; |pitch| ≤ π/2. At gimbal lock roll is 0.
inline Vec3<double> rpy_from_rotation(const Mat3<double>& R) {
  const double cy = std::hypot(R.col[0].x, R.col[0].y);
  if (cy < 1e-9) return {0.0, std::atan2(-R.col[0].z, cy), std::atan2(-R.col[1].x, R.col[1].y)};
  return {std::atan2(R.col[1].z, R.col[2].z), std::atan2(-R.col[0].z, cy),
          std::atan2(R.col[0].y, R.col[0].x)};
}

/// R from a unit quaternion w, x, y, z.
inline Mat3<double> rotation_from_quaternion(double w, double x, double y, double z) {
  const double n = w * w + x * x + y * y + z * z, s = 2.0 / n;
  return {{{1 - s * (y * y + z * z), s * (x * y + w * z), s * (x * z - w * y)},
           {s * (x * y - w * z), 1 - s * (x * x + z * z), s * (y * z + w * x)},
           {s * (x * z + w * y), s * (y * z - w * x), 1 - s * (x * x + y * y)}}};
}

}  // namespace diffnea
