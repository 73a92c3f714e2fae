#include "identify/constraint_geometry.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/dynamics/tree_constraints.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "identify/passes.hpp"
#include "identify/state_rows.hpp"

namespace diffnea {
namespace {

/// States that are kept [rows]; more are thinned out.
constexpr std::size_t kMostStates = 8192;
/// States whose scores are summed before they are squared [s]: longer than what filters remember.
constexpr double kScoreSeconds = 0.5;
/// Step that a transform may well take [rad, m], and how many times that the weak prior allows
/// (with_shape_steps, LinearFitOptions::prior_width).
constexpr double kTransformScale = 0.01, kTransformWidth = 10.0;
/// Least residual of a row that is no zero by structure, as of a planar loop across its plane.
constexpr double kLeastResidual = 1e-9;
constexpr int kMostTransformSteps = 30;
/// Largest step over the standard error that counts as none.
constexpr double kTransformSettled = 1e-2;

/// A state, and the block of states that it is of.
struct LoggedState {
  VecX<double> q, v;
  int block = 0;
};

/// ConstraintResiduals of all rows at all states, and their derivatives by the free parameters.
struct ConstraintResiduals {
  MatX<double> g;               ///< (states × rows)
  std::vector<MatX<double>> J;  ///< per free parameter (states × rows)
  std::vector<std::string> names;
};

class ConstraintGeometry {
 public:
  ConstraintGeometry(const Model& model, FitLayout layout, std::vector<LoggedState> states)
      : model_(model),
        layout_(std::move(layout)),
        states_(std::move(states)),
        constraints_(tree_constraints(model)),
        carriers_(joint_carriers(model)),
        tree_(make_tree(model)) {
    for (std::size_t s = 0; s < layout_.shape.size(); ++s)
      if (!layout_.shape[s].fixed) free_.push_back(static_cast<int>(s));
  }

  GeometryFit run() {
    const long p = static_cast<long>(free_.size());
    VecX<double> x = VecX<double>::Zero(static_cast<long>(layout_.shape.size())), std;
    const ConstraintResiduals first = residuals(x);
    ConstraintResiduals now = first;
    const double weak = 1.0 / std::pow(kTransformWidth * kTransformScale, 2);
    bool settled = false;
    for (int step = 0; step < kMostTransformSteps && !settled; ++step) {
      const VecX<double> sigma = sizes(now.g);
      MatX<double> H = MatX<double>::Zero(p, p), meat = H;
      VecX<double> slope = VecX<double>::Zero(p), score = slope;
      for (long i = 0; i < p; ++i) slope[i] = weak * x[free_[static_cast<std::size_t>(i)]];
      int block = -1;
      const auto close_block = [&] {
        meat += score * score.transpose();
        score.setZero();
      };
      for (long k = 0; k < now.g.rows(); ++k) {
        if (states_[static_cast<std::size_t>(k)].block != block) close_block();
        block = states_[static_cast<std::size_t>(k)].block;
        for (long c = 0; c < now.g.cols(); ++c) {
          VecX<double> row(p);
          for (long i = 0; i < p; ++i) row[i] = now.J[static_cast<std::size_t>(i)](k, c) / sigma[c];
          H += row * row.transpose();
          score += row * (now.g(k, c) / sigma[c]);
          slope += row * (now.g(k, c) / sigma[c]);
        }
      }
      close_block();
      H.diagonal().array() += weak;
      meat.diagonal().array() += weak;
      const Eigen::LDLT<MatX<double>> factor(H);
      const VecX<double> move = -factor.solve(slope);
      const MatX<double> half = factor.solve(meat);
      std = factor.solve(MatX<double>(half.transpose())).diagonal().cwiseMax(0.0).cwiseSqrt();
      for (long i = 0; i < p; ++i) x[free_[static_cast<std::size_t>(i)]] += move[i];
      now = residuals(x);
      settled = (move.cwiseAbs().array() <= kTransformSettled * std.array()).all();
    }
    return result(x, std, first, now, settled);
  }

 private:
  /// Root mean square of every row.
  static VecX<double> sizes(const MatX<double>& g) {
    return (g.colwise().squaredNorm().transpose() / static_cast<double>(g.rows()))
        .cwiseSqrt()
        .cwiseMax(kLeastResidual);
  }

