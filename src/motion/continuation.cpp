#include "motion/continuation.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include <diffnea/core/parallel.hpp>

#include "core/constants.hpp"
#include "core/number_text.hpp"
#include "core/statistics.hpp"

namespace diffnea {
namespace {

VecX<double> measured_state(const MotionStretch& stretch, const MotionWindow& window,
                            double first_horizon) {
  const std::vector<double>& t = stretch.time;
  const auto begin = t.begin() + window.first;
  const long rows = std::upper_bound(begin, begin + window.rows, *begin + first_horizon) - begin;
  const LocalMotion at = local_motion(stretch, *begin, window.first, rows);
  VecX<double> out(2 * at.q.size());
  out << at.q, at.qd;
  return out;
}

}  // namespace

void set_measured_states(const std::vector<MotionStretch>& stretches, double first_horizon,
                         std::vector<MotionWindow>& windows) {
  for (MotionWindow& w : windows) w.state = measured_state(stretches[w.stretch], w, first_horizon);
}

std::vector<MotionWindow> continued(Workers& workers, const std::vector<MotionStretch>& stretches,
                                    const std::vector<MotionWindow>& windows, double horizon,
                                    double first_horizon) {
  std::vector<MotionWindow> out = cut_windows(stretches, horizon);
  parallel_for(out.size(), workers.size(), [&](std::size_t i, std::size_t worker) {
    MotionWindow& w = out[i];
    const MotionStretch& stretch = stretches[w.stretch];
    for (const MotionWindow& from : windows)
      if (from.stretch == w.stretch && from.first <= w.first && w.first < from.first + from.rows) {
        if (!workers[worker]->state_at(stretch, from, w.first - from.first, w.state))
          w.state.resize(0);
        break;
      }
    if (w.state.size() == 0) w.state = measured_state(stretch, w, first_horizon);
  });
  return out;
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

WindowErrors window_errors(Workers& workers, const std::vector<MotionStretch>& stretches,
                           const std::vector<MotionWindow>& windows, const VecX<double>& limit) {
  const long n = limit.size();
  WindowErrors out;
  out.sum = out.count = RowMatX<double>::Zero(static_cast<long>(windows.size()), n);
  std::vector<std::optional<Apart>> apart(windows.size());
  parallel_for(windows.size(), workers.size(), [&](std::size_t i, std::size_t worker) {
    const MotionWindow& w = windows[i];
    const MotionStretch& stretch = stretches[w.stretch];
    const RowMatX<double> q = workers[worker]->positions(stretch, w);
    const long row = static_cast<long>(i);
    std::optional<Apart> first;
    for (long k = 0; k < w.rows; ++k)
      for (int j = 0; j < n; ++j) {
        const double measured = stretch.q(w.first + k, j), error = q(k, j) - measured;
        if (!std::isnan(measured)) {
          out.sum(row, j) += error * error;
          out.count(row, j) += 1;
        }
        const bool gone = std::isnan(q(k, j)) || std::abs(error) > limit[j];
        if (gone && !first) {
          const std::size_t at = static_cast<std::size_t>(w.first);
          first = Apart{i, j, stretch.time[at + static_cast<std::size_t>(k)] - stretch.time[at]};
        }
      }
    for (int j = 0; j < n; ++j) {
      const double mean = out.sum(row, j) / std::max(out.count(row, j), 1.0);
      if (first && !(mean <= limit[j] * limit[j])) apart[i] = first;
    }
  });
  for (const auto& a : apart)
    if (a) out.apart.push_back(*a);
  return out;
}

double torque_noise_share(JointWindows& simulator, const std::vector<MotionStretch>& stretches,
                          const std::vector<MotionWindow>& windows, const VecX<double>& density,
                          const VecX<double>& limit) {
  constexpr std::size_t kLooked = 9;  // windows that are enough for a median
  if (!(density.maxCoeff() > 0.0)) return 0.0;
  std::vector<double> shares;
  const std::size_t every = std::max<std::size_t>(windows.size() / kLooked, 1);
  for (std::size_t i = 0; i < windows.size(); i += every) {
    const MotionWindow& w = windows[i];
    const VecX<double> reach = simulator.torque_noise_reach(stretches[w.stretch], w, density);
    const double share = reach.cwiseQuotient(limit).maxCoeff();
    shares.push_back(std::isfinite(share) ? share : kInfinity);
  }
  return shares.empty() ? 0.0 : median(std::move(shares));
}

std::string unlike_the_others(const WindowErrors& errors,
                              const std::vector<MotionStretch>& stretches,
                              const std::vector<MotionWindow>& windows,
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
    for (const double x : mean) known.push_back(std::isnan(x) ? kInfinity : x);
    const double usual = median(std::move(known));
    std::vector<std::string> times;
    for (long i = 0; i < mean.size(); ++i)
      if (usual > 0.0 && !(mean[i] <= kUnlike * usual)) {
        const MotionWindow& w = windows[static_cast<std::size_t>(i)];
        const MotionStretch& s = stretches[w.stretch];
        times.push_back(detail::number_text(s.time[static_cast<std::size_t>(w.first)]) + " s" +
                        (s.run > 0 ? " of run " + std::to_string(s.run) : ""));
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
