#pragma once
/// From the factors of the regression to parameters with uncertainties: noise of each joint,
/// consistent optimum, what the data see and what they do not.

#include <diffnea/core/fields.hpp>
#include <diffnea/core/triangular_factor.hpp>
#include <diffnea/identify/convex_fit.hpp>
#include <diffnea/identify/layout.hpp>

namespace diffnea {

/// All rows of one joint's torque: a factor over the columns that can be nonzero there.
struct JointFactor {
  std::vector<int> columns;  ///< columns of the layout (then of the shape directions)
  TriangularFactor factor;   ///< of [Y τ], Y those columns
  /// (columns) Of a passive joint: its inertia M_jj = inertia·x at the first row; else empty. Its
  /// torque is known: 0, so that any multiple of x fits its rows as well, or a ball's pull. The
  /// noise that they hold, that of the acceleration, grows with M_jj: they say nothing of scale.
  VecX<double> inertia = {};

  /// Rows [Y τ] of a passive joint as those of M_jj(at)·(Y x − τ)/(inertia·x), linear about `at`:
  /// [Y τ] times this, (columns + 1)². Identity for other joints.
  MatX<double> without_scale(const VecX<double>& at) const;
  /// Σ (τ̂ − τ)² over the rows, for parameters x of the whole layout.
  double sum_of_squares(const VecX<double>& x) const;
  /// Root mean square of the rows' residuals at x.
  double rmse(const VecX<double>& x) const;
};

/// A combination of parameters that the data determine by themselves.
struct BaseParameter {
  std::string expression;
  double value = 0.0;
  double std = 0.0;
  std::vector<int> columns;
  std::vector<double> coefficients;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("BaseParameter",
              "A combination of parameters that the data determine by themselves.");
    list.field("expression", &BaseParameter::expression, "``upper_arm.Izz + 0.055 forearm.mass``.");
    list.field("value", &BaseParameter::value,
               "Σ coefficient · parameter, in the first one's unit.");
    list.field("std", &BaseParameter::std, "Its standard error.");
    list.in_memory("columns", &BaseParameter::columns,
                   "Indices of the parameters, the leading one first.");
    list.in_memory("coefficients", &BaseParameter::coefficients,
                   "Of these; the leading one's is 1.");
  }
};

/// Coordinates in which inertias are fitted: their own, where the problem is convex, or the paper's
/// virtual ones, for comparison.
enum class FitParameters { kConvex, kVirtual };
/// Names in options.
template <>
struct EnumNames<FitParameters> {
  /// All of them.
  static constexpr NamedValue<FitParameters> list[] = {{FitParameters::kConvex, "convex"},
                                                       {FitParameters::kVirtual, "virtual"}};
};

/// Priors and consistency of a linear fit.
struct LinearFitOptions {
  FitParameters parameters = FitParameters::kConvex;  ///< coordinates of the inertias
  bool physical = true;         ///< false: inertias are free (least squares), for comparison
  double entropic_prior = 0.0;  ///< γ of solve_convex_fit
  /// Parameters the data say nothing of stay at the prior: a Gaussian this many times as wide as
  /// their scale. At 10, a direction known to its own scale is shrunk by 1 %, one known to a tenth
  /// of it by 0.01 %.
  double prior_width = 10.0;
  int max_reweightings = 20;  ///< of the joints' noise; stops when no σ moves by more than 0.1 %
};

/// Estimates of linear parameters, with errors and what cannot be told.
struct LinearFit {
  VecX<double> x;    ///< (p) values
  VecX<double> std;  ///< (p) standard errors; NaN where not identifiable; 0 where fixed
  std::vector<bool> identifiable;  ///< the data alone know it better than its scale
  VecX<double> sigma;              ///< (n) noise of each joint's torque [N·m]
  MatX<double> information;        ///< (p, p) of the data alone, inverse covariance
  VecX<double> scale;              ///< (p) how far a parameter may well be from its prior
  VecX<double> weak;               ///< (p) diagonal of the weak prior Λ
  int rank = 0;                    ///< number of combinations the data determine
  std::vector<BaseParameter> base_parameters;  ///< these combinations, by their leading columns
  ConvexFitResult solver;                      ///< the fit with the last noise
};

/// How far each linear parameter may well be from its prior (FitParameter::scale; what makes an
/// effect's torque as large as the joint's where the layout leaves it open), (p).
VecX<double> parameter_scales(const FitLayout& layout, const std::vector<JointFactor>& factors);

/// Parameters strictly inside what is physically possible, as near to the prior as that allows: a
/// link that the model gives no (or an impossible) inertia becomes a ball of its scale.
VecX<double> consistent_start(const FitLayout& layout, const VecX<double>& scale);

/// Free parameters of effects whose torque is, in these data, exactly one of the links' inertias':
/// the rotor inertia of a joint that always turns about the same axis is part of what it carries.
/// (Columns that the links' columns span.)
std::vector<int> absorbed_by_links(const FitLayout& layout,
                                   const std::vector<JointFactor>& factors);

/// Standard errors are those of independent residuals until use_sandwich() replaces them.
/// @param factors  one a joint; joints without torque have no rows
/// @throws DataError if there are fewer rows than free parameters
LinearFit fit_linear(const FitLayout& layout, const std::vector<JointFactor>& factors,
                     const LinearFitOptions& options = {});

/// Standard errors, and what counts as identifiable, for residuals that are not independent: (H +
/// Λ)⁻¹ (meat + Λ) (H + Λ)⁻¹, and never less than independent residuals give: noise of the
/// positions, differentiated twice, can make the sandwich small where what limits the fit is no
/// noise at all (blurred friction). The information is scaled down by the mean ratio of meat to H.
/// @param meat  (p, p) covariance of the score Σ yᵀr/σ² (autocorrelation included)
void use_sandwich(const FitLayout& layout, const MatX<double>& meat, LinearFit& fit);

}  // namespace diffnea
