#include "diagnose/simulated.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/sim/replay.hpp>

#include "core/constants.hpp"

namespace diffnea {
namespace {

constexpr double kBefore = 0.5;            ///< [s] that effects with memory look back
constexpr double kInLoop = 4.0;            ///< [s] of a window; the controller holds it together
constexpr double kByTorque = 0.5;          ///< [s]; beyond, errors of the first velocity take over
constexpr double kMostSeconds = 10.0;      ///< of all windows
constexpr double kMostInLoop = 24.0;       ///< the same with the controller
constexpr std::size_t kMostPoints = 3000;  ///< of a joint that are kept

/// A stretch that is simulated: the rows from `begin` to `end` of `x`, others around it.
struct Window {
  int run = 0;
  double first = 0.0, last = 0.0;  ///< [s]
  int segment = -1;
  double start = kNaN;  ///< of the rows below [s]
  std::vector<RowMatX<double>> parts;
  JointSeries x;
  long begin = 0, end = 0;
};

std::optional<Feedback> feedback_of(const Recording& recording) {
  if (recording.qcmd.size() == 0) return {};
  const int n = recording.num_joints();
  Feedback out{VecX<double>::Zero(n), VecX<double>::Zero(n),
               VecX<double>::Constant(n, std::numeric_limits<double>::infinity())};
  for (int j = 0; j < n; ++j) {
    bool known = !recording.has_tau[static_cast<std::size_t>(j)];
    for (const JointValue& v : recording.info.controller) {
      if (v.joint != recording.joint_names[static_cast<std::size_t>(j)]) continue;
      known |= v.name == "kp";
      if (v.name == "kp") out.kp[j] = v.value;
      if (v.name == "kd") out.kd[j] = v.value;
      if (v.name == "limit") out.limit[j] = v.value;
    }
    if (!known) return {};
  }
  return out;
}

/// That of all recordings, if they have one and the same.
std::optional<Feedback> common_feedback(const std::vector<Recording>& recordings) {
  const std::optional<Feedback> first = feedback_of(recordings.front());
  for (const Recording& r : recordings) {
    const std::optional<Feedback> own = feedback_of(r);
    if (!first || !own || own->kp != first->kp || own->kd != first->kd) return {};
  }
  return first;
}

/// All windows of that length that fit into held-out stretches, one after the other.
std::vector<Window> possible_windows(const Evidence& evidence, const std::vector<bool>& held,
                                     double seconds) {
  std::vector<Window> out;
  const auto counts = [&](long i) { return held.empty() || held[static_cast<std::size_t>(i)]; };
  const std::vector<double>& time = evidence.time();
  for (long i = 0; i < evidence.times();) {
    if (!counts(i)) {
      ++i;
      continue;
    }
    const int stretch = evidence.stretch()[static_cast<std::size_t>(i)];
    long end = i;
    while (end < evidence.times() && counts(end) &&
           evidence.stretch()[static_cast<std::size_t>(end)] == stretch)
      ++end;
    const double last = time[static_cast<std::size_t>(end - 1)];
    for (double t = time[static_cast<std::size_t>(i)]; t + seconds <= last; t += seconds) {
      out.emplace_back();
      out.back().run = evidence.series()[static_cast<std::size_t>(stretch)].run;
      out.back().first = t;
      out.back().last = t + seconds;
    }
    i = end;
  }
  return out;
}

std::vector<Window> spread(std::vector<Window> all, std::size_t most) {
  if (all.size() <= most) return all;
  std::vector<Window> out;
  for (std::size_t i = 0; i < most; ++i) out.push_back(std::move(all[i * all.size() / most]));
  return out;
}

/// Takes the block's rows that belong to the window, [q q̇ q̈ τ].
void collect(const Preprocessed& block, double run_start, Window& w) {
  const double from = w.first - kBefore - 0.5 * block.dt, to = w.last + 1.5 * block.dt;
  const double* time = block.time.data();
  const long n = block.q.cols();
  for (long k = std::lower_bound(time, time + block.rows(), from) - time;
       k < block.rows() && time[k] < to; ++k) {
    const int segment = block.segment[static_cast<std::size_t>(k)];
    if (segment != w.segment) {
      if (time[k] > w.first) return;
      w.parts.clear();
      w.segment = segment;
      w.start = time[k] - run_start;
      w.x.dt = block.dt;
      w.begin = w.end = 0;
    }
    RowMatX<double> row(1, 4 * n);
    row << block.q.row(k), block.qd.row(k), block.qdd.row(k), block.tau.row(k);
    w.parts.push_back(std::move(row));
    if (time[k] < w.first - 0.5 * block.dt) ++w.begin;
    if (time[k] < w.last - 0.5 * block.dt) ++w.end;
  }
}

/// @return false if rows around the window are missing
bool finish(Window& w) {
  const long rows = static_cast<long>(w.parts.size());
  if (w.begin < 1 || w.end <= w.begin + 8 || w.end >= rows) return false;
  const long n = w.parts.front().cols() / 4;
  for (RowMatX<double>* m : {&w.x.q, &w.x.qd, &w.x.qdd, &w.x.logged}) m->resize(rows, n);
  for (long k = 0; k < rows; ++k) {
    const RowMatX<double>& row = w.parts[static_cast<std::size_t>(k)];
    w.x.q.row(k) = row.leftCols(n);
    w.x.qd.row(k) = row.middleCols(n, n);
    w.x.qdd.row(k) = row.middleCols(2 * n, n);
    w.x.logged.row(k) = row.rightCols(n);
  }
  w.parts.clear();
  w.x.run = w.run;
  w.x.start = w.start;
  return true;
}

/// @return the windows with their rows; those that lack some are left out
std::vector<Window> read_windows(std::vector<Window> windows, const RecordingSource& source,
                                 const PreprocessPlan& plan, const IdentifyOptions& reading,
                                 int first_run) {
  int run = -1;
  double run_start = 0.0;
  for_each_block(source, plan, "simulating", 0, reading, [&](const Preprocessed& block) {
    if (block.run != run) run_start = block.time[0];
    run = block.run;
    for (Window& w : windows)
      if (w.run == first_run + run) collect(block, run_start, w);
  });
  std::erase_if(windows, [](Window& w) { return !finish(w); });
  return windows;
}

/// Simulates windows by one model, in each run with the effects that act there.
class Replayed {
 public:
  Replayed(const Model& model, const std::vector<int>& runs) : model_(model), runs_(runs) {}

