#pragma once
/// The ball of an MJCF, as dm_control draws it: a free body `ball`, and where it hangs on a string
/// a limited spatial tendon `string` from a site on the arm to a site on the ball. The upper limit
/// is the string's length, the centre of mass the ball's centre.

#include <optional>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include <diffnea/model/model.hpp>

#include "io/mjcf.hpp"
#include "io/xml.hpp"

namespace diffnea::io {

/// MuJoCo's numbers of the ball's parts.
struct MjcfBall {
  int body = -1;
  int tendon = -1;      ///< −1: no string
  int anchor = -1;      ///< site on the arm or in the world
  double offset = 0.0;  ///< from the site on the ball to the ball's centre, part of the length [m]
};

/// Tells whether the body floats, by a free joint.
bool is_free(const mjModel& m, int body);

/// Bodies of the free ball and what hangs on it: not part of the robot. Nor are bodies that stand
/// in the world beside a robot that floats.
/// @throws ModelError if several bodies are free beside the ball
std::vector<bool> left_out_bodies(const mjModel& m, const Mjcf& mjcf);

/// @param notes  gets what looks like a ball or string and is none, and what the ball loses
/// @return nothing if no free body is named `ball`
/// @throws ModelError if the tendon `string` is no string from the arm to the ball, or has no limit
std::optional<MjcfBall> find_ball(const mjModel& m, const std::string& where,
                                  std::vector<std::string>& notes);

/// @param link  the model link that carries the anchor's body, −1: the world
/// @param X_LB  that body's pose in it
BallSpec ball_spec(const mjModel& m, const MjcfBall& parts, int link, const Pose<double>& X_LB);

/// Puts the string of `now` into the document where it differs from `then`, which was read from it.
/// @param notes  gets what cannot be put there
/// @return `then` with what was put there
BallSpec write_string(XmlElement& root, const mjModel& m, const MjcfBall& parts,
                      const BallSpec& now, const BallSpec& then, std::vector<std::string>& notes);

}  // namespace diffnea::io
