#include <diffnea/core/error.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/model/free_base.hpp>

namespace diffnea {

ExtendedTree extend(const Model& model, const std::vector<int>& runs, int run) {
  require_fixed_base("effects", model);
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
  const int n = model.tree.num_dofs();
  require_fixed_base("inverse_dynamics", model.tree);
  require_size("inverse_dynamics: columns of q", q.cols(), n, "joint");
  for (const auto* m : {&qd, &qdd}) {
    require_size("inverse_dynamics: columns", m->cols(), n, "joint");
    require_size("inverse_dynamics: rows", m->rows(), q.rows(), "row of q");
  }
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
  VecX<double> links(n), armature(n);
  for (int j = 0; j < n; ++j) armature[j] = model.tree.armature(j);
  for (long k = 0; k < q.rows(); ++k) {
    links = rnea<double, double>(model.tree, q.row(k).transpose(), qd.row(k).transpose(),
                                 qdd.row(k).transpose(), ws);
    tau.row(k) = links.transpose();
    for (int j = 0; j < n; ++j) links[j] -= armature[j] * qdd(k, j);
    JointSample<double> x;
    x.time = time ? (*time)[k] : 0.0;
    x.run = run;
    x.q = q.row(k).data();
    x.qd = qd.row(k).data();
    x.qdd = qdd.row(k).data();
    x.tau = links.data();
    for (const BoundEffect& e : model.effects)
      add_torque(e, model.tree, x, e.parameters.data(), tau.row(k).data());
  }
  return tau;
}

}  // namespace diffnea
