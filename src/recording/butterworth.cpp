#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/butterworth.hpp>

#include "core/constants.hpp"

namespace diffnea {

Butterworth::Butterworth(int order, double cutoff_hz, double rate_hz)
    : order_(order), rate_hz_(rate_hz) {
  if (order < 1 || order > 12)
    throw DataError("Butterworth: got order " + std::to_string(order) + ", expected 1 to 12");
  if (!(cutoff_hz > 0.0 && cutoff_hz < 0.5 * rate_hz))
    throw DataError("Butterworth: got a cut-off of " + std::to_string(cutoff_hz) +
                    " Hz, expected above 0 and below half of the sampling rate, " +
                    std::to_string(0.5 * rate_hz) + " Hz");
  // Bilinear transform of 1/(s² + d s + 1), s = (1/w)(1 − z⁻¹)/(1 + z⁻¹), which maps the cut-off
  // exactly.
  const double w = std::tan(kPi * cutoff_hz / rate_hz);
  for (int k = 0; k < order / 2; ++k) {
    const double d = 2.0 * std::sin(kPi * (2 * k + 1) / (2.0 * order));
    const double scale = 1.0 / (1.0 + d * w + w * w);
    const double b = w * w * scale, a2 = (1.0 - d * w + w * w) * scale;
    sections_.push_back({b, 2.0 * b, b, 2.0 * (w * w - 1.0) * scale, a2});
    slowest_pole_ = std::max(slowest_pole_, std::sqrt(a2));  // a conjugate pair: |p|² = a2
  }
  if (order % 2 == 1) {
    const double b = w / (1.0 + w), a1 = (w - 1.0) / (w + 1.0);
    sections_.push_back({b, b, 0.0, a1, 0.0});
    slowest_pole_ = std::max(slowest_pole_, std::abs(a1));
  }
}

void Butterworth::filter_forward(RowMatX<double>& x) const {
  const long rows = x.rows(), n = x.cols();
  std::vector<double> z1(n), z2(n);
  for (const Section& s : sections_) {
    // Transposed direct form II; settled states for the first row: y = x.
    for (long j = 0; j < n; ++j) {
      z1[j] = (1.0 - s.b0) * x(0, j);
      z2[j] = (s.b2 - s.a2) * x(0, j);
    }
    for (long i = 0; i < rows; ++i) {
      double* row = x.data() + i * n;
      for (long j = 0; j < n; ++j) {
        const double u = row[j], y = s.b0 * u + z1[j];
        z1[j] = s.b1 * u - s.a1 * y + z2[j];
        z2[j] = s.b2 * u - s.a2 * y;
        row[j] = y;
      }
    }
  }
}

void Butterworth::filter_both_ways(RowMatX<double>& x) const {
  const long rows = x.rows(), n = x.cols();
  if (rows < 2 || n == 0) return;
  const long pad = std::min(extension(), rows - 1);
  // Without its first row: a large offset costs digits in the recursion.
  const Eigen::RowVectorXd offset = x.row(0);
  RowMatX<double> y(rows + 2 * pad, n);
  y.middleRows(pad, rows) = x.rowwise() - offset;
  for (long k = 1; k <= pad; ++k) {
    y.row(pad - k) = 2.0 * y.row(pad) - y.row(pad + k);
    y.row(pad + rows - 1 + k) = 2.0 * y.row(pad + rows - 1) - y.row(pad + rows - 1 - k);
  }
  filter_forward(y);
  y.colwise().reverseInPlace();
  filter_forward(y);
  y.colwise().reverseInPlace();
  x = y.middleRows(pad, rows).rowwise() + offset;
}

double Butterworth::response(double hz) const {
  const std::complex<double> z = std::polar(1.0, -2.0 * kPi * hz / rate_hz_);  // z⁻¹
  double gain = 1.0;
  for (const Section& s : sections_)
    gain *= std::norm((s.b0 + z * (s.b1 + z * s.b2)) / (1.0 + z * (s.a1 + z * s.a2)));
  return gain;
}

long Butterworth::memory(double share) const {
  return static_cast<long>(std::ceil(std::log(share) / std::log(std::max(slowest_pole_, 1e-3))));
}

}  // namespace diffnea
