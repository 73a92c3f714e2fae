#include "io/mjcf_pose.hpp"

#include <cmath>
#include <cstdlib>
#include <sstream>

#include <Eigen/Geometry>

#include <diffnea/lie/so3.hpp>

#include "core/c_numbers.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

constexpr const char* kOrientations[] = {"quat", "axisangle", "euler", "xyaxes", "zaxis"};

Vec3<double> unit(const Vec3<double>& v) {
  const double length = std::sqrt(dot(v, v));
  return length > 0.0 ? v * (1.0 / length) : v;
}

Mat3<double> columns(const Vec3<double>& x, const Vec3<double>& y, const Vec3<double>& z) {
  Mat3<double> R;
  R.col[0] = x;
  R.col[1] = y;
  R.col[2] = z;
  return R;
}

Mat3<double> from_euler(const std::vector<double>& angle, double unit, const std::string& axes) {
  Mat3<double> R = Mat3<double>::identity();
  for (std::size_t k = 0; k < 3; ++k) {
    const char axis = static_cast<char>(std::tolower(axes[k]));
    const Vec3<double> a{axis == 'x' ? 1.0 : 0.0, axis == 'y' ? 1.0 : 0.0, axis == 'z' ? 1.0 : 0.0};
    const Mat3<double> turn = rotation_about<double>(a, angle[k] * unit);
    R = axes[k] == axis ? R * turn : turn * R;
  }
  return R;
}

/// The shortest turn that takes z there.
Mat3<double> from_z_axis(const Vec3<double>& to) {
  const Vec3<double> z = unit(to), axis = cross(Vec3<double>{0, 0, 1}, z);
  const double sine = std::sqrt(dot(axis, axis));
  if (sine == 0.0)
    return z.z >= 0.0 ? Mat3<double>::identity() : rotation_about<double>({1, 0, 0}, M_PI);
  return rotation_about<double>(axis * (1.0 / sine), std::atan2(sine, z.z));
}

}  // namespace

std::vector<double> mjcf_numbers(const std::string& text) {
  const detail::CNumbers point;
  std::vector<double> out;
  std::istringstream words(text);
  for (std::string word; words >> word;) out.push_back(std::strtod(word.c_str(), nullptr));
  return out;
}

Vec3<double> mjcf_vec3(const std::string& text, const Vec3<double>& otherwise) {
  const std::vector<double> x = mjcf_numbers(text);
  return x.size() == 3 ? Vec3<double>{x[0], x[1], x[2]} : otherwise;
}

MjcfAngles::MjcfAngles(XmlElement& root) {
  for_each_child(root, "compiler", [&](XmlElement& c) {
    if (c.Attribute("angle")) degrees = attribute(c, "angle") != "radian";
    if (attribute(c, "eulerseq").size() == 3) euler = attribute(c, "eulerseq");
  });
}

Pose<double> mjcf_pose(const XmlElement& element, const MjcfDefaults& defaults,
                       const MjcfAngles& angles) {
  Pose<double> X = Pose<double>::identity();
  X.p = mjcf_vec3(defaults.attribute(element, "pos"), {0, 0, 0});
  const double unit_of_angle = angles.degrees ? M_PI / 180.0 : 1.0;
  const auto numbers = [&](const char* name) {
    return mjcf_numbers(defaults.attribute(element, name));
  };
  if (const auto v = numbers("quat"); v.size() == 4)
    X.R = rotation_from_quaternion(v[0], v[1], v[2], v[3]);
  if (const auto v = numbers("axisangle"); v.size() == 4)
    X.R = rotation_about<double>(unit({v[0], v[1], v[2]}), v[3] * unit_of_angle);
  if (const auto v = numbers("euler"); v.size() == 3)
    X.R = from_euler(v, unit_of_angle, angles.euler);
  if (const auto v = numbers("xyaxes"); v.size() == 6) {
    const Vec3<double> x = unit({v[0], v[1], v[2]}), along{v[3], v[4], v[5]},
                       y = unit(along - x * dot(x, along));
    X.R = columns(x, y, cross(x, y));
  }
  if (const auto v = numbers("zaxis"); v.size() == 3) X.R = from_z_axis({v[0], v[1], v[2]});
  return X;
}

void set_mjcf_pose(XmlElement& element, const Pose<double>& X) {
  for (const char* name : kOrientations) element.DeleteAttribute(name);
  const Eigen::Quaterniond q(to_eigen(X.R));
  element.SetAttribute("pos", exact(X.p).c_str());
  element.SetAttribute("quat", (exact(q.w()) + " " + exact(vec3<double>(q.vec()))).c_str());
}

}  // namespace diffnea::io
