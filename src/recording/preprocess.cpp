#include <algorithm>
#include <limits>
#include <optional>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/preprocess.hpp>
#include <diffnea/recording/refresh.hpp>

#include "core/c_numbers.hpp"
#include "recording/between.hpp"
#include "recording/floating_base.hpp"
#include "recording/fresh_positions.hpp"
#include "recording/gridder.hpp"
#include "recording/path_smoother.hpp"

namespace diffnea {
namespace {

using detail::Gridder;
using detail::PathSmoother;

/// What a block's artificial end may leave in its rows, relative to the signal. q̈ magnifies it by
/// the square of the cut-off in the units of the data (10³ to 10⁵), which leaves 1e-9 of q̈.
constexpr double kForgotten = 1e-15;

}  // namespace

struct Preprocessor::Impl {
  Impl(const PreprocessPlan& p, long rows)
      : plan(p), smoother(p.filter_hz, 1.0 / p.dt), halo(smoother.memory(kForgotten)) {
    block_rows = rows > 0 ? rows : std::max(4 * halo, 8192L);
    if (detail::is_slow_and_uneven(plan)) fresh.emplace(plan.refresh, /*curved=*/true);
  }

  /// @param r  with the base as positions
  void begin_recording(const Recording& r) {
    header = Preprocessed{};
    header.source = r.source;
    header.run = r.run;
    header.joint_names = r.joint_names;
    header.has_tau = r.has_tau;
    header.dt = plan.dt;
    n = r.num_joints();
    if (plan.measured_velocity && r.qd.size() == 0)
      throw DataError(r.source +
                      ": measured velocities were asked for, but there is no column qd_<joint>" +
                      (floats ? ", or no base_wx … base_vz" : ""));
    gridder.emplace_back(Gridder::Options{.dt = plan.dt,
                                          .max_gap = plan.max_gap,
                                          .velocity = plan.measured_velocity,
                                          .average_hold = true},
                         n);
  }

  void take(const Recording& logged) {
    if (gridder.empty()) floats = logged.base.size() > 0;
    const Recording with_base = floats ? base.apply(logged) : Recording{};
    const Recording& r = floats ? with_base : logged;
    if (!gridder.empty() && (r.run != header.run || r.joint_names != header.joint_names))
      throw DataError(r.source + ": another recording than " + header.source +
                      " goes on; finish() ends a recording");
    if (gridder.empty()) begin_recording(r);
    place(fresh ? fresh->push(r) : r);
  }

  void place(const Recording& r) {
    for (long i = 0; i < r.rows(); ++i)
      if (!gridder[0].push(r, i)) {
        end_segment();
        gridder[0].push(r, i);
      }
    emit(false);
  }

  Preprocessed finish() {
    if (fresh && !gridder.empty()) place(fresh->finish());
    if (!gridder.empty()) end_segment();
    if (base.flips() > 0)
      notes.push_back(header.source + ": the base's quaternion changes its sign " +
                      std::to_string(base.flips()) + " times; q and −q are one rotation");
    Preprocessed out = collect();
    gridder.clear();
    base = {};
    segment = 0;
    return out;
  }

  void end_segment() {
    if (!gridder[0].in_segment()) return;
    const double start = gridder[0].start_time();
    gridder[0].finish_segment();
    const long rows = first_row + buffered();
    if (is_too_short(rows)) {
      char text[160];
      detail::print(text, sizeof text,
                    "the stretch from %.6g s was dropped: its %.4g s between gaps are too short",
                    start, static_cast<double>(rows) * plan.dt);
      notes.emplace_back(text);
    } else {
      emit(true);
      ++segment;
    }
    gridder[0].rows.clear();
    first_row = 0;
    next_row = 0;
  }

  long buffered() const {
    return static_cast<long>(gridder[0].rows.size()) / gridder[0].num_columns();
  }

  bool is_too_short(long rows) const {
    return static_cast<double>(rows) * plan.dt < plan.min_segment ||
           rows < detail::kFewestPathRows;
  }

