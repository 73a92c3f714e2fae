#include "diagnose/rows.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

#include "core/constants.hpp"
#include "diagnose/halves.hpp"
#include "dynamics/loop_motion.hpp"
#include "recording/cut_off.hpp"
#include "recording/overlap.hpp"

namespace diffnea {
namespace {

/// Rows a second, over the frequency up to which they tell something: what lies beyond half of it
/// is a hundredth of that.
constexpr double kRowsOverCutOff = 8.0;
/// Rows a second: the fewest that tell turns of a motion apart; as many as a fit usually has, which
/// bounds the cost where one light joint would ask for more.
constexpr double kLeastRows = 10.0, kMostRows = 50.0;

/// What a joint that moves goes through, in standard deviations of its position's noise.
constexpr double kMoves = 20.0;

/// Stretches of which every other one is held out: each half is then a sample of the motion.
constexpr int kManyStretches = 8;
/// Of the blocks that are held out [s]; where there are two of them only, they may be shorter.
constexpr double kLeastBlock = 4.0, kShortestBlock = 3.5;

/// Inertia that each joint moves: at 0, of a closed chain with all that moves with it, in its first
/// posture.
VecX<double> inertias(const Model& links, const std::vector<Recording>& sample) {
  const Tree<double> tree = make_tree(links);
  MassMatrixWorkspace<double, double> ws;
  VecX<double> q = VecX<double>::Zero(tree.num_dofs());
  if (links.constraints.empty()) return mass_matrix<double, double>(tree, q, ws).diagonal();
  const RowMatX<double>& logged = sample.front().q;
  for (long k = 0; k < logged.rows(); ++k)
    if (logged.row(k).allFinite()) {
      q = logged.row(k).transpose();
      break;
    }
  const MatX<double>& M = mass_matrix<double, double>(tree, q, ws);
  return loop_mobility(tree, tree_constraints(links), q, M).cwiseInverse();
}

/// The highest frequency at which the positions' noise, as a torque of a joint's own inertia, is
/// still below the torque's: beyond, rows tell little (torque_filter.hpp). 0: not known.
double telling_hz(const Model& links, const std::vector<Recording>& sample,
                  const PreprocessPlan& plan) {
  const VecX<double> inertia = inertias(links, sample);
  double out = 0.0;
  for (long j = 0; j < inertia.size(); ++j) {
    if (!(plan.tau_noise[j] > 0.0)) continue;
    if (!(plan.q_noise[j] > 0.0) || !(inertia[j] > 0.0)) return 0.0;
    out = std::max(out, std::sqrt(plan.tau_noise[j] / (inertia[j] * plan.q_noise[j])) /
                            (2.0 * std::numbers::pi));
  }
  return out;
}

/// Rows of a period must be a whole number, so that its repeats can be compared.
void fit_rows_to_period(double period, PreprocessPlan& plan) {
  const long samples = std::lround(period / plan.dt);
  if (period <= 0.0 || samples < 1) return;
  for (int factor = plan.decimator.factor; factor > plan.decimator.factor / 2 && factor >= 1;
       --factor)
    if (samples % factor == 0) {
      plan.decimator.factor = factor;
      return;
    }
}

}  // namespace

PreprocessPlan plan_rows(const Model& links, const std::vector<Recording>& sample, double period,
                         const PreprocessOptions& options) {
  PreprocessOptions any = options;
  any.min_segment = 0.0;
  PreprocessPlan out = plan_preprocess(sample, any);
  // With one path effects see half the cut-off (smooth_more()); two that keep as much are better.
  // Not where the cut-off is the highest there is: what moves above either's is no noise then.
  const double own = out.filter_hz, highest = detail::kTrueTo / out.dt;
  if (const double hz = cutoff_of_halves(out);
      options.filter_hz == 0.0 && own < highest && hz < own && hz >= 0.5 * own) {
    any.filter_hz = hz;
    out = plan_preprocess(sample, any);
  }
  if (const double hz = telling_hz(links, sample, out); options.decimate_to_hz == 0.0 && hz > 0.0) {
    const double of_motion = 1.0 / (out.dt * out.decimator.factor);
    const double rows =
        std::clamp(kRowsOverCutOff * hz, kLeastRows, std::max(kMostRows, of_motion));
    out.decimator.factor = std::max(1, static_cast<int>(std::lround(1.0 / (out.dt * rows))));
  }
  fit_rows_to_period(period, out);
  return out;
}

PreprocessPlan plan_held_out(const std::vector<Recording>& sample, const PreprocessPlan& fitted,
                             const PreprocessOptions& options) {
  PreprocessPlan out = plan_like(fitted, sample);
  PreprocessOptions any = options;
  any.min_segment = any.filter_hz = any.decimate_to_hz = 0.0;
  const PreprocessPlan own = plan_preprocess(sample, any);  // for the noise of its sensors
  out.q_noise = own.q_noise;
  out.q_step = own.q_step;
  out.tau_noise = own.tau_noise;
  return out;
}

void require_motion(const Evidence& evidence, const PreprocessPlan& plan,
                    const std::vector<Recording>& sample) {
  std::vector<std::string> still;
  for (const int j : evidence.joints()) {
    still.push_back(sample.front().joint_names.at(j));
    double low = kInfinity, high = -kInfinity;
    for (const JointSeries& s : evidence.series()) {
      low = std::min(low, s.q.col(j).minCoeff());
      high = std::max(high, s.q.col(j).maxCoeff());
    }
    const double noise = std::max(plan.q_noise.at(j), kLeastPosition);
    if (high - low > kMoves * noise) return;
  }
  const std::string lost = detail::uneven_columns(sample);
  throw DataError(sample.front().source + ": diagnose: no joint whose torque is recorded moves (" +
                  detail::join(still) + ")" +
                  (lost.empty() ? std::string()
                                : " in the " +
                                      format_number(static_cast<double>(evidence.times()) *
                                                    evidence.step()) +
                                      " s in which every column has a value (" + lost + ")") +
                  "; record a motion, e.g. one of `diffnea excite`");
}

void split_in_time(const Evidence& evidence, std::vector<bool>& fitted, std::vector<bool>& held) {
  fitted.assign(evidence.rows(), false);
  held = fitted;
  const long m = evidence.times();
  const auto put = [&](long i, bool hold) {
    for (std::size_t k = 0; k < evidence.joints().size(); ++k)
      (hold ? held : fitted)[k * m + i] = true;
  };
  if (evidence.stretch().back() + 1 >= kManyStretches) {
    for (long i = 0; i < m; ++i) put(i, evidence.stretch()[i] % 2 == 1);
    return;
  }
  const long block = std::max<long>(
      m / 10, std::min(std::lround(kLeastBlock / evidence.step()), m / 2));
  if (static_cast<double>(m) * evidence.step() < 2.0 * kShortestBlock)
    throw DataError("diagnose: " + format_number(static_cast<double>(m) * evidence.step()) +
                    " s are too short to hold blocks of time out; record " +
                    format_number(2.5 * kLeastBlock) + " s or more, or give --test");
  const long guard = std::lround(1.0 / evidence.step());
  for (long i = 0; i < m; ++i)
    if (std::min(i % block, block - 1 - i % block) >= guard / 2) put(i, (i / block) % 2 == 1);
}

}  // namespace diffnea
