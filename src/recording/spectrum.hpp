#pragma once
/// Power spectra for the choice of cut-off and the estimate of noise. Internal to recording/.

#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea::detail {

/// Welch's estimate with a Kaiser window (β = 14, side lobes at −105 dB), half overlap, each window
/// without its mean. Power per Hz, one-sided; bins 0 … L/2.
struct Spectrum {
  double rate_hz = 0.0;
  std::vector<double> power;
  int num_windows = 0;

  double frequency(std::size_t bin) const {
    return rate_hz * static_cast<double>(bin) / (2.0 * static_cast<double>(power.size() - 1));
  }
};

/// @param segments  series that are not continuous with one another
/// @param length    of a window [rows], a power of two; shorter segments are left out
Spectrum welch(const std::vector<Eigen::VectorXd>& segments, double rate_hz, long length);

/// White noise under a spectrum: the median power over the upper half of the band.
double noise_floor(const Spectrum& s);

}  // namespace diffnea::detail
