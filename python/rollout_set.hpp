#pragma once
/// Rollouts as Python runs them: judged by a task, or kept whole.

#include <memory>

#include <pybind11/pybind11.h>

#include <diffnea/policy/rollouts.hpp>

#include "python_world.hpp"

namespace diffnea::python {

struct RolloutSet {
  std::shared_ptr<RolloutStore> store;  ///< null: rollouts are not kept
  std::unique_ptr<Rollouts> rollouts;
  std::vector<std::string> channels;
  double period = 0.0;
};

/// @param task   None: nothing ends; rollouts must then be kept
/// @param ended  None, or a function of an observation that ends episodes
/// @param whole  rollouts are kept, and their rewards are their places in the store
/// @throws Error if there is neither a task nor a store; as Rollouts
RolloutSet make_rollouts(const Simulator& simulator, const Promp& promp, const py::object& task,
                         const py::object& ended, bool whole, VecX<double> start,
                         MotionLimits limits, int threads);

/// time, channels, values, q_desired, reward, solved, failure
py::tuple trace_out(const RolloutTrace& trace);

}  // namespace diffnea::python