  /// Filters and differentiates all rows whose surroundings are there.
  void emit(bool segment_ended) {
    const long columns = gridder[0].num_columns();
    while (true) {
      const long end = first_row + buffered();  // grid rows of the segment so far
      long last = next_row + block_rows;  // of the block, exclusive
      if (segment_ended)
        last = end - next_row <= block_rows + halo ? end : last;
      else if (end < last + halo || is_too_short(end))
        return;
      if (last <= next_row) return;
      const long from = std::max(first_row, (next_row - halo) / smoother.every() * smoother.every()),
                 to = std::min(end, last + halo);
      const Eigen::Map<const RowMatX<double>> all(gridder[0].rows.data(), end - first_row, columns);
      RowMatX<double> stretch = all.middleRows(from - first_row, to - from);
      RowMatX<double> curved = stretch.leftCols(n);
      for (int j = 0; j < n && static_cast<std::size_t>(j) < plan.refresh.size(); ++j) {
        const int refresh = plan.refresh[static_cast<std::size_t>(j)];
        VecX<double> channel = stretch.col(j);
        detail::curve_stale(channel, refresh);
        curved.col(j) = channel;
        channel = stretch.col(j);
        fill_stale(channel, refresh);
        stretch.col(j) = channel;
      }
      RowMatX<double> q, qd, qdd, unused_qdd;
      smoother.smooth(curved, q, qd, qdd);
      if (plan.measured_velocity) smoother.smooth(stretch.rightCols(n), qd, qdd, unused_qdd);
      const long rows = last - next_row, at = next_row - from;
      out_q.emplace_back(q.middleRows(at, rows));
      out_qd.emplace_back(qd.middleRows(at, rows));
      out_qdd.emplace_back(qdd.middleRows(at, rows));
      const auto logged = stretch.middleRows(at, rows);
      out_q_logged.emplace_back(logged.leftCols(n));
      out_tau.emplace_back(logged.middleCols(n, n));
      for (long k = next_row; k < last; ++k) {
        out_time.push_back(gridder[0].start_time() + static_cast<double>(k) * plan.dt);
        out_segment.push_back(segment);
      }
      next_row = last;
      const long unused = std::max(0L, (next_row - halo) / smoother.every() * smoother.every() - first_row);
      gridder[0].rows.erase(gridder[0].rows.begin(), gridder[0].rows.begin() + unused * columns);
      first_row += unused;
    }
  }

  Preprocessed collect() {
    Preprocessed out = header;
    out.time = Eigen::Map<const VecX<double>>(out_time.data(), static_cast<long>(out_time.size()));
    out.segment.swap(out_segment);
    const auto stack = [&](std::vector<RowMatX<double>>& parts) {
      if (parts.size() == 1) {
        RowMatX<double> one = std::move(parts.front());
        parts.clear();
        return one;
      }
      RowMatX<double> all(out.time.size(), n);
      long at = 0;
      for (const RowMatX<double>& p : parts) {
        all.middleRows(at, p.rows()) = p;
        at += p.rows();
      }
      parts.clear();
      return all;
    };
    out.q = stack(out_q);
    out.qd = stack(out_qd);
    out.qdd = stack(out_qdd);
    out.q_logged = stack(out_q_logged);
    out.tau = stack(out_tau);
    out.notes.swap(notes);
    out_time.clear();
    out_segment.clear();
    if (floats) detail::move_to_manifold(n - detail::kPose, out);
    return out;
  }

  PreprocessPlan plan;
  PathSmoother smoother;
  long halo, block_rows = 0;
  std::optional<detail::FreshPositions> fresh;
  bool floats = false;           ///< the recording has a base's pose
  detail::BasePositions base;    ///< state of that recording
  std::vector<Gridder> gridder;  ///< one, once the joints are known
  int n = 0;
  int segment = 0;
  long first_row = 0;  ///< grid row at the front of the gridder's rows
  long next_row = 0;   ///< grid row to emit next
  Preprocessed header;
  std::vector<double> out_time;
  std::vector<int> out_segment;
  std::vector<RowMatX<double>> out_q, out_qd, out_qdd, out_q_logged, out_tau;
  std::vector<std::string> notes;
};

Preprocessor::Preprocessor(const PreprocessPlan& plan, long block_rows)
    : impl_(std::make_unique<Impl>(plan, block_rows)) {}
Preprocessor::~Preprocessor() = default;
Preprocessor::Preprocessor(Preprocessor&&) noexcept = default;
Preprocessor& Preprocessor::operator=(Preprocessor&&) noexcept = default;

Preprocessed Preprocessor::push(const Recording& block) {
  impl_->take(block);
  return impl_->collect();
}
Preprocessed Preprocessor::finish() { return impl_->finish(); }

Preprocessed preprocess(const Recording& recording, const PreprocessPlan& plan) {
  // One block: nothing is emitted before the recording ends.
  Preprocessor::Impl whole(plan, std::numeric_limits<long>::max() / 4);
  whole.take(recording);
  return whole.finish();
}

}  // namespace diffnea
