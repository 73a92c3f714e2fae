
#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/sim/controller.hpp>

#include "core/decompositions.hpp"
#include "dynamics/loop_motion.hpp"

namespace diffnea {
namespace {

/// Mobility of a joint, over the largest, that is rounding alone.
constexpr double kHeld = 1e-12;

/// @param given  empty, or one value per degree of freedom
VecX<double> given_or(const VecX<double>& given, const VecX<double>& derived, const char* name) {
  if (given.size() == 0) return derived;
  require_size(name, given.size(), derived.size(), "degree of freedom");
  return given;
}

/// @throws ModelError naming a joint that moves nothing: its acceleration would be infinite
void require_inertia(const Model& model, const MatX<double>& M) {
  const std::vector<int> moving = moving_links(model);
  for (std::size_t j = 0; j < moving.size(); ++j) {
    const ModelLink& link = model.links[static_cast<std::size_t>(moving[j])];
    if (!(M(static_cast<long>(j), static_cast<long>(j)) > 0.0))
      throw ModelError(model.source + ": joint '" + link.joint + "' moves link '" + link.name +
                       "', which has no inertia, nor has anything that it carries: nothing can be "
                       "simulated; state its inertia or an armature, or make the joint fixed");
  }
}

}  // namespace

JointGains joint_gains(const Model& nominal, const ControllerOptions& o, const VecX<double>& q0) {
  const Tree<double> tree = make_tree(nominal);
  VecX<double> inertia = VecX<double>::Ones(tree.num_dofs());
  if (o.law == ControlLaw::kPd) {
    // What a joint feels while the others move freely, 1/(M⁻¹)_jj: with it the sampled loop is
    // stable however the joints are coupled; M_jj can be a hundred times that.
    MassMatrixWorkspace<double, double> ws;
    const long n = tree.num_dofs();
    VecX<double> at = q0;  // with a base that floats, and gives way
    if (tree.free_base) {
      at.resize(tree.num_positions());
      at << VecX<double>::Unit(kBasePositions, kBasePositions - 1), q0;
    }
    const MatX<double> M = mass_matrix(tree, VecIn<double>(at), ws);
    require_inertia(nominal, M.bottomRightCorner(n, n));
    const VecX<double> mobility = nominal.constraints.empty()
                                      ? VecX<double>(M.inverse().diagonal().tail(n))
                                      : LoopMotion("controller", nominal).mobility(q0, M);
    // A joint that its loop holds here, but for rounding, has no gain.
    const double least = nominal.constraints.empty() ? 0.0 : kHeld * mobility.maxCoeff();
    for (long j = 0; j < inertia.size(); ++j)
      inertia[j] = mobility[j] > least ? 1.0 / mobility[j] : 0.0;
  }
  return {given_or(o.kp, inertia * (o.bandwidth * o.bandwidth), "controller: kp"),
          given_or(o.kd, inertia * (2.0 * o.damping * o.bandwidth), "controller: kd")};
}

}  // namespace diffnea
