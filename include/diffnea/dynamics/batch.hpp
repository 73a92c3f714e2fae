#pragma once
/// Dynamics of many states at once: rows of matrices, one state a row. Several rows run side by
/// side in the lanes of SIMD registers; the instruction set is chosen when the program runs. Needs
/// the compiled library, diffnea::identify: its kernels are built once for each instruction set.

#include <string>
#include <vector>

#include <diffnea/model/tree.hpp>

namespace diffnea {

/// How a batch is shared among threads.
struct BatchOptions {
  int num_threads = 1;  ///< rows are divided among as many threads; ≤ 0: one per processor
  /// Of batch_instruction_sets(); empty: the first, and for a single row the scalar recursion,
  /// which takes half the time of a pack with one lane in use (they agree to rounding).
  std::string instruction_set;
};

/// Instruction sets that this build holds and this processor has, best first.
std::vector<std::string> batch_instruction_sets();

/// τ [N·m], (N × n): rnea of every row. With a free base Q is (N × (7 + n)), and all others are
/// (N × (6 + n)) (model/tree.hpp), in all functions of this header.
/// @param Q, Qd, Qdd  (N × n) positions [rad], velocities [rad/s], accelerations [rad/s²]; [m …] if
/// prismatic
/// @throws ShapeError if shapes differ or columns are not tree.num_positions(),
/// tree.num_velocities()
/// @throws DataError naming a row whose quaternion of a free base is not unit
/// @throws Error naming the instruction sets there are if options ask for another
RowMatX<double> rnea_batch(const Tree<double>& tree, const RowMatX<double>& Q,
                           const RowMatX<double>& Qd, const RowMatX<double>& Qdd,
                           const BatchOptions& options = {});

/// q̈ [rad/s²], (N × n): aba of every row.
/// @param Q, Qd, Tau  (N × n) positions [rad], velocities [rad/s], torques [N·m]; [m …] if
/// prismatic
/// @throws as rnea_batch
RowMatX<double> aba_batch(const Tree<double>& tree, const RowMatX<double>& Q,
                          const RowMatX<double>& Qd, const RowMatX<double>& Tau,
                          const BatchOptions& options = {});

/// Torque regressors of all rows, stacked: (N·n × 10 links), rows k·n … k·n + n − 1 are those of
/// state k; with a free base 6 + n in place of n.
/// @param Q, Qd, Qdd  (N × n) as for rnea_batch
/// @throws as rnea_batch
RowMatX<double> regressor_batch(const Tree<double>& tree, const RowMatX<double>& Q,
                                const RowMatX<double>& Qd, const RowMatX<double>& Qdd,
                                const BatchOptions& options = {});
/// The same into Y, which is resized if need be: no allocation where the size already fits.
void regressor_batch(const Tree<double>& tree, const RowMatX<double>& Q, const RowMatX<double>& Qd,
                     const RowMatX<double>& Qdd, RowMatX<double>& Y,
                     const BatchOptions& options = {});

}  // namespace diffnea
