#pragma once
/// Robots given as text: the reader's model or its refusal, and whether two are the same.

#include <algorithm>
#include <cmath>
#include <string>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>

#include "support/matrix_near.hpp"
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

inline const ModelLink& link_of(const Model& m, const std::string& joint) {
  return *std::ranges::find(m.links, joint, &ModelLink::joint);
}

/// Poses are turned and added in another order than the compiler's: rounding of numbers of order 1.
inline constexpr double kPoseTol = 1e-14;

/// Same links, joints, frames and inertias.
inline void check_same(const Model& a, const Model& b) {
  REQUIRE(a.links.size() == b.links.size());
  const auto near = [](const Pose<double>& x, const Pose<double>& y) {
    CHECK_THAT(to_eigen(x.p), MatrixNear(to_eigen(y.p), kPoseTol));
    CHECK_THAT(to_eigen(x.R), MatrixNear(to_eigen(y.R), kPoseTol));
  };
  for (std::size_t i = 0; i < a.links.size(); ++i) {
    const ModelLink &x = a.links[i], &y = b.links[i];
    CAPTURE(x.name, y.name);
    CHECK(x.name == y.name);
    CHECK(x.joint == y.joint);
    CHECK(x.parent == y.parent);
    near(x.X_PJ, y.X_PJ);
    CHECK_THAT(to_eigen(x.axis), MatrixNear(to_eigen(y.axis), kPoseTol));
    const Theta<double> s = x.inertia.theta(), t = y.inertia.theta();
    for (int k = 0; k < kThetaSize; ++k)
      CHECK(std::abs(s[k] - t[k]) <= kPoseTol * std::max(1.0, t[0]));  // mass, poses of 1 m
  }
  REQUIRE(a.frames.size() == b.frames.size());
  for (std::size_t i = 0; i < a.frames.size(); ++i) near(a.frames[i].X_LF, b.frames[i].X_LF);
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
