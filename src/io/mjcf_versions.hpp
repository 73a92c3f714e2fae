#pragma once
/// Words of MJCF that are later than MuJoCo 2.2, which this project compiles models with, and what
/// they mean for a tree of bodies: one table.

#include <span>
#include <string>

#include "io/xml.hpp"

namespace diffnea::io {

/// Fate of a word.
enum class LaterMeans {
  kLeftOut,  ///< removed; a note names it
  kMapped,   ///< said in words of MuJoCo 2.2
  kRefused   ///< moves the tree, and cannot be said: an error
};

/// One line of the table.
struct LaterWord {
  const char* elements;    ///< tags, spaces between; PARENT/TAG where the parent decides
  const char* attributes;  ///< words, spaces between; nullptr: the elements themselves
  const char* since;       ///< first version that has it
  LaterMeans means;
  /// Left out: what it sets, in the plural. Mapped: to what. Refused: why, and what to do.
  const char* text;
  /// True for a value to which the line does not apply; nullptr: it applies to all.
  bool (*excepts)(const std::string& value) = nullptr;
  /// Says it in words of MuJoCo 2.2 and takes the word out, for kMapped; nullptr: done before
  /// (mjcf_generated.hpp, mjcf_attach.hpp).
  void (*map)(XmlElement& element, const char* attribute) = nullptr;
};

/// The latest version that the table knows.
inline constexpr const char* kLatestMjcf = "4.0";

std::span<const LaterWord> later_words();

/// Attribute `user` of an actuator, by which what a position drive brakes passes through the
/// compiler: two numbers, at kDriveDamping the damping, at kDampingRatio its ratio to the critical.
inline constexpr const char* kDriveBrakes = "user";
inline constexpr int kDriveDamping = 0, kDampingRatio = 1;

/// Attribute `user` of a joint, by which the range of force that its drives can have in all passes
/// through the compiler: two numbers, equal ones where there is no limit.
inline constexpr const char* kForceRange = "user";

}  // namespace diffnea::io
