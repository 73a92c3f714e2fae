#include "diagnose/evidence_plots.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <set>

namespace diffnea {
namespace {

using Column = std::vector<double>;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kBins = 30;
constexpr int kLeastVisits = 3;    ///< of a bin, to say how sure its mean is
constexpr int kMostOverviews = 3;  ///< joints that are shown where no cause names one
constexpr std::size_t kMostPlots = 24;

/// Rows that follow each other at equal steps.
struct Stretch {
  std::size_t begin, end;
};

double step_of(const Column& time) {
  double out = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < time.size(); ++k)
    if (time[k] > time[k - 1]) out = std::min(out, time[k] - time[k - 1]);
  return out;
}

std::vector<Stretch> stretches(const Column& time) {
  const double step = step_of(time);
  std::vector<Stretch> out;
  for (std::size_t k = 0; k < time.size(); ++k) {
    const bool follows = k > 0 && time[k] > time[k - 1] && time[k] - time[k - 1] < 1.5 * step;
    if (!follows) out.push_back({k, k});
    out.back().end = k + 1;
  }
  return out;
}

Column error(const ResidualSeries& s, const Column& model) {
  Column out(model.size());
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = s.measured[k] - model[k];
  return out;
}

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

/// Central differences inside each stretch; NaN at its ends.
Column rate(const Column& time, const Column& x) {
  Column out(x.size(), kNaN);
  for (const Stretch& s : stretches(time))
    for (std::size_t k = s.begin + 1; k + 1 < s.end; ++k)
      out[k] = (x[k + 1] - x[k - 1]) / (time[k + 1] - time[k - 1]);
  return out;
}

double mean_square(const Column& x) {
  return x.empty() ? 0.0
                   : std::inner_product(x.begin(), x.end(), x.begin(), 0.0) /
                         static_cast<double>(x.size());
}

/// Edges between which equally many of the values lie on one half and equally wide bins on the
/// other: tails are neither empty nor one bin.
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

/// Means over the rows of each bin. Errors that follow each other are alike: rows of one visit to a
/// bin count as one draw, and the interval is from the spread between visits (Liang & Zeger 1986).
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

Column middles(const Column& edges) {
  Column out;
  for (std::size_t b = 1; b < edges.size(); ++b) out.push_back(0.5 * (edges[b - 1] + edges[b]));
  return out;
}

/// Amplitude of the error's part a sin(n x) + b cos(n x) over n, each n fitted by itself with a
/// mean (Zechmeister & Kürster 2009): positions are no equal steps.
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

class Plots {
 public:
  explicit Plots(const Finding& finding) : finding_(finding) {}

  std::vector<EvidencePlot> run() {
    for (const Cause& c : finding_.causes) add(c);
    for (const Witness& w : finding_.witness)
      for (const std::string& variable : w.variables) add_witness(w.where, variable);
    if (plots_.empty()) overview();
    if (plots_.size() > kMostPlots) plots_.resize(kMostPlots);
    return std::move(plots_);
  }

 private:
  const ResidualSeries* series(const std::string& joint) const {
    const auto found = std::ranges::find(finding_.series, joint, &ResidualSeries::joint);
    return found == finding_.series.end() || found->time.empty() ? nullptr : &*found;
  }

  /// The joints that a place means; where it names none, those whose error fell most.
  std::vector<const ResidualSeries*> at(const std::string& where) const {
    std::vector<const ResidualSeries*> out;
    for (std::size_t begin = 0; begin <= where.size();) {
      const std::size_t end = std::min(where.find(',', begin), where.size());
      if (const ResidualSeries* s = series(where.substr(begin, end - begin))) out.push_back(s);
      begin = end + 1;
    }
    if (!out.empty()) return out;
    std::vector<std::pair<double, const ResidualSeries*>> all;
    for (const ResidualSeries& s : finding_.series) {
      if (s.time.empty()) continue;
      const double before = mean_square(error(s, s.base));
      all.push_back({before > 0.0 ? mean_square(error(s, s.extended)) / before : 1.0, &s});
    }
    std::ranges::stable_sort(all, {}, &std::pair<double, const ResidualSeries*>::first);
    for (const auto& [rest, s] : all)
      if (static_cast<int>(out.size()) < kMostOverviews) out.push_back(s);
    return out;
  }

