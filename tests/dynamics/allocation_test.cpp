/// "No allocation once it has seen this tree": counted at malloc, where Eigen's and the standard
/// library's end.

#include <cstddef>
#include <functional>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/dynamics/mass_matrix.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/effects/ball_network.hpp>

#include "support/random_floating.hpp"

// The sanitizers have a malloc of their own.
#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#if defined(__has_feature)
#if !__has_feature(address_sanitizer) && !__has_feature(thread_sanitizer)
#define DIFFNEA_COUNTS_ALLOCATIONS
#endif
#else
#define DIFFNEA_COUNTS_ALLOCATIONS
#endif
#endif

namespace {

struct Allocations {
  long count = 0;
  std::size_t largest = 0;  ///< [bytes]
};
thread_local Allocations* counting = nullptr;

[[maybe_unused]] void count_allocation(std::size_t size) {
  if (!counting) return;
  ++counting->count;
  if (size > counting->largest) counting->largest = size;
}

}  // namespace

#ifdef DIFFNEA_COUNTS_ALLOCATIONS
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t size) {
  count_allocation(size);
  return __libc_malloc(size);
}
void* calloc(std::size_t number, std::size_t size) {
  count_allocation(number * size);
  return __libc_calloc(number, size);
}
void* realloc(void* old, std::size_t size) {
  count_allocation(size);
  return __libc_realloc(old, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  count_allocation(size);
  return __libc_memalign(alignment, size);
}
}
#endif

using namespace diffnea;
using namespace diffnea::test;

namespace {

Allocations allocations(const std::function<void()>& call) {
#ifndef DIFFNEA_COUNTS_ALLOCATIONS
  SKIP("malloc is another's");
#endif
  Allocations out;
  counting = &out;
  call();
  counting = nullptr;
  return out;
}

}  // namespace

TEST_CASE("allocations: they are counted, the standard library's and Eigen's", "[dynamics]") {
  std::vector<double> x;
  VecX<double> y;
  const Allocations seen = allocations([&] {
    x.resize(100);
    y.resize(1000);
  });
  CHECK(seen.count == 2);
  CHECK(seen.largest >= 8000);
}

TEST_CASE("allocations: none in a recursion that has seen the tree", "[dynamics]") {
  const unsigned seed = GENERATE(range(0u, 6u));
  CAPTURE(seed);
  const RandomArm arm(seed, {.num_dofs = 2 + 2 * static_cast<int>(seed)});
  const Tree<double>& tree = arm.tree;
  RneaWorkspace<double, double> rnea_ws, gravity_ws;
  AbaWorkspace<double, double> aba_ws;
  RegressorWorkspace<double, double> regressor_ws;
  MassMatrixWorkspace<double, double> mass_ws;
  LinkKinematics<double> kinematics, still;
  MatX<double> J;
  RneaDerivatives rnea_slopes;
  AbaDerivatives aba_slopes;
  ParameterJacobianWorkspace parameter_ws;
  const int tip = tree.num_dofs() - 1;
  const Pose<double> X_LF{Mat3<double>::identity(), {0.1, 0.2, 0.3}};
  const std::pair<const char*, std::function<void()>> calls[] = {
      {"rnea", [&] { rnea(tree, arm.q, arm.qd, arm.qdd, rnea_ws); }},
      {"gravity_torques", [&] { gravity_torques(tree, arm.q, gravity_ws); }},
      {"aba", [&] { aba(tree, arm.q, arm.qd, arm.tau, aba_ws); }},
      {"torque_regressor", [&] { torque_regressor(tree, arm.q, arm.qd, arm.qdd, regressor_ws); }},
      {"mass_matrix", [&] { mass_matrix(tree, arm.q, mass_ws); }},
      {"forward_kinematics",
       [&] { forward_kinematics<double, double>(tree, arm.q, arm.qd, arm.qdd, kinematics); }},
      {"forward_kinematics at rest",
       [&] { forward_kinematics<double, double>(tree, arm.q, still); }},
      {"frame_jacobian", [&] { frame_jacobian(tree, kinematics, tip, X_LF, J); }},
      {"rnea_derivatives", [&] { rnea_derivatives(tree, arm.q, arm.qd, arm.qdd, rnea_slopes); }},
      {"aba_derivatives", [&] { aba_derivatives(tree, arm.q, arm.qd, arm.tau, aba_slopes); }},
      {"forward_dynamics_parameter_jacobian",
       [&] { forward_dynamics_parameter_jacobian(tree, arm.q, arm.qd, arm.tau, parameter_ws); }},
  };
  for (const auto& [name, call] : calls) {
    CAPTURE(name);
    call();
    const Allocations seen = allocations(call);  // it may skip, which a CHECK takes for a failure
    CHECK(seen.count == 0);
  }
}

