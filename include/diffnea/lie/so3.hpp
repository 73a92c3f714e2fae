#pragma once
/// Rotations: about an axis, from roll–pitch–yaw, from a quaternion (wxyz).

#include <diffnea/lie/vec3.hpp>

namespace diffnea {

/// R = exp([axis] angle), Rodrigues; `axis` is a unit vector.
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
