#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/preprocess.hpp>

#include "core/statistics.hpp"
#include "identify/passes.hpp"
#include "identify/window_integrator.hpp"

namespace diffnea {

std::vector<ShootingWindow> make_windows(const Recording& recording, double window_seconds,
                                         double filter_hz, const std::vector<bool>& passive) {
  PreprocessOptions options;
  options.filter_hz = filter_hz;
  const PreprocessPlan plan = plan_preprocess({recording}, options);
  const Preprocessed smooth = preprocess(recording, plan);
  const int n = recording.num_joints();
  std::vector<ShootingWindow> out;
  const bool hold = recording.info.torque_sampling == TorqueSampling::kHold;
  const auto torque = [&](long k, int j) {  // a passive joint's is 0, or the ball's pull
    const bool none = j < static_cast<int>(passive.size()) &&
                      passive[static_cast<std::size_t>(j)] && std::isnan(recording.tau(k, j));
    return none ? 0.0 : recording.tau(k, j);
  };
  long at = 0;
  for (long k = 0; k < recording.rows();) {
    while (at < smooth.rows() && smooth.time[at] < recording.time[k] - 0.5 * smooth.dt) ++at;
    if (at == smooth.rows()) break;
    if (smooth.time[at] > recording.time[k] + 0.5 * smooth.dt) {  // filtered rows begin later
      ++k;
      continue;
    }
    long end = k;
    bool complete = true;
    while (end < recording.rows() && recording.time[end] - recording.time[k] < window_seconds) {
      for (int j = 0; j < n; ++j) complete = complete && !std::isnan(torque(end, j));
      if (end > k && recording.time[end] - recording.time[end - 1] > plan.max_gap * plan.dt)
        complete = false;
      ++end;
    }
    const bool whole = end < recording.rows() ||
                       recording.time[end - 1] - recording.time[k] > 0.9 * window_seconds;
    if (complete && whole && end - k > 8) {
      ShootingWindow w;
      w.run = recording.run;
      const long m = end - k;
      w.q = recording.q.middleRows(k, m);
      w.u.resize(m, n);
      w.u_end.resize(m, n);
      for (long r = 0; r < m; ++r) {
        w.time.push_back(recording.time[k + r]);
        const long next = std::min(k + r + 1, recording.rows() - 1);
        for (int j = 0; j < n; ++j) {
          w.u(r, j) = torque(k + r, j);
          w.u_end(r, j) = hold ? w.u(r, j) : torque(next, j);
        }
      }
      w.measured_state.resize(2 * n);
      w.measured_state.head(n) = smooth.q.row(at).transpose();
      w.measured_state.tail(n) = smooth.qd.row(at).transpose();
      w.state = w.measured_state;
      out.push_back(std::move(w));
    }
    k = std::max(end, k + 1);
  }
  if (out.empty())
    throw DataError(recording.source + ": no window of " + std::to_string(window_seconds) +
                    " s has a torque at every row; choose a shorter window, or declare joints "
                    "without a drive passive");
  return out;
}

RowMatX<double> simulate_window(ForwardDynamics& dynamics, const ShootingWindow& window,
                                const VecX<double>& state, const SteppingOptions& options) {
  const int n = dynamics.num_dofs();
  RowMatX<double> q = RowMatX<double>::Constant(static_cast<long>(window.time.size()), n,
                                                std::numeric_limits<double>::quiet_NaN());
  MatX<double> z = state;
  integrate(window, fastest_rate(dynamics, window), options.max_step, z,
            state_slope(dynamics, window.run),
            [&](long k, const MatX<double>& at) { q.row(k) = at.col(0).head(n).transpose(); });
  return q;
}

VecX<double> WindowErrors::rmse() const {
  VecX<double> squares = VecX<double>::Zero(sum.cols()), rows = squares;
  for (long i = 0; i < sum.rows(); ++i) {
    if (!sum.row(i).allFinite()) continue;
    squares += sum.row(i).transpose();
    rows += count.row(i).transpose();
  }
  return squares.cwiseQuotient(rows).cwiseSqrt();  // NaN where no window says anything
}

long WindowErrors::blown_up() const {
  long out = 0;
  for (long i = 0; i < sum.rows(); ++i) out += !sum.row(i).allFinite();
  return out;
}

WindowErrors window_errors(const Model& model, const std::vector<ShootingWindow>& windows,
                           bool measured_state, const SteppingOptions& options) {
  std::vector<int> runs;
  for (const ShootingWindow& w : windows) runs.push_back(w.run);
  ForwardDynamics dynamics(extend(model, runs));
  const int n = dynamics.num_dofs();
  WindowErrors out;
  out.sum = out.count = RowMatX<double>::Zero(static_cast<long>(windows.size()), n);
  for (long i = 0; i < out.sum.rows(); ++i) {
    const ShootingWindow& w = windows[static_cast<std::size_t>(i)];
    const RowMatX<double> q =
        simulate_window(dynamics, w, measured_state ? w.measured_state : w.state, options);
    for (long k = 0; k < q.rows(); ++k)
      for (int j = 0; j < n; ++j)
        if (!std::isnan(w.q(k, j))) {
          out.sum(i, j) += std::pow(q(k, j) - w.q(k, j), 2);
          out.count(i, j) += 1;
        }
  }
  return out;
}

std::string unlike_the_others(const WindowErrors& errors,
                              const std::vector<ShootingWindow>& windows,
                              const std::vector<std::string>& joints) {
  constexpr long kFewest = 8;         // windows that have a median
  constexpr double kUnlike = 10.0;    // times the median
  constexpr std::size_t kListed = 5;  // of a joint
  std::string out;
  if (errors.sum.rows() < kFewest) return out;
  for (long j = 0; j < errors.sum.cols(); ++j) {
    const VecX<double> mean =
        errors.sum.col(j).cwiseQuotient(errors.count.col(j).cwiseMax(1.0)).cwiseSqrt();
    std::vector<double> known;
    for (const double x : mean)
      known.push_back(std::isnan(x) ? std::numeric_limits<double>::infinity() : x);
    const double usual = median(std::move(known));
    std::vector<std::string> times;
    for (long i = 0; i < mean.size(); ++i)
      if (usual > 0.0 && !(mean[i] <= kUnlike * usual)) {
        const ShootingWindow& w = windows[static_cast<std::size_t>(i)];
        times.push_back(format_number(w.time.front()) + " s" +
                        (w.run > 0 ? " of run " + std::to_string(w.run) : ""));
      }
    for (std::size_t i = 0; i < std::min(times.size(), kListed); ++i)
      out += (i > 0         ? ", "
              : out.empty() ? joints[static_cast<std::size_t>(j)] + " from "
                            : "; " + joints[static_cast<std::size_t>(j)] + " from ") +
             times[i];
    if (times.size() > kListed) out += " and " + std::to_string(times.size() - kListed) + " more";
  }
  if (out.empty()) return out;
  return "windows that the fit does not reproduce (over ten times the joint's median error): " +
         out +
         "; something acted there that the model does not know (a hand, a stop), or rows are bad";
}

}  // namespace diffnea
