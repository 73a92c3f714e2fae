#include "report/evidence_plots.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include <diffnea/effects/bound_effect.hpp>

#include "core/constants.hpp"
#include "report/diagnose_words.hpp"
#include "report/error_curves.hpp"

namespace diffnea::report {
namespace {

constexpr int kMostOverviews = 3;  ///< joints that are shown where no cause names one
constexpr std::size_t kMostPlots = 24;

Column error(const ResidualSeries& s, const Column& model) {
  Column out(model.size());
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = s.measured[k] - model[k];
  return out;
}

class Plots {
 public:
  explicit Plots(const Finding& finding) : finding_(finding) {
    for (const Cause& c : finding.causes)  // a ball's are none in the torque
      if (!at_ball(c.where)) causes_.push_back(&c);
  }

  std::vector<EvidencePlot> run() {
    for (const Cause* c : causes_) add(*c);
    for (const Witness& w : finding_.witness) {
      for (const std::string& variable : w.variables) add_witness(w.where, variable);
      if (const ResidualSeries* s = series(w.where)) time(*s);
    }
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

  bool extended() const { return !causes_.empty(); }

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

  void time(const ResidualSeries& s) { over("time", s, one_axis(s.time), "time", "s"); }
  void time_along_motion(const ResidualSeries& s) {
    over("time_along_motion", s, one_axis(s.time), "time", "s", signs(s.qd),
         "error along the motion");
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
    const std::vector<SignChange> turns = sign_changes(s.time, x);
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
      plot.curves.push_back(mean_around(name, turns, error(s, model), reach));
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
      plot.curves.push_back(lagged_correlation(name, s.time, r, error(s, model), kReach));
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
    effect_ = cause.effect;
    const EffectInfo* known = known_effect(cause.effect);
    const EffectInfo& info = known ? *known : EffectInfo{};
    for (const ResidualSeries* s : at(cause.where))
      for (const ShownOver over : info.shown_over) show(over, *s, cause);
    effect_.clear();
  }

  void show(ShownOver what, const ResidualSeries& s, const Cause& cause) {
    switch (what) {
      case ShownOver::kPosition:
        return position(s);
      case ShownOver::kVelocity:
        return velocity(s);
      case ShownOver::kAcceleration:
        return acceleration(s);
      case ShownOver::kTorque:
        return torque(s);
      case ShownOver::kTorqueRate:
        return torque_rate(s);
      case ShownOver::kLoad:
        return load(s);
      case ShownOver::kTime:
        return time(s);
      case ShownOver::kTimeAlongMotion:
        return time_along_motion(s);
      case ShownOver::kSpectrum:
        return spectrum(s, value(cause, "cycles"));
      case ShownOver::kReversals:
        return reversals("reversal", s, s.qd, "velocity");
      case ShownOver::kTorqueReversals:
        return reversals("torque_reversal", s, s.extended, "torque");
      case ShownOver::kCorrelation:
        return correlation(s, kNaN);
    }
  }

  /// The error of one joint over a channel of any: "qd_elbow".
  void add_witness(const std::string& where, const std::string& channel) {
    const std::size_t bar = channel.find('_');
    if (bar == std::string::npos) return;
    const ResidualSeries *of = series(where), *by = series(channel.substr(bar + 1));
    const std::string what = channel.substr(0, bar);
    if (!of || !by || of->time.size() != by->time.size()) return;
    const std::string unit = position_unit(*by), at = by == of ? "" : " of " + by->joint;
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
  std::vector<const Cause*> causes_;
  std::string effect_;
  std::set<std::string> seen_;
  std::vector<EvidencePlot> plots_;
};

}  // namespace

std::vector<EvidencePlot> evidence_plots(const Finding& finding) { return Plots(finding).run(); }

}  // namespace diffnea::report
