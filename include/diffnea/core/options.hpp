#pragma once
/// Options of a command and of its Python function: names, text and bounds said once, beside the
/// struct that holds them; defaults are those of its members.
///
///     struct Options {
///       double filter_hz = 0.0;
///       int max_passes = 25;
///
///       template <class List>
///       void options(List& list) {
///         list.option("--filter", "filter_hz", filter_hz, "low-pass [Hz], 0: chosen", {.least =
///         0}); list.option(nullptr, "max_passes", max_passes, "over the data");
///       }
///     };
///
/// A name that is null: that side has no such option. Words that are no enumeration's:
///
///     list.words("--loss", "loss", {"inverse", "ball"}, "inverse", set, "…");
///
/// Visitors: apps/options.hpp, python/options.hpp.

#include <limits>

namespace diffnea {

/// Traits of an option besides names and text.
struct OptionTraits {
  double least = -std::numeric_limits<double>::infinity();  ///< smallest number a command takes
  bool above = false;                                       ///< `least` itself is too small
  bool by_commas = false;  ///< a list: a command splits it at commas, too
  bool all = false;        ///< an empty list stands for all there are; None in Python
};

}  // namespace diffnea
