#pragma once
/// An informative motion: a finite Fourier series per joint (Swevers et al. 1997), chosen so that
/// log det of the information about the base parameters is largest (D-optimal) within the limits.
///
///     const Excitation e = design_excitation(read_model("arm.urdf"), {});
///     write_trajectory(e.trajectory, "motion.csv");
///
/// q_j(t) = c_j + Σ_k a_jk sin(kωt) + b_jk cos(kωt) with Σ k a_jk = Σ k² b_jk = 0: at rest, without
/// a step of the acceleration, at the start and after every period.
///
/// The rows of the torque regressor, with the columns that `identify` fits by default (inertias,
/// rotors, friction, offsets, the model's own effects), divided by each joint's noise, are summed
/// over a period. A random start is improved by CMA-ES (Hansen 2016) over shape, centre and
/// amplitude of every joint; each trial is scaled into its limits first, so that all are feasible.
///
/// Limits hold at every instant, between the rows too: a trigonometric polynomial of degree H stays
/// below 1/cos(πH/N) of the largest of N equal samples (Ehlich and Zeller 1964), which bounds
/// positions, velocities and accelerations. Torques are no polynomials: they are evaluated every
/// millisecond or finer, and twice the error of a straight line between the samples, h²/8 |τ̈| with
/// τ̈ from differences, is added.
///
/// Loops that constraints close are led by as many joints with a motor as there are motions; the
/// others follow, and what their limits leave narrows the ranges. Their positions, velocities
/// and accelerations are no polynomials: they are looked at on the samples, with a margin.

#include <functional>
#include <map>

#include <diffnea/core/fields.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/identify/identify.hpp>

namespace diffnea {

/// Limits in place of the model's, by joint; the empty name stands for all joints. They are used in
/// full, where of the model's own a share is kept back.
struct LimitOverrides {
  std::map<std::string, std::pair<double, double>> position;  ///< lowest, highest [rad] or [m]
  std::map<std::string, double> velocity;                     ///< [rad/s] or [m/s]
  std::map<std::string, double> acceleration;                 ///< [rad/s²] or [m/s²]
  std::map<std::string, double> effort;                       ///< [N·m] or [N]
};

/// What an informative motion may look like, and how long it is searched for.
struct DesignOptions {
  FourierOptions motion;  ///< times, harmonics and seed; shares of the model's limits
  LimitOverrides limits;  ///< in place of those
  /// Noise of each joint's torque, (n) [N·m] or [N]; empty: 1 % of its effort limit, or of the
  /// largest torque of the random motions where there is none. Ratios alone count.
  std::vector<double> noise;
  int starts = 25;       ///< random motions: the best is improved, the median is compared with
  int iterations = 300;  ///< generations of the search; 0: the best random motion
  /// Returns false: stop with the best so far.
  std::function<bool(const FitProgress&)> progress;
};

/// What a motion uses of the limits it was designed with (of the model's what FourierOptions
/// leaves, LimitOverrides in full), shares of 1, bounds over all instants. 0 of a joint that is
/// held, but for its effort.
struct LimitUse {
  std::string joint;
  double position = 0.0;
  double velocity = 0.0;
  double acceleration = 0.0;
  double effort = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("LimitUse", "What a motion uses of a joint's limits, shares of 1 at any instant.");
    list.field("joint", &LimitUse::joint, "Of the model, with a motor.");
    list.field("position", &LimitUse::position,
               "Largest distance from the range's middle, over half of the range.");
    list.field("velocity", &LimitUse::velocity, "Largest speed over its limit.");
    list.field("acceleration", &LimitUse::acceleration, "Largest acceleration over its limit, without sign.");
    list.field("effort", &LimitUse::effort,
               "By the model with its effects; 0 where no limit is known.");
  }
};

/// A motion that was designed, and what it tells.
struct Excitation {
  Trajectory trajectory;
  double period = 0.0;
  int base_parameters = 0;
  double log_det = 0.0;
  double random_log_det = 0.0;
  double condition = 0.0;
  double random_condition = 0.0;
  double std_ratio = 1.0;
  double best_std_ratio = 1.0;
  double worst_std_ratio = 1.0;
  std::vector<LimitUse> limits;
  std::vector<std::string> notes;
  int iterations = 0;
  bool interrupted = false;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Excitation", "An informative motion, and what it gains.");
    list.field("trajectory", &Excitation::trajectory, "The :class:`Trajectory` to record.");
    list.field("period", &Excitation::period, "A whole number of rows.", {.unit = "s"});
    list.field("base_parameters", &Excitation::base_parameters,
               "p, combinations of parameters that torques depend on.");
    list.field("log_det", &Excitation::log_det,
               "Of the information, columns scaled to one over random states.");
    list.field("random_log_det", &Excitation::random_log_det,
               "Of the median random motion; of this one if none is feasible.");
    list.field("condition", &Excitation::condition,
               "Condition number of the scaled regressor along the motion.");
    list.field("random_condition", &Excitation::random_condition,
               "The same of the median random motion.");
    list.field("std_ratio", &Excitation::std_ratio,
               "Expected standard errors over those of the median random motion: geometric mean (= "
               "exp(−Δ log det / 2p)).");
    list.field("best_std_ratio", &Excitation::best_std_ratio, "Smallest ratio of one parameter.");
    list.field("worst_std_ratio", &Excitation::worst_std_ratio, "Largest ratio of one parameter.");
    list.field("limits", &Excitation::limits, "A list of :class:`LimitUse`.");
    list.field("notes", &Excitation::notes,
               "What stands in for limits that are not known, and the like.");
    list.field("iterations", &Excitation::iterations, "Generations that the search ran.");
    list.field("interrupted", &Excitation::interrupted,
               "The caller's ``progress`` stopped it: the best until then.");
  }
};

/// Deterministic for a seed. A robot that floats is designed for in flight: its base gives way to
/// the joints, whose torques count without weight, and six rows of the wrench on it count, too.
/// @throws ModelError if nothing can move, limits are inverted, or no posture can be held or no
/// motion be made within the torque limits (names joint, torque and limit); if loops close nowhere
/// within the limits, or fewer joints have a motor than constraints leave motions;
///         Error for options out of range
Excitation design_excitation(const Model& model, const DesignOptions& options = {});

}  // namespace diffnea
