#pragma once
/// A motion that would tell rivals apart.

#include <array>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/recording/trajectory.hpp>

namespace diffnea {

/// A cause and a rival of its class, and how clearly they differ.
struct ExperimentPair {
  std::string effect;
  std::string where;
  std::string rival;
  std::string rival_where;
  double delta_bic = 0.0;
  double expected_delta_bic = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("ExperimentPair", "A cause and a rival of its class, and how clearly they differ.");
    list.field("effect", &ExperimentPair::effect, "The cause's effect.");
    list.field("where", &ExperimentPair::where, "Where it acts.");
    list.field("rival", &ExperimentPair::rival, "Effect of the rival.");
    list.field("rival_where", &ExperimentPair::rival_where, "Where that would act.");
    list.field("delta_bic", &ExperimentPair::delta_bic, "In this recording.");
    list.field("expected_delta_bic", &ExperimentPair::expected_delta_bic,
               "In the next one, if the cause is the cause.");
  }
};

/// Where RUN/ holds the motion.
inline const std::string kNextExperimentFile = "next_experiment.csv";

/// A motion that would tell the rivals apart.
struct NextExperiment {
  std::string sentence;
  std::vector<ExperimentPair> pairs;
  double expected_delta_bic = 0.0;
  std::string trajectory;
  Trajectory motion;

  /// Effect and rival of all pairs.
  std::vector<std::array<std::string, 2>> separates() const {
    std::vector<std::array<std::string, 2>> out;
    for (const ExperimentPair& pair : pairs) out.push_back({pair.effect, pair.rival});
    return out;
  }

  template <class List>
  static constexpr void fields(List& list) {
    list.type("NextExperiment", "A motion that would tell rivals apart.");
    list.field("sentence", &NextExperiment::sentence, "What to do, and what to expect of it.");
    list.derived("separates", &NextExperiment::separates,
                 "Effect and rival of all pairs, told apart or not.");
    list.field("pairs", &NextExperiment::pairs,
               "In question, a list of :class:`ExperimentPair`; told apart are those that expect "
               "10 or more.");
    list.field("expected_delta_bic", &NextExperiment::expected_delta_bic,
               "The smallest of the pairs that it tells apart.");
    list.field("trajectory", &NextExperiment::trajectory,
               "File beside the result; empty: no motion that was tried tells any pair apart.",
               {.empty_is_null = true});
    list.in_memory("motion", &NextExperiment::motion, "The :class:`Trajectory` to record.");
  }
};

}  // namespace diffnea
