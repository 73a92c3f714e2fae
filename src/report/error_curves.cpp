#include "report/error_curves.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/constants.hpp"

namespace diffnea::report {
namespace {

constexpr int kBins = 30;

std::vector<EvenRows> even_rows(const Column& time) {
  const double step = step_of(time);
  std::vector<EvenRows> out;
  for (std::size_t k = 0; k < time.size(); ++k) {
    const bool follows = k > 0 && time[k] > time[k - 1] && time[k] - time[k - 1] < 1.5 * step;
    if (!follows) out.push_back({k, k});
    out.back().end = k + 1;
  }
  return out;
}

}  // namespace

Column product(const Column& a, const Column& b) {
  Column out(a.size());
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = a[k] * b[k];
  return out;
}

Column signs(const Column& x) {
  Column out(x.size());
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = x[k] > 0.0 ? 1.0 : x[k] < 0.0 ? -1.0 : 0.0;
  return out;
}

double mean_square(const Column& x) {
  return x.empty() ? 0.0
                   : std::inner_product(x.begin(), x.end(), x.begin(), 0.0) /
                         static_cast<double>(x.size());
}

double step_of(const Column& time) {
  double out = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < time.size(); ++k)
    if (time[k] > time[k - 1]) out = std::min(out, time[k] - time[k - 1]);
  return out;
}

Column rate(const Column& time, const Column& x) {
  Column out(x.size(), kNaN);
  for (const EvenRows& s : even_rows(time))
    for (std::size_t k = s.begin + 1; k + 1 < s.end; ++k)
      out[k] = (x[k + 1] - x[k - 1]) / (time[k + 1] - time[k - 1]);
  return out;
}

Column one_axis(const Column& time) {
  Column out = time;
  double offset = 0.0;
  for (std::size_t k = 1; k < out.size(); ++k) {
    if (time[k] <= time[k - 1]) offset = out[k - 1] - time[k] + step_of(time);
    out[k] = time[k] + offset;
  }
  return out;
}

Column bin_edges(const Column& x) {
  Column sorted;
  for (const double v : x)
    if (std::isfinite(v)) sorted.push_back(v);
  if (sorted.size() < 2 * kBins) return {};
  std::ranges::sort(sorted);
  const double low = sorted.front(), high = sorted.back();
  if (!(high > low)) return {};
  Column out;
  for (int b = 0; b <= kBins; ++b) {
    const double share = static_cast<double>(b) / kBins;
    const auto at = static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1));
    out.push_back(0.5 * (sorted[at] + low + share * (high - low)));
  }
  return out;
}

Column middles(const Column& edges) {
  Column out;
  for (std::size_t b = 1; b < edges.size(); ++b) out.push_back(0.5 * (edges[b - 1] + edges[b]));
  return out;
}

EvidenceCurve binned(const std::string& model, const Column& x, const Column& y,
                     const Column& edges) {
  struct Visit {
    double sum = 0.0, count = 0.0;
  };
  std::vector<std::vector<Visit>> visits(edges.size() - 1);
  long last = -1;
  for (std::size_t k = 0; k < x.size(); ++k) {
    if (!std::isfinite(x[k]) || !std::isfinite(y[k])) {
      last = -1;
      continue;
    }
    const long bin = std::clamp<long>(std::ranges::upper_bound(edges, x[k]) - edges.begin() - 1, 0,
                                      static_cast<long>(visits.size()) - 1);
    std::vector<Visit>& of_bin = visits[static_cast<std::size_t>(bin)];
    if (bin != last) of_bin.emplace_back();
    of_bin.back().sum += y[k];
    of_bin.back().count += 1.0;
    last = bin;
  }
  EvidenceCurve out{model, {}, {}, {}};
  for (const std::vector<Visit>& of_bin : visits) {
    double sum = 0.0, count = 0.0, spread = 0.0;
    for (const Visit& v : of_bin) {
      sum += v.sum;
      count += v.count;
    }
    const double mean = count > 0.0 ? sum / count : kNaN;
    for (const Visit& v : of_bin) spread += std::pow(v.sum - v.count * mean, 2);
    const double n = static_cast<double>(of_bin.size());
    const double half = n >= kLeastVisits ? 1.96 * std::sqrt(spread * n / (n - 1.0)) / count : kNaN;
    out.mean.push_back(mean);
    out.low.push_back(mean - half);
    out.high.push_back(mean + half);
  }
  return out;
}

