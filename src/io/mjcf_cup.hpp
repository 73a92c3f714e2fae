#pragma once
/// The cup of an MJCF and what else the ball must not touch: `<custom><numeric name="cup"
/// data="INNER_RADIUS WALL FLOOR RIM"/></custom>` gives the dimensions [m] of the cup at the site
/// `cup`; the robot's capsules and spheres that collide with the ball are its obstacles.

#include <optional>
#include <string>
#include <vector>

#include <mujoco/mujoco.h>

#include <diffnea/model/model.hpp>

namespace diffnea::io {

/// Where a body B is in the model.
struct BodyAt {
  int link = -1;
  Pose<double> X_LB = Pose<double>::identity();
};

/// @return nothing if there is no numeric `cup`
/// @throws ModelError if it has not four numbers
std::optional<CupSpec> find_cup(const mjModel& m, const std::string& where);

/// By MuJoCo's rule of contype and conaffinity; the ball's own geoms are none.
/// @param bodies  one entry a body; those of `left_out` are not read
/// @param notes   gets the shapes of other kinds that the ball collides with; those of the cup are
/// what the cup stands for
std::vector<CapsuleSpec> find_obstacles(const mjModel& m, int ball,
                                        const std::vector<BodyAt>& bodies,
                                        const std::vector<bool>& left_out,
                                        std::vector<std::string>& notes);

}  // namespace diffnea::io
