#include "recording/spectrum.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

#include "core/constants.hpp"
#include "core/statistics.hpp"
#include "recording/kaiser.hpp"

namespace diffnea::detail {
namespace {

/// Radix-2 transform in place; the size is a power of two.
void fft(std::vector<std::complex<double>>& x) {
  const std::size_t n = x.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(x[i], x[j]);
  }
  for (std::size_t len = 2; len <= n; len <<= 1)
    for (std::size_t k = 0; k < len / 2; ++k) {
      const std::complex<double> w =
          std::polar(1.0, -2.0 * kPi * static_cast<double>(k) / static_cast<double>(len));
      for (std::size_t i = k; i < n; i += len) {
        const std::complex<double> a = x[i], b = w * x[i + len / 2];
        x[i] = a + b;
        x[i + len / 2] = a - b;
      }
    }
}

}  // namespace

Spectrum welch(const std::vector<Eigen::VectorXd>& segments, double rate_hz, long length) {
  Spectrum out;
  out.rate_hz = rate_hz;
  out.power.assign(length / 2 + 1, 0.0);
  constexpr double kBeta = 14.0;
  std::vector<double> window(length);
  double energy = 0.0;
  for (long i = 0; i < length; ++i) {
    const double r = (2.0 * static_cast<double>(i) - static_cast<double>(length - 1)) /
                     static_cast<double>(length - 1);
    window[i] = kaiser(kBeta, r);
    energy += window[i] * window[i];
  }
  std::vector<std::complex<double>> x(length);
  for (const Eigen::VectorXd& s : segments)
    for (long at = 0; at + length <= s.size(); at += length / 2) {
      const double mean = s.segment(at, length).mean();
      for (long i = 0; i < length; ++i) x[i] = window[i] * (s[at + i] - mean);
      fft(x);
      for (long k = 0; k <= length / 2; ++k) out.power[k] += std::norm(x[k]);
      ++out.num_windows;
    }
  // One-sided, so that the integral over frequency is the variance.
  for (double& p : out.power) p *= 2.0 / (rate_hz * energy * std::max(1, out.num_windows));
  return out;
}

double noise_floor(const Spectrum& s) {
  // The last bins are left out: half of the power of the bin at half of the rate is folded.
  return median({s.power.begin() + static_cast<long>(s.power.size() / 2), s.power.end() - 2});
}

}  // namespace diffnea::detail
