#include "arm.hpp"

#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <numbers>

#include <Eigen/Geometry>

namespace rigs {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kGravity = 9.81;

Matrix3d any_rotation(Draw& draw) {
  Eigen::Quaterniond turn(draw.normal(), draw.normal(), draw.normal(), draw.normal());
  return turn.normalized().toRotationMatrix();
}

/// Ellipsoid of even density: ∫ x xᵀ dm = m diag(a², b², c²)/5 about its centre.
Matrix4d ellipsoid(double mass, const Vector3d& centre, const Vector3d& half_axes,
                   const Matrix3d& turn) {
  Matrix4d out;
  out.topLeftCorner<3, 3>() =
      mass * (turn * half_axes.cwiseAbs2().asDiagonal() * turn.transpose() / 5.0 +
              centre * centre.transpose());
  out.topRightCorner<3, 1>() = mass * centre;
  out.bottomLeftCorner<1, 3>() = mass * centre.transpose();
  out(3, 3) = mass;
  return out;
}

struct Body {
  double mass;
  Vector3d centre;
  Matrix3d inertia;  ///< about the centre
};

Body body_of(const Matrix4d& pseudo) {
  Body out;
  out.mass = pseudo(3, 3);
  out.centre = pseudo.topRightCorner<3, 1>() / out.mass;
  const Matrix3d second =
      pseudo.topLeftCorner<3, 3>() - out.mass * out.centre * out.centre.transpose();
  out.inertia = second.trace() * Matrix3d::Identity() - second;
  return out;
}

Vector3d cardinal(int i) { return Vector3d::Unit(i); }

/// Rotation that takes the base's gravity to straight down.
Matrix3d to_world(const Vector3d& gravity) {
  return Eigen::Quaterniond::FromTwoVectors(gravity, Vector3d(0.0, 0.0, -1.0)).toRotationMatrix();
}

__attribute__((format(printf, 1, 2))) std::string text(const char* format, ...) {
  char out[768];
  va_list list;
  va_start(list, format);
  std::vsnprintf(out, sizeof out, format, list);
  va_end(list);
  return out;
}

std::string triple(const Vector3d& v) { return text("%.12g %.12g %.12g", v[0], v[1], v[2]); }

}  // namespace

bool Arm::first_is_upright() const {
  return !joints[0].slide && joints[0].axis.cross(gravity).norm() < 1e-9 * kGravity;
}

Arm draw_arm(const std::string& kind, int num_joints, bool level, Draw& draw) {
  Arm out;
  out.kind = kind;
  const bool gantry = kind == "gantry", pendulum = kind == "pendulum";
  const int n = gantry || pendulum ? 2 : num_joints;
  const double scale = draw.ratio(0.5, 1.5);
  const double reach = scale * draw.uniform(0.6, 1.1), heaviest = draw.ratio(2.0, 8.0);
  const double thinning = draw.uniform(0.6, 0.9);
  if (!level && !gantry && !pendulum && draw.chance(0.5)) {
    const double tilt = draw.chance(0.3) ? std::numbers::pi / 2.0 : draw.uniform(0.15, 0.9);
    const double to = draw.uniform(-std::numbers::pi, std::numbers::pi);
    out.gravity = kGravity * Vector3d(std::sin(tilt) * std::cos(to), std::sin(tilt) * std::sin(to),
                                      -std::cos(tilt));
  }
  const bool skew = draw.chance(0.3);
  int axis = draw.chance(0.65) ? 2 : draw.index(2);
  if (gantry) axis = 0;
  Vector3d along = Vector3d::Zero();
  for (int j = 0; j < n; ++j) {
    Joint joint;
    joint.name = (gantry ? "rail" : "axis") + std::to_string(j + 1);
    joint.slide = gantry;
    joint.passive = pendulum && j == 1;
    if (j > 0 && gantry)
      axis = draw.chance(0.5) ? 1 : 2;
    else if (pendulum && j == 1)
      axis = axis == 2 ? draw.index(2) : axis;
    else if (j > 0 && !draw.chance(0.3))
      axis = (axis + 1 + draw.index(2)) % 3;
    joint.axis = cardinal(axis);
    if (skew && !gantry && j > 0) {
      joint.axis += 0.1 * Vector3d(draw.normal(), draw.normal(), draw.normal());
      joint.axis.normalize();
    }
    if (draw.chance(0.3)) joint.axis = -joint.axis;
    joint.offset = j == 0 ? Vector3d(0.0, 0.0, 0.2 * scale) : along;
    // The link goes on across its axis, seldom along it.
    const int forward = draw.chance(0.8) ? (axis + 1 + draw.index(2)) % 3 : axis;
    const double length = reach / n * draw.uniform(0.6, 1.4);
    along = draw.sign() * length * cardinal(forward);
    for (int i = 0; i < 3; ++i) along[i] += 0.08 * length * draw.normal();
    const double thick = scale * draw.uniform(0.03, 0.08);
    Vector3d half = Vector3d::Constant(thick), centre = draw.uniform(0.3, 0.6) * along;
    for (int i = 0; i < 3; ++i)
      half[i] *= draw.uniform(0.7, 1.3), centre[i] += 0.3 * thick * draw.normal();
    half[forward] += 0.5 * length;
    const double mass = heaviest * scale * scale * std::pow(thinning, j) * draw.uniform(0.7, 1.3) *
                        (gantry ? 3.0 : 1.0);
    const Matrix3d turn =
        Eigen::AngleAxisd(0.3 * draw.normal(), any_rotation(draw).col(0)).toRotationMatrix();
    joint.pseudo = ellipsoid(mass, centre, half, turn);
    out.joints.push_back(joint);
  }
  out.tip = along;
  return out;
}

