#include "recording/path_smoother.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"

namespace diffnea::detail {
namespace {

/// Rate of what is smoothed, over the cut-off: above the first, rounding shows in accelerations.
constexpr double kMostRate = 100.0, kRateOfMeans = 50.0;
/// Change from one step to the next that is rounding.
constexpr double kSettled = 1e-13;
/// Share of an end that may be left in the steps that are taken for alike.
constexpr double kForgotten = 1e-12;

double binomial(int n, int k) {
  double out = 1.0;
  for (int i = 0; i < k; ++i) out *= static_cast<double>(n - i) / static_cast<double>(i + 1);
  return out;
}

}  // namespace

// The state is z_i = q⁽ⁱ⁾ dtⁱ/i!, in which a step is Pascal's triangle, and information of the
// positions is of order 1 whatever the rate.
PathSmoother::PathSmoother(double cutoff_hz, double rate_hz, long every)
    : cutoff_hz_(cutoff_hz), rate_hz_(rate_hz / static_cast<double>(every)), every_(every) {
  if (!(cutoff_hz > 0.0 && cutoff_hz < 0.5 * rate_hz))
    throw DataError("the path's cut-off is " + std::to_string(cutoff_hz) +
                    " Hz, expected above 0 and below half of the sampling rate, " +
                    std::to_string(0.5 * rate_hz) + " Hz");
  // A mean of rows about its middle: of q dt²/2 it has the mean square of their distances.
  const double m = static_cast<double>(every);
  shown_ << 1.0, 0.0, (1.0 - 1.0 / (m * m)) / 12.0, 0.0;
  const double h = 2.0 * kPi * cutoff_hz_ / rate_hz_;
  Square covariance;  // noise of white d⁴q/dt⁴ over a step, over h⁸/36
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      advance_(i, j) = binomial(j, i);
      covariance(i, j) = binomial(3, i) * binomial(3, j) / static_cast<double>(7 - i - j);
    }
  weight_ = 6.0 / std::pow(h, 4) *
            Square(covariance.llt().matrixL()).triangularView<Eigen::Lower>().solve(
                Square(Square::Identity()));
  const long most = std::max(memory(kForgotten) / every_, kFewestPathRows);
  steps_.push_back(eliminate(nullptr));
  while (static_cast<long>(steps_.size()) < most) {
    steps_.push_back(eliminate(&steps_.back().root));
    const Step &now = steps_.back(), &before = steps_[steps_.size() - 2];
    if ((now.root - before.root).norm() < kSettled * now.root.norm() &&
        (now.next - before.next).norm() < kSettled * now.next.norm())
      break;
  }
}

long PathSmoother::rows_at_once(double cutoff_hz, double rate_hz) {
  return rate_hz > kMostRate * cutoff_hz
             ? static_cast<long>(rate_hz / (kRateOfMeans * cutoff_hz))
             : 1;
}

PathSmoother::Step PathSmoother::eliminate(const Square* before) const {
  // Heavy rows first: Householder's transformations then keep what the light ones say.
  Eigen::Matrix<double, 9, 8> rows = Eigen::Matrix<double, 9, 8>::Zero();
  rows.topLeftCorner<4, 4>() = -weight_ * advance_;
  rows.topRightCorner<4, 4>() = weight_;
  if (before) rows.block<4, 4>(4, 0) = *before;
  rows.row(8).head<4>() = shown_;
  const Eigen::HouseholderQR<Eigen::Matrix<double, 9, 8>> qr(rows);
  const Eigen::Matrix<double, 9, 9> q = qr.householderQ();
  const Eigen::Matrix<double, 8, 8> R =
      Eigen::Matrix<double, 8, 8>(qr.matrixQR().topRows<8>().triangularView<Eigen::Upper>());
  Step out;
  out.inverse = Square(R.topLeftCorner<4, 4>())
                    .triangularView<Eigen::Upper>()
                    .solve(Square(Square::Identity()));
  out.next = out.inverse * R.topRightCorner<4, 4>();
  out.solved = out.inverse * q.transpose().block<4, 5>(0, 4);
  out.information = q.transpose().block<4, 5>(4, 4);
  out.root = R.bottomRightCorner<4, 4>();
  for (int i = 0; i < 4; ++i)  // rows have either sign; the steps are alike only if it is always the same
    if (out.root(i, i) < 0.0) {
      out.root.row(i) *= -1.0;
      out.information.row(i) *= -1.0;
    }
  return out;
}

