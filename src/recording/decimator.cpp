#include <algorithm>
#include <cmath>
#include <complex>
#include <string>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/decimator.hpp>

#include "core/constants.hpp"
#include "core/number_text.hpp"
#include "recording/kaiser.hpp"

namespace diffnea {
namespace {

constexpr int kMostTaps = 1 << 24;  ///< 134 MB; 1 mHz at 4 kHz
constexpr long kFewColumns = 8;     ///< columns: each by itself runs on SIMD registers

}  // namespace

Decimator::Decimator(const DecimatorOptions& o) : rate_hz_(o.rate_hz), factor_(o.factor) {
  if (factor_ < 1)
    throw DataError("Decimator: got factor " + std::to_string(factor_) + ", expected 1 or more");
  h_ = {1.0};
  if (factor_ == 1 && o.pass_hz == 0.0) return;
  const double out_hz = rate_hz_ / factor_;
  const double pass = o.pass_hz > 0.0 ? o.pass_hz : 0.35 * out_hz;
  const double stop = o.stop_hz > 0.0 ? o.stop_hz
                      : factor_ > 1   ? out_hz - pass
                                      : std::min(2.0 * pass, 0.5 * rate_hz_);
  if (!(pass > 0.0 && pass < stop && stop <= 0.5 * rate_hz_))
    throw DataError("Decimator: got the bands pass " + std::to_string(pass) + " Hz, stop " +
                    std::to_string(stop) + " Hz, expected 0 < pass < stop <= half of the rate, " +
                    std::to_string(0.5 * rate_hz_) + " Hz");
  // Kaiser's estimates of order and β (Oppenheim & Schafer, eq. 7.75, 7.76).
  const double A = std::max(o.attenuation_db, 21.0);
  const double beta =
      A > 50.0 ? 0.1102 * (A - 8.7) : 0.5842 * std::pow(A - 21.0, 0.4) + 0.07886 * (A - 21.0);
  const double width = 2.0 * kPi * (stop - pass) / rate_hz_;
  const double support = std::ceil(0.5 * (A - 7.95) / (2.285 * width));
  if (!(2.0 * support + 1.0 <= kMostTaps))
    throw DataError("low-pass: a pass band of " + detail::number_text(pass) + " Hz at " +
                    detail::number_text(rate_hz_) + " rows a second hangs on " +
                    detail::number_text(2.0 * support + 1.0) + " rows, expected " +
                    std::to_string(kMostTaps) + " at most: choose a higher pass band");
  const int half = static_cast<int>(support);
  const double cut = (pass + stop) / rate_hz_;  // 2 f_c / rate
  h_.assign(2 * half + 1, 0.0);
  double sum = 0.0;
  for (int k = 0; k <= half; ++k) {
    const double x = kPi * cut * k, r = static_cast<double>(k) / half;
    const double ideal = k == 0 ? cut : cut * std::sin(x) / x;
    const double h = ideal * detail::kaiser(beta, r);
    h_[half + k] = h_[half - k] = h;
    sum += k == 0 ? h : 2.0 * h;
  }
  for (double& h : h_) h /= sum;
}

RowMatX<double> Decimator::push(const Eigen::Ref<const RowMatX<double>>& rows) {
  const long taps = static_cast<long>(h_.size());
  const long skipped = std::min<long>(skip_, rows.rows());
  skip_ -= skipped;
  const long fresh = rows.rows() - skipped;
  if (filled_ == 0) {
    if (buffer_.cols() != rows.cols()) buffer_.resize(0, rows.cols());
  } else if (buffer_.cols() != rows.cols()) {
    throw ShapeError("Decimator: got " + std::to_string(rows.cols()) + " columns, expected " +
                     std::to_string(buffer_.cols()) + " as before (reset() ends a segment)");
  }
  if (buffer_.rows() < filled_ + fresh) buffer_.conservativeResize(filled_ + fresh, rows.cols());
  buffer_.middleRows(filled_, fresh) = rows.bottomRows(fresh);
  filled_ += fresh;

  const long num_out = filled_ < taps ? 0 : (filled_ - taps) / factor_ + 1;
  RowMatX<double> out(num_out, rows.cols());
  const Eigen::Map<const Eigen::RowVectorXd> h(h_.data(), taps);
  if (buffer_.cols() <= kFewColumns)
    for (long c = 0; c < buffer_.cols(); ++c) {
      const VecX<double> column = buffer_.col(c).head(filled_);
      for (long k = 0; k < num_out; ++k) out(k, c) = h.dot(column.segment(k * factor_, taps));
    }
  else
    for (long k = 0; k < num_out; ++k)
      out.row(k).noalias() = h * buffer_.middleRows(k * factor_, taps);

  const long used = num_out * factor_, kept = std::max(0L, filled_ - used);
  skip_ += std::max(0L, used - filled_);
  if (used > 0 && kept > 0)
    std::copy_n(buffer_.data() + used * buffer_.cols(), kept * buffer_.cols(), buffer_.data());
  filled_ = kept;
  return out;
}

void Decimator::reset() { filled_ = skip_ = 0; }

double Decimator::noise_gain() const {
  double sum = 0.0;
  for (const double h : h_) sum += h * h;
  return sum;
}

double Decimator::response(double hz) const {
  double sum = 0.0;
  for (int k = -half_length(); k <= half_length(); ++k)
    sum += h_[half_length() + k] * std::cos(2.0 * kPi * hz / rate_hz_ * k);
  return std::abs(sum);
}

}  // namespace diffnea
