/// What a recording needs before it is differentiated: grid, cut-off, rate of the fit.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/preprocess.hpp>
#include <diffnea/recording/refresh.hpp>

#include "core/constants.hpp"
#include "core/number_text.hpp"
#include "core/statistics.hpp"
#include "recording/columns.hpp"
#include "recording/cut_off.hpp"
#include "recording/floating_base.hpp"
#include "recording/fresh_positions.hpp"
#include "recording/gridder.hpp"
#include "recording/overlap.hpp"
#include "recording/spectrum.hpp"
#include "recording/time_unit.hpp"

namespace diffnea {
namespace {

using detail::Gridder;

/// Rows that planning looks at, at most; enough for any spectrum.
constexpr long kPlanRows = 400'000;
/// No drive is sampled faster; a pause of milliseconds would be a gap of millions of rows [s].
constexpr double kShortestPeriod = 1e-6;

// Bands of torques and regressor, in shares of the output rate as in DecimatorOptions, or of the
// cut-off where lower.
constexpr double kPass = 0.35, kStop = 0.65, kPassOfCutoff = 0.5, kStopOfCutoff = 0.95;
/// The grid's period: mean of the intervals within half of their median, which is the median to the
/// accuracy that time was written with, and its true value where it was rounded. A row that lacks a
/// value is as good as none: where torques are logged less often than positions, theirs count.
double choose_period(const std::vector<Recording>& recordings, bool measured_velocity,
                     double& jitter) {
  std::vector<double> steps;
  for (const Recording& r : recordings)
    for (long i = 0, before = -1; i < r.rows() && static_cast<long>(steps.size()) < kPlanRows;
         ++i) {
      if (detail::is_gap(r, i, measured_velocity)) continue;
      if (before >= 0) steps.push_back(r.time[i] - r.time[before]);
      before = i;
    }
  if (steps.empty())
    throw DataError(recordings.front().source + ": " + detail::why_no_rows(recordings, 2) +
                    ", so there is nothing to differentiate");
  const double middle = median(steps);
  double sum = 0.0, count = 0.0;
  for (const double s : steps)
    if (std::abs(s - middle) < 0.5 * middle) {
      sum += s;
      count += 1.0;
    }
  const double mean = sum / count;
  // A mean far off the median is no rounding: two rates, or many rows left out.
  const double dt = std::abs(mean - middle) < 0.1 * middle ? mean : middle;
  if (!(dt >= kShortestPeriod))
    throw DataError(recordings.front().source + ": rows follow each other every " +
                    detail::number_text(dt, 6) + " s, expected " +
                    detail::number_text(kShortestPeriod, 6) +
                    " s or more: is the unit of `time` right?");
  jitter = static_cast<double>(std::ranges::count_if(
               steps, [&](double s) { return std::abs(s - dt) > 0.02 * dt; })) /
           static_cast<double>(steps.size());
  return dt;
}

/// Uniform segments of all recordings, column by column: [column][segment].
std::vector<std::vector<Eigen::VectorXd>> grid_segments(const std::vector<Recording>& recordings,
                                                        const Gridder::Options& options) {
  const int n = recordings.front().num_joints();
  Gridder gridder(options, n);
  std::vector<std::vector<Eigen::VectorXd>> out(gridder.num_columns());
  const auto take = [&] {
    gridder.finish_segment();
    const long columns = gridder.num_columns();
    const long rows = static_cast<long>(gridder.rows.size()) / columns;
    const Eigen::Map<const RowMatX<double>> m(gridder.rows.data(), rows, columns);
    for (long c = 0; c < columns && rows > 0; ++c) out[c].emplace_back(m.col(c));
    gridder.rows.clear();
  };
  long taken = 0;
  for (const Recording& r : recordings) {
    for (long i = 0; i < r.rows() && taken < kPlanRows; ++i, ++taken)
      if (!gridder.push(r, i)) {
        take();
        gridder.push(r, i);
      }
    take();
  }
  return out;
}

/// On lines: where polynomials have no noise, none would be found.
std::vector<Recording> without_repeats(const std::vector<Recording>& recordings,
                                       const std::vector<int>& refresh) {
  std::vector<Recording> out;
  for (const Recording& r : recordings)
    out.push_back(detail::FreshPositions(refresh, /*curved=*/false).whole(r));
  return out;
}

/// Of a stretch of the recordings that no pause interrupts [s].
double longest_of(const std::vector<Recording>& recordings, double longest_pause) {
  double out = 0.0;
  for (const Recording& r : recordings)
    for (long first = 0, k = 1; k < r.rows(); ++k) {
      if (!(r.time[k] - r.time[k - 1] <= longest_pause)) first = k;
      out = std::max(out, r.time[k] - r.time[first]);
    }
  return out;
}

/// Largest band of the rows in which the accelerations of a floating base are known well enough to
/// be regressors [Hz]; infinite where its motion is too short to tell. White noise σ of positions
/// has the density 2 σ² dt (2π f)⁴ as accelerations, of which the band f holds the fifth part of
/// its end times f. All links move by it, in every row; arms hang on no such measurement.
/// @param of_pose  spectra of x y z qx qy qz qw
/// @param longest  stretch without a gap [s]
double band_of_base(std::span<const detail::PositionSpectrum> of_pose, double dt, double longest) {
  // Variance of noise over that of motion. Errors in variables shrink parameters by as much, and
  // standard errors of ten seconds of flight show fifty times as much. Noise grows with the fourth
  // power of the frequency: a wider band makes standard errors larger, too.
  constexpr double kNoiseOverMotion = 5e-5;
  // Length of the rows' filter times the width from pass to stop (Kaiser, 60 dB): it takes half of
  // the longest stretch at most, however still the base is.
  constexpr double kLengthTimesWidth = 3.62;
  const double least = 2.0 * kLengthTimesWidth / longest * kPass / (kStop - kPass);
  double out = kInfinity;
  for (const auto part : {of_pose.first(3), of_pose.subspan(3)}) {
    double motion = 0.0, noise = 0.0;
    for (const detail::PositionSpectrum& s : part) {
      motion = std::max(motion, s.acceleration);
      noise = std::max(noise, s.noise);
    }
    const double density = 2.0 * noise * noise * dt * std::pow(2.0 * std::numbers::pi, 4);
    if (motion > 0.0 && density > 0.0)
      out = std::min(out, std::pow(5.0 * kNoiseOverMotion * motion / density, 0.2));
  }
  return std::max(out, least);
}

/// Tells whether a base's pose was logged.
bool floats(const std::vector<Recording>& recordings) {
  return std::ranges::any_of(recordings, [](const Recording& r) { return r.base.size() > 0; });
}

/// Five rows that the filter leaves independent, at least.
/// @param plan  with filter_hz, max_gap and min_segment
void require_enough(const std::vector<Recording>& recordings, const PreprocessPlan& plan,
                    const PreprocessOptions& options) {
  const std::string& where = recordings.front().source;
  const double longest = longest_of(recordings, plan.max_gap * plan.dt);
  const std::string lasts =
      detail::number_text(longest, 3) + " s" +
      (longest < longest_of(recordings, kInfinity) ? " (its longest stretch without a gap)" : "");
  const auto too_few = [&](double hz) { return hz > 0.0 && !(hz * longest >= 5.0); };
  for (const double hz : {options.filter_hz, options.decimate_to_hz})
    if (too_few(hz))
      throw DataError(where + ": filter or decimation to " + detail::number_text(hz, 4) +
                      " Hz leaves fewer than five rows of " + lasts + "; expected " +
                      detail::number_text(5.0 / longest, 4) + " Hz or more");
  // Where any stretch will do, a path needs five rows of it alone.
  if (plan.min_segment > 0.0 && too_few(plan.filter_hz))
    throw DataError(where + ": lasts " + lasts + ", of which the filter that suits it (" +
                    detail::number_text(plan.filter_hz, 3) +
                    " Hz) leaves fewer than five rows; record ten seconds or more, e.g. a "
                    "motion of `diffnea excite`, or have runs of any length simulated (`--loss "
                    "motion`)");
}

/// One kind of recordings, with something to differentiate.
void require_alike(const std::vector<Recording>& recordings, bool measured_velocity) {
  if (recordings.empty()) throw DataError("preprocess: got no recording, expected one or more");
  const std::vector<std::string>& names = recordings.front().joint_names;
  for (const Recording& r : recordings) {
    if (r.joint_names != names)
      throw DataError(r.source + ": the joints are not those of " + recordings.front().source +
                      ": " + detail::join_or_none(r.joint_names) + "; " +
                      detail::join_or_none(names));
    if (measured_velocity && r.qd.size() == 0)
      throw DataError(r.source +
                      ": measured velocities were asked for, but there is no column qd_<joint>" +
                      (r.base.size() > 0 ? ", or no base_wx … base_vz" : ""));
  }
  if (names.empty())
    throw DataError(recordings.front().source +
                    ": there is no joint, so there is nothing to differentiate");
}

}  // namespace

PreprocessPlan plan_preprocess(const std::vector<Recording>& logged,
                               const PreprocessOptions& options) {
  const std::vector<Recording> with_base =
      floats(logged) ? detail::with_base_positions(logged) : std::vector<Recording>{};
  const std::vector<Recording>& recordings = floats(logged) ? with_base : logged;
  require_alike(recordings, options.measured_velocity);
  PreprocessPlan plan;
  plan.min_segment = options.min_segment;
  plan.measured_velocity = options.measured_velocity;
  plan.dt = choose_period(recordings, options.measured_velocity, plan.timing_jitter);
  const double rate = 1.0 / plan.dt;
  const std::size_t n = recordings.front().joint_names.size();

  // Until the cut-off is known: a pause of 20 ms is short against the motion of a robot.
  plan.max_gap = std::max(5.0, 0.02 / plan.dt);
  plan.refresh = refresh_rows(recordings);
  auto columns = grid_segments(
      detail::is_slow_and_uneven(plan) ? without_repeats(recordings, plan.refresh) : recordings,
      {.dt = plan.dt, .max_gap = plan.max_gap, .velocity = false, .average_hold = false});
  for (std::size_t j = 0; j < n; ++j)
    for (Eigen::VectorXd& segment : columns[j]) fill_stale(segment, plan.refresh[j]);
  // Rounding of a joint that hardly moves is no noise that a spectrum shows.
  plan.q_step = quantisation_steps(recordings);
  double cutoff = 0.0, busy = 0.0;
  std::vector<detail::PositionSpectrum> spectra;
  for (std::size_t j = 0; j < n; ++j) {
    detail::PositionSpectrum s = detail::look_at_position(columns[j], rate, plan.q_step[j]);
    if (s.cutoff_hz > 0.0)
      s.cutoff_hz = detail::cutoff_of_events(
          columns[j], rate, std::clamp(s.cutoff_hz, 1e-3 * rate, detail::kTrueTo * rate),
          detail::kTrueTo * rate, s.noise);
    spectra.push_back(s);
    plan.joint_hz.push_back(s.cutoff_hz);
    plan.q_noise.push_back(std::max(s.noise, plan.q_step[j] / std::sqrt(12.0)));
    cutoff = std::max(cutoff, s.cutoff_hz);
    busy = std::max(busy, s.busy_hz);
    const long length = detail::window_length(columns[n + j], plan.dt);
    const bool measured = recordings.front().has_tau[j] && length > 0;
    plan.tau_noise.push_back(
        measured ? std::sqrt(detail::noise_floor(detail::welch(columns[n + j], rate, length)) *
                             0.5 * rate)
                 : kNaN);
  }
  plan.filter_hz = options.filter_hz > 0.0 ? options.filter_hz
                   : cutoff > 0.0          ? std::clamp(cutoff, 1e-3 * rate, detail::kTrueTo * rate)
                                           : 0.1 * rate;
  if (!(options.filter_hz >= 0.0 && options.decimate_to_hz >= 0.0))
    throw DataError("preprocess: filter_hz is " + std::to_string(options.filter_hz) +
                    ", decimate_to_hz " + std::to_string(options.decimate_to_hz) +
                    "; expected 0 (chosen from the data) or above");
  // A pause of a tenth of the cut-off's period holds nothing that the interpolation would miss.
  plan.max_gap =
      options.max_gap > 0.0 ? options.max_gap : std::max(5.0, 0.1 / (plan.filter_hz * plan.dt));
  require_enough(recordings, plan, options);
  if (plan.filter_hz >= 0.5 * rate)
    throw DataError(recordings.front().source + ": filter_hz is " + std::to_string(plan.filter_hz) +
                    " Hz, expected below half of the sampling rate, " + std::to_string(0.5 * rate) +
                    " Hz");

  // Torques and regressor pass as far as the filter of the positions is flat (4
  // % at two thirds of the cut-off). Above, torque noise meets no motion, and noise of q̈ would bias
  // inertias (errors in variables).
  constexpr double kUsualRate = 50.0;
  const double of_base = floats(logged)
                             ? band_of_base(std::span(spectra).last(detail::kPose), plan.dt,
                                            longest_of(recordings, plan.max_gap * plan.dt))
                             : kInfinity;
  const double wanted =
      options.decimate_to_hz > 0.0
          ? options.decimate_to_hz
          : std::min({std::max(kUsualRate, busy / kPass), 2.0 * plan.filter_hz, of_base / kPass});
  plan.decimator.rate_hz = rate;
  plan.decimator.factor = std::max(1, static_cast<int>(std::lround(rate / wanted)));
  const double output = rate / plan.decimator.factor;
  plan.decimator.pass_hz = std::min(kPass * output, kPassOfCutoff * plan.filter_hz);
  plan.decimator.stop_hz = std::min({kStop * output, kStopOfCutoff * plan.filter_hz, 0.5 * rate});
  return plan;
}

PreprocessPlan plan_like(const PreprocessPlan& plan, const std::vector<Recording>& logged) {
  const std::vector<Recording> with_base =
      floats(logged) ? detail::with_base_positions(logged) : std::vector<Recording>{};
  const std::vector<Recording>& recordings = floats(logged) ? with_base : logged;
  require_alike(recordings, plan.measured_velocity);
  PreprocessPlan out = plan;
  out.dt = choose_period(recordings, plan.measured_velocity, out.timing_jitter);
  detail::require_unit_of_time(recordings, plan.dt, out.dt);
  out.refresh = refresh_rows(recordings);
  const double rate = 1.0 / out.dt;
  // Positions may be smoothed more, as long as that is flat over the band of the torques.
  out.filter_hz =
      std::min(plan.filter_hz, std::max(detail::kTrueTo, plan.filter_hz * plan.dt) * rate);
  out.max_gap = std::max(5.0, plan.max_gap * plan.dt / out.dt);
  require_enough(recordings, out, {});
  const double wanted = 1.0 / (plan.dt * plan.decimator.factor);
  out.decimator.rate_hz = rate;
  out.decimator.factor = std::max(1, static_cast<int>(std::lround(rate / wanted)));
  const double output = rate / out.decimator.factor;
  out.decimator.pass_hz =
      std::min({plan.decimator.pass_hz, kPass * output, kPassOfCutoff * out.filter_hz});
  out.decimator.stop_hz =
      std::min({plan.decimator.stop_hz, kStop * output, kStopOfCutoff * out.filter_hz, 0.5 * rate});
  return out;
}

}  // namespace diffnea
