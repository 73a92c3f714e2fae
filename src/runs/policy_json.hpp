#pragma once
/// What files of policies, of searches and of their runs share. Every number is exact.

#include <diffnea/experiment/ball_in_cup.hpp>

#include "io/json.hpp"

namespace diffnea::io {

Json values(const VecX<double>& x);
/// {mean, covariance}: the covariance by rows.
Json gaussian(const Gaussian& g);
/// Columns of numbers by name, one value an iteration.
Json curve(const std::vector<ErepsIteration>& history);
Json primitive(const PrompSpec& spec);
Json search(const ErepsOptions& o);
Json controller(const ControllerOptions& o);
Json reward(const BallInCupOptions& o);
/// {draws, caught, reward}.
Json in_draws(const InDraws& d);
Json network_source(const NetworkSource& source);
/// Start, primitive, search, reward, simulator, robust, and of a network which one: all that is not
/// a model.
Json task(const BallInCup& task);

VecX<double> read_values(JsonObject& o, const char* key);
long read_integer(JsonObject& o, const char* key);
std::uint64_t read_seed(JsonObject& o);
/// @throws ModelError if it is not positive definite, or has another size
Gaussian read_gaussian(JsonObject& o, long size);
std::vector<ErepsIteration> read_curve(JsonObject& o, const char* key);
/// @throws ModelError if no primitive can be so
PrompSpec read_primitive(JsonObject& o);
ErepsOptions read_search(JsonObject& o);
ControllerOptions read_controller(JsonObject& o, long joints);
BallInCupOptions read_reward(JsonObject& o);
/// Reads `in_draws`, which need not be there.
InDraws read_in_draws(JsonObject& o);
/// The key `ball_network`; empty where there is none.
NetworkSource read_network_source(JsonObject& o);
/// Reads `task`, without its network. @param joints  of the model
LearnOptions read_task(JsonObject& root, long joints);

}  // namespace diffnea::io
