#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/identify/body_motion.hpp>

#include "core/decompositions.hpp"
#include "core/statistics.hpp"

namespace diffnea {
namespace {

constexpr long kUnknowns = 6;  ///< coefficients of a quintic
/// Rows on either side: nine rows leave three numbers that tell noise.
constexpr long kLeastHalfWidth = 4;
/// Bias over noise of the second derivative at the centre, squared, of the same ratio of a sextic's
/// coefficient: with Legendre's a_n = P_n''(0)²/|P_n|², a_6/(a_2 + a_4).
constexpr double kBiasPerSextic = 4.06;
/// Bias that all windows may share, over the standard error of what all of them say together. A
/// parameter may gather it from windows that say most.
constexpr double kBiasOfError = 0.05;
/// Turn in a window, from which log is far from a polynomial; at π it jumps [rad].
constexpr double kMostTurn = 2.0;
/// Standard errors from which a sextic shows. Later, where it is as large as noise, windows are as
/// long as the motion's own times, and the power below is none.
constexpr double kShows = 4.0;
/// Power of the width that the square of a sextic's coefficient grows by.
constexpr double kSexticPower = 13.0;
/// Share of a stretch that a window may be: of each stretch three quarters have all neighbours.
constexpr long kWindowsPerStretch = 4;
constexpr double kNextWidth = 1.25;  ///< ratio of widths that are tried

/// A window of rows, and its quintics' design in units of its half length.
struct Window {
  long first, rows;
  double scale;  ///< [s]
  Eigen::ColPivHouseholderQR<MatX<double>> qr;
  VecX<double> sextic;  ///< remainder of t⁶ beside quintics, of length 1
};

Window window_at(const std::vector<PosedRow>& rows, long k, long half) {
  Window w{k - half, 2 * half + 1, 0.0, {}, {}};
  w.scale = 0.5 * (rows[k + half].time - rows[k - half].time);
  MatX<double> A(w.rows, kUnknowns);
  w.sextic.resize(w.rows);
  for (long i = 0; i < w.rows; ++i) {
    const double t = (rows[w.first + i].time - rows[k].time) / w.scale;
    const double square = t * t;
    A.row(i) << 1.0, t, 0.5 * square, t * square, square * square, t * square * square;
    w.sextic[i] = square * square * square;
  }
  w.qr.compute(A);
  w.sextic -= A * w.qr.solve(w.sextic);
  w.sextic.normalize();
  return w;
}

/// A point's value and derivatives at the window's centre, and the mean squares that the quintics
/// leave: of a number, and of a sextic's coefficient, which noise makes as large.
struct Smoothed {
  std::array<Vec3<double>, 3> at;
  double left = 0.0, sextic = 0.0;
};

Smoothed smoothed(const Window& w, const MatX<double>& y) {
  const MatX<double> c = w.qr.solve(y);
  Smoothed out;
  double scale = 1.0;
  for (std::size_t d = 0; d < 3; ++d, scale *= w.scale) {
    const auto row = static_cast<Eigen::Index>(d);
    out.at[d] = Vec3<double>{c(row, 0), c(row, 1), c(row, 2)} * (1.0 / scale);
  }
  const MatX<double> rotated = w.qr.householderQ().transpose() * y;
  out.left = rotated.bottomRows(w.rows - kUnknowns).squaredNorm() /
             static_cast<double>(3 * (w.rows - kUnknowns));
  out.sextic = (w.sextic.transpose() * y).squaredNorm() / 3.0;
  return out;
}

Smoothed smoothed_position(const std::vector<PosedRow>& rows, const Window& w, std::size_t b) {
  MatX<double> y(w.rows, 3);
  for (long i = 0; i < w.rows; ++i) {
    const Vec3<double>& p = rows[w.first + i].X_WB[b].p;
    y.row(i) << p.x, p.y, p.z;
  }
  return smoothed(w, y);
}

/// Turns against `about`, which the smoothed one at the centre replaces: at log = 0 its derivatives
/// are ω and ω̇. Axes that turn with the body would do for faster ones, but tie noise of ω̇ to that
/// of ω, which biases what gyroscopic forces tell.
Smoothed smoothed_turn(const std::vector<PosedRow>& rows, const Window& w, std::size_t b,
                       Mat3<double>& about) {
  MatX<double> y(w.rows, 3);
  Smoothed out;
  for (int pass = 0; pass < 2; ++pass) {
    for (long i = 0; i < w.rows; ++i) {
      const Vec3<double> turn = log(Mat3<double>(transpose(about) * rows[w.first + i].X_WB[b].R));
      y.row(i) << turn.x, turn.y, turn.z;
    }
    out = smoothed(w, y);
    if (y.rowwise().norm().maxCoeff() > kMostTurn)
      out.sextic = std::numeric_limits<double>::infinity();
    about = about * exp(out.at[0]);
  }
  return out;
}

/// Calls `each(k)` for every `step`th row with `half` neighbours of its stretch on either side.
template <class Each>
void each_centre(const std::vector<PosedRow>& rows, long half, long step, const Each& each) {
  const auto n = static_cast<long>(rows.size());
  for (long k = half; k + half < n; k += step)
    if (rows[k - half].stretch == rows[k + half].stretch) each(k);
}

/// Variances of all bodies, angle and position each, that quintics leave: of a number, by the
/// median over windows; of a sextic's coefficient, by the quantile 0.9, so that the fastest part of
/// a motion counts and a few impacts do not. Both over those of χ².
struct Left {
  std::vector<double> all, sextic;
};
constexpr double kFast = 0.9, kFastOfThree = 6.251 / 3.0;  ///< quantile of χ²₃ over its mean
/// The same of the quantile 0.99: samples beyond are left out, of a motion that is too fast for its
/// window, or of an impact.
constexpr double kTooFast = 11.345 / 3.0;

Left left_by(const std::vector<PosedRow>& rows, long half) {
  const std::size_t bodies = rows.front().X_WB.size();
  std::vector<std::vector<double>> all(2 * bodies), sextic(2 * bodies);
  const auto put = [&](std::size_t at, const Smoothed& s) {
    all[at].push_back(s.left);
    sextic[at].push_back(s.sextic);
  };
  each_centre(rows, half, half, [&](long k) {  // neighbours tell nothing new
    const Window w = window_at(rows, k, half);
    for (std::size_t b = 0; b < bodies; ++b) {
      Mat3<double> about = rows[k].X_WB[b].R;
      put(2 * b, smoothed_turn(rows, w, b, about));
      put(2 * b + 1, smoothed_position(rows, w, b));
    }
  });
  const double degrees = static_cast<double>(3 * (2 * half + 1 - kUnknowns)),
               middle = std::pow(1.0 - 2.0 / (9.0 * degrees), 3);  // Wilson, Hilferty 1931
  Left out;
  for (std::size_t i = 0; i < all.size(); ++i) {
    out.all.push_back(median(std::move(all[i])) / middle);
    const bool turns_too_far =
        std::ranges::any_of(sextic[i], [](double x) { return std::isinf(x); });
    out.sextic.push_back(turns_too_far ? std::numeric_limits<double>::infinity()
                                       : quantile(std::move(sextic[i]), kFast) / kFastOfThree);
  }
  return out;
}

/// The widest windows whose bias, should all of them share it, is small beside the standard error
/// of what all of them say together. It is read off where a sextic shows in the noise, and grows by
/// a known power.
long chosen_width(const std::vector<PosedRow>& rows, const std::vector<double>& noise,
                  long longest) {
  double chosen = static_cast<double>(kLeastHalfWidth);
  for (long half = kLeastHalfWidth; kWindowsPerStretch * (2 * half + 1) <= longest;
       half = std::max(half + 1, std::lround(kNextWidth * static_cast<double>(half)))) {
    const Left left = left_by(rows, half);
    double sextic = 0.0;  // over noise, of the body that shows it most
    for (std::size_t i = 0; i < noise.size(); ++i)
      if (noise[i] > 0.0) sextic = std::max(sextic, left.sextic[i] / noise[i] - 1.0);
    if (!std::isfinite(sextic)) break;
    const double windows = static_cast<double>(rows.size()) / static_cast<double>(2 * half + 1),
                 most = kBiasOfError * kBiasOfError / (kBiasPerSextic * windows),
                 unsure = std::sqrt(2.0 / (3.0 * windows)),  // standard error of the mean square
        share = std::pow(most / (sextic + unsure), 1.0 / kSexticPower);
    chosen = std::max(static_cast<double>(kLeastHalfWidth),
                      std::min(1.0, share) * static_cast<double>(half));
    if (sextic > kShows * unsure) break;
  }
  return std::lround(chosen);
}

long longest_stretch(const std::vector<PosedRow>& rows) {
  long longest = 0;
  for (std::size_t first = 0; first < rows.size();) {
    std::size_t end = first + 1;
    for (; end < rows.size() && rows[end].stretch == rows[first].stretch; ++end)
      if (!(rows[end].time > rows[end - 1].time))
        throw DataError("smooth_bodies: row " + std::to_string(end) + " is at " +
                        detail::number_text(rows[end].time) + " s, expected later than " +
                        detail::number_text(rows[end - 1].time) + " s, the row before");
    longest = std::max(longest, static_cast<long>(end - first));
    first = end;
  }
  return longest;
}

}  // namespace

BodyMotion smooth_bodies(const std::vector<PosedRow>& rows) {
  for (const PosedRow& r : rows)
    if (r.X_WB.size() != rows.front().X_WB.size())
      throw ShapeError("smooth_bodies: the row at " + detail::number_text(r.time) + " s has " +
                       std::to_string(r.X_WB.size()) + " bodies, expected " +
                       std::to_string(rows.front().X_WB.size()) + " as the first one");
  const long longest = longest_stretch(rows);
  if (longest < 2 * kLeastHalfWidth + 1)
    throw DataError("smooth_bodies: the longest stretch without a gap has " +
                    std::to_string(longest) + " rows, expected at least " +
                    std::to_string(2 * kLeastHalfWidth + 1));
  const std::vector<double> noise = left_by(rows, kLeastHalfWidth).all;
  const long half = chosen_width(rows, noise, longest);
  BodyMotion out;
  out.half_width = static_cast<int>(half);

  // Without noise, a sample is too fast beside the others.
  std::vector<double> most = left_by(rows, half).sextic;
  for (std::size_t i = 0; i < most.size(); ++i) most[i] = kTooFast * std::max(most[i], noise[i]);
  std::array<double, 3> gain{};
  each_centre(rows, half, 1, [&](long k) {
    const Window w = window_at(rows, k, half);
    BodySample s{rows[k].time, rows[k].stretch, {}, {}, 0, {}};
    for (std::size_t b = 0; b < rows[k].X_WB.size(); ++b) {
      Mat3<double> R = rows[k].X_WB[b].R;
      const Smoothed turn = smoothed_turn(rows, w, b, R), place = smoothed_position(rows, w, b);
      if (std::isinf(turn.sextic) || turn.sextic > most[2 * b] || place.sextic > most[2 * b + 1])
        return;
      const Vec3<double>& spin = turn.at[1];
      const Vec3<double> v = transpose_times(R, place.at[1]);
      s.states.push_back({{R, place.at[0]}, {spin, v}});
      s.accelerations.push_back({turn.at[2], transpose_times(R, place.at[2]) - cross(spin, v)});
    }
    const MatX<double> weights = w.qr.solve(MatX<double>::Identity(w.rows, w.rows));
    s.first_row = w.first;
    for (long i = 0; i < w.rows; ++i)
      s.weights.push_back(
          {weights(0, i), weights(1, i) / w.scale, weights(2, i) / (w.scale * w.scale)});
    if (out.samples.empty())  // of white noise
      for (const std::array<double, 3>& c : s.weights)
        for (std::size_t d = 0; d < 3; ++d) gain[d] = std::hypot(gain[d], c[d]);
    out.samples.push_back(std::move(s));
  });
  for (std::size_t b = 0; 2 * b < noise.size(); ++b) {
    BodyNoise of;
    of.row_angle = std::sqrt(noise[2 * b]);
    of.row_position = std::sqrt(noise[2 * b + 1]);
    for (std::size_t d = 0; d < 3; ++d) {
      of.angle[d] = gain[d] * of.row_angle;
      of.position[d] = gain[d] * of.row_position;
    }
    out.noise.push_back(of);
  }
  return out;
}

}  // namespace diffnea