  RowMatX<double> operator()(const Window& w, const Feedback* feedback) {
    const auto [at, is_new] = trees_.try_emplace(w.run);
    if (is_new) at->second = extend(model_, runs_, w.run);
    return replay(at->second, w.x, w.begin, w.end, feedback, w.run);
  }

 private:
  const Model& model_;
  std::vector<int> runs_;
  std::map<int, ExtendedTree> trees_;
};

/// Whether it stopped early; the clock of a log may cost a few rows at the ends.
bool blew_up(const RowMatX<double>& q) {
  constexpr double kFinished = 0.9;
  const long finite = q.array().isFinite().rowwise().all().count();
  return static_cast<double>(finite) < kFinished * static_cast<double>(q.rows());
}

void compare(const std::vector<Window>& windows, const std::vector<RowMatX<double>>& base,
             const std::vector<RowMatX<double>>& extended, SimulatedMotion& out) {
  long rows = 0;
  for (const Window& w : windows) rows += w.end - w.begin;
  const long stride = 1 + (rows - 1) / static_cast<long>(kMostPoints);
  std::vector<double> count(out.joints.size(), 0.0);
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const Window& w = windows[i];
    const bool finished = !blew_up(base[i]) && !blew_up(extended[i]);
    out.base_failed += blew_up(base[i]);
    out.extended_failed += blew_up(extended[i]);
    const long length = w.end - w.begin;
    for (std::size_t j = 0; j < out.joints.size(); ++j) {
      SimulatedSeries& s = out.joints[j];
      for (long k = 0; k < length; ++k) {
        const long c = static_cast<long>(j);
        const double measured = w.x.q(w.begin + k, c), q0 = base[i](k, c), q1 = extended[i](k, c);
        if (finished && std::isfinite(q0) && std::isfinite(q1)) {
          s.base_rmse += (q0 - measured) * (q0 - measured);
          s.extended_rmse += (q1 - measured) * (q1 - measured);
          ++count[j];
        }
        if (k % stride != 0) continue;
        const bool ends = k + stride >= length;
        s.time.push_back(w.first + static_cast<double>(k) * w.x.dt);
        s.measured.push_back(measured);
        s.base.push_back(ends ? kNaN : q0);
        s.extended.push_back(ends ? kNaN : q1);
      }
    }
  }
  for (std::size_t j = 0; j < out.joints.size(); ++j)
    for (double* e : {&out.joints[j].base_rmse, &out.joints[j].extended_rmse})
      *e = count[j] > 0.0 ? std::sqrt(*e / count[j]) : kNaN;
}

}  // namespace

