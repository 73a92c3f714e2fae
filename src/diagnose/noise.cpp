#include "diagnose/noise.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/decompositions.hpp"
#include "diagnose/hats.hpp"
#include "diagnose/thresholds.hpp"

namespace diffnea {
namespace {


/// Levinson–Durbin recursion. @param r  autocovariances r_0 … r_order
JointNoise levinson(const std::vector<double>& r) {
  JointNoise out;
  out.rms = std::sqrt(r[0]);
  std::vector<double> a;
  double error = r[0];
  out.orders.push_back({a, out.rms});
  for (std::size_t k = 1; k < r.size(); ++k) {
    double reflection = 0.0;
    if (error > 1e-12 * r[0]) {
      reflection = r[k];
      for (std::size_t i = 1; i < k; ++i) reflection -= a[i - 1] * r[k - i];
      reflection /= error;
    }
    const std::vector<double> before = a;
    a.push_back(reflection);
    for (std::size_t i = 1; i < k; ++i) a[i - 1] = before[i - 1] - reflection * before[k - i - 1];
    error *= 1.0 - reflection * reflection;
    out.orders.push_back({a, std::sqrt(std::max(error, 1e-12 * r[0]))});
  }
  return out;
}

/// A column for each run but the first: its constant beside that of the others.
MatX<double> sessions(const Evidence& e, const std::vector<long>& rows) {
  std::vector<int> runs;
  const auto run_of = [&](long row) { return e.series()[e.stretch()[row]].run; };
  for (const long i : rows)
    if (runs.empty() || runs.back() != run_of(i)) runs.push_back(run_of(i));
  const long m = std::ssize(rows), count = std::max<long>(std::ssize(runs) - 1, 0);
  MatX<double> out = MatX<double>::Zero(m, count);
  long at = 0;
  for (long i = 0; i < m; ++i) {
    while (run_of(rows[i]) != runs[at]) ++at;
    if (at > 0) out(i, at - 1) = 1.0;
  }
  return out;
}

/// Of a function of one variable that what is missing may be; fewer where there are few rows.
constexpr int kKnots = 16, kLeastKnots = 4;

}  // namespace

JointNoise white(double rms) {
  JointNoise out;
  out.rms = rms;
  out.orders = {{{}, rms}};
  return out;
}

std::vector<JointNoise> white_noise(const Evidence& evidence) {
  std::vector<JointNoise> out;
  for (long k = 0; k < std::ssize(evidence.joints()); ++k)
    out.push_back(white(std::max(evidence.size(k), 1e-12)));
  return out;
}

std::vector<JointNoise> estimate_noise(const Evidence& evidence, const VecX<double>& residual,
                                       const std::vector<bool>& used,
                                       const std::vector<double>& lost,
                                       const std::vector<double>& least) {
  const long m = evidence.times();
  std::vector<JointNoise> out;
  for (std::size_t k = 0; k < evidence.joints().size(); ++k) {
    const long begin = k * m;
    // A constant is no noise: whitened away, an offset would be invisible.
    double mean = 0.0;
    long count = 0;
    for (long i = 0; i < m; ++i)
      if (used[begin + i]) mean += residual[begin + i], ++count;
    mean /= static_cast<double>(std::max<long>(count, 1));
    std::vector<double> r(kNoiseOrder + 1, 0.0);
    std::vector<long> pairs(kNoiseOrder + 1, 0);
    for (long i = 0; i < m; ++i) {
      if (!used[begin + i]) continue;
      for (long lag = 0; lag <= kNoiseOrder && lag <= i; ++lag) {
        if (!used[begin + i - lag] || evidence.stretch()[i] != evidence.stretch()[i - lag])
          continue;
        r[lag] += (residual[begin + i] - mean) * (residual[begin + i - lag] - mean);
        ++pairs[lag];
      }
    }
    const double n = std::max<double>(static_cast<double>(pairs[0]), 1.0);
    const double freedom = lost.empty() ? 1.0 : n / std::max(n - lost[k], 0.1 * n);
    // Bartlett's weights keep the sequence positive definite where rows are missing.
    for (int lag = 0; lag <= kNoiseOrder; ++lag) r[lag] *= freedom / n * (lag ? 1.0 - 1e-6 : 1.0);
    const double rounding = kLeastNoise * evidence.scale(k);
    const double assumed = std::max(rounding * rounding, 1e-300);
    r[0] = std::max(r[0], least.empty() ? 0.0 : least[k] * least[k]) + assumed;
    out.push_back(levinson(r));
    out.back().assumed = assumed / r[0];
  }
  return out;
}

std::vector<double> signals_noise(const Evidence& evidence, const VecX<double>& left,
                                  const std::vector<bool>& used) {
  std::vector<double> out;
  for (std::size_t k = 0; k < evidence.joints().size(); ++k)
    out.push_back(std::min(evidence.signal_noise(k), evidence.rms(k, left, used)));
  return out;
}

Smoothed beside_smooth_functions(const Evidence& e, const std::vector<int>& free,
                                 const VecX<double>& x0, const VecX<double>& residual,
                                 const std::vector<bool>& used, double lost) {
  Smoothed out{residual, std::vector<double>(e.joints().size(), lost), {}};
  for (std::size_t k = 0; k < e.joints().size(); ++k) {
    const long begin = static_cast<long>(k) * e.times();
    std::vector<long> rows;
    for (long i = 0; i < e.times(); ++i)
      if (used[begin + i]) rows.push_back(i);
    const long m = std::ssize(rows);
    if (m == 0) continue;
    const long own = k;
    const VecX<double> q = e.q(own).col(e.joints()[k])(rows),
                       qd = e.qd(own).col(e.joints()[k])(rows);
    // Nothing but the links moves a passive joint: what other links would do there is no noise,
    // whether or not the base may be refitted. Where no torque is known these explain all.
    std::vector<int> columns = free;
    if (e.passive(own) && e.has_passive_beside_torques()) {
      columns.resize(e.base().cols());
      std::iota(columns.begin(), columns.end(), 0);
    }
    const MatX<double> base =
        e.without_scale(own, e.base().middleRows(begin, e.times()), x0)(rows, columns);
    const long rank = base.cols() ? Eigen::ColPivHouseholderQR<MatX<double>>(base).rank() : 0;
    int count = kKnots;
    while (count > kLeastKnots && (rank + 2 * count) * kRowsAColumn > m) count /= 2;
    if ((rank + 2 * count) * kRowsAColumn > m) {
      out.blind.push_back(static_cast<long>(k));
      continue;
    }
    const VecX<double> time = Eigen::Map<const VecX<double>>(e.time().data(), e.times())(rows);
    // A drift is slower than the motion: shorter pieces would take up noise that goes with it.
    const int pieces =
        static_cast<int>((time.maxCoeff() - time.minCoeff()) / (2.0 * kBlockSeconds));
    MatX<double> of_time(m, 0);
    if (pieces >= kLeastKnots && (rank + 3 * count) * kRowsAColumn <= m)
      of_time = hats(time, knots(time, std::min(count, pieces)));
    const MatX<double> of_q = hats(q, knots(q, count)), of_qd = hats(qd, knots(qd, count));
    const MatX<double> of_torque =
        e.passive(own) ? MatX<double>(m, 0) : MatX<double>(e.curvature(own)(rows, Eigen::all));
    MatX<double> of_run = sessions(e, rows);
    if ((rank + 2 * count + of_time.cols() + of_run.cols()) * kRowsAColumn > m) of_run.resize(m, 0);
    MatX<double> A(m, base.cols() + of_q.cols() + of_qd.cols() + of_torque.cols() + of_time.cols() +
                          of_run.cols());
    A << base, of_q, of_qd, of_torque, of_time, of_run;
    const Eigen::ColPivHouseholderQR<MatX<double>> qr(A);
    const VecX<double> r = residual.segment(begin, e.times())(rows);
    out.left.segment(begin, e.times())(rows) = r - A * qr.solve(r);
    out.lost[k] = std::max(lost, static_cast<double>(qr.rank()));
  }
  return out;
}

VecX<double> repeatable_noise(const Evidence& evidence, const VecX<double>& residual,
                              double period) {
  const double steps = period / evidence.step();
  const long p = std::lround(steps), m = evidence.times();
  VecX<double> out =
      VecX<double>::Constant(residual.size(), std::numeric_limits<double>::quiet_NaN());
  bool any = false;
  for (long begin = 0; begin < m;) {
    long end = begin;
    while (end < m && evidence.stretch()[end] == evidence.stretch()[begin]) ++end;
    const long n = end - begin;
    // Over the whole stretch the phase may slip by a twentieth of a row.
    const bool whole =
        p > 0 &&
        std::abs(steps - static_cast<double>(p)) * static_cast<double>(n / std::max(p, 1L)) < 0.05;
    for (std::size_t k = 0; whole && k < evidence.joints().size(); ++k)
      for (long phase = 0; phase < std::min(p, n); ++phase) {
        // A stretch's first rows are others than those a period later.
        const long own = k, late = evidence.begins(begin + phase, own) ? p : 0;
        const long first = own * m + begin + phase + late,
                   repeats = (n - 1 - phase - late) / p + 1;
        if (n <= phase + late || repeats < 2) continue;
        any = true;
        double mean = 0.0;
        for (long c = 0; c < repeats; ++c) mean += residual[first + c * p];
        mean /= static_cast<double>(repeats);
        const double scale =
            std::sqrt(static_cast<double>(repeats) / static_cast<double>(repeats - 1));
        for (long c = 0; c < repeats; ++c)
          out[first + c * p] = scale * (residual[first + c * p] - mean);
      }
    begin = end;
  }
  return any ? out : VecX<double>();
}

Whitener::Whitener(const Evidence& evidence, std::vector<JointNoise> noise,
                   const std::vector<bool>& used)
    : noise_(std::move(noise)), times_(evidence.times()) {
  kept_.assign(evidence.rows(), false);
  before_.assign(kept_.size(), -1);
  for (std::size_t k = 0; k < evidence.joints().size(); ++k) {
    long since = 0;  // usable rows in a row
    for (long i = 0; i < times_; ++i) {
      const std::size_t row = k * static_cast<std::size_t>(times_) + static_cast<std::size_t>(i);
      const bool follows = i > 0 && evidence.stretch()[i] == evidence.stretch()[i - 1];
      const bool may = used.empty() || used[row];
      since = !may || evidence.sticks(i, k) ? 0 : follows ? since + 1 : 1;
      kept_[row] = since > 0 && !evidence.rests(i, k);
      if (kept_[row])
        before_[row] = static_cast<int>(std::min<long>(since, std::ssize(noise_[k].orders))) - 1;
      used_rows_ += kept_[row];
      assumed_sum_ += kept_[row] ? noise_[k].assumed : 0.0;
    }
  }
}

MatX<double> Whitener::operator()(const MatX<double>& rows) const {
  MatX<double> out(rows.rows(), rows.cols());
  if (rows.cols() == 0) return out;
  for (long k = 0; k < std::ssize(noise_); ++k)
    out.middleRows(k * times_, times_) = joint(k, rows.middleRows(k * times_, times_));
  return out;
}

MatX<double> Whitener::joint(long k, const Eigen::Ref<const MatX<double>>& rows) const {
  MatX<double> out = MatX<double>::Zero(rows.rows(), rows.cols());
  const JointNoise& noise = noise_[k];
  for (long c = 0; c < rows.cols(); ++c) {
    if (rows.col(c).isZero(0.0)) continue;
    for (long i = 0; i < times_; ++i) {
      const int before = before_[k * times_ + i];
      if (before < 0) continue;
      const JointNoise::Prediction& from = noise.orders[before];
      double e = rows(i, c);
      for (int l = 0; l < before; ++l) e -= from.a[l] * rows(i - 1 - l, c);
      out(i, c) = e / from.sigma;
    }
  }
  return out;
}

}  // namespace diffnea
