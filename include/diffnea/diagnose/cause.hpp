#pragma once
/// An effect that the model lacks, with its size, its rivals and what it gains.

#include <limits>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/diagnose/verdict.hpp>

namespace diffnea {

/// One parameter of a cause with its uncertainty.
struct CauseParameter {
  std::string name;
  std::string unit;
  double value = 0.0;
  double std = std::numeric_limits<double>::quiet_NaN();
  double low = std::numeric_limits<double>::quiet_NaN();
  double high = std::numeric_limits<double>::quiet_NaN();

  template <class List>
  static constexpr void fields(List& list) {
    list.type("CauseParameter", "One parameter of a cause.");
    list.field("name", &CauseParameter::name, "As the effect has it (ParameterInfo): ``coulomb``.");
    list.field("value", &CauseParameter::value, "Estimate, or what it is held at.");
    list.field("unit", &CauseParameter::unit,
               "SI, as effects write it: ``N*m*s/rad``; ``1``: none.");
    list.field("std", &CauseParameter::std, "Standard error; NaN: held, or open.");
    list.field("low", &CauseParameter::low, "Lower end of its 95 % interval; NaN as std.",
               {.key = "ci95[0]"});
    list.field("high", &CauseParameter::high, "Upper end of its 95 % interval; NaN as std.",
               {.key = "ci95[1]"});
  }
};

/// Another effect in the place of a cause.
struct Rival {
  std::string effect;
  std::string where;
  double delta_bic = 0.0;
  bool more_general = false;
  double stability = std::numeric_limits<double>::quiet_NaN();

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Rival", "Another effect in the place of a cause.");
    list.field("effect", &Rival::effect, "Name, as of a cause.");
    list.field("where", &Rival::where, "Joint, pair of joints, ``tip``, ``base`` or ``all``.");
    list.field("delta_bic", &Rival::delta_bic, "How much worse the fit is with the rival instead.");
    list.field("more_general", &Rival::more_general,
               "Whether it has the cause as a special case: the simpler one is named unless it is "
               "better by far.");
    list.field("stability", &Rival::stability,
               "Share of random halves of the recording on which it is chosen; NaN: not asked.",
               {.optional = true});
  }
};

/// Gain of one step (or of all of them) on held-out data. Errors are of the filtered, decimated
/// torques, each joint's divided by its noise (of the ball's positions: by the camera's): 1 is
/// noise alone.
struct Gain {
  double before = 0.0;
  double after = 0.0;
  double noise_floor = 0.0;
  double explained_share = 0.0;
  double low = 0.0;
  double high = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Gain",
              "What causes gain on held-out data. Errors are of filtered, decimated torque, each "
              "joint's over its noise.");
    list.field("before", &Gain::before, "Root mean square without the cause.",
               {.key = "test_rmse_before"});
    list.field("after", &Gain::after, "Root mean square with it.", {.key = "test_rmse_after"});
    list.field("noise_floor", &Gain::noise_floor,
               "What no smooth function of the motion removes either.");
    list.field("explained_share", &Gain::explained_share,
               "Of the removable mean square; of one cause of a joint: of the whole mean square.");
    list.field(
        "low", &Gain::low,
        "Removed share of the mean square: lower end of the 95 % interval (block bootstrap).",
        {.key = "ci95[0]"});
    list.field("high", &Gain::high, "Its upper end.", {.key = "ci95[1]"});
  }
};

/// Share of the held-out error that all causes remove: a cause with less is no word in a sentence,
/// and worth no experiment.
inline constexpr double kWorthWords = 0.05;

/// An effect that the model lacks.
struct Cause {
  std::string effect;
  std::string where;
  Verdict verdict = Verdict::kNamed;
  std::vector<CauseParameter> parameters;
  double delta_bic = 0.0;
  double lm = 0.0;
  double visible_share = 0.0;
  double torque_share = 0.0;
  double stability = std::numeric_limits<double>::quiet_NaN();
  double share = std::numeric_limits<double>::quiet_NaN();
  std::vector<Rival> members;
  std::vector<Rival> rivals;
  Gain gain;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Cause", "An effect that the model lacks.");
    list.field("effect", &Cause::effect,
               "As ``diffnea effects`` lists it; ``residual``; or that of an own candidate.");
    list.field(
        "where", &Cause::where,
        "A joint, ``elbow,wrist``, ``tip``, ``base``, ``all``, ``ball``, ``string``, ``camera``.");
    list.field("verdict", &Cause::verdict,
               "``NAMED``; ``CLASS`` if ``members`` do as well; ``UNKNOWN``: a learned remainder.");
    list.field("parameters", &Cause::parameters,
               "All of the effect, those that are held included.");
    list.field("delta_bic", &Cause::delta_bic, "Of leaving it out.");
    list.field("lm", &Cause::lm,
               "Its share of χ², base refitted: twice the log-likelihood that it gains.");
    list.field("visible_share", &Cause::visible_share,
               "Of its torque: what the base parameters cannot take over.");
    list.field("torque_share", &Cause::torque_share,
               "Root mean square of its torque over that of its joint's torque.");
    list.field("stability", &Cause::stability,
               "Share of random halves of the recording on which it is chosen among itself and its "
               "rivals; NaN: not asked.",
               {.optional = true});
    list.field(
        "share", &Cause::share,
        "Of the held-out error² that all causes remove, each joint's counting alike, what it "
        "removes beside those before it; each is the next that removes most. NaN: not asked.",
        {.optional = true});
    list.field("members", &Cause::members,
               "Its class without itself: effects that this recording cannot tell from it; a list "
               "of :class:`Rival`.",
               {.key = "class"});
    list.field("rivals", &Cause::rivals, "The next ones, a list of :class:`Rival`.");
    list.field("gain", &Cause::gain, "Of this cause alone, the others in place.",
               {.optional = true});
  }
};

}  // namespace diffnea
