#pragma once
/// A stretch of motion, integrated with the torques that were measured. Shared by plain simulation
/// and by sensitivities. Internal to the library.
///
/// Runge–Kutta 4 in even steps wherever few of them are stable. Where dry friction is steeper,
/// steps follow the speed: explicit ones that a constant friction stops at rest, and where that is
/// within a fraction of a row, and they would chatter, a Rosenbrock–Wanner method of order 2 (ROS2:
/// Verwer, Spee, Blom, Hundsdorfer 1999) treats friction and drives as dampers D. Any matrix keeps
/// the order of a W method. Near rest D is the secant through 0, which keeps a joint from being
/// pushed through; where it moves, the slope. No step leads over a reversal: by how much a velocity
/// changes is told with D, for q̈ of one instant may be of a motion that is over within the step.

#include <algorithm>
#include <cmath>

#include <diffnea/dynamics/integrators.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/motion/stepping.hpp>
#include <diffnea/motion/window.hpp>

#include "core/decompositions.hpp"
#include "motion/hidden_rotors.hpp"

namespace diffnea {

/// Integrator of one model. Not thread-safe; no allocation after the first window.
class MotionPath {
 public:
  /// @param first  of the columns of stretches that are the model's joints
  /// @throws ModelError for effects with memory, other than a hidden motor's, or of a measurement
  /// channel
  MotionPath(ExtendedTree model, const SteppingOptions& options, int first = 0);

  /// Dynamics of the unfolded model: N degrees of freedom, n joints and their hidden rotors.
  ForwardDynamics& dynamics() { return dynamics_; }
  const HiddenRotors& rotors() const { return rotors_; }

  /// First state of all degrees of freedom, (2N). Hidden sides begin at rest against what gravity
  /// and the motion of the links ask of them.
  /// @param read    (2n) q, q̇ where encoders read
  /// @param pushes  (n) torques at the links
  VecX<double> first_state(const VecX<double>& read, const VecX<double>& pushes);
  /// The same where a window begins: integrators have what their drives have summed up of the run
  /// before, by the positions that were measured.
  VecX<double> first_state(const MotionStretch& stretch, const MotionWindow& window);
  /// Positions and velocities of the model's joints, (2n), in the first state of a window.
  VecX<double> own_state(const MotionWindow& window) const;
  /// Torques of the model's joints from that row on, (n).
  auto logged(const MotionStretch& stretch, long row) const {
    return stretch.u.row(row).segment(first_joint_, rotors_.joints()).transpose();
  }
  /// The same at the links, (n): none but of a stretch whose torques act there.
  VecX<double> pushes(const MotionStretch& stretch, long row) const {
    return stretch.at_links ? VecX<double>(logged(stretch, row))
                            : VecX<double>::Zero(rotors_.joints());
  }
  /// Torques of joints (n) where they act, of all degrees of freedom (N).
  void act(const MotionStretch& stretch, const Eigen::Ref<const VecX<double>>& u,
           VecX<double>& out) const {
    if (stretch.at_links) {
      out.setZero(n_);
      out.head(rotors_.joints()) = u;
    } else {
      rotors_.at_drives(u, out);
    }
  }
  /// Sum of one integrator there; derivatives 0 to 6 are those by the parameters of position_servo,
  /// 7 that by the rate of the integral.
  JetD summed_before(const DriveIntegrator& integrator, const MotionStretch& stretch,
                     const MotionWindow& window);

  /// Integrates the columns of A = [state | sensitivities] (2N, …) over a window.
  /// @param slope   slope(u, A, dA)
  /// @param at_row  called with (k, A) at every row k of the window, from 0
  /// @return rows that were reached before the state blew up; all of them: it did not
  template <class Slope, class AtRow>
  long integrate(const MotionStretch& stretch, const MotionWindow& window, MatX<double>& A,
                 const Slope& slope, const AtRow& at_row) {
    const double finest = finest_rate(stretch, window);
    const std::size_t first = static_cast<std::size_t>(window.first);
    for (long k = 0; k < window.rows; ++k) {
      at_row(k, A);
      if (k + 1 == window.rows) break;
      const std::size_t row = first + static_cast<std::size_t>(k);
      const double h = stretch.time[row + 1] - stretch.time[row];
      // Even steps, wherever the joints are, keep what is simulated a smooth function of them.
      const double even = finest > 0.0 ? options_.max_step / finest : h;
      // Friction that follows the load has no rate that holds for all of a window.
      const bool steep = h > kMostEven * even || dynamics_.is_implicit();
      // Commands are taken over parts of the row that depend on no motion within it.
      const double longest = std::min({longest_, h, steep ? h : even});
      const double parts = std::min(std::ceil(h / longest * (1.0 - 1e-12)), kMostParts);
      for (double i = 0.0; i < parts; ++i) {
        const double begin = h * i / parts, end = h * (i + 1.0) / parts;
        const SimulationStep part{stretch.time[row] + begin, stretch.time[row] + end};
        const auto enter = [&](double t) {
          const double a = t / h;
          dynamics_.set_time(stretch.time[row] + t, part);
          logged_ = ((1 - a) * stretch.u.row(static_cast<long>(row)) +
                     a * stretch.u_end.row(static_cast<long>(row)))
                        .segment(first_joint_, rotors_.joints())
                        .transpose();
          act(stretch, logged_, u_);
        };
        long steps = 0;
        for (double t = begin; t < end - 1e-12 * h;) {
          double step = end - t;
          bool stiff = false;
          enter(t);
          slope(u_, A, rk_.slope);
          if (steep) {
            qdd_ = rk_.slope.col(0).tail(n_);
            const double steepest =
                dynamics_.is_implicit() ? friction_rate(A, kAtRest, stretch.run) : finest;
            const double rate = friction_rate(A, kAsItMoves, stretch.run);
            if (step * rate > kStops)
              step = kStops > kFinest * h * rate ? kStops / rate : std::min(step, h * kStiff);
            if (step * steepest > kStops) step = step_to_turn(A, stretch.run, step);
            stiff = step * rate > kStops * (1.0 + 1e-9);
          }
          const auto at_share = [&](double share, const MatX<double>& at, MatX<double>& d) {
            enter(t + share * step);
            slope(u_, at, d);
          };
          if (stiff)
            implicit_step(at_share, step, A);
          else
            rk_.go_on(at_share, step, A);
          t += step;
          if (++steps > kMostSteps || !(A.col(0).cwiseAbs().maxCoeff() < kBlowUp)) return k + 1;
        }
      }
    }
    return window.rows;
  }

