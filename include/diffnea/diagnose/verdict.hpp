#pragma once
/// Verdicts of a diagnosis, and from which held-out error on a verdict speaks of it.

#include <diffnea/core/fields.hpp>

namespace diffnea {

/// Outcome of a diagnosis (docs/diagnosis.md).
enum class Verdict {
  kNamed,            ///< every cause has one name
  kClass,            ///< some cause cannot be told from its rivals with this recording
  kUnknown,          ///< something is left that no effect of the catalogue explains
  kNone,             ///< nothing is left to explain
  kNotIdentifiable,  ///< the recording cannot show what the model lacks
};

/// Names in result files.
template <>
struct EnumNames<Verdict> {
  /// All verdicts.
  static constexpr NamedValue<Verdict> list[] = {{Verdict::kNamed, "NAMED"},
                                                 {Verdict::kClass, "CLASS"},
                                                 {Verdict::kUnknown, "UNKNOWN"},
                                                 {Verdict::kNone, "NONE"},
                                                 {Verdict::kNotIdentifiable, "NOT_IDENTIFIABLE"}};
};

/// Held-out error over the noise that a sentence mentions: 1.24 at most in 264 recordings that hide
/// nothing.
inline constexpr double kUneasy = 1.35;

/// Held-out error over the noise that no verdict passes over: 1.37 at most in 207 of 209 recordings
/// whose cause was named.
inline constexpr double kFarOff = 3.0;

}  // namespace diffnea