Column amplitudes(const Column& x, const Column& y, const Column& n) {
  Column out;
  const double rows = static_cast<double>(x.size());
  const double y0 = std::accumulate(y.begin(), y.end(), 0.0) / rows;
  for (const double cycles : n) {
    double s = 0, c = 0, ss = 0, cs = 0, ys = 0, yc = 0;
    for (std::size_t k = 0; k < x.size(); ++k) {
      const double sin = std::sin(cycles * x[k]), cos = std::cos(cycles * x[k]);
      s += sin;
      c += cos;
      ss += sin * sin;
      cs += sin * cos;
      ys += (y[k] - y0) * sin;
      yc += (y[k] - y0) * cos;
    }
    const double cc = rows - ss - c * c / rows;
    ss -= s * s / rows;
    cs -= s * c / rows;
    const double det = ss * cc - cs * cs;
    out.push_back(det > 1e-6 * rows * rows
                      ? std::hypot((cc * ys - cs * yc) / det, (ss * yc - cs * ys) / det)
                      : kNaN);
  }
  return out;
}

std::vector<SignChange> sign_changes(const Column& time, const Column& x) {
  std::vector<SignChange> out;
  for (const EvenRows& r : even_rows(time))
    for (std::size_t k = r.begin + 1; k < r.end; ++k)
      if ((x[k - 1] < 0.0) != (x[k] < 0.0)) out.push_back({k, x[k] < 0.0 ? -1.0 : 1.0, r});
  return out;
}

EvidenceCurve mean_around(const std::string& model, const std::vector<SignChange>& changes,
                          const Column& error, long reach) {
  EvidenceCurve c{model, {}, {}, {}};
  for (long d = -reach; d <= reach; ++d) {
    double n = 0.0, sum = 0.0, squares = 0.0;
    for (const SignChange& t : changes) {
      const long row = static_cast<long>(t.row) + d;
      if (row < static_cast<long>(t.inside.begin) || row >= static_cast<long>(t.inside.end))
        continue;
      const double y = t.sign * error[static_cast<std::size_t>(row)];
      n += 1.0;
      sum += y;
      squares += y * y;
    }
    const double mean = n > 0.0 ? sum / n : kNaN;
    const double half = n >= kLeastVisits
                            ? 1.96 * std::sqrt(std::max(squares / n - mean * mean, 0.0) / (n - 1.0))
                            : kNaN;
    c.mean.push_back(mean);
    c.low.push_back(mean - half);
    c.high.push_back(mean + half);
  }
  return c;
}

EvidenceCurve lagged_correlation(const std::string& model, const Column& time, const Column& x,
                                 const Column& error, long reach) {
  const std::vector<EvenRows> runs = even_rows(time);
  EvidenceCurve c{model, {}, {}, {}};
  for (long d = -reach; d <= reach; ++d) {
    double xy = 0.0, xx = 0.0, yy = 0.0, n = 0.0;
    for (const EvenRows& run : runs)
      for (std::size_t k = run.begin; k < run.end; ++k) {
        const long other = static_cast<long>(k) - d;
        if (other < static_cast<long>(run.begin) || other >= static_cast<long>(run.end)) continue;
        const double before = x[static_cast<std::size_t>(other)];
        if (!std::isfinite(before)) continue;
        xy += before * error[k];
        xx += before * before;
        yy += error[k] * error[k];
        n += 1.0;
      }
    const double half = n > 0.0 ? 1.96 / std::sqrt(n) : kNaN;
    c.mean.push_back(xx > 0.0 && yy > 0.0 ? xy / std::sqrt(xx * yy) : kNaN);
    c.low.push_back(c.mean.back() - half);
    c.high.push_back(c.mean.back() + half);
  }
  return c;
}

}  // namespace diffnea::report
