#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/identify/compare.hpp>

#include "core/decompositions.hpp"
#include "core/statistics.hpp"

namespace diffnea {
namespace {

/// Directions whose information is below this share of the largest (in units of the parameters' own
/// standard errors) are not seen: exactly dependent columns leave 1e-13, seen ones 1e-8 and more.
constexpr double kUnseen = 1e-10;
/// A combination counts as seen if no more than this share of it lies in unseen directions.
constexpr double kOutside = 1e-4;

std::vector<std::string> joints_of(const IdentifyResult& fit) {
  std::vector<std::string> out;
  out.reserve(fit.errors.size());
  for (const JointError& e : fit.errors) out.push_back(e.joint);
  return out;
}

void require_same_joints(const IdentifyResult& before, const IdentifyResult& after) {
  const std::vector<std::string> a = joints_of(before), b = joints_of(after);
  if (a == b) return;
  throw DataError("compare: the fits are of different robots; joints of the first: " +
                  detail::join(a) + "; of the second: " + detail::join(b));
}

std::map<std::string, const ParameterEstimate*> by_name(const IdentifyResult& fit) {
  std::map<std::string, const ParameterEstimate*> out;
  for (const ParameterEstimate& p : fit.parameters) out[p.name] = &p;
  return out;
}

/// Variances of combinations of parameters, by the posterior's information.
class Variance {
 public:
  explicit Variance(const Posterior& posterior) {
    const long n = static_cast<long>(posterior.names.size());
    for (long i = 0; i < n; ++i) index_[posterior.names[i]] = i;
    const MatX<double> information =
        Eigen::Map<const MatX<double>>(posterior.information.data(), n, n);
    // Parameters of different units are made comparable by their own information.
    scale_ = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const MatX<double> scaled = scale_.asDiagonal() * information * scale_.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<MatX<double>> solver(scaled);
    values_ = solver.eigenvalues();
    vectors_ = solver.eigenvectors();
  }

  /// @return nothing if the data do not see the combination
  std::optional<double> of(const std::map<std::string, double>& combination) const {
    VecX<double> c = VecX<double>::Zero(scale_.size());
    for (const auto& [name, coefficient] : combination) {
      const auto found = index_.find(name);
      if (found == index_.end()) return std::nullopt;
      c[found->second] = coefficient * scale_[found->second];
    }
    const VecX<double> u = vectors_.transpose() * c;
    double variance = 0.0, outside = 0.0;
    for (long i = 0; i < u.size(); ++i) {
      if (values_[i] > kUnseen * values_[values_.size() - 1])
        variance += u[i] * u[i] / values_[i];
      else
        outside += u[i] * u[i];
    }
    if (outside > kOutside * kOutside * u.squaredNorm()) return std::nullopt;
    return variance;
  }

 private:
  std::map<std::string, long> index_;
  VecX<double> scale_, values_;
  MatX<double> vectors_;
};

Change make_change(const std::string& name, const std::string& unit, double before, double after,
                   double variance) {
  Change c{name, unit, before, after, std::sqrt(variance), 0.0, 1.0, false};
  c.z = (after - before) / c.std;
  c.p = std::erfc(std::abs(c.z) / std::numbers::sqrt2);
  return c;
}

/// Standard errors of the second fit over the first's; zero and unknown ones have no part.
class StdRatios {
 public:
  void add(double variance_before, double variance_after) {
    if (variance_before > 0.0 && variance_after > 0.0)
      logs_.push_back(0.5 * std::log(variance_after / variance_before));
  }
  /// Of the two in the middle, where there are two, the geometric mean: the fits in the other order
  /// have the reciprocal.
  double median() const {
    std::vector<double> negative = logs_;
    for (double& x : negative) x = -x;
    return std::exp(0.5 * (diffnea::median(logs_) - diffnea::median(negative)));
  }

