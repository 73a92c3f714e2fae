#pragma once
/// Charts of searches and of what came of them.

#include <string>

#include <diffnea/runs/policy_result.hpp>

namespace diffnea::report {

/// Reward, captures, entropy and KL of all seeds over iterations; one policy's is drawn boldly.
std::string learning_curves(const std::vector<LearnedPolicy>& policies, const ErepsOptions& options,
                            int bold);
/// Obtained against expected reward, a point a policy.
std::string reward_scatter(const TransferRun& run);
/// From the ball to the cup's origin over time, imagined and obtained.
std::string distance_chart(const RolloutTrace& imagined, const RolloutTrace& obtained);

}  // namespace diffnea::report
