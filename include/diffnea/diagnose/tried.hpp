#pragma once
/// Candidates that were tried, and why those that are no cause are none.

#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>

namespace diffnea {

/// How much of the catalogue a diagnosis tried.
enum class Tried { kAll, kSome, kNothing };

/// Names in Python.
template <>
struct EnumNames<Tried> {
  /// All there are.
  static constexpr NamedValue<Tried> list[] = {
      {Tried::kAll, "all"}, {Tried::kSome, "some"}, {Tried::kNothing, "nothing"}};
};

/// A candidate that could not be tested or was refused, and why.
struct Refusal {
  std::string effect;
  std::string where;
  std::string reason;
  double delta_bic = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Refusal", "A candidate that could not be tested, or was refused.");
    list.field("effect", &Refusal::effect, "Name, as of a cause.");
    list.field("where", &Refusal::where, "Place, as of a cause.");
    list.field("reason", &Refusal::reason, "Half a sentence: ``does not help on held-out data``.",
               {.optional = true});
    list.field("delta_bic", &Refusal::delta_bic,
               "What it gains on the fitted rows; 0: not tested, or not known.");
  }
};

/// One line of the table of candidates: at the first step, before anything was accepted.
struct CandidateScore {
  std::string effect;
  std::string where;
  double delta_bic = 0.0;
  double lm = 0.0;
  double visible_share = 0.0;
  std::vector<double> shape;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("CandidateScore", "A candidate before anything was accepted.");
    list.field("effect", &CandidateScore::effect, "Name, as of a cause.");
    list.field("where", &CandidateScore::where, "Place, as of a cause.");
    list.field("delta_bic", &CandidateScore::delta_bic,
               "Of adding it to the base alone; above 0 it is better.");
    list.field("lm", &CandidateScore::lm, "χ² that it removes, base refitted, to first order.");
    list.field("visible_share", &CandidateScore::visible_share,
               "Of its columns, what the base leaves; near 0: it cannot show.");
    list.field("shape", &CandidateScore::shape,
               "Its shape parameters where it scored best, as the search first tries them; empty: "
               "it has none, or is a ball's.",
               {.optional = true});
  }
};

/// An effect that this recording cannot show beside the base parameters.
struct Absorbed {
  std::string effect;
  std::string where;
  double visible_share = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Absorbed", "An effect that this recording cannot show beside the base parameters.");
    list.field("effect", &Absorbed::effect, "Name, as of a cause.");
    list.field("where", &Absorbed::where, "Place, as of a cause.");
    list.field("visible_share", &Absorbed::visible_share,
               "Of its columns, what the base leaves: below 0.01.");
  }
};

}  // namespace diffnea
