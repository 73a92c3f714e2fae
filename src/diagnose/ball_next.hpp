#pragma once
/// The motion that tells apart what a recording of a ball could not. Internal to diagnose/.

#include <cstdint>
#include <optional>
#include <span>

#include <diffnea/diagnose/cause.hpp>
#include <diffnea/diagnose/next_experiment.hpp>

#include "diagnose/ball_search.hpp"

namespace diffnea {

/// argmax over random motions of the hand (slow, ordinary, lively; several draws) of the smallest
/// ψ²‖M g‖²/σ² over the pairs of a cause and a rival of its class: g is what the cause moves the
/// ball by, M projects out the base, the other causes, the rival and the windows' initial states.
/// @return empty without a string on a link that joints move
std::optional<NextExperiment> ball_next_experiment(const BallSolution& best,
                                                   std::span<const Cause> causes, double sigma,
                                                   std::uint64_t seed);

}  // namespace diffnea
