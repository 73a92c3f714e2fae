#include "identify/local_factors.hpp"

#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/effects/extended_tree.hpp>

#include "identify/passes.hpp"

namespace diffnea {
namespace {

double middle_time(const MotionStretch& stretch, const MotionWindow& window) {
  return stretch.time[static_cast<std::size_t>(window.first + window.rows / 2)];
}

}  // namespace

std::vector<LocalMotion> middle_motions(const std::vector<MotionStretch>& stretches,
                                        const std::vector<MotionWindow>& windows) {
  std::vector<LocalMotion> out;
  for (const MotionWindow& w : windows) {
    const MotionStretch& s = stretches[w.stretch];
    out.push_back(local_motion(s, middle_time(s, w), w.first, w.rows));
  }
  return out;
}

std::vector<JointFactor> local_factors(const Model& model, const FitLayout& layout,
                                       const std::vector<MotionStretch>& stretches,
                                       const std::vector<MotionWindow>& windows,
                                       const std::vector<LocalMotion>& motions,
                                       const CountsFor& counts) {
  const int n = layout.num_dofs;
  const long p = static_cast<long>(layout.linear.size());
  const Tree<double> tree = make_tree(model);
  std::vector<JointFactor> out(static_cast<std::size_t>(n));
  for (int j = 0; j < n; ++j) {
    out[static_cast<std::size_t>(j)].columns = layout.columns_of_row(tree, j);
    out[static_cast<std::size_t>(j)].factor =
        TriangularFactor(static_cast<int>(out[static_cast<std::size_t>(j)].columns.size()));
  }
  RegressorWorkspace<double, double> ws;
  RowMatX<double> Y(n, p + 1);
  const VecX<double> prior = layout.prior();
  VecX<double> transmitted(n);
  std::vector<double> scratch;
  std::shared_ptr<const CommandPath> told;  // commands of the run
  CommandPath led;                          // these, as the drives lead them
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const MotionWindow& w = windows[i];
    const MotionStretch& s = stretches[w.stretch];
    const LocalMotion& at = motions[i];
    Y.setZero();
    const RowMatX<double>& links = torque_regressor<double, double>(tree, at.q, at.qd, at.qdd, ws);
    JointSample<double> x;
    x.time = middle_time(s, w);
    if (s.command && s.command != told) {
      told = s.command;
      led = *told;
      for (const BoundEffect& e : layout.effects) lead_command(e, led);
    }
    x.command = s.command ? &led : nullptr;
    const double period = s.length() / static_cast<double>(s.time.size() - 1);
    x.step = {x.time - 0.5 * period, x.time + 0.5 * period};
    x.run = s.run;
    x.q = at.q.data();
    x.qd = at.qd.data();
    const auto is_absent = [&](const FitParameter& def) {
      return def.effect >= 0 && !layout.effects[static_cast<std::size_t>(def.effect)].acts_in(s.run);
    };
    for (long c = 0; c < p; ++c) {
      const FitParameter& def = layout.linear[static_cast<std::size_t>(c)];
      if (def.theta < 0 || is_absent(def)) continue;
      const int link = def.effect < 0
                           ? def.dof
                           : layout.effects[static_cast<std::size_t>(def.effect)].links.at(0);
      Y.col(c) = links.col(kThetaSize * link + def.theta);
    }
    transmitted = Y.leftCols(p) * prior;  // nothing but links so far
    x.qdd = at.qdd.data();
    x.tau = transmitted.data();
    std::vector<std::size_t> next(layout.effects.size(), 0);  // linear parameter of each effect
    for (long c = 0; c < p; ++c) {
      const FitParameter& def = layout.linear[static_cast<std::size_t>(c)];
      if (def.theta >= 0 || is_absent(def)) continue;
      const BoundEffect& e = layout.effects[static_cast<std::size_t>(def.effect)];
      const std::size_t k = next[static_cast<std::size_t>(def.effect)]++;
      scratch.resize(e.linear_parameters().size() * static_cast<std::size_t>(n));
      linear_columns(e, x, scratch.data());
      Y.col(c) =
          Eigen::Map<const VecX<double>>(scratch.data() + k * static_cast<std::size_t>(n), n);
    }
    Y.col(p) = s.u.row(w.first + w.rows / 2).transpose();
    for (int j = 0; j < n; ++j) {
      if (counts && !counts(w, j)) continue;
      JointFactor& f = out[static_cast<std::size_t>(j)];
      RowMatX<double> row(1, static_cast<long>(f.columns.size()) + 1);
      for (std::size_t k = 0; k < f.columns.size(); ++k)
        row(0, static_cast<long>(k)) = Y(j, f.columns[k]);
      row(0, row.cols() - 1) = Y(j, p);
      f.factor.add(row);
    }
  }
  return out;
}

VecX<double> inverse_guess(const FitLayout& layout, const std::vector<JointFactor>& factors) {
  try {
    return fit_linear(layout, factors).x;
  } catch (const DataError&) {
    return {};
  }
}

std::vector<JointFactor> hold_absorbed(const Model& model,
                                       const std::vector<MotionStretch>& stretches,
                                       const std::vector<MotionWindow>& windows, FitLayout& layout,
                                       std::vector<std::string>& notes) {
  std::vector<JointFactor> out = local_factors(model, layout, stretches, windows,
                                               middle_motions(stretches, windows));
  for (const int c : absorbed_by_links(layout, out)) {
    FitParameter& p = layout.linear[static_cast<std::size_t>(c)];
    p.fixed = true;
    p.absorbed = true;
    notes.push_back(p.name + " cannot be told from the links' inertia, which absorbs it: held at " +
                    format_number(p.prior));
  }
  return out;
}

}  // namespace diffnea
