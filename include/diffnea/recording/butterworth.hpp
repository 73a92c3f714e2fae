#pragma once
/// Butterworth low-pass, forward and backward: no phase, gain |H|², that is ½ at the cut-off.
/// Sections of second order; the ends are extended by their point reflection and the states start
/// settled, as scipy.signal.sosfiltfilt does (the tests hold its numbers).

#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// A low-pass of Butterworth's, in sections of order two.
class Butterworth {
 public:
  /// @param order      of the filter that acts in each direction, 1 to 12
  /// @param cutoff_hz  where one direction has gain 1/√2; below half of rate_hz
  /// @throws DataError for anything else
  Butterworth(int order, double cutoff_hz, double rate_hz);

  /// Filters every column of x, (N, n) rows in time, in place. Shorter than the extension: that is
  /// cut to N − 1.
  void filter_both_ways(RowMatX<double>& x) const;

  /// Gain of both directions together at a frequency [Hz].
  double response(double hz) const;

  /// Rows after which a disturbance has decayed to `share` of its size, in either direction.
  long memory(double share) const;

  /// Rows that the ends are extended by, 3 (order + 1).
  long extension() const { return 3 * (order_ + 1); }

 private:
  /// H(z) = (b0 + b1 z⁻¹ + b2 z⁻²)/(1 + a1 z⁻¹ + a2 z⁻²), gain 1 at 0 Hz.
  struct Section {
    double b0, b1, b2, a1, a2;
  };
  void filter_forward(RowMatX<double>& x) const;

  int order_;
  double rate_hz_;
  double slowest_pole_ = 0.0;  ///< largest |pole|
  std::vector<Section> sections_;
};

}  // namespace diffnea