  std::string position_unit(const ResidualSeries& s) const { return s.unit == "N" ? "m" : "rad"; }

  bool extended() const { return !finding_.causes.empty(); }

  /// Errors times `weight` (empty: 1) over x, in bins.
  void over(const char* kind, const ResidualSeries& s, const Column& x, const std::string& x_name,
            const std::string& x_unit, const Column& weight = {},
            const std::string& y_name = "error") {
    if (!seen_.insert(std::string(kind) + "|" + s.joint + "|" + x_name).second) return;
    const Column edges = bin_edges(x);
    if (edges.empty()) return;
    EvidencePlot plot{kind, s.joint, x_name, x_unit, y_name, s.unit, effect_, middles(edges), {}};
    const auto curve = [&](const char* name, const Column& model) {
      const Column e = error(s, model);
      plot.curves.push_back(binned(name, x, weight.empty() ? e : product(e, weight), edges));
    };
    curve("base", s.base);
    if (extended()) curve("extended", s.extended);
    plots_.push_back(std::move(plot));
  }

  void velocity(const ResidualSeries& s) {
    over("velocity", s, s.qd, "velocity", position_unit(s) + "/s");
  }
  void position(const ResidualSeries& s) { over("position", s, s.q, "position", position_unit(s)); }
  void acceleration(const ResidualSeries& s) {
    over("acceleration", s, s.qdd, "acceleration", position_unit(s) + "/s^2");
  }
  void torque(const ResidualSeries& s) { over("torque", s, s.extended, "torque", s.unit); }
  void torque_rate(const ResidualSeries& s) {
    over("torque_rate", s, rate(s.time, s.extended), "rate of the torque", s.unit + "/s");
  }
  /// What grows with the load and turns with the velocity.
  void load(const ResidualSeries& s) {
    Column size;
    for (const double t : s.extended) size.push_back(std::abs(t));
    over("load", s, size, "size of the torque", s.unit, signs(s.qd), "error along the motion");
  }

  /// Time as one axis: a run begins where the one before ends.
  Column one_axis(const ResidualSeries& s) const {
    Column out = s.time;
    double offset = 0.0;
    for (std::size_t k = 1; k < out.size(); ++k) {
      if (s.time[k] <= s.time[k - 1]) offset = out[k - 1] - s.time[k] + step_of(s.time);
      out[k] = s.time[k] + offset;
    }
    return out;
  }
  void time(const ResidualSeries& s) { over("time", s, one_axis(s), "time", "s"); }
  void time_along_motion(const ResidualSeries& s) {
    over("time_along_motion", s, one_axis(s), "time", "s", signs(s.qd), "error along the motion");
  }

  void spectrum(const ResidualSeries& s, double mark) {
    if (!seen_.insert("spectrum|" + s.joint).second) return;
    const auto [low, high] = std::ranges::minmax(s.q);
    const double stroke = high - low, step = step_of(s.time);
    const double fast = std::sqrt(mean_square(s.qd));
    if (!(stroke > 0.0) || !(fast > 0.0) || !std::isfinite(step)) return;
    // One cycle over the stroke at least; at most what the rows resolve at twice the usual speed.
    const double first = 2.0 * std::numbers::pi / stroke;
    const double last = std::min(std::numbers::pi / (2.0 * fast * step), 60.0 * first);
    if (!(last > 1.2 * first)) return;
    EvidencePlot plot{"spectrum",
                      s.joint,
                      "cycles",
                      "1/" + position_unit(s),
                      "amplitude of error",
                      s.unit,
                      effect_,
                      {},
                      {},
                      mark};
    const long points = std::clamp(std::lround(4.0 * (last - first) / first), 40L, 240L);
    for (long k = 0; k < points; ++k)
      plot.x.push_back(first +
                       (last - first) * static_cast<double>(k) / static_cast<double>(points - 1));
    const auto curve = [&](const char* name, const Column& model) {
      const Column a = amplitudes(s.q, error(s, model), plot.x);
      plot.curves.push_back({name, a, Column(a.size(), kNaN), Column(a.size(), kNaN)});
    };
    curve("base", s.base);
    if (extended()) curve("extended", s.extended);
    plots_.push_back(std::move(plot));
  }

