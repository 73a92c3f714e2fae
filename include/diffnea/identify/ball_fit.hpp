#pragma once
/// A ball's flight fitted to what a camera saw: output error over windows, each with an initial
/// state of its own, which is estimated and eliminated (multiple shooting; Bock 1983). Parameters
/// are the string's length r and its attachment p_LS (the visible part of the paper's T_E) and
/// those of effects on ball, string and camera; derivatives by Jets through the switches of the
/// string.
///
/// One linearisation serves fit and diagnosis: what a parameter at its present value, 0 of a
/// candidate, would change of every position, with the initial states projected out.

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/identify/ball_options.hpp>
#include <diffnea/identify/ball_series.hpp>
#include <diffnea/identify/hand_motion.hpp>

namespace diffnea {

/// One parameter of a ball fit.
struct BallParameter {
  std::string name;         ///< "string.length", "string.attachment_x", "ball.linear_drag.drag"
  std::string unit;         ///< as effects write it (effects/effect.hpp): "m", "1/s"
  Sign sign = Sign::kFree;  ///< that the fit keeps
  double value = 0.0;       ///< where the fit starts, and stays if it is fixed
  bool fixed = false;       ///< held at `value`
  int effect = -1;          ///< index into BallLayout::effects; −1: the string itself
  int index = -1;           ///< of the effect's parameters; of the string: 0 length, 1–3 attachment
  double most = std::numeric_limits<double>::infinity();  ///< its largest value
};

/// Which parameters of ball, string and camera are fitted, and the effects that they belong to.
struct BallLayout {
  std::vector<BallParameter> parameters;  ///< the string's four if there is one, then the effects'
  std::vector<BoundEffect> effects;       ///< that `parameters` are of; their values are there

  /// Present values of all parameters.
  VecX<double> values() const;
};
/// The string's parameters, if the ball has one, then those of `effects` (names as in result
/// files); a place may be left empty where there is one alone.
/// @param fit_string  false: length and attachment are held at the model's
/// @throws ModelError if the model has no ball, or an effect is of a joint
BallLayout make_ball_layout(const Model& model, const std::vector<EffectSpec>& effects,
                            bool fit_string = true);

/// A stretch of a recording that is simulated in one go.
struct BallWindow {
  int run = 0;                     ///< number of its recording
  int hand = 0;                    ///< index into BallData::hands
  std::vector<double> time;        ///< (m) [s], of the rows at which the ball was seen
  std::vector<Vec3<double>> seen;  ///< (m) [m], W
  Vec3<double> spin{0, 0, 0};      ///< [rad/s], W, mean over the window; 0 where not recorded
  ParticleState<double> state;     ///< at time[0], estimate
  bool taut = false;               ///< the string is, at time[0]
};
/// Recordings of a ball, cut into windows.
struct BallData {
  std::vector<HandMotion> hands;    ///< of what the string is tied to, one a stretch without a gap
  std::vector<BallWindow> windows;  ///< what is fitted
  std::vector<BallFlag> flagged;    ///< rows and windows that were left out
  long touching = 0;                ///< rows left out because the ball touched the cup
  std::string source;               ///< of the first recording, for messages
};

/// Windows of the recordings, with first states from the positions themselves.
/// Rows far from where their neighbours lead are left out and flagged, and so are windows whose
/// recorded spin cannot be. Without a string, and without a bounce in the model, windows end where
/// the ball bounces.
/// @param smoothing  of the joints' motion  @throws DataError if a recording has no ball, or no
///        window is left
BallData make_ball_data(const Model& model, const std::vector<Recording>& recordings,
                        const BallFitOptions& options, const PreprocessOptions& smoothing = {});

/// Residual and derivatives of all windows about (p, states), states projected out. P counts the
/// free parameters alone.
struct BallLinearisation {
  MatX<double> R;      ///< (P, P) upper factor of the whitened parameters' columns
  VecX<double> d;      ///< (P): Qᵀ of the residual
  double chi2 = 0.0;   ///< Σ w e²/σ² at (p, states)
  double left = 0.0;   ///< χ² that neither parameters nor states reach, to first order
  long samples = 0;    ///< numbers compared, 3 a row
  VecX<double> norms;  ///< (P) of the whitened columns, states not projected out
  std::vector<MatX<double>> state_steps;  ///< per window: (6, 1 + P), step of the state = col 0 −
                                          ///< cols 1… · step of p
};

/// A fit of ball and string: estimates, errors, and how it ended.
struct BallFit {
  VecX<double> p;            ///< (P)
  MatX<double> covariance;   ///< (P, P) σ² of what the states leave; 0 of fixed ones
  double sigma = 0.0;        ///< of one position along one axis [m]
  double chi2 = 0.0;         ///< at p, with sigma
  long samples = 0;          ///< numbers compared, 3 a row
  int iterations = 0;        ///< Levenberg–Marquardt steps, refused ones included
  bool converged = false;    ///< no step is worth more than the tolerance
  bool interrupted = false;  ///< the callback said so; p is the best until then
  std::string termination;   ///< why it ended, in words
};

/// Positions that the camera would have seen, (m) per window. @param p  as the layout's parameters
std::vector<Vec3<double>> predict_ball(const Model& model, const BallLayout& layout,
                                       const VecX<double>& p, const BallData& data,
                                       const BallWindow& window, const FlightOptions& flight);

/// Residuals of all windows at p and their derivatives, the windows' own states eliminated.
/// @param go_on  asked before each window; false: what there is of the windows so far
BallLinearisation linearise_ball(const Model& model, const BallLayout& layout,
                                 const VecX<double>& p, const BallData& data, double sigma,
                                 const BallFitOptions& options,
                                 const std::function<bool()>& go_on = {});

/// Σ ρ(e/σ) over all windows, Huber's ρ (of one number: its square); infinite where a flight went
/// nowhere.
double ball_cost(const Model& model, const BallLayout& layout, const VecX<double>& p,
                 const BallData& data, double sigma, const BallFitOptions& options);

/// Levenberg–Marquardt from the layout's values; states of `data` are updated. Where these led
/// astray, they are estimated over times that grow, and it descends once more.
/// @param progress  after every step, taken back or not, with (iteration, rms [m]); false stops
BallFit fit_ball(const Model& model, const BallLayout& layout, BallData& data,
                 const BallFitOptions& options = {},
                 const std::function<bool(int, double)>& progress = {});

/// The paper's constrained loss of ball and string: fit_constrained (constrained_loss.hpp) on the
/// smoothed windows, anchor and forces those of the other loss.
/// @throws ModelError for effects of the camera, DataError as smooth_bodies and fit_constrained
BallFit fit_ball_constrained(const Model& model, const BallLayout& layout, const BallData& data,
                             const BallFitOptions& options = {});

/// First guess of length and attachment from distances alone: Σ (‖y − x_S‖ − r)² over rows at which
/// the string is taut, from any start (Gauss–Newton; rows nearer than r by 5 % count as slack).
/// At those rows the ball must also move as one that hangs: ẍ − g along the string.
/// @throws DataError if the ball is never taut (naming the largest distance)
void guess_string(const BallData& data, Vec3<double>& p_LS, double& length,
                  const Vec3<double>& gravity = {0, 0, -9.81});

}  // namespace diffnea
