#pragma once
/// Two fits of one robot: what changed, and whether that is more than their uncertainties explain.
///
/// Single parameters are often not identifiable; combinations are. So the base parameters c·x of
/// the first fit are evaluated in the second, with its own standard error √(c Σ c): comparable
/// where the second fit sees the combination too. z = difference / √(σ₁² + σ₂²); Holm's procedure
/// (1979) keeps the chance of any false alarm among all base parameters below `alpha`.

#include <limits>
#include <string>
#include <vector>

#include <diffnea/identify/identify.hpp>

namespace diffnea {

/// One quantity in two fits.
struct Change {
  std::string name;  ///< a parameter, or the expression of a base parameter
  std::string unit;  ///< of all numbers here but z and p; of an expression: its first parameter's
  double before = 0.0;  ///< in the first fit
  double after = 0.0;   ///< in the second
  double std = 0.0;     ///< of the difference
  double z = 0.0;       ///< difference / std
  double p =
      0.0;  ///< probability of such a z by chance, two-sided; adjusted for how many were tested
  bool significant = false;  ///< p < CompareOptions::alpha
};

/// What each fit leaves of its own recording at one joint. Where one leaves much more than the
/// other, its model lacks something there: that widens its uncertainties, and moves its parameters.
struct LeftOver {
  std::string joint;    ///< its name, or `ball`
  std::string unit;     ///< "N*m", "N"; trajectory loss: "rad", "m"; of `ball`: "m"
  double before = 0.0;  ///< RMS of the series that was fitted, by the first fit
  double after = 0.0;   ///< by the second
};

/// When a change counts.
struct CompareOptions {
  double alpha = 0.05;  ///< chance of any false alarm, in each of the two lists
};

/// What changed between two fits of one robot.
struct Comparison {
  std::vector<std::string> joints;      ///< of both fits; `ball` among them where one was fitted
  std::vector<Change> base_parameters;  ///< combinations that both fits see, most significant first
  std::vector<Change> parameters;       ///< parameters that both fits see by themselves
  std::vector<LeftOver> left_over;      ///< joints of equal units (both fits by the same loss)
  /// Median of the second fit's standard errors over the first's, of `base_parameters` (without
  /// them: of `parameters`); NaN if nothing is compared.
  double std_ratio = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::string> only_before;  ///< parameters that the first fit alone has
  std::vector<std::string> only_after;   ///< parameters that the second fit alone has
  int not_comparable = 0;  ///< base parameters of the first fit that the second does not see
  bool changed = false;  ///< any base parameter (without them: any parameter) changed significantly
};

/// @param before, after  with posteriors (Model::posterior) for combinations; without, the base
/// parameters of equal expression are compared
/// @throws DataError listing both sets of joints if the robots differ
Comparison compare(const IdentifyResult& before, const IdentifyResult& after,
                   const CompareOptions& options = {});

}  // namespace diffnea
