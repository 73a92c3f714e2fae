#pragma once
/// What is fuzzed: one function a format, each of which hands its input to the readers that users
/// hand foreign files to. The contract: a result or a diffnea::Error, whatever the input; no other
/// exception, crash, hang, leak or undefined behaviour, and memory in proportion to the input.
///
/// The same functions serve libFuzzer (fuzz_main.cpp) and the default tests, which replay seeds
/// and every input that once broke the contract (fuzz_replay_test.cpp).

#include <array>
#include <string_view>

#include <diffnea/core/error.hpp>

namespace diffnea::fuzz {

void audit(std::string_view input);         ///< recording and sidecar, as `audit` reads them
void ball_network(std::string_view input);  ///< network of a ball
void csv(std::string_view input);           ///< recording and sidecar, no model; preprocessing
void csv_model(std::string_view input);     ///< recording and sidecar, matched to a model
void diagnose_run(std::string_view input);  ///< folder of `diagnose`, and its page
void fit_run(std::string_view input);       ///< folder of `identify`, and its page
void learn_run(std::string_view input);     ///< folder of `learn`, and its page
void mjcf(std::string_view input);          ///< MJCF with the files that it includes
void model_json(std::string_view input);    ///< the project's own description of a robot
void policy(std::string_view input);        ///< policy
void surrogate(std::string_view input);     ///< ranges of a world's robots
void trajectory(std::string_view input);    ///< desired motion
void transfer_run(std::string_view input);  ///< folder of `transfer`, and its page
void urdf(std::string_view input);          ///< URDF
void world(std::string_view input);         ///< `mujoco:NAME,key=value`

struct Target {
  std::string_view name;
  void (*run)(std::string_view input);
};

inline constexpr std::array kTargets{
    Target{"audit", audit},
    Target{"ball_network", ball_network},
    Target{"csv", csv},
    Target{"csv_model", csv_model},
    Target{"diagnose_run", diagnose_run},
    Target{"fit_run", fit_run},
    Target{"learn_run", learn_run},
    Target{"mjcf", mjcf},
    Target{"model_json", model_json},
    Target{"policy", policy},
    Target{"surrogate", surrogate},
    Target{"trajectory", trajectory},
    Target{"transfer_run", transfer_run},
    Target{"urdf", urdf},
    Target{"world", world},
};

/// Runs `f`; an Error is an answer. Anything else that is thrown goes on to the caller.
/// @return whether there was a result
template <class F>
bool result_or_error(F&& f) {
  try {
    f();
    return true;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace diffnea::fuzz