Arm misjudged(const Arm& arm, double low, double high, Draw& draw) {
  Arm out = arm;
  const auto off = [&] { return 1.0 + draw.sign() * draw.uniform(low, high); };
  for (Joint& joint : out.joints) {
    // A congruence keeps a pseudo-inertia positive definite.
    Matrix4d change = Matrix4d::Identity();
    const double size = draw.uniform(low, high);
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) change(i, k) += 0.25 * size * draw.normal();
    for (int i = 0; i < 3; ++i)
      change(i, 3) += 0.3 * size * draw.normal() *
                      std::sqrt(joint.pseudo.topLeftCorner<3, 3>().trace() / joint.pseudo(3, 3));
    joint.pseudo = off() * change * joint.pseudo * change.transpose();
    joint.coulomb *= off();
    joint.viscous *= off();
    joint.rotor *= off();
  }
  return out;
}

std::string to_mjcf(const Arm& arm, bool as_nominal) {
  std::string out =
      "<mujoco model=\"machine\">\n <compiler angle=\"radian\"/>\n <option gravity=\"" +
      triple(arm.gravity) + "\"/>\n <worldbody>\n";
  for (const Joint& joint : arm.joints) {
    const Body body = body_of(joint.pseudo);
    const Matrix3d& I = body.inertia;
    out += text("  <body name=\"link_%s\" pos=\"%s\">\n", joint.name.c_str(),
                triple(joint.offset).c_str());
    out += text(
        "   <inertial pos=\"%s\" mass=\"%.12g\" fullinertia=\"%.12g %.12g %.12g %.12g %.12g "
        "%.12g\"/>\n",
        triple(body.centre).c_str(), body.mass, I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2),
        I(1, 2));
    out += text("   <joint name=\"%s\" type=\"%s\" axis=\"%s\"", joint.name.c_str(),
                joint.slide ? "slide" : "hinge", triple(joint.axis).c_str());
    if (as_nominal) {
      if (joint.viscous > 0.0) out += text(" damping=\"%.6g\"", joint.viscous);
      if (joint.coulomb > 0.0) out += text(" frictionloss=\"%.6g\"", joint.coulomb);
      if (joint.rotor > 0.0) out += text(" armature=\"%.6g\"", joint.rotor);
    }
    out += "/>\n";
  }
  if (as_nominal) out += "   <site name=\"tip\" pos=\"" + triple(arm.tip) + "\"/>\n";
  for (int j = 0; j < arm.size(); ++j) out += "  </body>\n";
  out += " </worldbody>\n";
  if (as_nominal) {
    out += " <actuator>\n";
    for (const Joint& joint : arm.joints)
      if (!joint.passive)
        out += text("  <motor joint=\"%s\" name=\"drive_%s\"/>\n", joint.name.c_str(),
                    joint.name.c_str());
    out += " </actuator>\n";
  }
  return out + "</mujoco>\n";
}

