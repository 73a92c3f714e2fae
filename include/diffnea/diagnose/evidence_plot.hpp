#pragma once
/// Signature of a cause in the torque error, to draw.

#include <limits>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>

namespace diffnea {

/// One line of a plot: means with their 95 % intervals; NaN where there is none.
struct EvidenceCurve {
  std::string model;
  std::vector<double> mean;
  std::vector<double> low;
  std::vector<double> high;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("EvidenceCurve", "One line of a plot: means with their 95 % intervals.",
              {.columns = true});
    list.field("model", &EvidenceCurve::model, "Whose error: ``base`` or ``extended``.",
               {.choices = "base|extended"});
    list.field("mean", &EvidenceCurve::mean,
               "Means, one for each ``x`` of the plot [``y_unit``]; NaN: none.");
    list.field("low", &EvidenceCurve::low, "Lower ends of their 95 % intervals.");
    list.field("high", &EvidenceCurve::high, "Upper ends of their 95 % intervals.");
  }
};

/// Signature of an effect in the torque error (measured − predicted) of held-out rows.
struct EvidencePlot {
  std::string kind;
  std::string joint;
  std::string x_name;
  std::string x_unit;
  std::string y_name;
  std::string y_unit;
  std::string effect;
  std::vector<double> x;
  std::vector<EvidenceCurve> curves;
  double mark = std::numeric_limits<double>::quiet_NaN();

  template <class List>
  static constexpr void fields(List& list) {
    list.type("EvidencePlot", "What an effect looks like in the torque error of held-out rows.");
    list.field("kind", &EvidencePlot::kind,
               "``velocity``, ``position``, ``spectrum``, ``reversal``, ``correlation``, …");
    list.field("joint", &EvidencePlot::joint, "Whose error.");
    list.field("effect", &EvidencePlot::effect, "The cause that it stands for; empty: an overview.",
               {.empty_is_null = true});
    list.field("x_name", &EvidencePlot::x_name,
               "What x is, in words: ``velocity``, ``time from the reversal of the torque``.");
    list.field("x_unit", &EvidencePlot::x_unit, "Its unit.");
    list.field("y_name", &EvidencePlot::y_name,
               "What the curves are: ``error``, ``error along the motion``, ``correlation``.");
    list.field("y_unit", &EvidencePlot::y_unit, "``N*m``; ``1``: none.");
    list.field("mark", &EvidencePlot::mark, "A ripple's own cycles [``x_unit``]; NaN: none.");
    list.field("x", &EvidencePlot::x,
               "Where the curves have points: middles of bins, cycles, lags.");
    list.field("curves", &EvidencePlot::curves,
               "Of the base model; where there is a cause, of the extended one.");
  }
};

}  // namespace diffnea
