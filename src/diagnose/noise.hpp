#pragma once
/// Noise of every joint's rows: an autoregression of order 8 (Ljung 1999, sec. 4.2), and the filter
/// that makes rows independent of equal variance. White where the signals' noise is all there is.
/// Internal to diagnose/.

#include "diagnose/evidence.hpp"

namespace diffnea {

/// Of a joint's torque, RMS (Evidence::scale()): noise that is white and always there. Errors below
/// it are of filters, integrators and digits, which are no cause: in a simulation without noise
/// they would be named.
inline constexpr double kLeastNoise = 1e-4;

struct JointNoise {
  /// Best prediction from the rows before: e_m = Σ a_k e_{m−k} + innovation.
  struct Prediction {
    std::vector<double> a;
    double sigma = 1.0;  ///< of the innovations [N·m] or [N]
  };
  std::vector<Prediction> orders;  ///< from none of them, from one, …: a stretch begins with these
  double rms = 1.0;                ///< of the noise itself [N·m] or [N]
  double assumed = 0.0;  ///< share of its variance that is kLeastNoise's, and in no residual
};

/// White noise. @param rms  [N·m] or [N]
JointNoise white(double rms);

/// From residuals, (rows()), and kLeastNoise; rows that are not in `used` are gaps.
/// @param lost   (joints) degrees of freedom that the fit took of each joint's rows; empty: none
/// @param least  (joints) noise that the residual may lack, RMS; empty: none
std::vector<JointNoise> estimate_noise(const Evidence& evidence, const VecX<double>& residual,
                                       const std::vector<bool>& used,
                                       const std::vector<double>& lost = {},
                                       const std::vector<double>& least = {});

/// Noise that the signals give the rows `used`, at most what is left of them, RMS, (joints): of a
/// coarse encoder it is the same in every period.
std::vector<double> signals_noise(const Evidence& evidence, const VecX<double>& left,
                                  const std::vector<bool>& used);

/// Noise is what changes from one period of the motion to the next, whatever the model lacks:
/// differences to the mean over periods, scaled by √(R/(R−1)).
/// Rows that hang on how their stretch begins have none.
/// @param period  [s]
/// @return (rows()) noise; empty unless a period is a whole number of rows and a stretch holds
/// three of them
VecX<double> repeatable_noise(const Evidence& evidence, const VecX<double>& residual,
                              double period);

/// A residual without what smooth functions explain of it.
struct Smoothed {
  VecX<double> left;         ///< (rows())
  std::vector<double> lost;  ///< (joints) columns that were fitted
  std::vector<long> blind;   ///< joints (of evidence.joints()) that have too few rows for any
};

/// Leaves what no function of a joint's position plus one of its velocity plus one of the time plus
/// a constant of each run can explain, beside the base's free columns, over the rows `used`; joints
/// with too few of them, and all other rows, keep their residual. Without repeats, what the model
/// lacks is not to be taken for noise: whitened away, it would stay hidden.
/// @param x0    about which rows of passive joints are linear: their residual, X x, is a
///              combination of the columns of X as they are
/// @param lost  degrees of freedom that the fit took of each joint's rows already
Smoothed beside_smooth_functions(const Evidence& evidence, const std::vector<int>& free,
                                 const VecX<double>& x0, const VecX<double>& residual,
                                 const std::vector<bool>& used, double lost);

/// Before any noise is known: white, of the size of each joint's torque.
std::vector<JointNoise> white_noise(const Evidence& evidence);

/// Rows that tests use, those at rest left out, each beside the rows before it in its stretch.
class Whitener {
 public:
  /// @param used  (rows()) which rows may be used at all; empty: all
  Whitener(const Evidence& evidence, std::vector<JointNoise> noise, const std::vector<bool>& used);

  /// Rows in units of independent noise; unused ones are 0. (rows(), C) → (rows(), C)
  MatX<double> operator()(const MatX<double>& rows) const;
  /// The rows of the k-th joint alone, (times(), C) → (times(), C).
  MatX<double> joint(long k, const Eigen::Ref<const MatX<double>>& rows) const;
  const std::vector<JointNoise>& noise() const { return noise_; }
  long used_rows() const { return used_rows_; }
  /// Sum of squares that the noise assumed of all joints has in the rows used, and no residual.
  double assumed_sum() const { return assumed_sum_; }
  const std::vector<bool>& kept() const { return kept_; }

 private:
  std::vector<JointNoise> noise_;
  std::vector<bool> kept_;
  std::vector<int> before_;  ///< rows before each one that predict it; −1: it is not used
  long times_ = 0, used_rows_ = 0;
  double assumed_sum_ = 0.0;
};

}  // namespace diffnea
