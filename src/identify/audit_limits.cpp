#include <diffnea/dynamics/batch.hpp>
#include <diffnea/identify/audit_limits.hpp>
#include <diffnea/identify/source.hpp>

namespace diffnea {

AuditLimits audit_limits(const Model& model) {
  AuditLimits out;
  out.joints = describe_joints(model);
  const Tree<double> tree = make_tree(model);
  if (tree.num_dofs() > 0 && !tree.free_base)  // torques of joints hang on the base's motion
    out.model_torque = [tree](const RowMatX<double>& q, const RowMatX<double>& qd,
                              const RowMatX<double>& qdd) { return rnea_batch(tree, q, qd, qdd); };
  return out;
}

}  // namespace diffnea
