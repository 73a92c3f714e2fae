#include <algorithm>

#include <diffnea/dynamics/batch.hpp>
#include <diffnea/identify/audit_limits.hpp>
#include <diffnea/identify/source.hpp>

namespace diffnea {

AuditLimits audit_limits(const Model& model) {
  AuditLimits out;
  out.joints = describe_joints(model);
  const Tree<double> tree = make_tree(model);
  // Torques of joints depend on the base's motion, and on the forces that close loops.
  if (tree.num_dofs() > 0 && !tree.free_base && model.constraints.empty())
    out.model_torque = [tree](const RowMatX<double>& q, const RowMatX<double>& qd,
                              const RowMatX<double>& qdd) { return rnea_batch(tree, q, qd, qdd); };
  return out;
}

void match_logged_joints(AuditLimits& limits, std::vector<Recording>& recordings) {
  std::erase_if(limits.joints, [&](const JointDescription& joint) {
    return joint.passive && std::ranges::all_of(recordings, [&](const Recording& r) {
             return std::ranges::find(r.joint_names, joint.name) == r.joint_names.end();
           });
  });
  match_joints(limits.joints, recordings);
}

}  // namespace diffnea
