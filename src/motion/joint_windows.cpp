#include "motion/joint_windows.hpp"

#include <cmath>

#include <diffnea/core/error.hpp>

#include "core/constants.hpp"

namespace diffnea {

JointWindows::JointWindows(const std::vector<ModelOfRuns>& models,
                           const std::vector<BoundEffect>& effects,
                           const std::vector<MotionParameter>& parameters,
                           const SteppingOptions& options)
    : joints_(models.front().model.tree.num_dofs()), f_(static_cast<int>(parameters.size())) {
  const Tree<double>& tree = models.front().model.tree;
  for (const MotionParameter& p : parameters)
    if (p.effect < 0 && (p.dof < 0 || p.theta < 0))
      throw ModelError("motion: a window has no derivative by a fixed transform");
  std::vector<BoundEffect> all = effects;
  for (const ModelOfRuns& m : models)
    all.insert(all.end(), m.model.effects.begin(), m.model.effects.end());
  for (const Limb& limb : limbs(models.front().model, all)) {
    const LimbPart part(tree, limb);
    std::vector<int> to;
    for (const int first : {0, joints_})
      for (int j = 0; j < limb.count; ++j) to.push_back(first + limb.first + j);
    std::vector<BoundEffect> own;
    std::vector<int> number(effects.size(), -1);  // among the limb's, for each effect
    for (std::size_t e = 0; e < effects.size(); ++e)
      if (part.has(effects[e])) {
        number[e] = static_cast<int>(own.size());
        own.push_back(part.effect(effects[e]));
      }
    std::vector<MotionParameter> of_limb;
    for (int k = 0; k < f_; ++k) {
      MotionParameter p = parameters[static_cast<std::size_t>(k)];
      int& of = p.effect >= 0 ? p.effect : p.dof;
      of = p.effect >= 0 ? number[static_cast<std::size_t>(of)] : part.link(of);
      if (of < 0) continue;
      of_limb.push_back(p);
      to.push_back(2 * joints_ + k);
    }
    std::vector<ModelOfRuns> of_runs;
    for (const ModelOfRuns& m : models) of_runs.push_back({m.runs, part.model(m.model)});
    parts_.push_back(
        {LimbWindows(limb, std::move(of_runs), std::move(own), of_limb, options), std::move(to)});
  }
}

bool JointWindows::linearise(const MotionStretch& stretch, const MotionWindow& window,
                             const VecX<double>& sigma, std::span<TriangularFactor> rows) {
  if (parts_.size() == 1) return parts_.front().windows.linearise(stretch, window, sigma, rows);
  const int width = 2 * joints_ + f_;
  bool reached = true;
  for (Part& part : parts_) {
    const int own = static_cast<int>(part.to.size());
    std::vector<TriangularFactor> factors(rows.size(), TriangularFactor(own));
    reached = part.windows.linearise(stretch, window, sigma, factors) && reached;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const MatX<double> R = factors[k].R();
      RowMatX<double> placed = RowMatX<double>::Zero(own + 1, width + 1);
      for (int c = 0; c < own; ++c)
        placed.col(part.to[static_cast<std::size_t>(c)]).head(own) = R.col(c);
      placed.col(width).head(own) = factors[k].d();
      placed(own, width) = std::sqrt(factors[k].residual_sum_of_squares());
      rows[k].add(placed);
    }
  }
  return reached;
}

double JointWindows::cost(const MotionStretch& stretch, const MotionWindow& window,
                          const VecX<double>& sigma) {
  double sum = 0.0;
  for (Part& part : parts_)
    if (sum < kInfinity) sum += part.windows.cost(stretch, window, sigma);
  return sum;
}

RowMatX<double> JointWindows::positions(const MotionStretch& stretch, const MotionWindow& window) {
  RowMatX<double> q = RowMatX<double>::Constant(window.rows, joints_, kNaN);
  for (Part& part : parts_) part.windows.positions(stretch, window, q);
  return q;
}

bool JointWindows::state_at(const MotionStretch& stretch, const MotionWindow& window, long row,
                            VecX<double>& out) {
  out.resize(2 * joints_);
  bool reached = true;
  for (Part& part : parts_) reached = part.windows.state_at(stretch, window, row, out) && reached;
  return reached;
}

VecX<double> JointWindows::torque_noise_reach(const MotionStretch& stretch,
                                              const MotionWindow& window,
                                              const VecX<double>& density) {
  VecX<double> out(joints_);
  for (Part& part : parts_) part.windows.torque_noise_reach(stretch, window, density, out);
  return out;
}

}  // namespace diffnea
