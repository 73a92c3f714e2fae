#include <algorithm>
#include <thread>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/lie/inertia.hpp>
#include <diffnea/model/free_base.hpp>

#include "dynamics/batch_kernels.hpp"

namespace diffnea {
namespace {

struct Kernels {
  const char* name;
  bool (*supported)();
  batch::Kernel *rnea, *aba, *regressor;
};

/// Best first.
const Kernels kKernels[] = {
#ifdef DIFFNEA_HAS_X86_KERNELS
#ifndef DIFFNEA_NO_AVX512_KERNELS
    // What the build's -march=x86-64-v4, and then -v3, lets the compiler use.
    {"avx512",
     [] {
       return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
              __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
              __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("bmi2");
     },
     batch::avx512::rnea, batch::avx512::aba, batch::avx512::regressor},
#endif
    {"avx2",
     [] {
       return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
              __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
     },
     batch::avx2::rnea, batch::avx2::aba, batch::avx2::regressor},
    {"sse2", [] { return true; }, batch::sse2::rnea, batch::sse2::aba, batch::sse2::regressor},
#else
    {"base", [] { return true; }, batch::base::rnea, batch::base::aba, batch::base::regressor},
#endif
};

const Kernels& choose(const std::string& name) {
  std::string known;
  for (const Kernels& k : kKernels) {
    if (!k.supported()) continue;
    if (name.empty() || name == k.name) return k;
    known += (known.empty() ? "" : ", ") + std::string(k.name);
  }
  throw Error("batch: this build and processor have no instruction set '" + name +
              "'; choices: " + known);
}

/// Every thread takes a contiguous share of the rows.
void run(batch::Kernel* kernel, const Tree<double>& tree, const batch::Rows& all, int num_threads) {
  constexpr long kRowsPerThread = 64;  // fewer are done before a thread has started
  const long count = all.end - all.begin;
  // The number of processors is read from a file: only on request.
  const long wanted =
      num_threads > 0 ? num_threads : std::max(1u, std::thread::hardware_concurrency());
  const long shares = std::clamp<long>(wanted, 1, std::max(1L, count / kRowsPerThread));
  std::vector<std::jthread> threads;
  for (long s = 0; s < shares; ++s) {
    batch::Rows rows = all;
    rows.begin = all.begin + count * s / shares;
    rows.end = all.begin + count * (s + 1) / shares;
    if (s + 1 == shares)
      kernel(tree, rows);
    else
      threads.emplace_back([kernel, &tree, rows] { kernel(tree, rows); });
  }
}

void require_shape(const char* where, const char* name, const RowMatX<double>& M, long rows,
                   int columns, const char* behind) {
  if (M.rows() == rows && M.cols() == columns) return;
  throw ShapeError(std::string(where) + ": " + name + " is " + std::to_string(M.rows()) + "x" +
                   std::to_string(M.cols()) + ", expected " + std::to_string(rows) + "x" +
                   std::to_string(columns) + " (one row per state, one column per joint" + behind +
                   ")");
}

void require_shapes(const char* where, const Tree<double>& tree, const RowMatX<double>& Q,
                    const RowMatX<double>& Qd, const char* name_x, const RowMatX<double>& X) {
  const bool floats = tree.free_base;
  require_shape(where, "Q", Q, Q.rows(), tree.num_positions(), floats ? " behind a pose of 7" : "");
  for (const auto& [name, M] : {std::pair("Qd", &Qd), std::pair(name_x, &X)})
    require_shape(where, name, *M, Q.rows(), tree.num_velocities(),
                  floats ? " behind a twist of 6" : "");
  for (long k = 0; floats && k < Q.rows(); ++k)
    require_unit_quaternion((std::string(where) + ": row " + std::to_string(k) + " of Q").c_str(),
                            Q(k, 3), Q(k, 4), Q(k, 5), Q(k, 6));
}

/// @param of_one_row  computes a single state without packs: a register that holds one row costs
///                    as much as a full one, and so does its scratch
template <class OneRow>
void run_rows(const char* where, batch::Kernel* Kernels::* kernel, const OneRow& of_one_row,
              const Tree<double>& tree, const RowMatX<double>& Q, const RowMatX<double>& Qd,
              const char* name_x, const RowMatX<double>& X, long out_rows_per_state,
              long out_columns, RowMatX<double>& out, const BatchOptions& options) {
  require_shapes(where, tree, Q, Qd, name_x, X);
  out.resize(Q.rows() * out_rows_per_state, out_columns);
  if (Q.rows() == 1 && options.instruction_set.empty())
    of_one_row(Q.row(0).transpose(), Qd.row(0).transpose(), X.row(0).transpose());
  else
    run(choose(options.instruction_set).*kernel, tree,
        {Q.data(), Qd.data(), X.data(), out.data(), 0, Q.rows()}, options.num_threads);
}

}  // namespace

std::vector<std::string> batch_instruction_sets() {
  std::vector<std::string> names;
  for (const Kernels& k : kKernels)
    if (k.supported()) names.emplace_back(k.name);
  return names;
}

RowMatX<double> rnea_batch(const Tree<double>& tree, const RowMatX<double>& Q,
                           const RowMatX<double>& Qd, const RowMatX<double>& Qdd,
                           const BatchOptions& options) {
  RowMatX<double> tau;
  const auto of_one_row = [&](VecIn<double> q, VecIn<double> qd, VecIn<double> qdd) {
    RneaWorkspace<double, double> ws;
    tau.row(0) = rnea<double, double>(tree, q, qd, qdd, ws);
  };
  run_rows("rnea_batch", &Kernels::rnea, of_one_row, tree, Q, Qd, "Qdd", Qdd, 1,
           tree.num_velocities(), tau, options);
  return tau;
}

RowMatX<double> aba_batch(const Tree<double>& tree, const RowMatX<double>& Q,
                          const RowMatX<double>& Qd, const RowMatX<double>& Tau,
                          const BatchOptions& options) {
  RowMatX<double> qdd;
  const auto of_one_row = [&](VecIn<double> q, VecIn<double> qd, VecIn<double> tau) {
    AbaWorkspace<double, double> ws;
    qdd.row(0) = aba<double, double>(tree, q, qd, tau, ws);
  };
  run_rows("aba_batch", &Kernels::aba, of_one_row, tree, Q, Qd, "Tau", Tau, 1,
           tree.num_velocities(), qdd, options);
  return qdd;
}

void regressor_batch(const Tree<double>& tree, const RowMatX<double>& Q, const RowMatX<double>& Qd,
                     const RowMatX<double>& Qdd, RowMatX<double>& Y, const BatchOptions& options) {
  const int n = tree.num_velocities();
  const auto of_one_row = [&](VecIn<double> q, VecIn<double> qd, VecIn<double> qdd) {
    RegressorWorkspace<double, double> ws;
    Y = torque_regressor<double, double>(tree, q, qd, qdd, ws);
  };
  run_rows("regressor_batch", &Kernels::regressor, of_one_row, tree, Q, Qd, "Qdd", Qdd, n,
           kThetaSize * tree.num_links(), Y, options);
}

RowMatX<double> regressor_batch(const Tree<double>& tree, const RowMatX<double>& Q,
                                const RowMatX<double>& Qd, const RowMatX<double>& Qdd,
                                const BatchOptions& options) {
  RowMatX<double> Y;
  regressor_batch(tree, Q, Qd, Qdd, Y, options);
  return Y;
}

}  // namespace diffnea
