#include "diagnose/halves.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "recording/between.hpp"
#include "recording/fresh_positions.hpp"
#include "recording/path_smoother.hpp"

namespace diffnea {
namespace {

/// Samples of a half over the path's cut-off: at two thirds of it, where the motion is as small as
/// the noise, polynomials of degree 5 between them are then good to a tenth.
constexpr double kRateOfHalf = 2.5;
/// Correlation of two halves' errors from which they are no instruments for each other. Sums of
/// sines have up to 0.1, moves at an even speed 0.3 to 0.6 at some joint.
constexpr double kShared = 0.25;
/// Change of slope, over the positions' size, that is rounding of lines between new ones.
constexpr double kRounding = 1e-12;

/// Rows at which a sensor has shown something new, or the same once more.
std::vector<long> new_rows(const VecX<double>& y, int refresh) {
  std::vector<long> out;
  const double rounding = kRounding * y.cwiseAbs().maxCoeff();
  for (long k = 0; k < y.size(); ++k)
    if (refresh < 2 || k == 0 || k + 1 == y.size() || k - out.back() >= refresh ||
        std::abs(y[k + 1] - 2.0 * y[k] + y[k - 1]) > rounding)
      out.push_back(k);
  return out;
}

/// Correlation of the accelerations that rounding makes of every other sample and of those between.
/// Smoothing has taken that away for the own steps; those of an encoder whose steps are a hundredth
/// larger are of the same kind.
double shared_rounding(const PreprocessPlan& plan, const std::vector<RowMatX<double>>& positions,
                       int joint) {
  const double step = 1.01 * plan.q_step[joint];
  const int refresh = plan.refresh[joint];
  const double hz = std::min(plan.filter_hz, 1.0 / (kRateOfHalf * 2.0 * refresh * plan.dt));
  const detail::PathSmoother smoother(hz, 1.0 / plan.dt);
  const long ends = std::lround(2.0 / (hz * plan.dt));  // they hang on few samples
  double both = 0.0, of_even = 0.0, of_odd = 0.0;
  for (const RowMatX<double>& stretch : positions) {
    const long inner = stretch.rows() - 2 * ends;
    if (inner <= 0) continue;
    RowMatX<double> q, qd, even, odd;
    smoother.smooth(RowMatX<double>(stretch.col(joint)), q, qd, even);
    RowMatX<double> error = step * (q / step).array().round().matrix() - q, other = error;
    for (long k = 0; k < error.rows(); ++k) (k / refresh % 2 == 0 ? other : error)(k, 0) = 0.0;
    smoother.smooth(error, q, qd, even);
    smoother.smooth(other, q, qd, odd);
    const auto a = even.col(0).segment(ends, inner), b = odd.col(0).segment(ends, inner);
    both += a.dot(b);
    of_even += a.squaredNorm();
    of_odd += b.squaredNorm();
  }
  return both / std::max(std::sqrt(of_even * of_odd), 1e-300);
}

}  // namespace

double cutoff_of_halves(const PreprocessPlan& plan) {
  if (detail::is_slow_and_uneven(plan)) return 0.0;  // which were new is not known any more
  int slowest = 1;
  for (const int r : plan.refresh) slowest = std::max(slowest, r);
  return 1.0 / (kRateOfHalf * 2.0 * slowest * plan.dt);
}

bool halves_suffice(const PreprocessPlan& plan) {
  return plan.filter_hz <= cutoff_of_halves(plan);
}

RowMatX<double> half_of(const RowMatX<double>& logged, const PreprocessPlan& plan, bool even) {
  RowMatX<double> out = logged;
  for (long j = 0; j < logged.cols(); ++j) {
    const VecX<double> y = logged.col(j);
    const std::vector<long> rows = new_rows(y, plan.refresh[j]);
    std::vector<long> known;
    for (std::size_t i = even ? 0 : 1; i < rows.size(); i += 2) known.push_back(rows[i]);
    if (known.empty()) continue;
    const VecX<double> at =
        VecX<double>::LinSpaced(y.size(), 0.0, static_cast<double>(y.size() - 1));
    for (long k = 0; k < y.size(); ++k)
      if (!std::ranges::binary_search(known, k)) out(k, j) = detail::between(at, y, known, k);
  }
  return out;
}

std::vector<int> joints_alike(const PreprocessPlan& plan,
                              const std::vector<RowMatX<double>>& positions) {
  // Half a step of noise, and what rounding adds to it: 1/4 + 1/12 of a step squared.
  constexpr double kDithered = 1.0 / 3.0;
  std::vector<int> out;
  if (!halves_suffice(plan)) {
    out.resize(positions.front().cols());
    std::iota(out.begin(), out.end(), 0);
    return out;
  }
  for (std::size_t j = 0; j < plan.q_step.size(); ++j)
    if (plan.q_noise[j] * plan.q_noise[j] < kDithered * plan.q_step[j] * plan.q_step[j])
      out.push_back(static_cast<int>(j));
  const bool alike = std::ranges::any_of(
      out, [&](int j) { return std::abs(shared_rounding(plan, positions, j)) > kShared; });
  return alike ? out : std::vector<int>{};
}

void smooth_more(const RowMatX<double>& positions, const PreprocessPlan& plan,
                 const std::vector<int>& joints, JointSeries& path) {
  if (joints.empty()) return;
  RowMatX<double> q, qd, qdd;
  detail::PathSmoother(0.5 * plan.filter_hz, 1.0 / path.dt)
      .smooth(positions(Eigen::all, joints), q, qd, qdd);
  path.q(Eigen::all, joints) = q;
  path.qd(Eigen::all, joints) = qd;
  path.qdd(Eigen::all, joints) = qdd;
}

}  // namespace diffnea
