#include "io/mjcf_inertial.hpp"

#include <Eigen/Geometry>

#include "core/decompositions.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Excess of a principal moment, relative to the largest, that is rounding: of a flat body, whose
/// largest is the sum of the others, and of a rod, whose smallest is 0.
constexpr double kFrameTol = 1e-9;

/// MuJoCo refuses a moment below 0 and one above the sum of the others, by however little.
/// @param moments  in ascending order
Eigen::Vector3d without_rounding(Eigen::Vector3d moments) {
  const double rounding = kFrameTol * moments[2];
  for (double& x : moments)
    if (x < 0.0 && -x <= rounding) x = 0.0;
  const double sum = moments[0] + moments[1];
  if (moments[2] > sum && moments[2] - sum <= rounding) moments[2] = sum;
  return moments;
}

}  // namespace

void write_mjcf_inertial(XmlElement& body, const SpatialInertia<double>& b, double least) {
  remove_children(body, "inertial");
  XmlElement* inertial = body.GetDocument()->NewElement("inertial");
  body.InsertFirstChild(inertial);
  if (is_zero(b)) {  // stated, or MuJoCo would weigh the geoms
    inertial->SetAttribute("pos", "0 0 0");
    inertial->SetAttribute("mass", "0");
    inertial->SetAttribute("diaginertia", "0 0 0");
    return;
  }
  const ComInertia c = com_inertia(b);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(to_eigen(full(c.I)));
  Eigen::Matrix3d R = eigen.eigenvectors();
  if (R.determinant() < 0) R.col(0) = -R.col(0);
  const Eigen::Quaterniond q(R);
  const Eigen::Vector3d moments = without_rounding(eigen.eigenvalues().cwiseMax(least));
  inertial->SetAttribute("pos", exact(c.com).c_str());
  inertial->SetAttribute("quat", (exact(q.w()) + " " + exact(vec3<double>(q.vec()))).c_str());
  inertial->SetAttribute("mass", exact(b.m).c_str());
  inertial->SetAttribute("diaginertia", exact(vec3<double>(moments)).c_str());
}

}  // namespace diffnea::io