  /// The mean error around the instants at which x changes its sign, turned so that it becomes
  /// positive.
  void reversals(const char* kind, const ResidualSeries& s, const Column& x,
                 const std::string& of) {
    if (!seen_.insert(std::string(kind) + "|" + s.joint).second) return;
    struct Turn {
      std::size_t row;
      double sign;
      Stretch inside;
    };
    std::vector<Turn> turns;
    for (const Stretch& r : stretches(s.time))
      for (std::size_t k = r.begin + 1; k < r.end; ++k)
        if ((x[k - 1] < 0.0) != (x[k] < 0.0)) turns.push_back({k, x[k] < 0.0 ? -1.0 : 1.0, r});
    if (turns.size() < kLeastVisits) return;
    // A third of the usual time between two of them to either side.
    const double step = step_of(s.time);
    const double between = step * static_cast<double>(s.time.size() / turns.size());
    const long reach = std::clamp(std::lround(between / 3.0 / step), 4L, 30L);
    EvidencePlot plot{kind,
                      s.joint,
                      "time from the reversal of the " + of,
                      "s",
                      "error along the motion",
                      s.unit,
                      effect_,
                      {},
                      {}};
    for (long d = -reach; d <= reach; ++d) plot.x.push_back(static_cast<double>(d) * step);
    const auto curve = [&](const char* name, const Column& model) {
      const Column e = error(s, model);
      EvidenceCurve c{name, {}, {}, {}};
      for (long d = -reach; d <= reach; ++d) {
        double n = 0.0, sum = 0.0, squares = 0.0;
        for (const Turn& t : turns) {
          const long row = static_cast<long>(t.row) + d;
          if (row < static_cast<long>(t.inside.begin) || row >= static_cast<long>(t.inside.end))
            continue;
          const double y = t.sign * e[static_cast<std::size_t>(row)];
          n += 1.0;
          sum += y;
          squares += y * y;
        }
        const double mean = n > 0.0 ? sum / n : kNaN;
        const double half =
            n >= kLeastVisits
                ? 1.96 * std::sqrt(std::max(squares / n - mean * mean, 0.0) / (n - 1.0))
                : kNaN;
        c.mean.push_back(mean);
        c.low.push_back(mean - half);
        c.high.push_back(mean + half);
      }
      plot.curves.push_back(std::move(c));
    };
    curve("base", s.base);
    if (extended()) curve("extended", s.extended);
    plots_.push_back(std::move(plot));
  }

  /// Correlation of the error with the rate of the torque, over the time between them; the band is
  /// what noise without correlation stays inside in 95 %.
  void correlation(const ResidualSeries& s, double mark) {
    if (!seen_.insert("correlation|" + s.joint).second) return;
    const Column r = rate(s.time, s.extended);
    const double step = step_of(s.time);
    const std::vector<Stretch> runs = stretches(s.time);
    constexpr long kReach = 25;
    if (!std::isfinite(step) || s.time.size() < 8 * kReach) return;
    EvidencePlot plot{"correlation",
                      s.joint,
                      "lag behind the rate of the torque",
                      "s",
                      "correlation",
                      "1",
                      effect_,
                      {},
                      {},
                      mark};
    for (long d = -kReach; d <= kReach; ++d) plot.x.push_back(static_cast<double>(d) * step);
    const auto curve = [&](const char* name, const Column& model) {
      const Column e = error(s, model);
      EvidenceCurve c{name, {}, {}, {}};
      for (long d = -kReach; d <= kReach; ++d) {
        double xy = 0.0, xx = 0.0, yy = 0.0, n = 0.0;
        for (const Stretch& run : runs)
          for (std::size_t k = run.begin; k < run.end; ++k) {
            const long other = static_cast<long>(k) - d;
            if (other < static_cast<long>(run.begin) || other >= static_cast<long>(run.end))
              continue;
            const double x = r[static_cast<std::size_t>(other)];
            if (!std::isfinite(x)) continue;
            xy += x * e[k];
            xx += x * x;
            yy += e[k] * e[k];
            n += 1.0;
          }
        const double half = n > 0.0 ? 1.96 / std::sqrt(n) : kNaN;
        c.mean.push_back(xx > 0.0 && yy > 0.0 ? xy / std::sqrt(xx * yy) : kNaN);
        c.low.push_back(c.mean.back() - half);
        c.high.push_back(c.mean.back() + half);
      }
      plot.curves.push_back(std::move(c));
    };
    curve("base", s.base);
    if (extended()) curve("extended", s.extended);
    plots_.push_back(std::move(plot));
  }

