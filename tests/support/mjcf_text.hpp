#pragma once
/// Robots given as text, and what the reader says to them.

#include <string>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>

#include "support/temporary_folder.hpp"

namespace diffnea::test {

inline constexpr const char* kInertial = "<inertial pos='0 0 .1' mass='1' diaginertia='.1 .1 .1'/>";

inline Model model_of(const TemporaryFolder& folder, const std::string& text,
               const ModelReading& reading = {}) {
  write_file_atomically(folder.path() / "robot.xml", text);
  return read_model(folder.path() / "robot.xml", reading);
}
inline Model model_of(const std::string& text, const ModelReading& reading = {}) {
  const TemporaryFolder folder;
  return model_of(folder, text, reading);
}

/// Reader's words for a text that it refuses.
inline std::string refusal(const TemporaryFolder& folder, const std::string& text,
                    const ModelReading& reading = {}) {
  try {
    model_of(folder, text, reading);
  } catch (const Error& error) {
    return error.what();
  }
  return "was read";
}
inline std::string refusal(const std::string& text, const ModelReading& reading = {}) {
  const TemporaryFolder folder;
  return refusal(folder, text, reading);
}

inline std::string notes_of(const Model& m) {
  std::string out;
  for (const std::string& note : m.notes) out += note + "\n";
  return out;
}

/// One joint `j` on body `a`; the rest goes where its name says.
struct Parts {
  std::string head = {}, joint = {}, in_body = {}, tail = {}, in_world = {};
};
inline std::string one_joint(const Parts& p) {
  return "<mujoco>" + p.head + "<worldbody>" + p.in_world + "<body name='a'>" + kInertial +
         "<joint name='j' " + p.joint + "/>" + p.in_body + "<site name='s'/></body></worldbody>" +
         p.tail + "</mujoco>";
}

}  // namespace diffnea::test
