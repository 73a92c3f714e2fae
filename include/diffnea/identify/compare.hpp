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

#include <diffnea/core/fields.hpp>
#include <diffnea/identify/identify.hpp>

namespace diffnea {

/// One quantity in two fits.
struct Change {
  std::string name;
  std::string unit;
  double before = 0.0;
  double after = 0.0;
  double std = 0.0;
  double z = 0.0;
  double p = 0.0;
  bool significant = false;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Change", "One quantity in two fits.");
    list.field("name", &Change::name, "A parameter, or the expression of a base parameter.");
    list.field("unit", &Change::unit,
               "Of all numbers here but z and p; of an expression: its first parameter's.");
    list.field("before", &Change::before, "In the first fit.");
    list.field("after", &Change::after, "In the second.");
    list.field("std", &Change::std, "Standard error of the difference.");
    list.field("z", &Change::z, "Difference over its standard error.");
    list.field("p", &Change::p,
               "Probability of such a z by chance, two-sided; adjusted for how many were tested.");
    list.field("significant", &Change::significant, "The change is more than chance explains.");
  }
};

/// What each fit leaves of its own recording at one joint. Where one leaves much more than the
/// other, its model lacks something there: that widens its uncertainties, and moves its parameters.
struct LeftOver {
  std::string joint;
  std::string unit;
  double before = 0.0;
  double after = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("LeftOver", "What each of two fits leaves of its own recording at one joint.");
    list.field("joint", &LeftOver::joint, "Its name, or ``ball``.");
    list.field("unit", &LeftOver::unit,
               "``N*m``, ``N``; motion loss: ``rad``, ``m``; of ``ball``: ``m``.");
    list.field("before", &LeftOver::before, "RMS of the series that was fitted, by the first fit.");
    list.field("after", &LeftOver::after, "By the second.");
  }
};

/// When a change counts.
struct CompareOptions {
  double alpha = 0.05;  ///< chance of any false alarm, in each of the two lists
};

/// What changed between two fits of one robot.
struct Comparison {
  std::vector<std::string> joints;
  std::vector<Change> base_parameters;
  std::vector<Change> parameters;
  std::vector<LeftOver> left_over;
  double std_ratio = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::string> only_before;
  std::vector<std::string> only_after;
  int not_comparable = 0;
  bool changed = false;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Comparison", "What changed between two fits of one robot.");
    list.field("joints", &Comparison::joints,
               "Of both fits; ``ball`` among them where one was fitted.");
    list.field("changed", &Comparison::changed,
               "Any base parameter (without them: any parameter) changed significantly.");
    list.field(
        "base_parameters", &Comparison::base_parameters,
        "Combinations that both fits see, most significant first; a list of :class:`Change`.");
    list.field("parameters", &Comparison::parameters,
               "Parameters that both fits see by themselves.");
    list.field("left_over", &Comparison::left_over,
               "A :class:`LeftOver` for each joint that both fit by the same loss.");
    list.field(
        "std_ratio", &Comparison::std_ratio,
        "Median of the second fit's standard errors over the first's, of ``base_parameters`` "
        "(without them: of ``parameters``); NaN if nothing is compared.");
    list.field("only_before", &Comparison::only_before, "Parameters that the first fit alone has.");
    list.field("only_after", &Comparison::only_after, "Parameters that the second fit alone has.");
    list.field("not_comparable", &Comparison::not_comparable,
               "Base parameters of the first fit that the second does not see.");
  }
};

/// @param before, after  with posteriors (Model::posterior) for combinations; without, the base
/// parameters of equal expression are compared
/// @throws DataError listing both sets of joints if the robots differ
Comparison compare(const IdentifyResult& before, const IdentifyResult& after,
                   const CompareOptions& options = {});

}  // namespace diffnea