PathSmoother::Square PathSmoother::last(long row, Eigen::Matrix<double, 4, 5>& q) const {
  Eigen::Matrix<double, 5, 4> rows;
  rows.topRows<4>() = step(row - 1).root;
  rows.row(4) = shown_;
  const Eigen::HouseholderQR<Eigen::Matrix<double, 5, 4>> qr(rows);
  const Eigen::Matrix<double, 5, 5> whole = qr.householderQ();
  q = whole.transpose().topRows<4>();
  return Square(qr.matrixQR().topRows<4>().triangularView<Eigen::Upper>());
}

void PathSmoother::smooth(const Eigen::Ref<const RowMatX<double>>& y, RowMatX<double>& q,
                          RowMatX<double>& qd, RowMatX<double>& qdd) const {
  const long samples = y.rows(), n = y.cols(), rows = samples / every_;
  if (rows < kFewestPathRows && every_ > 1)
    return PathSmoother(cutoff_hz_, rate_hz_ * static_cast<double>(every_), 1)
        .smooth(y, q, qd, qdd);
  if (rows < kFewestPathRows)
    throw DataError("a path of " + std::to_string(rows) + " rows, expected " +
                    std::to_string(kFewestPathRows) + " or more");
  using State = Eigen::Matrix<double, 4, Eigen::Dynamic>;
  const auto mean = [&](long k) {
    return y.middleRows(k * every_, every_).colwise().sum() / static_cast<double>(every_);
  };
  Eigen::Matrix<double, 5, Eigen::Dynamic> known(5, n);
  known.setZero();
  State solved(4, n * (rows - 1));
  for (long k = 0; k + 1 < rows; ++k) {
    const Step& s = step(k);
    known.row(4) = mean(k);
    solved.middleCols(k * n, n).noalias() = s.solved * known;
    known.topRows<4>() = (s.information * known).eval();
  }
  known.row(4) = mean(rows - 1);
  Eigen::Matrix<double, 4, 5> onto;
  const Square R = last(rows - 1, onto);
  State z = R.triangularView<Eigen::Upper>().solve(State(onto * known));
  q.resize(samples, n);
  qd.resize(samples, n);
  qdd.resize(samples, n);
  for (long k = rows - 1;; --k) {
    // About its middle a mean's rows are a cubic: the fourth derivative changes it by 1e-7.
    for (long i = k * every_; i < (k + 1 < rows ? (k + 1) * every_ : samples); ++i) {
      const double s = (static_cast<double>(i - k * every_) + 0.5) / static_cast<double>(every_) -
                       0.5;
      q.row(i) = z.row(0) + s * (z.row(1) + s * (z.row(2) + s * z.row(3)));
      qd.row(i) = (z.row(1) + s * (2.0 * z.row(2) + 3.0 * s * z.row(3))) * rate_hz_;
      qdd.row(i) = (2.0 * z.row(2) + 6.0 * s * z.row(3)) * (rate_hz_ * rate_hz_);
    }
    if (k == 0) return;
    z = (solved.middleCols((k - 1) * n, n) - step(k - 1).next * z).eval();
  }
}

long PathSmoother::memory(double share) const {
  // The slowest pole of 1/(1 + s⁸) decays as exp(−sin(π/8) ω_c t).
  const double rate = std::sin(kPi / 8.0) * 2.0 * kPi * cutoff_hz_ / rate_hz_;
  return every_ * static_cast<long>(std::ceil(-std::log(share) / rate));
}

VecX<double> PathSmoother::acceleration_variance(long samples) const {
  const long rows = samples / every_;
  if (rows < kFewestPathRows && every_ > 1)
    return PathSmoother(cutoff_hz_, rate_hz_ * static_cast<double>(every_), 1)
        .acceleration_variance(samples);
  VecX<double> out(samples);
  Eigen::Matrix<double, 4, 5> onto;
  const Square R = last(rows - 1, onto);
  const Square inverse = R.triangularView<Eigen::Upper>().solve(Square(Square::Identity()));
  Square P = inverse * inverse.transpose();
  const double scale = 4.0 * std::pow(rate_hz_, 4) / static_cast<double>(every_);
  for (long k = rows - 1;; --k) {
    out.segment(k * every_, (k + 1 < rows ? every_ : samples - k * every_))
        .setConstant(scale * P(2, 2));
    if (k == 0) return out;
    const Step& s = step(k - 1);
    P = (s.inverse * s.inverse.transpose() + s.next * P * s.next.transpose()).eval();
  }
}

}  // namespace diffnea::detail
