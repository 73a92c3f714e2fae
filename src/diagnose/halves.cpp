#include "diagnose/halves.hpp"

#include <algorithm>
#include <cmath>

#include "recording/between.hpp"
#include "recording/fresh_positions.hpp"
#include "recording/path_smoother.hpp"

namespace diffnea {
namespace {

/// Samples of a half over the path's cut-off: at two thirds of it, where the motion is as small as
/// the noise, polynomials of degree 5 between them are then good to a tenth.
constexpr double kRateOfHalf = 2.5;
/// Change of slope, over the positions' size, that is rounding of lines between new ones.
constexpr double kRounding = 1e-12;

int refresh_of(const PreprocessPlan& plan, long j) {
  return static_cast<std::size_t>(j) < plan.refresh.size() ? plan.refresh[static_cast<std::size_t>(j)]
                                                           : 1;
}

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

}  // namespace

bool halves_suffice(const PreprocessPlan& plan) {
  if (detail::is_slow_and_uneven(plan)) return false;  // which were new is not known any more
  int slowest = 1;
  for (const int r : plan.refresh) slowest = std::max(slowest, r);
  return plan.filter_hz * kRateOfHalf * 2.0 * slowest * plan.dt <= 1.0;
}

RowMatX<double> half_of(const RowMatX<double>& logged, const PreprocessPlan& plan, bool even) {
  RowMatX<double> out = logged;
  for (long j = 0; j < logged.cols(); ++j) {
    const VecX<double> y = logged.col(j);
    const std::vector<long> rows = new_rows(y, refresh_of(plan, j));
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

std::vector<int> rounded_joints(const PreprocessPlan& plan) {
  // Half a step of noise, and what rounding adds to it: 1/4 + 1/12 of a step squared.
  constexpr double kDithered = 1.0 / 3.0;
  std::vector<int> out;
  for (std::size_t j = 0; j < plan.q_step.size(); ++j)
    if (plan.q_noise[j] * plan.q_noise[j] < kDithered * plan.q_step[j] * plan.q_step[j])
      out.push_back(static_cast<int>(j));
  return out;
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
