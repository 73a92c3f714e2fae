#pragma once
/// A link tree as an MJCF, compiled by MuJoCo.

#include <cstdio>
#include <fstream>
#include <initializer_list>
#include <memory>
#include <stdexcept>
#include <string>
#include <support/temporary_folder.hpp>
#include <vector>

#include <Eigen/Eigenvalues>
#include <mujoco/mujoco.h>

#include <diffnea/model/tree.hpp>

namespace diffnea::test {

inline std::string numbers(std::initializer_list<double> values) {
  std::string out;
  char buffer[32];
  for (const double x : values) {
    std::snprintf(buffer, sizeof buffer, "%s%.17g", out.empty() ? "" : " ", x);
    out += buffer;
  }
  return out;
}

inline std::string quaternion(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  return numbers({q.w(), q.x(), q.y(), q.z()});
}

/// Inertia in principal axes: `fullinertia` would be diagonalised by MuJoCo, before 3.16 to 1e-6
/// only.
inline std::string inertial(const SpatialInertia<double>& b) {
  const Vec3<double> p = b.h * (1.0 / b.m);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(to_eigen(full(inertia_about_com(b))));
  Eigen::Matrix3d axes = solver.eigenvectors();
  if (axes.determinant() < 0) axes.col(0) *= -1.0;
  const Eigen::Vector3d moments = solver.eigenvalues();
  return "<inertial mass='" + numbers({b.m}) + "' pos='" + numbers({p.x, p.y, p.z}) + "' quat='" +
         quaternion(axes) + "' diaginertia='" + numbers({moments[0], moments[1], moments[2]}) +
         "'/>";
}

inline std::string bodies(const Tree<double>& tree, int parent) {
  std::string out;
  for (int i = 0; i < tree.num_links(); ++i) {
    const Link<double>& link = tree.links[i];
    if (link.parent != parent) continue;
    const Vec3<double>&p = link.X_PJ.p, &a = link.axis;
    const std::string number = std::to_string(i);
    const std::string joint = "<joint name='j" + number + "' type='" +
                              (link.type == JointType::kRevolute ? "hinge" : "slide") + "' axis='" +
                              numbers({a.x, a.y, a.z}) + "' armature='" + numbers({link.armature}) +
                              "'/>";
    out += "<body name='b" + number + "' pos='" + numbers({p.x, p.y, p.z}) + "' quat='" +
           quaternion(to_eigen(link.X_PJ.R)) + "'>" +
           (tree.free_base && i == 0 ? "<freejoint/>" : joint) + inertial(link.inertia) +
           bodies(tree, i) + "</body>";
  }
  return out;
}

/// A tree as MuJoCo compiles it, and the order in which it numbers our joints.
struct Mujoco {
  explicit Mujoco(const Tree<double>& tree) {
    const TemporaryFolder folder;
    const auto path = folder.path() / "tree.xml";
    std::ofstream(path)
        << "<mujoco><compiler angle='radian' inertiafromgeom='false'/><option gravity='"
        << numbers({tree.gravity.x, tree.gravity.y, tree.gravity.z}) << "'/><worldbody>"
        << bodies(tree, -1) << "</worldbody></mujoco>";
    char error[500] = "";
    model.reset(mj_loadXML(path.c_str(), nullptr, error, sizeof error));
    if (!model) throw std::runtime_error(error);
    data.reset(mj_makeData(model.get()));
    const int base = tree.free_base ? kBaseVelocities : 0;
    for (int i = tree.first_joint(); i < tree.num_links(); ++i) {
      const int joint = mj_name2id(model.get(), mjOBJ_JOINT, ("j" + std::to_string(i)).c_str());
      dof.push_back(model->jnt_dofadr[joint] - base);
    }
  }

  /// Our tree with the inertia that MuJoCo has compiled.
  Tree<double> with_compiled_inertia(Tree<double> tree) const {
    for (int i = 0; i < tree.num_links(); ++i) {
      const int body = mj_name2id(model.get(), mjOBJ_BODY, ("b" + std::to_string(i)).c_str());
      const mjtNum *p = model->body_ipos + 3 * body, *q = model->body_iquat + 4 * body,
                   *moments = model->body_inertia + 3 * body;
      const Sym3<double> I_com = rotate(rotation_from_quaternion(q[0], q[1], q[2], q[3]),
                                        Sym3<double>{moments[0], 0, 0, moments[1], 0, moments[2]});
      tree.links[i].inertia =
          inertia_from_com<double>(model->body_mass[body], {p[0], p[1], p[2]}, I_com);
    }
    return tree;
  }
  void scatter(const VecX<double>& from, mjtNum* to) const {
    for (std::size_t i = 0; i < dof.size(); ++i) to[dof[i]] = from[i];
  }
  VecX<double> gather(const mjtNum* from) const {
    VecX<double> to(dof.size());
    for (std::size_t i = 0; i < dof.size(); ++i) to[i] = from[dof[i]];
    return to;
  }

  std::unique_ptr<mjModel, decltype(&mj_deleteModel)> model{nullptr, mj_deleteModel};
  std::unique_ptr<mjData, decltype(&mj_deleteData)> data{nullptr, mj_deleteData};
  /// MuJoCo's index of our degree of freedom, behind those of a free base; one number a joint.
  std::vector<int> dof;
};

}  // namespace diffnea::test
