#pragma once
/// A fit to simulated windows on its way up the horizons. Internal to identify/.

#include <optional>

#include "core/constants.hpp"
#include "identify/motion_data.hpp"
#include "identify/motion_fit.hpp"

namespace diffnea {

/// Windows of one set of data under one model, from horizon to horizon.
struct Ladder {
  std::vector<MotionWindow> windows;
  WindowErrors errors;

  /// Windows of the next horizon, from states of the present ones.
  void next(Workers workers, const std::vector<MotionStretch>& stretches, double horizon,
            double first);
};

/// Parameters that a fit moves, and where it begins.
struct MotionBeginning {
  FitLayout layout;
  VecX<double> scale;  ///< (p) how far a parameter may well be from its start
  VecX<double> start;  ///< (p) linear parameters, physically consistent
  VecX<double> guess;  ///< (p) those that torques of one instant tell; may be empty
  VecX<double> shape;  ///< (s) shape parameters
  double fitted_to = 0.0;  ///< horizon up to which it was fitted before [s]; 0: it was not
  std::vector<std::string> notes;  ///< on what it holds
};

/// How a step up ended.
enum class Rung {
  kReached,   ///< the windows are fitted; they may fall apart at the shortest horizon
  kDrowned,   ///< noise of the measured torques would move the robot more than the windows tell
  kFellBack,  ///< they fall apart; the fit is that of the horizon before
};

/// Share of the objective that a step gains at least where a longer horizon follows.
inline constexpr double kOnTheWay = 1e-3;

/// One fit. Model and data outlive it.
class MotionClimb {
 public:
  /// @param limit     (n) error beyond which a window is apart (apart_limit)
  /// @param progress  as for MotionFitter
  MotionClimb(const Model& model, const MotionData& data, MotionBeginning from,
              const VecX<double>& limit, const MotionOptions& options,
              std::function<bool(int, double)> progress = {});
  MotionClimb(const MotionClimb&) = delete;
  MotionClimb& operator=(const MotionClimb&) = delete;

  /// Begins at what simulates the shortest windows best: the start, or the guess.
  void begin(double first_horizon);
  /// Fits the windows of a horizon, their states alone where the beginning has seen longer ones.
  /// @param tolerance, to_beat  as for MotionFitter::fit
  Rung advance(double horizon, double tolerance, double to_beat = kInfinity);
  /// Goes on to a longer horizon with the parameters as they are: states alone are fitted.
  Rung follow(double horizon, double tolerance);
  /// Fits the horizon that was reached anew.
  void finish(double tolerance);
  /// Goes on from a layout that holds other shapes, at these values and with these windows.
  void change(FitLayout layout, const VecX<double>& x, const VecX<double>& shape,
              std::vector<MotionWindow> windows);

  const MotionFitter& fitter() const { return *fitter_; }
  /// Standard errors at the present point.
  void set_covariance() { fitter_->set_covariance(at_.windows); }
  const FitLayout& layout() const { return from_.layout; }
  const MotionBeginning& beginning() const { return from_; }
  /// The fitted windows.
  const Ladder& at() const { return at_; }
  /// The same windows in pieces of a horizon, from states that the positions give.
  std::vector<MotionWindow> pieces(double horizon) const;
  /// Windows that fell apart last, of the horizon that was tried.
  const Ladder& apart() const { return apart_; }
  double reached() const { return reached_; }  ///< longest horizon that holds together [s]
  double drowned() const { return drowned_; }  ///< noise over what windows tell, last (1: as large)
  bool whole() const { return whole_; }  ///< windows of the horizon that was reached hold together
  double seconds() const { return seconds_; }  ///< spent on fits

  /// How many positions independent errors would leave as sure as these are, which hang together.
  double independent() const;

 private:
  /// Windows that have been fitted take the place of the last ones, unless they fall apart.
  Rung settle(double horizon, Ladder next, const MotionFit& before);
  void begin_fitter(const VecX<double>& x, const VecX<double>& shape, int iterations);

  const Model& model_;
  const MotionData& data_;
  MotionBeginning from_;
  const VecX<double> limit_;
  MotionOptions options_;
  std::function<bool(int, double)> progress_;
  MotionProblem problem_;
  std::optional<MotionFitter> fitter_;
  Ladder at_, apart_;
  double first_ = 0.0, reached_ = 0.0, drowned_ = 0.0, seconds_ = 0.0;
  bool whole_ = true;
};

}  // namespace diffnea
