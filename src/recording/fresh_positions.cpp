#include "recording/fresh_positions.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/recording/refresh.hpp>

#include "recording/between.hpp"

namespace diffnea::detail {
namespace {

/// Standard deviation of intervals, over the period, from which rows lie off the grid: four of them
/// are the fiftieth of a period within which a row is taken as it is (Gridder).
constexpr double kUneven = 0.005;

RowMatX<double> stacked(const RowMatX<double>& a, const RowMatX<double>& b) {
  if (a.size() == 0) return b;
  RowMatX<double> out(a.rows() + b.rows(), a.cols());
  out << a, b;
  return out;
}

}  // namespace

Recording part(const Recording& r, long from, long rows) {
  Recording out;
  out.source = r.source;
  out.run = r.run;
  out.joint_names = r.joint_names;
  out.has_tau = r.has_tau;
  out.info = r.info;
  out.time = r.time.segment(from, rows);
  out.q = r.q.middleRows(from, rows);
  out.tau = r.tau.middleRows(from, rows);
  if (r.qd.size() > 0) out.qd = r.qd.middleRows(from, rows);
  return out;
}

bool is_slow_and_uneven(const PreprocessPlan& plan) {
  return plan.timing_jitter > kUneven &&
         std::ranges::any_of(plan.refresh, [](int rows) { return rows > 1; });
}

FreshPositions::FreshPositions(std::vector<int> refresh, bool curved)
    : refresh_(std::move(refresh)),
      curved_(curved),
      // Positions that do not change count as new ones late.
      margin_(2 * (kEachSide + 1) * std::max(1, std::ranges::max(refresh_))) {}

Recording FreshPositions::push(const Recording& block) {
  if (kept_.rows() == 0) {
    kept_ = part(block, 0, block.rows());
  } else {
    Recording more = part(block, 0, block.rows());
    VecX<double> time(kept_.rows() + more.rows());
    time << kept_.time, more.time;
    kept_.time = std::move(time);
    kept_.q = stacked(kept_.q, more.q);
    kept_.tau = stacked(kept_.tau, more.tau);
    if (more.qd.size() > 0) kept_.qd = stacked(kept_.qd, more.qd);
  }
  return filled(std::max(returned_, kept_.rows() - margin_));
}

Recording FreshPositions::finish() {
  Recording out = filled(kept_.rows());
  kept_ = Recording{};
  returned_ = 0;
  return out;
}

Recording FreshPositions::whole(const Recording& recording) {
  kept_ = part(recording, 0, recording.rows());
  return finish();
}

/// Rows that have not been returned up to that one; forgets those that no other hangs on.
Recording FreshPositions::filled(long to) {
  Recording out = part(kept_, returned_, to - returned_);
  for (long j = 0; j < kept_.q.cols(); ++j) {
    const int refresh = refresh_[static_cast<std::size_t>(j)];
    if (refresh < 2) continue;
    const VecX<double> y = kept_.q.col(j);
    const std::vector<long> known = rows_of(refreshed(y, refresh));
    for (std::size_t i = 1; i < known.size(); ++i)
      for (long k = std::max(known[i - 1] + 1, returned_); k < std::min(known[i], to); ++k) {
        if (std::isnan(y[k])) continue;
        const std::vector<long> line{known[i - 1], known[i]};
        out.q(k - returned_, j) = between(kept_.time, y, curved_ ? known : line, k);
      }
  }
  const long unused = std::max(0L, to - margin_);
  kept_ = part(kept_, unused, kept_.rows() - unused);
  returned_ = to - unused;
  return out;
}

}  // namespace diffnea::detail