  static double value(const Cause& cause, const char* name) {
    for (const CauseParameter& p : cause.parameters)
      if (p.name == name) return p.value;
    return kNaN;
  }

  void add(const Cause& cause) {
    const std::string& e = cause.effect;
    effect_ = e;
    const auto is = [&](std::initializer_list<const char*> names) {
      return std::ranges::any_of(names, [&](const char* n) { return e == n; });
    };
    for (const ResidualSeries* s : at(cause.where)) {
      if (is({"cogging"})) {
        position(*s);
        spectrum(*s, value(cause, "cycles"));
      } else if (is({"joint_spring", "encoder_offset", "encoder_scale"})) {
        position(*s);
        if (e == "joint_spring") spectrum(*s, kNaN);
      } else if (is({"presliding_dahl", "presliding_lugre", "stribeck_friction"})) {
        velocity(*s);
        reversals("reversal", *s, s->qd, "velocity");
      } else if (is({"backlash"})) {
        reversals("torque_reversal", *s, s->extended, "torque");
        reversals("reversal", *s, s->qd, "velocity");
      } else if (is({"warm_up"})) {
        time_along_motion(*s);
        velocity(*s);
      } else if (is({"torque_offset", "session_offset"})) {
        time(*s);
      } else if (is({"actuator_lag", "actuator_delay", "time_shift", "velocity_filter_lag"})) {
        torque_rate(*s);
        correlation(*s, kNaN);
      } else if (is({"joint_elasticity"})) {
        correlation(*s, kNaN);
        acceleration(*s);
      } else if (is({"torque_gain", "saturation"})) {
        torque(*s);
      } else if (is({"load_friction"})) {
        load(*s);
        velocity(*s);
      } else if (is({"armature", "transmission_coupling"})) {
        acceleration(*s);
        velocity(*s);
      } else if (e.ends_with("friction") || e.starts_with("asymmetric_")) {
        velocity(*s);
      } else {
        velocity(*s);
        position(*s);
      }
    }
    effect_.clear();
  }

  /// The error of one joint over a channel of any: "qd_elbow".
  void add_witness(const std::string& where, const std::string& channel) {
    const std::size_t bar = channel.find('_');
    if (bar == std::string::npos) return;
    const ResidualSeries *of = series(where), *by = series(channel.substr(bar + 1));
    const std::string what = channel.substr(0, bar);
    if (!of || !by || of->time.size() != by->time.size()) return;
    const std::string unit = position_unit(*by), at = " of " + by->joint;
    if (what == "q") over("position", *of, by->q, "position" + at, unit);
    if (what == "qd") over("velocity", *of, by->qd, "velocity" + at, unit + "/s");
    if (what == "qdd") over("acceleration", *of, by->qdd, "acceleration" + at, unit + "/s^2");
    if (what == "tau") over("torque", *of, by->extended, "torque" + at, by->unit);
  }

  void overview() {
    for (const ResidualSeries* s : at("")) {
      velocity(*s);
      position(*s);
    }
  }

  const Finding& finding_;
  std::string effect_;
  std::set<std::string> seen_;
  std::vector<EvidencePlot> plots_;
};

}  // namespace

std::vector<EvidencePlot> evidence_plots(const Finding& finding) { return Plots(finding).run(); }

}  // namespace diffnea