  /// Jets have six directions: one pass a joint.
  ConstraintResiduals residuals(const VecX<double>& x) const {
    ConstraintResiduals out;
    out.J.resize(free_.size());
    for (std::size_t joint = 0; joint + 5 < layout_.shape.size(); joint += 6) {
      std::vector<JetD> shape;
      for (long s = 0; s < x.size(); ++s) {
        shape.emplace_back(x[s]);
        const long k = s - static_cast<long>(joint);
        if (k >= 0 && k < 6) shape.back().v[k] = 1.0;
      }
      Tree<JetD> tree = tree_.cast<JetD>();
      move_joints(layout_, carriers_, shape.data(), tree);
      LinkKinematics<JetD> kinematics;
      std::vector<BodyState<JetD>> links;
      TreeRows<JetD> rows;
      for (std::size_t k = 0; k < states_.size(); ++k) {
        const LoggedState& state = states_[k];
        const VecX<double> still = VecX<double>::Zero(state.v.size());
        forward_kinematics<JetD, double>(tree, state.q, state.v, still, kinematics);
        tree_rows(tree, constraints_, kinematics, links, rows);
        const long count = static_cast<long>(rows.rows.size()), at = static_cast<long>(k);
        if (out.g.size() == 0) {
          out.g.resize(static_cast<long>(states_.size()), count);
          for (MatX<double>& J : out.J) J.resize(out.g.rows(), count);
          for (const auto& row : rows.rows) out.names.push_back(row.name);
        }
        for (long c = 0; c < count; ++c) {
          const JetD& g = rows.rows[static_cast<std::size_t>(c)].g;
          out.g(at, c) = g.a;
          for (std::size_t i = 0; i < free_.size(); ++i)
            if (const long d = free_[i] - static_cast<long>(joint); d >= 0 && d < 6)
              out.J[i](at, c) = g.v[d];
        }
      }
    }
    return out;
  }

  GeometryFit result(const VecX<double>& x, const VecX<double>& std,
                     const ConstraintResiduals& before, const ConstraintResiduals& after,
                     bool settled) const {
    GeometryFit out;
    out.model = apply_fit(model_, layout_, {}, x);
    std::size_t i = 0;
    for (std::size_t s = 0; s < layout_.shape.size(); ++s) {
      const FitParameter& p = layout_.shape[s];
      const double error = p.fixed ? 0.0 : std[static_cast<long>(i++)];
      const bool known = !p.fixed && error < 0.5 * kTransformWidth * kTransformScale;
      out.parameters.push_back({p.name, p.unit, x[static_cast<long>(s)],
                                p.fixed || known ? error : kNaN, p.prior, known, p.fixed, false});
    }
    const VecX<double> first = sizes(before.g), last = sizes(after.g);
    for (const TreeConstraint<double>& c : constraints_.list) {
      double a = 0.0, b = 0.0;
      for (std::size_t r = 0; r < after.names.size(); ++r)
        if (after.names[r] == c.name) {
          a = std::max(a, first[static_cast<long>(r)]);
          b = std::max(b, last[static_cast<long>(r)]);
        }
      const std::string note = "constraint '" + c.name + "' was off by " + format_number(a) +
                               " m, m/s or rad (rms) before its transforms were fitted, now by " +
                               format_number(b);
      if (std::ranges::find(out.notes, note) == out.notes.end()) out.notes.push_back(note);
    }
    if (!settled)
      out.notes.push_back(std::string(kWarning) +
                          "the transforms have not settled; hold some of them (--fix)");
    return out;
  }

  const Model& model_;
  FitLayout layout_;
  std::vector<LoggedState> states_;
  TreeConstraints<double> constraints_;
  std::vector<Mat3<double>> carriers_;
  Tree<double> tree_;
  std::vector<int> free_;  ///< indices into the layout's shapes
};

/// States of all recordings, no closer than what the filter leaves independent.
std::vector<LoggedState> logged_states(const RecordingSource& train, const PreprocessPlan& plan,
                                       const IdentifyOptions& options) {
  std::vector<LoggedState> out;
  long stride = std::max(1L, std::lround(0.5 / (plan.filter_hz * plan.dt))), number = 0;
  int block = 0, segment = -1, run = -1;
  double begin = 0.0;
  for_each_block(train, plan, "closing loops", 0, options, [&](const Preprocessed& b) {
    const RowsOfState states(b);
    for (long k = 0; k < b.rows(); ++k, ++number) {
      const bool breaks = b.run != run || b.segment[static_cast<std::size_t>(k)] != segment;
      if (breaks || b.time[k] - begin > kScoreSeconds) {
        ++block;
        begin = b.time[k];
      }
      run = b.run;
      segment = b.segment[static_cast<std::size_t>(k)];
      if (number % stride != 0) continue;
      out.push_back({states.q.row(k).transpose(), states.v.row(k).transpose(), block});
    }
    while (out.size() > kMostStates) {  // every second one goes
      stride *= 2;
      std::size_t left = 0;
      for (std::size_t k = 0; k < out.size(); k += 2) out[left++] = std::move(out[k]);
      out.resize(left);
    }
  });
  return out;
}

}  // namespace

bool fits_kinematics(const FitChoice& choice) {
  return std::ranges::any_of(choice.fit,
                             [](const std::string& g) { return g.starts_with("kinematics"); });
}

GeometryFit fit_geometry(const Model& model, const RecordingSource& train, const FitChoice& choice,
                         const IdentifyOptions& options) {
  std::vector<std::string> unused;
  const FitLayout whole = layout_for(model, train, nullptr, choice, unused);
  FitLayout transforms;
  transforms.num_dofs = whole.num_dofs;
  transforms.base_rows = whole.base_rows;
  for (const FitParameter& p : whole.shape)
    if (p.kinematic >= 0) transforms.shape.push_back(p);
  const PreprocessPlan plan = plan_preprocess(train.sample(), options.preprocess);
  return ConstraintGeometry(model, std::move(transforms), logged_states(train, plan, options))
      .run();
}

}  // namespace diffnea