 private:
  std::vector<double> logs_;
};

/// Sorts by significance and adjusts p for the number of tests (Holm 1979).
void holm(std::vector<Change>& changes, double alpha) {
  std::ranges::sort(changes,
                    [](const Change& a, const Change& b) { return std::abs(a.z) > std::abs(b.z); });
  double largest = 0.0;
  for (std::size_t k = 0; k < changes.size(); ++k) {
    largest = std::max(largest, changes[k].p * static_cast<double>(changes.size() - k));
    changes[k].p = std::min(largest, 1.0);
    changes[k].significant = changes[k].p < alpha;
  }
}

/// The base parameters of the first fit, evaluated in both.
/// @return the median ratio of their standard errors
double compare_combinations(const IdentifyResult& before, const IdentifyResult& after,
                            Comparison& out) {
  StdRatios ratios;
  const auto values = by_name(after);
  std::optional<Variance> seen;
  if (after.model.posterior && !after.model.posterior->names.empty())
    seen.emplace(*after.model.posterior);
  for (const BaseParameter& b : before.base_parameters) {
    std::map<std::string, double> combination;
    double value_before = 0.0, value_after = 0.0;
    bool known = true;
    for (std::size_t k = 0; k < b.columns.size(); ++k) {
      const ParameterEstimate& p = before.parameters[b.columns[k]];
      const auto found = values.find(p.name);
      known = known && found != values.end();
      if (!known) break;
      // What is held has no part in the uncertainty: the data see the combination by what moved.
      if (!found->second->fixed) combination[p.name] = b.coefficients[k];
      value_before += b.coefficients[k] * p.value;
      value_after += b.coefficients[k] * found->second->value;
    }
    std::optional<double> variance;
    if (known && seen) {
      variance = seen->of(combination);
    } else if (known) {
      for (const BaseParameter& other : after.base_parameters)
        if (other.expression == b.expression) variance = other.std * other.std;
    }
    if (!variance || !(*variance + b.std * b.std > 0.0)) {
      ++out.not_comparable;
      continue;
    }
    const std::string unit = b.columns.empty() ? "" : before.parameters[b.columns[0]].unit;
    out.base_parameters.push_back(
        make_change(b.expression, unit, value_before, value_after, *variance + b.std * b.std));
    ratios.add(b.std * b.std, *variance);
  }
  return ratios.median();
}

/// @return the median ratio of their standard errors
double compare_parameters(const IdentifyResult& before, const IdentifyResult& after,
                          Comparison& out) {
  StdRatios ratios;
  const auto known_before = by_name(before), known_after = by_name(after);
  for (const ParameterEstimate& p : after.parameters)
    if (!known_before.contains(p.name)) out.only_after.push_back(p.name);
  for (const ParameterEstimate& p : before.parameters) {
    const auto found = known_after.find(p.name);
    if (found == known_after.end()) {
      out.only_before.push_back(p.name);
      continue;
    }
    const ParameterEstimate& q = *found->second;
    if (!p.identifiable || !q.identifiable || p.fixed || q.fixed) continue;
    const double variance = p.std * p.std + q.std * q.std;
    if (variance > 0.0)
      out.parameters.push_back(make_change(p.name, p.unit, p.value, q.value, variance));
    ratios.add(p.std * p.std, q.std * q.std);
  }
  return ratios.median();
}

std::vector<LeftOver> left_over(const IdentifyResult& before, const IdentifyResult& after) {
  std::vector<LeftOver> out;
  for (std::size_t j = 0; j < before.errors.size(); ++j) {
    const JointError &a = before.errors[j], &b = after.errors[j];
    if (a.unit == b.unit) out.push_back({a.joint, a.unit, a.train, b.train});
  }
  return out;
}

}  // namespace

Comparison compare(const IdentifyResult& before, const IdentifyResult& after,
                   const CompareOptions& options) {
  require_same_joints(before, after);
  Comparison out;
  out.joints = joints_of(before);
  const double of_combinations = compare_combinations(before, after, out);
  const double of_parameters = compare_parameters(before, after, out);
  out.std_ratio = out.base_parameters.empty() ? of_parameters : of_combinations;
  out.left_over = left_over(before, after);
  holm(out.base_parameters, options.alpha);
  holm(out.parameters, options.alpha);
  out.changed = std::ranges::any_of(
      out.base_parameters.empty() ? out.parameters : out.base_parameters, &Change::significant);
  return out;
}

}  // namespace diffnea
