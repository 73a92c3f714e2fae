#include <diffnea/core/error.hpp>
#include <diffnea/effects/extended_tree.hpp>

namespace diffnea {
namespace {

/// @throws ModelError for an effect whose torque needs the place of a link, if the base floats
void require_joint_torques(const char* where, const ExtendedTree& model) {
  for (const BoundEffect& e : model.effects)
    if (model.tree.free_base && e.info().port != Port::kJointTorque)
      throw ModelError(std::string(where) + ": " + e.info().name + " at '" + e.where +
                       "' acts on a link of a robot that floats, which is not served here yet; "
                       "--fix-base (fix_base=True) reads the base as fixed where the file has it");
}

}  // namespace

ExtendedTree extend(const Model& model, const std::vector<int>& runs, int run) {
  ExtendedTree out{make_tree(model), {}, {}};  // make_tree takes the armature
  for (const EffectSpec& spec : model.effects) {
    if (find_effect(spec.effect).has(Trait::kRotor)) continue;
    const BoundEffect effect = bind(spec, model, runs);
    if (!effect.acts_in(run) || acts_on_ball(effect.info())) continue;
    if (effect.info().port == Port::kModelParameter)
      add_to_tree(effect, effect.parameters.data(), out.tree);
    else
      (effect.is_local() ? out.effects : out.series).push_back(effect);
  }
  return out;
}

bool reads_time(const BoundEffect& e) { return e.info().has(Trait::kReadsTime); }

RowMatX<double> inverse_dynamics(const ExtendedTree& model,
                                 const Eigen::Ref<const RowMatX<double>>& q,
                                 const Eigen::Ref<const RowMatX<double>>& qd,
                                 const Eigen::Ref<const RowMatX<double>>& qdd, int run,
                                 const VecX<double>* time) {
  const int n = model.tree.num_velocities(), joints = model.tree.num_dofs(), base = n - joints;
  require_size("inverse_dynamics: columns of q", q.cols(), model.tree.num_positions(),
               base > 0 ? "number of the base's pose, of 7, and joint" : "joint");
  for (const auto* m : {&qd, &qdd}) {
    require_size("inverse_dynamics: columns", m->cols(), n,
                 base > 0 ? "number of the base's twist, of 6, and joint" : "joint");
    require_size("inverse_dynamics: rows", m->rows(), q.rows(), "row of q");
  }
  require_joint_torques("inverse_dynamics", model);
  if (time) require_size("inverse_dynamics: time", time->size(), q.rows(), "row of q");
  if (!model.series.empty())
    throw ModelError("inverse_dynamics: the torque of " + model.series.front().info().name +
                     " at '" + model.series.front().where +
                     "' depends on rows before and after; expected a model without such effects");
  for (const BoundEffect& e : model.effects)
    if (!time && reads_time(e))
      throw ModelError("inverse_dynamics: the torque of " + e.info().name + " at '" + e.where +
                       "' depends on the time since the run began, which is not given; expected "
                       "the time of each row, or a model without such effects");
  RowMatX<double> tau(q.rows(), n);
  RneaWorkspace<double, double> ws;
  VecX<double> links(n), armature(joints);
  for (int j = 0; j < joints; ++j) armature[j] = model.tree.armature(j);
  for (long k = 0; k < q.rows(); ++k) {
    links = rnea<double, double>(model.tree, q.row(k).transpose(), qd.row(k).transpose(),
                                 qdd.row(k).transpose(), ws);
    tau.row(k) = links.transpose();
    links.tail(joints) -= armature.cwiseProduct(qdd.row(k).tail(joints).transpose());
    JointSample<double> x;
    x.time = time ? (*time)[k] : 0.0;
    x.run = run;
    x.q = q.row(k).data() + (q.cols() - joints);
    x.qd = qd.row(k).data() + base;
    x.qdd = qdd.row(k).data() + base;
    x.tau = links.data() + base;
    for (const BoundEffect& e : model.effects)
      add_torque(e, model.tree, x, e.parameters.data(), tau.row(k).data() + base);
  }
  return tau;
}

}  // namespace diffnea
