#pragma once
/// The component `diffnea::dynamics` in one line: groups, link trees and inertias, the recursions
/// and their derivatives, bodies under constraints, a ball on a string. Header-only: needs Eigen
/// and ceres/jet.h, and no library (core/compiled.hpp). An effect has its own header, e.g.
/// effects/coulomb_friction.hpp. Batches of states (dynamics/batch.hpp) need the compiled library.

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/ball_flight.hpp>
#include <diffnea/dynamics/constrained_bodies.hpp>
#include <diffnea/dynamics/constraints.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/free_motion.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/dynamics/string_particle.hpp>
#include <diffnea/dynamics/string_route.hpp>
#include <diffnea/dynamics/string_step.hpp>
#include <diffnea/model/model.hpp>
#include <diffnea/model/physical.hpp>