  /// Simulates a window: at_row(k, z) with z (2N, 1).
  template <class AtRow>
  long simulate(const MotionStretch& stretch, const MotionWindow& window, const AtRow& at_row) {
    state_ = first_state(stretch, window);
    return integrate(
        stretch, window, state_,
        [&](const VecX<double>& u, const MatX<double>& z, MatX<double>& dz) {
          dz.resize(2 * n_, 1);
          dz.topRows(n_) = z.bottomRows(n_);
          dynamics_.acceleration(z.data(), z.data() + n_, u.data(), stretch.run, dz.data() + n_);
        },
        at_row);
  }

 private:
  /// State beyond which a simulation has blown up, whatever the robot [rad, rad/s or m, m/s].
  static constexpr double kBlowUp = 1e6;
  /// Even steps within a row, at most.
  static constexpr double kMostEven = 8.0;
  /// Share of the speed by which a step changes a velocity, where friction is too steep for it:
  /// none leads from rest to beyond where friction is steep,
  static constexpr double kTurns = 0.5;
  /// nor over a reversal, though the acceleration grows by a quarter.
  static constexpr double kBrakes = 0.8;
  /// Step times the rate of friction that brings a joint to rest within the step and no further.
  static constexpr double kStops = 1.0;
  /// Parts of a row: beyond, a simulation blows up within them.
  static constexpr double kMostParts = 1e9;
  /// Steps within a part, which is too short for the motion to turn fifty times: a reversal takes
  /// some twenty, from the fastest speed of a joint to where its friction is sharp and back. A run
  /// with more of them chatters, and counts as one that blows up.
  static constexpr long kMostSteps = 1000;
  /// Explicit step over the row's that is not worth its time.
  static constexpr double kFinest = 1.0 / 16.0;
  /// Implicit step over the row's.
  static constexpr double kStiff = 1.0 / 8.0;

  /// Commands of the run as the model's drives lead them; null if there are none.
  const CommandPath* led(const std::shared_ptr<const CommandPath>& command);
  double finest_rate(const MotionStretch& stretch, const MotionWindow& window);
  double step_of_gears() const;
  double step_of_swings() const;
  bool moves(const MatX<double>& A, int joint) const;
  void set_change(double step, const VecX<double>& damping);
  double step_to_turn(const MatX<double>& A, int run, double step);
  enum Speed { kAtRest, kAsItMoves };
  double friction_rate(const MatX<double>& A, Speed speed, int run);
  void friction(const double* q, const double* qd, int run, VecX<double>& tau);

  /// From the slope that `rk_` holds.
  template <class Slope>
  void implicit_step(const Slope& slope, double h, MatX<double>& A) {
    static constexpr double kGamma = 1.7071067811865476;  // 1 + 1/√2: monotone with any D above
    W_ = mass_;
    W_.diagonal() += kGamma * h * damping_;
    factor_.compute(W_);
    const auto damped = [&](MatX<double>& slope_of) {
      rates_.noalias() = mass_ * slope_of.bottomRows(n_);
      slope_of.bottomRows(n_) = factor_.solve(rates_);
    };
    first_ = rk_.slope;
    damped(first_);
    stage_ = A + h * first_;
    slope(1.0, stage_, second_);
    second_ -= 2.0 * first_;
    damped(second_);
    A += 1.5 * h * first_ + 0.5 * h * second_;
  }

  SteppingOptions options_;
  HiddenRotors rotors_;
  ForwardDynamics dynamics_;
  int first_joint_;       ///< column of stretches that is the model's first
  int n_;                 ///< degrees of freedom N
  bool dry_ = false;      ///< some effect's torque reads the velocity
  VecX<double> sharp_;    ///< (N) speed within which dry friction turns; infinite: there is none
  VecX<double> slow_;     ///< (N) speed at rest
  double longest_ = 0.0;  ///< step that the motion itself allows [s]
  RungeKutta4<MatX<double>> rk_;
  MassMatrixWorkspace<double, double> mass_ws_;
  MatX<double> state_, mass_, W_, first_, second_, stage_, rates_;
  Eigen::LLT<MatX<double>> factor_;
  std::shared_ptr<const CommandPath> told_;  ///< commands that `led_` is of
  CommandPath led_;
  RneaWorkspace<double, double> rnea_ws_;
  VecX<double> logged_, u_, damping_, moving_, resting_, probe_, still_, qdd_, change_, holding_;
};

}  // namespace diffnea
