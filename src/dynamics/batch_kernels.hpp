#pragma once
/// Entry points of batch_kernels.cpp, one namespace per instruction set. Plain pointers only: what
/// an instruction set does to the layout of a type must not cross this line.

#include <diffnea/model/tree.hpp>

namespace diffnea::batch {

/// Rows begin ≤ k < end of (N × n) row-major arrays, q of tree.num_positions() columns, the others
/// of tree.num_velocities(). The last lanes repeat the last row.
struct Rows {
  const double* q;
  const double* qd;
  const double* x;  ///< q̈ for rnea and regressor, torque for aba
  double* out;      ///< (N × n), for the regressor (N·n × 10 links)
  long begin, end;
};

using Kernel = void(const Tree<double>&, const Rows&);

#define DIFFNEA_DECLARE_KERNELS(isa) \
  namespace isa {                    \
  Kernel rnea, aba, regressor;       \
  }
#ifdef DIFFNEA_HAS_X86_KERNELS
DIFFNEA_DECLARE_KERNELS(sse2)
DIFFNEA_DECLARE_KERNELS(avx2)
DIFFNEA_DECLARE_KERNELS(avx512)
#else
DIFFNEA_DECLARE_KERNELS(base)
#endif
#undef DIFFNEA_DECLARE_KERNELS

}  // namespace diffnea::batch
