#pragma once

#include <algorithm>

#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/effects/effect.hpp>
#include <diffnea/model/model.hpp>
#include <diffnea/model/tree.hpp>

namespace diffnea {

/// tip_force: a constant force F in the world's directions that pulls at a point of the last moving
/// link (a cable, a hose, a balancer), or of the link that the named joint moves. The drives must
/// give −JᵀF. The point is the frame `tip` of that link if the model has one, else the outermost
/// frame or link that is fixed to it, else its centre of mass (bind() sees to it).
struct TipForce {
  Vec3<double> p_LF{0, 0, 0};  ///< where it pulls, in the link's frame [m]

  static const EffectInfo& info() {
    static const EffectInfo kInfo{
        .name = "tip_force",
        .formula = "-J^T F",
        .summary = "constant force on the tip, in the world's directions",
        .place = Place::kTip,
        .port = Port::kLinkForce,
        .parameters = {{.name = "force_x", .unit = "N", .unit_prismatic = "N"},
                       {.name = "force_y", .unit = "N", .unit_prismatic = "N"},
                       {.name = "force_z", .unit = "N", .unit_prismatic = "N"}}};
    return kInfo;
  }

  /// Where it pulls on that model.
  void complete(const BoundSetting& setting) {
    p_LF = point_of(setting.model, setting.links.at(0));
  }

  template <Scalar T>
  void add_torque(const Tree<double>& tree, const JointSample<T>& x, const int* tip, const T* p,
                  T* tau) const {
    const int n = tree.num_dofs();
    LinkKinematics<T> kinematics;
    forward_kinematics<double, T>(tree, Eigen::Map<const VecX<T>>(x.q, n), kinematics);
    const Vec3<T> force{p[0], p[1], p[2]};
    const Pose<T>& X_WT = kinematics.links[*tip].X_WL;
    const Vec3<T> point = X_WT.p + X_WT.R * p_LF;
    for (int i = *tip; i >= 0; i = tree.links[i].parent) {  // columns of J
      const Pose<T>& X_WL = kinematics.links[i].X_WL;
      const Vec3<T> axis = X_WL.R * tree.links[i].axis;
      const Vec3<T> column =
          tree.links[i].type == JointType::kPrismatic ? axis : cross(axis, point - X_WL.p);
      const JointDrive d = tree.drive(i);
      tau[d.dof] = tau[d.dof] - dot(column, force) * d.ratio;
    }
  }

 private:
  static Vec3<double> point_of(const Model& model, int tree_link) {
    const TreeMap map = map_to_tree(model);
    const ModelFrame* frame = nullptr;
    for (const ModelFrame& f : model.frames)
      if (f.link >= 0 && map.dof[static_cast<std::size_t>(f.link)] == tree_link &&
          (!frame || frame->name != "tip"))
        frame = &f;
    if (frame) return (map.X_LF[static_cast<std::size_t>(frame->link)] * frame->X_LF).p;
    const auto outermost = std::ranges::find(map.dof.rbegin(), map.dof.rend(), tree_link);
    const auto link = map.dof.rend() - outermost - 1;
    if (model.links[static_cast<std::size_t>(link)].type == ModelJoint::kFixed)
      return map.X_LF[static_cast<std::size_t>(link)].p;
    const SpatialInertia<double>& body = model.links[static_cast<std::size_t>(link)].inertia;
    return body.m > 0.0 ? body.h * (1.0 / body.m) : Vec3<double>{0, 0, 0};
  }
};

}  // namespace diffnea
