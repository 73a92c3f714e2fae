#pragma once
/// A string with mass for a MuJoCo world: a chain of capsules in place of a massless tendon.

#include <string>

#include <diffnea/worlds/world.hpp>

namespace diffnea::io {

/// The document with a chain in place of the tendon `string`, on whose end the body `ball` hangs.
/// As long as the tendon of `truth` (to the ball's centre) and tied where it says; the attachment
/// moves with its site.
/// @param nominal  the document's own model
/// @throws ModelError if it has no ball on a string
std::string with_chain(const std::string& mjcf, const Model& nominal, const Model& truth,
                       const Rope& rope);

/// The document without its ball and string. @throws ModelError if it is no XML
std::string without_ball(const std::string& mjcf, const Model& truth);

}  // namespace diffnea::io
