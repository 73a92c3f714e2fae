/// The recursions over packs. The build compiles this file once per instruction set, DIFFNEA_ISA
/// its name.
///
/// One-definition rule: a template over `double` that both this file and the rest of the library
/// instantiate (lie/, std::vector) would be one symbol, and the linker might keep the AVX-512 copy
/// for everyone. The build therefore makes every symbol of this file local but those that carry the
/// instruction set's name (src/cmake/DiffneaIsaKernels.cmake); the pack's type differs by itself.

#include "dynamics/batch_kernels.hpp"

#include <algorithm>

#include <diffnea/core/pack.hpp>
#include <diffnea/dynamics/aba.hpp>
#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/dynamics/rnea.hpp>

namespace diffnea::batch {
namespace {

/// Lane l reads row begin + l, or the last row where there is none.
void load(const double* rows, long begin, long end, int n, std::vector<Pack>& out) {
  for (int j = 0; j < n; ++j)
    out[j] = Pack([&](auto lane) {
      return rows[std::min(begin + static_cast<long>(lane), end - 1) * n + j];
    });
}

void store(const std::vector<Pack>& in, long begin, long end, int n, double* rows) {
  const int lanes = static_cast<int>(std::min<long>(kPackWidth, end - begin));
  for (int j = 0; j < n; ++j)
    for (int lane = 0; lane < lanes; ++lane) rows[(begin + lane) * n + j] = value(in[j], lane);
}

/// Calls compute(q, qd, x, first row) for every pack of rows.
template <class Compute>
void for_each_pack(const Tree<double>& tree, const Rows& rows, const Compute& compute) {
  const int n = tree.num_velocities();
  std::vector<Pack> q(tree.num_positions()), qd(n), x(n);
  for (long begin = rows.begin; begin < rows.end; begin += kPackWidth) {
    load(rows.q, begin, rows.end, tree.num_positions(), q);
    load(rows.qd, begin, rows.end, n, qd);
    load(rows.x, begin, rows.end, n, x);
    compute(q.data(), qd.data(), x.data(), begin);
  }
}

/// (n × 10 links) packs to one such matrix a lane; a block is zero unless its row's joint carries
/// its link, or one that follows it does.
void store_regressors(const Tree<double>& tree, const std::vector<Pack>& Y, long begin, long end,
                      double* out) {
  const int n = tree.num_velocities(), columns = kThetaSize * tree.num_links();
  const int base = n - tree.num_dofs(), first = tree.first_joint();
  const int lanes = static_cast<int>(std::min<long>(kPackWidth, end - begin));
  alignas(Pack) double block[kThetaSize][kPackWidth];
  std::fill_n(out + begin * n * columns, static_cast<long>(lanes) * n * columns, 0.0);
  const auto store_block = [&](int row, int k) {
    const long offset = static_cast<long>(row) * columns + kThetaSize * k;
    for (int c = 0; c < kThetaSize; ++c)
      Y[offset + c].copy_to(block[c], std::experimental::vector_aligned);
    for (int lane = 0; lane < lanes; ++lane) {
      double* target = out + (begin + lane) * n * columns + offset;
      for (int c = 0; c < kThetaSize; ++c) target[c] = block[c][lane];
    }
  };
  for (int k = 0; k < tree.num_links(); ++k) {
    for (int row = 0; row < base; ++row) store_block(row, k);
    for (int i = k; i >= first; i = tree.links[i].parent) store_block(base + tree.drive(i).dof, k);
  }
}

}  // namespace

namespace DIFFNEA_ISA {

void rnea(const Tree<double>& tree, const Rows& rows) {
  LinkStates<double, Pack> ws;
  std::vector<Pack> tau(tree.num_velocities());
  for_each_pack(tree, rows, [&](const Pack* q, const Pack* qd, const Pack* qdd, long begin) {
    call_inlined<Pack>([&] { detail::rnea(tree, q, qd, qdd, ws, tau.data()); });
    store(tau, begin, rows.end, tree.num_velocities(), rows.out);
  });
}

void aba(const Tree<double>& tree, const Rows& rows) {
  AbaStates<double, Pack> ws;
  std::vector<Pack> qdd(tree.num_velocities());
  for_each_pack(tree, rows, [&](const Pack* q, const Pack* qd, const Pack* tau, long begin) {
    call_inlined<Pack>([&] { detail::aba(tree, q, qd, tau, ws, qdd.data()); });
    store(qdd, begin, rows.end, tree.num_velocities(), rows.out);
  });
}

void regressor(const Tree<double>& tree, const Rows& rows) {
  const int n = tree.num_velocities(), columns = kThetaSize * tree.num_links();
  std::vector<RegressorLinkMotion<Pack>> ws;
  std::vector<Pack> Y(static_cast<std::size_t>(n) * columns);
  for_each_pack(tree, rows, [&](const Pack* q, const Pack* qd, const Pack* qdd, long begin) {
    call_inlined<Pack>([&] { detail::torque_regressor(tree, q, qd, qdd, ws, Y.data(), columns); });
    store_regressors(tree, Y, begin, rows.end, rows.out);
  });
}

}  // namespace DIFFNEA_ISA
}  // namespace diffnea::batch