SimulatedMotion simulate_held_out(const Model& base, const Model& extended,
                                  const RecordingSource& source, const Evidence& evidence,
                                  const std::vector<bool>& held, const PreprocessPlan& plan,
                                  const IdentifyOptions& reading) {
  SimulatedMotion out;
  const std::vector<Recording> sample = source.sample();
  const std::optional<Feedback> feedback = common_feedback(sample);
  out.driven_by = feedback ? "controller" : "measured torque";
  out.window = feedback ? kInLoop : kByTorque;
  const Recording& first = sample.front();
  for (int j = 0; j < first.num_joints(); ++j)
    if (first.rows() > 0 && !first.has_tau[static_cast<std::size_t>(j)] &&
        std::isnan(first.tau(0, j))) {
      out.reason = "the torque of " + first.joint_names[static_cast<std::size_t>(j)] +
                   " was not recorded: its motion is an input, not a result";
      return out;
    }
  std::vector<Window> windows = possible_windows(evidence, held, out.window);
  if (windows.empty()) {  // a short recording, or short blocks
    out.window = kByTorque;
    windows = possible_windows(evidence, held, out.window);
  }
  const double most = (feedback ? kMostInLoop : kMostSeconds) / out.window;
  windows = read_windows(spread(std::move(windows), static_cast<std::size_t>(most)), source, plan,
                         reading, evidence.first_run());
  out.windows = static_cast<int>(windows.size());
  if (windows.empty()) {
    out.reason = "no held-out stretch lasts " + format_number(out.window) + " s";
    return out;
  }
  std::vector<RowMatX<double>> q0, q1;
  try {
    Replayed by_base(base, source.runs()), by_extended(extended, source.runs());
    for (const Window& w : windows) {
      q0.push_back(by_base(w, feedback ? &*feedback : nullptr));
      q1.push_back(by_extended(w, feedback ? &*feedback : nullptr));
    }
  } catch (const Error& e) {
    out.reason = e.what();
    return out;
  }
  const std::vector<std::string> names = joint_names(base);
  for (std::size_t j = 0; j < names.size(); ++j) {
    out.joints.emplace_back();
    out.joints.back().joint = names[j];
    out.joints.back().unit = unit_of_joint(base, static_cast<int>(j), false);
  }
  compare(windows, q0, q1, out);
  if (out.base_failed == out.windows || out.extended_failed == out.windows)
    out.reason = std::string("the simulation with the ") +
                 (out.base_failed == out.windows ? "base" : "extended") +
                 " model was tried and blew up in every window";
  return out;
}

}  // namespace diffnea