TEST_CASE("allocations: none in a recursion that has seen a tree on a free base", "[dynamics]") {
  const RandomFloating s(3);
  RneaWorkspace<double, double> rnea_ws;
  AbaWorkspace<double, double> aba_ws;
  RegressorWorkspace<double, double> regressor_ws;
  MassMatrixWorkspace<double, double> mass_ws;
  LinkKinematics<double> kinematics;
  MatX<double> J;
  const int tip = s.tree.num_links() - 1;
  const Pose<double> X_LF{Mat3<double>::identity(), {0.1, 0.2, 0.3}};
  const std::pair<const char*, std::function<void()>> calls[] = {
      {"rnea", [&] { rnea(s.tree, s.q, s.v, s.vd, rnea_ws); }},
      {"gravity_torques", [&] { gravity_torques(s.tree, s.q, rnea_ws); }},
      {"aba", [&] { aba(s.tree, s.q, s.v, s.tau, aba_ws); }},
      {"torque_regressor", [&] { torque_regressor(s.tree, s.q, s.v, s.vd, regressor_ws); }},
      {"mass_matrix", [&] { mass_matrix(s.tree, s.q, mass_ws); }},
      {"forward_kinematics",
       [&] { forward_kinematics<double, double>(s.tree, s.q, s.v, s.vd, kinematics); }},
      {"frame_jacobian", [&] { frame_jacobian(s.tree, kinematics, tip, X_LF, J); }},
  };
  for (const auto& [name, call] : calls) {
    CAPTURE(name);
    call();
    const Allocations seen = allocations(call);
    CHECK(seen.count == 0);
  }
}

TEST_CASE("allocations: no other matrix where a batch of regressors has one that fits",
          "[dynamics]") {
  const RandomArm arm(3);
  const int rows = 50, n = arm.tree.num_dofs();
  const RowMatX<double> Q = arm.q.transpose().replicate(rows, 1),
                        Qd = arm.qd.transpose().replicate(rows, 1);
  RowMatX<double> Y;
  const auto fill = [&] { regressor_batch(arm.tree, Q, Qd, Qd, Y); };
  const std::size_t whole = sizeof(double) * rows * n * kThetaSize * n;
  const Allocations general = allocations(fill);
  CHECK(general.largest >= whole);
  // What is left is the scratch of one thread, some states wide.
  const Allocations seen = allocations(fill);
  CHECK(seen.largest < whole / 2);
}

TEST_CASE("allocations: none in a network's evaluator", "[ball_network]") {
  const auto layer = [](int inputs, int outputs) {
    return DenseLayer{inputs, outputs, std::vector<double>(std::size_t(inputs * outputs), 0.1),
                      std::vector<double>(std::size_t(outputs), 0.2)};
  };
  BallNetwork network;
  network.input_mean.assign(kNetworkInputs, 0.0);
  network.input_scale.assign(kNetworkInputs, 1.0);
  network.output_mean.assign(kNetworkOutputs, 0.0);
  network.output_scale.assign(kNetworkOutputs, 1.0);
  network.members = {{{}, {layer(kNetworkInputs, 40), layer(40, 3)}},    // a feed-forward net
                     {{layer(kNetworkInputs + 5, 20)}, {layer(5, 3)}}};  // a cell of 5, and a head
  NetworkEvaluator<double> evaluate(network);
  const std::vector<double> input(kNetworkInputs, 0.5);
  std::vector<double> hidden(static_cast<std::size_t>(num_hidden(network)), 0.0);
  const Allocations seen = allocations([&] { evaluate(input.data(), hidden.data()); });
  CHECK(seen.count == 0);
}
