#pragma once
/// Low-pass and decimation of many columns at once, the same for torques and regressor columns
/// (Gautier's parallel filter), as a stream.
///
/// Linear-phase FIR with a Kaiser window: symmetric, hence exactly no phase, and of finite support,
/// so that blocks give the same rows as the whole. It is evaluated at output rows only. Rows whose
/// support would leave the segment are not emitted: half of the support is lost at either end.

#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Rates and sharpness of a decimating filter.
struct DecimatorOptions {
  double rate_hz = 0.0;
  int factor = 1;
  double pass_hz = 0.0;
  double stop_hz = 0.0;
  double attenuation_db = 60.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("DecimatorOptions", "The low-pass and decimation of torques and regressor.");
    list.field("rate_hz", &DecimatorOptions::rate_hz, "Of the rows that enter.", {.unit = "Hz"});
    list.field("factor", &DecimatorOptions::factor,
               "Input rows per output row; 1 without a pass band: copies.");
    list.field("pass_hz", &DecimatorOptions::pass_hz,
               "Kept to within the ripple; 0: 0.35 of the output rate.");
    list.field("stop_hz", &DecimatorOptions::stop_hz,
               "Suppressed from here; 0: the output rate − pass_hz, so that what folds lands above "
               "pass_hz.");
    list.field("attenuation_db", &DecimatorOptions::attenuation_db,
               "Ripple and suppression: 1e-3.");
  }
};

/// A linear-phase low-pass that keeps one row of several, alike for all columns.
class Decimator {
 public:
  /// @throws DataError unless 0 < pass < stop ≤ half of the input rate, and of 2^24 taps at most
  explicit Decimator(const DecimatorOptions& options);

  /// Takes the next input rows of the present segment.
  /// @param rows  (K, C) any number of rows, C the same until reset()
  /// @return (M, C) the output rows that they complete, possibly none
  RowMatX<double> push(const Eigen::Ref<const RowMatX<double>>& rows);

  /// Ends the segment: what follows is not filtered together with what was.
  void reset();

  /// Symmetric coefficients, sum 1, odd in number.
  const std::vector<double>& coefficients() const { return h_; }
  /// Rows on either side that a row of the result hangs on.
  int half_length() const { return static_cast<int>(h_.size() / 2); }
  /// One row of this many is kept.
  int factor() const { return factor_; }
  /// Output row k of a segment is centred on its input row half_length() + k·factor().
  long center(long k) const { return half_length() + k * factor_; }
  /// Of one output per input row: share of white noise variance that passes, Σ h².
  double noise_gain() const;
  /// |H| at a frequency [Hz].
  double response(double hz) const;

 private:
  std::vector<double> h_;
  double rate_hz_ = 0.0;
  int factor_ = 1;
  RowMatX<double> buffer_;  ///< rows that outputs to come still need
  long filled_ = 0;         ///< of the buffer
  long skip_ = 0;           ///< input rows to drop before the next support begins
};

}  // namespace diffnea