std::string to_urdf(const Arm& arm) {
  std::string out = "<?xml version=\"1.0\"?>\n<robot name=\"machine\">\n <link name=\"base\"/>\n";
  std::string parent = "base";
  const Matrix3d R = to_world(arm.gravity);
  if (!R.isIdentity(1e-12)) {
    const double pitch = std::asin(-R(2, 0));
    out =
        "<?xml version=\"1.0\"?>\n<robot name=\"machine\">\n <link name=\"room\"/>\n"
        " <link name=\"base\"/>\n <joint name=\"mounting\" type=\"fixed\">\n"
        "  <parent link=\"room\"/><child link=\"base\"/>\n  <origin xyz=\"0 0 0\" rpy=\"" +
        triple({std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))}) +
        "\"/>\n </joint>\n";
  }
  for (const Joint& joint : arm.joints) {
    const Body body = body_of(joint.pseudo);
    const Matrix3d& I = body.inertia;
    const char* name = joint.name.c_str();
    out += text(
        " <link name=\"link_%s\"><inertial>\n  <origin xyz=\"%s\" rpy=\"0 0 0\"/>"
        "<mass value=\"%.12g\"/>\n",
        name, triple(body.centre).c_str(), body.mass);
    out += text(
        "  <inertia ixx=\"%.12g\" ixy=\"%.12g\" ixz=\"%.12g\" iyy=\"%.12g\" iyz=\"%.12g\" "
        "izz=\"%.12g\"/>\n </inertial></link>\n",
        I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2));
    out += text(
        " <joint name=\"%s\" type=\"%s\">\n  <parent link=\"%s\"/><child "
        "link=\"link_%s\"/>\n  <origin xyz=\"%s\" rpy=\"0 0 0\"/><axis xyz=\"%s\"/>\n",
        name, joint.slide ? "prismatic" : "continuous", parent.c_str(), name,
        triple(joint.offset).c_str(), triple(joint.axis).c_str());
    if (joint.slide) out += "  <limit lower=\"-5\" upper=\"5\" effort=\"0\" velocity=\"0\"/>\n";
    if (joint.viscous > 0.0 || joint.coulomb > 0.0)
      out +=
          text("  <dynamics damping=\"%.6g\" friction=\"%.6g\"/>\n", joint.viscous, joint.coulomb);
    out += " </joint>\n";
    parent = "link_" + joint.name;
  }
  out += text(
      " <link name=\"tip\"/>\n <joint name=\"tip_mount\" type=\"fixed\">\n  <parent "
      "link=\"%s\"/><child link=\"tip\"/>\n  <origin xyz=\"%s\" rpy=\"0 0 0\"/>\n </joint>\n",
      parent.c_str(), triple(arm.tip).c_str());
  return out + "</robot>\n";
}

MatrixXd regressor(const Arm& arm, const VectorXd& q, const VectorXd& qd, const VectorXd& qdd) {
  const int n = arm.size();
  MatrixXd out = MatrixXd::Zero(n, 10 * n);
  std::vector<Vector3d> axes, origins;
  Matrix3d R = Matrix3d::Identity();
  Vector3d p = Vector3d::Zero(), w = p, dw = p, a = -arm.gravity;  // motion of the frame's origin
  for (int b = 0; b < n; ++b) {
    const Joint& joint = arm.joints[static_cast<std::size_t>(b)];
    const Vector3d z = R * joint.axis;
    Vector3d arm_of = R * joint.offset;
    if (joint.slide) arm_of += q[b] * z;
    a += dw.cross(arm_of) + w.cross(w.cross(arm_of));
    p += arm_of;
    if (joint.slide) {
      a += 2.0 * qd[b] * w.cross(z) + qdd[b] * z;
    } else {
      dw += qd[b] * w.cross(z) + qdd[b] * z;
      w += qd[b] * z;
      R = R * Eigen::AngleAxisd(q[b], joint.axis).toRotationMatrix();
    }
    axes.push_back(z);
    origins.push_back(p);
    for (int i = 0; i < 10; ++i) {
      Vector3d f = Vector3d::Zero(), m = Vector3d::Zero();
      if (i == 0) {
        f = a;
      } else if (i < 4) {
        const Vector3d h = R.col(i - 1);
        f = dw.cross(h) + w.cross(w.cross(h));
        m = h.cross(a);
      } else {
        constexpr int kRow[] = {0, 0, 0, 1, 1, 2}, kColumn[] = {0, 1, 2, 1, 2, 2};
        const Vector3d x = R.col(kRow[i - 4]), y = R.col(kColumn[i - 4]);
        const auto times = [&](const Vector3d& v) -> Vector3d {
          return kRow[i - 4] == kColumn[i - 4] ? Vector3d(x * x.dot(v))
                                               : Vector3d(x * y.dot(v) + y * x.dot(v));
        };
        m = times(dw) + w.cross(times(w));
      }
      for (int j = 0; j <= b; ++j) {
        const auto at = static_cast<std::size_t>(j);
        out(j, 10 * b + i) =
            arm.joints[at].slide ? axes[at].dot(f) : axes[at].dot(m + (p - origins[at]).cross(f));
      }
    }
  }
  return out;
}

VectorXd inertial_parameters(const Arm& arm) {
  VectorXd out(10 * arm.size());
  for (int b = 0; b < arm.size(); ++b) {
    const Matrix4d& P = arm.joints[static_cast<std::size_t>(b)].pseudo;
    const Matrix3d second = P.topLeftCorner<3, 3>();
    const Matrix3d I = second.trace() * Matrix3d::Identity() - second;
    out.segment<10>(10 * b) << P(3, 3), P(0, 3), P(1, 3), P(2, 3), I(0, 0), I(0, 1), I(0, 2),
        I(1, 1), I(1, 2), I(2, 2);
  }
  return out;
}

}  // namespace rigs
