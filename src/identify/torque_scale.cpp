#include "identify/torque_scale.hpp"

#include <algorithm>
#include <cmath>

#include "core/decompositions.hpp"

namespace diffnea {
namespace {

constexpr double kLeast = 1.25;      ///< smaller factors are those of masses and gears
constexpr double kAgreement = 1.15;  ///< of the joints, about their median
/// From this factor on it is the log's unit: masses of descriptions are seldom off by as much. Then
/// a third of the factor's logarithm is agreement enough: torque constants of an arm's drives
/// differ, 12 and 9 N·m/A, by less than an ampere does from a newton metre.
constexpr double kUnit = 3.0, kSpread = 1.0 / 3.0;
constexpr double kMajority = 0.8;   ///< light links' masses are often off by more
constexpr double kErrorLeft = 0.5;  ///< of the error without the factor

/// The factor of one joint's torque.
struct JointScale {
  double factor = 1.0;
  bool needed = false;  ///< without it the error is twice as large
};

/// Of one joint, if its links tell it.
std::optional<JointScale> torque_scale(const FitLayout& layout, const JointFactor& joint) {
  const MatX<double> R = joint.factor.R();
  const VecX<double> d = joint.factor.d();
  const double unexplained = joint.factor.residual_sum_of_squares();
  MatX<double> A = MatX<double>::Zero(R.rows(), R.cols() + 1);  // [links | all else]
  long columns = 1;
  for (long k = 0; k < R.cols(); ++k) {
    const int c = joint.columns[static_cast<std::size_t>(k)];
    if (c >= static_cast<int>(layout.linear.size())) return std::nullopt;  // shape directions
    const FitParameter& p = layout.linear[static_cast<std::size_t>(c)];
    if (p.fixed || p.effect < 0)
      A.col(0) += R.col(k) * p.prior;
    else
      A.col(columns++) = R.col(k);
  }
  A.conservativeResize(Eigen::NoChange, columns);
  const long rest = columns - 1;
  const auto solve = [](const auto& matrix, const VecX<double>& rhs) {
    return VecX<double>(Eigen::CompleteOrthogonalDecomposition<MatX<double>>(matrix).solve(rhs));
  };
  VecX<double> as_described = d - A.col(0), own = A.col(0);
  if (rest > 0) {
    const MatX<double> others = A.rightCols(rest);
    as_described -= others * solve(others, as_described);
    own -= others * solve(others, own);
  }
  const VecX<double> x = solve(A, d);
  const double described = as_described.squaredNorm() + unexplained;
  const double scaled = (A * x - d).squaredNorm() + unexplained;
  // The links must account for twice the error that stays, or their factor is a guess.
  if (!(x[0] * x[0] * own.squaredNorm() > 4.0 * scaled)) return std::nullopt;
  return JointScale{x[0], scaled < kErrorLeft * kErrorLeft * described};
}

}  // namespace

std::optional<TorqueScale> common_torque_scale(const FitLayout& layout,
                                               const std::vector<JointFactor>& factors) {
  std::vector<std::pair<int, JointScale>> told;
  std::vector<double> sorted;
  for (std::size_t j = 0; j < factors.size(); ++j) {
    if (factors[j].inertia.size() > 0) continue;  // passive
    const std::optional<JointScale> scale = torque_scale(layout, factors[j]);
    if (!scale) continue;
    told.emplace_back(static_cast<int>(j), *scale);
    sorted.push_back(scale->factor);
  }
  if (sorted.size() < 2) return std::nullopt;
  std::ranges::sort(sorted);
  TorqueScale out;
  out.factor = sorted[sorted.size() / 2];
  if (!(out.factor > 0.0) || std::abs(std::log(out.factor)) < std::log(kLeast)) return std::nullopt;
  const double size = std::abs(std::log(out.factor));
  const double agreement = size < std::log(kUnit) ? std::log(kAgreement) : kSpread * size;
  for (const auto& [joint, scale] : told)
    if (scale.needed && std::abs(std::log(scale.factor / out.factor)) < agreement)
      out.of_joint.emplace_back(joint, scale.factor);
  if (out.of_joint.size() < 2 ||
      static_cast<double>(out.of_joint.size()) < kMajority * static_cast<double>(told.size()))
    return std::nullopt;
  return out;
}

}  // namespace diffnea
