#include "diagnose/rows.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>

namespace diffnea {
namespace {

/// Where torques are compared, positions must not be attenuated: the order of their low-pass. (At
/// order 4, 14 % of an acceleration are missing at 0.8 of the cut-off, which looks like an elastic
/// joint.)
constexpr int kSteepFilter = 8;
constexpr double kLeastFilterHz = 5.0;

/// Of the frequency up to which positions tell something; of the recording's rate.
constexpr double kWide = 8.0, kWideShare = 0.05;

/// What a joint that moves goes through, in standard deviations of its position's noise.
constexpr double kMoves = 20.0;

/// Of the blocks that are held out [s]; where there are two of them only, they may be shorter.
constexpr double kLeastBlock = 4.0, kShortestBlock = 3.5;

/// Where the positions' noise, as an acceleration of the joint's own inertia, becomes four times
/// the torque's: beyond, rows tell little, and columns of accelerations are mostly noise. Median
/// over the joints.
double informative_hz(const Model& model, const PreprocessPlan& plan) {
  const Tree<double> tree = make_tree(model);
  MassMatrixWorkspace<double, double> ws;
  const MatX<double>& M =
      mass_matrix<double, double>(tree, VecX<double>::Zero(tree.num_dofs()), ws);
  std::vector<double> hz;
  for (int j = 0; j < tree.num_dofs(); ++j) {
    const std::size_t k = static_cast<std::size_t>(j);
    if (k >= plan.q_noise.size() || k >= plan.tau_noise.size() || !(plan.q_noise[k] > 0.0) ||
        !(plan.tau_noise[k] > 0.0) || !(M(j, j) > 0.0))
      continue;
    hz.push_back(std::sqrt(4.0 * plan.tau_noise[k] / (M(j, j) * plan.q_noise[k])) /
                 (2.0 * std::numbers::pi));
  }
  if (hz.empty()) return plan.filter_hz;
  std::ranges::nth_element(hz, hz.begin() + static_cast<long>(hz.size() / 2));
  return std::max(hz[hz.size() / 2], kLeastFilterHz);
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

RowsPlan plan_rows(const Model& model, const std::vector<Recording>& sample, double period,
                   Band band, const PreprocessOptions& options) {
  PreprocessOptions steep = options;
  steep.order = kSteepFilter;
  RowsPlan out{plan_preprocess(sample, steep)};
  if (options.filter_hz == 0.0) {
    const double moving = std::min(out.plan.filter_hz, informative_hz(model, out.plan));
    const double wide = std::min(kWide * moving, kWideShare / out.plan.dt);
    out.wider = wide > 1.5 * moving;
    steep.filter_hz = band == Band::kWide ? std::max(wide, moving) : moving;
    if (steep.filter_hz != out.plan.filter_hz) out.plan = plan_preprocess(sample, steep);
  }
  fit_rows_to_period(period, out.plan);
  // Beyond what the rows hold, positions bring noise alone, folded back by friction's turns.
  if (options.filter_hz == 0.0)
    out.plan.filter_hz =
        std::min(out.plan.filter_hz, 0.5 / (out.plan.dt * out.plan.decimator.factor));
  return out;
}

PreprocessPlan plan_held_out(const std::vector<Recording>& sample, const PreprocessPlan& fitted,
                             const PreprocessOptions& options) {
  PreprocessOptions same = options;
  same.order = kSteepFilter;
  same.filter_hz = fitted.filter_hz;
  PreprocessPlan out = plan_like(fitted, sample);
  const PreprocessPlan own = plan_preprocess(sample, same);  // for the noise of its sensors
  out.q_noise = own.q_noise;
  out.tau_noise = own.tau_noise;
  return out;
}

void require_motion(const Evidence& evidence, const PreprocessPlan& plan,
                    const std::string& source) {
  for (const int j : evidence.joints()) {
    const VecX<double> q = evidence.q().col(j);
    if (q.maxCoeff() - q.minCoeff() > kMoves * plan.q_noise.at(static_cast<std::size_t>(j))) return;
  }
  throw DataError(source +
                  ": diagnose: no joint whose torque is recorded moves; record a motion, e.g. one "
                  "of `diffnea excite`");
}

void split_in_time(const Evidence& evidence, std::vector<bool>& fitted, std::vector<bool>& held) {
  fitted.assign(static_cast<std::size_t>(evidence.rows()), false);
  held = fitted;
  const long m = evidence.times(),
             block = std::max<long>(m / 10,
                                    std::min(std::lround(kLeastBlock / evidence.step()), m / 2));
  if (static_cast<double>(m) * evidence.step() < 2.0 * kShortestBlock)
    throw DataError(
        "diagnose: " + format_number(static_cast<double>(m) * evidence.step()) +
        " s, without the ends that the filter needs, are too short to hold blocks of time out; " +
        "record " + format_number(2.5 * kLeastBlock) + " s or more, or give --test");
  const long guard = std::lround(1.0 / evidence.step());
  for (long i = 0; i < m; ++i) {
    const long inside = std::min(i % block, block - 1 - i % block);
    if (inside < guard / 2) continue;
    std::vector<bool>& which = (i / block) % 2 == 0 ? fitted : held;
    for (std::size_t k = 0; k < evidence.joints().size(); ++k)
      which[k * static_cast<std::size_t>(m) + static_cast<std::size_t>(i)] = true;
  }
}

}  // namespace diffnea
