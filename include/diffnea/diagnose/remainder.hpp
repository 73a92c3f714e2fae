#pragma once
/// Errors that no cause explains: the variables it depends on, and what was learned of it.

#include <limits>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>

namespace diffnea {

/// How an error depends on the variables of its witness.
enum class WitnessForm {
  kFunction,     ///< a smooth function of them
  kOscillation,  ///< a line in its spectrum, in fitted and held-out rows
  kBursts,       ///< it is many times what the same motion shows elsewhere
  kExcess,       ///< it is many times the noise of the signals, whatever it depends on
};

/// Names in result files.
template <>
struct EnumNames<WitnessForm> {
  /// All forms.
  static constexpr NamedValue<WitnessForm> list[] = {{WitnessForm::kFunction, "function"},
                                                     {WitnessForm::kOscillation, "oscillation"},
                                                     {WitnessForm::kBursts, "bursts"},
                                                     {WitnessForm::kExcess, "excess"}};
};

/// Variables that the residual depends on.
struct Witness {
  std::string where;
  std::vector<std::string> variables;
  double share = 0.0;
  double delta_bic = 0.0;
  WitnessForm form = WitnessForm::kFunction;
  double frequency = std::numeric_limits<double>::quiet_NaN();

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Witness", "What the error that is left depends on.");
    list.field("where", &Witness::where, "Joint, or ``ball``.");
    list.field("variables", &Witness::variables,
               "Channel names as in the recording: ``q_joint2``, ``qd_joint2``; ``time``.");
    list.field("share", &Witness::share, "Of the mean square of the joint's error.");
    list.field("delta_bic", &Witness::delta_bic,
               "Of a smooth function of them beside the causes; NaN: of another form.",
               {.optional = true});
    list.field(
        "form", &Witness::form,
        "A smooth function of the variables, or an oscillation or bursts in the time that go "
        "with no motion, or an excess over what the signals' noise gives.",
        {.optional = true});
    list.field("frequency", &Witness::frequency, "Of an oscillation; else NaN.",
               {.unit = "Hz", .optional = true});
  }
};

/// Remainder that the grey box has learned at a joint where the verdict is kUnknown: the torque of
/// the effect `residual` (effects/residual.hpp) over the variables that the witness names. It is
/// among the causes as well, kUnknown: a remainder without a name, no physics.
struct GreyBox {
  std::string where;
  std::string unit;
  std::vector<std::string> variables;
  std::vector<std::string> units;
  int bumps = 0;
  double effective_parameters = 0.0;
  double bound = 0.0;
  double torque_rms = 0.0;
  double before = 0.0;
  double after = 0.0;
  std::vector<std::vector<double>> at;
  std::vector<double> torque;
  std::vector<double> std;

  template <class List>
  static constexpr void fields(List& list) {
    list.type(
        "GreyBox",
        "What was learned without a name at one joint, where no effect explains what is left: the "
        "torque of the\neffect ``residual`` over the variables of the witness. No physics.",
        {.files = kInResult});
    list.field("where", &GreyBox::where, "The joint.", {.files = kInBoth});
    list.field("unit", &GreyBox::unit, "Of its torque: ``N*m``, ``N``.");
    list.field("variables", &GreyBox::variables, "One or two channels, e.g. ``q_elbow``.",
               {.files = kInBoth});
    list.field("units", &GreyBox::units, "Of these.", {.files = kInSeries});
    list.field("bumps", &GreyBox::bumps, "Of its table.");
    list.field("effective_parameters", &GreyBox::effective_parameters,
               "That the fit spent on them, what ΔBIC counts.");
    list.field("bound", &GreyBox::bound, "Most that it gives: the most that was seen.",
               {.unit = "unit"});
    list.field("torque_rms", &GreyBox::torque_rms, "Its root mean square on held-out data.");
    list.field("before", &GreyBox::before, "RMS of the joint's held-out error without it.",
               {.unit = "unit"});
    list.field("after", &GreyBox::after, "RMS of that error with it.", {.unit = "unit"});
    list.field("at", &GreyBox::at, "Of each variable, values of the drawing's grid.",
               {.files = kInSeries});
    list.field("torque", &GreyBox::torque, "On the grid, the last variable fastest.",
               {.unit = "unit", .files = kInSeries});
    list.field("std", &GreyBox::std, "The same, of the posterior given its widths.",
               {.files = kInSeries});
  }
};

}  // namespace diffnea
