#pragma once
/// Output error: simulated windows of a recording against measured positions (multiple shooting;
/// Bock 1983). Needs no velocity, acceleration or filter, hence no bias from them.
///
/// Each window has its own first state, eliminated by a QR of its rows, so that a Gauss–Newton step
/// costs one small convex problem (solve_convex_fit), in which physical consistency holds exactly.
/// Internal to identify/.

#include <functional>
#include <limits>

#include <diffnea/identify/convex_fit.hpp>
#include <diffnea/identify/layout.hpp>

#include "motion/continuation.hpp"
#include "motion/first_states.hpp"

namespace diffnea {

/// Where a fit to windows stands.
struct MotionFit {
  VecX<double> x;            ///< (p) linear parameters of the layout
  VecX<double> shape;        ///< (s) its shape parameters
  MatX<double> R;            ///< (f, p + s) factor of the last linearisation, in units of sigma
  MatX<double> covariance;   ///< (p + s, p + s) of both, shapes in their own unit
  long samples = 0;          ///< positions compared
  double objective = 0.0;    ///< χ²/2 of the windows whose simulation does not blow up
  long blown_up = 0;         ///< number of the others
  int iterations = 0;        ///< Gauss–Newton steps, of all horizons
  bool converged = false;    ///< the last fit met its stop rule, and no window blows up
  bool interrupted = false;  ///< the callback said so; what is here is the best until then
  std::string termination;   ///< why the last fit ended, in words
  double within_reach = 0.0;  ///< where it ended out of reach of its rival: objective at which it
                              ///< was not, χ²/2; 0: it went on to its own end
};

/// Data and scales of a fit, which outlive it.
struct MotionProblem {
  const Model& model;
  const FitLayout& layout;
  const std::vector<MotionStretch>& stretches;
  std::vector<int> runs;  ///< of the recordings, ascending
  VecX<double> sigma;     ///< (n) noise of the positions [rad] or [m]
  VecX<double> scale;     ///< (p) how far a parameter may well be from where it starts
};

/// A fit that goes on from horizon to horizon.
class MotionFitter {
 public:
  /// @param start, shape  (p), (s) where to begin; what the data cannot tell stays there
  /// @param progress      called after every step with (iteration, objective); false stops
  /// @throws ModelError if an effect has no forward form
  MotionFitter(const MotionProblem& problem, const MotionOptions& options, VecX<double> start,
               VecX<double> shape, std::function<bool(int, double)> progress = {});

  /// Fits parameters and the states of these windows.
  /// @param tolerance  stop when a step gains a smaller share of the objective
  /// @param to_beat    objective of a rival; stop where many steps like the last one would not come
  ///                   below it
  void fit(std::vector<MotionWindow>& windows, double tolerance, double to_beat = kNoRival);
  /// Fits the states alone.
  /// @param tolerance  as for fit()
  /// @param most       cost that decides: windows that stay above it need not be exact
  void fit_states(std::vector<MotionWindow>& windows, double tolerance,
                  double most = kNoRival) const;
  /// Standard errors at the present point: as they differ where blocks of time are left out in turn
  /// (jackknife; Efron 1982), so that residuals may depend on each other, and be larger here than
  /// there; no less than independent noise makes them.
  void set_covariance(const std::vector<MotionWindow>& windows);

  /// Columns that are fitted: linear parameters of the layout, then their number + index of shapes.
  const std::vector<int>& free() const { return free_; }
  /// [J | r] of all windows whose simulation does not blow up, first states eliminated.
  TriangularFactor factor(const std::vector<MotionWindow>& windows) const;
  /// Simulators at the present point, one a thread.
  Workers workers() const { return workers_at(now_.x, now_.shape, free_); }
  /// The present point.
  const MotionFit& now() const { return now_; }
  /// Goes on from these linear parameters, strictly consistent; the prior stays where it is.
  void begin_at(const VecX<double>& x) { now_.x = x; }
  /// Variance of what is left over that of the noise, times its correlation time.
  double correlation(const std::vector<MotionWindow>& windows) const;
  /// χ²/2 of these windows at the present point and their states; +∞ if one blows up.
  double cost(const std::vector<MotionWindow>& windows) const;
  /// Goes back to an earlier one.
  void restore(MotionFit earlier) { now_ = std::move(earlier); }

 private:
  static constexpr double kNoRival = std::numeric_limits<double>::infinity();

  /// The model in the runs, those alike together.
  std::vector<ModelOfRuns> models_of(const Model& model) const;
  Workers workers_at(const VecX<double>& x, const VecX<double>& shape,
                     const std::vector<int>& free) const;
  std::vector<ReducedWindow> linearise(Workers& workers, const std::vector<MotionWindow>& windows,
                                       int free) const;
  std::vector<double> costs(Workers& workers, const std::vector<MotionWindow>& windows,
                            std::vector<VecX<double>>& to, const std::vector<double>& before) const;
  /// Where a step leads.
  struct Step {
    VecX<double> x, shape;
    VecX<double> change;  ///< of the fitted columns
    double length = 0.0;  ///< in units of their curvature
  };
  Step step(const VecX<double>& d, double damping) const;
  /// At that damping, or more until it is half as long as a refused one at most.
  Step shorter_step(const VecX<double>& d, double refused, double& damping) const;
  double promise(const std::vector<ReducedWindow>& reduced, const VecX<double>& d) const;
  double blur(const std::vector<MotionWindow>& windows) const;
  double misfit() const;
  double weak(long column) const;
  double coordinate(long column, const VecX<double>& x, const VecX<double>& shape) const;
  double scale_of(long column) const;
  double curvature(long column) const;

  const MotionProblem& problem_;
  MotionOptions options_;
  VecX<double> start_, start_shape_;
  std::function<bool(int, double)> progress_;
  std::vector<int> free_;
  double blur_ = 1.0;  ///< blur() of the present fit
  MotionFit now_;
};

}  // namespace diffnea
