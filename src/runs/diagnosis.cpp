#include <diffnea/runs/diagnosis.hpp>

#include "runs/ball_json.hpp"
#include "runs/json_numbers.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::number;
using io::rounded;

constexpr std::size_t kMostPoints = 4000;  ///< of each series that is stored

Json gain(const Gain& g) {
  return {{"test_rmse_before", number(g.before)},
          {"test_rmse_after", number(g.after)},
          {"noise_floor", number(g.noise_floor)},
          {"explained_share", number(g.explained_share)},
          {"ci95", {number(g.low), number(g.high)}}};
}

Json rivals(const std::vector<Rival>& list) {
  Json out = Json::array();
  for (const Rival& r : list)
    out.push_back({{"effect", r.effect}, {"where", r.where}, {"delta_bic", number(r.delta_bic)}});
  return out;
}

Json causes(const Finding& f) {
  Json out = Json::array();
  for (const Cause& c : f.causes) {
    Json parameters = Json::array();
    for (const CauseParameter& p : c.parameters)
      parameters.push_back({{"name", p.name},
                            {"value", number(p.value)},
                            {"unit", p.unit},
                            {"std", number(p.std)},
                            {"ci95", {number(p.low), number(p.high)}}});
    out.push_back({{"effect", c.effect},
                   {"where", c.where},
                   {"verdict", name_of(c.verdict)},
                   {"parameters", parameters},
                   {"delta_bic", number(c.delta_bic)},
                   {"lm", number(c.lm)},
                   {"visible_share", number(c.visible_share)},
                   {"torque_share", number(c.torque_share)},
                   {"class", rivals(c.members)},
                   {"rivals", rivals(c.rivals)},
                   {"gain", gain(c.gain)}});
  }
  return out;
}

Json candidates(const Finding& f) {
  Json out = Json::array();
  for (const CandidateScore& c : f.candidates)
    out.push_back({{"effect", c.effect},
                   {"where", c.where},
                   {"delta_bic", number(c.delta_bic)},
                   {"lm", number(c.lm)},
                   {"visible_share", number(c.visible_share)},
                   {"shape", c.shape}});
  return out;
}

Json audit(const Finding& f) {
  Json out = Json::array();
  for (const ChannelFault& a : f.audit)
    out.push_back({{"fault", a.fault},
                   {"where", a.where},
                   {"channel", a.channel},
                   {"value", number(a.value)},
                   {"unit", a.unit},
                   {"std", number(a.std)},
                   {"significance", number(a.significance)},
                   {"severity", a.severity == FaultSeverity::kFault ? "fault" : "note"},
                   {"source", a.source.empty() ? Json() : Json(a.source)},
                   {"evidence", a.evidence}});
  return out;
}

Json next_experiment(const Finding& f) {
  if (!f.next_experiment) return {};
  const NextExperiment& next = *f.next_experiment;
  Json names = Json::array(), pairs = Json::array();
  for (const ExperimentPair& p : next.pairs) {
    names.push_back({p.effect, p.rival});
    pairs.push_back({{"effect", p.effect},
                     {"where", p.where},
                     {"rival", p.rival},
                     {"rival_where", p.rival_where},
                     {"delta_bic", number(p.delta_bic)},
                     {"expected_delta_bic", number(p.expected_delta_bic)}});
  }
  return {{"sentence", next.sentence},
          {"separates", names},
          {"pairs", pairs},
          {"expected_delta_bic", number(next.expected_delta_bic)},
          {"trajectory", next.trajectory.empty() ? Json() : Json(next.trajectory)}};
}

/// Every n-th value, so that at most kMostPoints are left.
std::vector<double> thinned(const std::vector<double>& values) {
  const std::size_t stride = (values.size() + kMostPoints - 1) / kMostPoints;
  if (stride <= 1) return values;
  std::vector<double> out;
  for (std::size_t k = 0; k < values.size(); k += stride) out.push_back(values[k]);
  return out;
}

Json curves(const EvidencePlot& plot) {
  Json out = Json::array();
  for (const EvidenceCurve& c : plot.curves)
    out.push_back({{"model", c.model},
                   {"mean", rounded(c.mean)},
                   {"low", rounded(c.low)},
                   {"high", rounded(c.high)}});
  return out;
}

template <class T, class F>
Json list(const std::vector<T>& items, F item) {
  Json out = Json::array();
  for (const T& i : items) out.push_back(item(i));
  return out;
}

Json simulated(const SimulatedMotion& m) {
  return {{"driven_by", m.driven_by},
          {"window", number(m.window)},
          {"windows", m.windows},
          {"failed", {{"base", m.base_failed}, {"extended", m.extended_failed}}},
          {"reason", m.reason.empty() ? Json() : Json(m.reason)},
          {"joints", list(m.joints, [](const SimulatedSeries& s) {
             return Json{{"joint", s.joint},
                         {"unit", s.unit},
                         {"rmse_base", number(s.base_rmse)},
                         {"rmse_extended", number(s.extended_rmse)}};
           })}};
}

}  // namespace

std::string diagnose_result_json(const DiagnoseRun& run) {
  const Finding& f = run.finding;
  return io::text(
      {{"schema", "diffnea/diagnose/1"},
       {"model", f.model.name},
       {"verdict", name_of(f.verdict)},
       {"sentence", f.sentence},
       {"base", f.base},
       {"held_out", f.held_out},
       {"audit", audit(f)},
       {"causes", causes(f)},
       {"witness", list(f.witness,
                        [](const Witness& w) {
                          return Json{{"where", w.where},
                                      {"variables", w.variables},
                                      {"share", number(w.share)},
                                      {"delta_bic", number(w.delta_bic)}};
                        })},
       {"grey_box", list(f.grey_box,
                         [](const GreyBox& g) {
                           return Json{{"where", g.where},
                                       {"unit", g.unit},
                                       {"variables", g.variables},
                                       {"bumps", g.bumps},
                                       {"effective_parameters", number(g.effective_parameters)},
                                       {"bound", number(g.bound)},
                                       {"torque_rms", number(g.torque_rms)},
                                       {"before", number(g.before)},
                                       {"after", number(g.after)}};
                         })},
       {"absorbed", list(f.absorbed,
                         [](const Absorbed& a) {
                           return Json{{"effect", a.effect},
                                       {"where", a.where},
                                       {"visible_share", number(a.visible_share)}};
                         })},
       {"refused", list(f.refused,
                        [](const Refusal& r) {
                          return Json{{"effect", r.effect},
                                      {"where", r.where},
                                      {"reason", r.reason},
                                      {"delta_bic", number(r.delta_bic)}};
                        })},
       {"candidates", candidates(f)},
       {"gain", gain(f.gain)},
       {"next_experiment", next_experiment(f)},
       {"joints", list(f.joints,
                       [](const JointGain& j) {
                         return Json{{"joint", j.joint},
                                     {"unit", j.unit},
                                     {"torque_rms", number(j.torque_rms)},
                                     {"base", number(j.base)},
                                     {"extended", number(j.extended)},
                                     {"noise_floor", number(j.noise_floor)}};
                       })},
       {"simulated", simulated(f.simulated)},
       {"ball", io::ball_summary(f.ball)},
       {"noise", f.noise},
       {"lack_of_fit", {{"f", number(f.lack_of_fit)}, {"p", number(f.lack_of_fit_p)}}},
       {"preprocessing",
        {{"filter_hz", number(f.plan.filter_hz)},
         {"decimated_to_hz", number(f.plan.decimator.rate_hz / f.plan.decimator.factor)},
         {"quarantined", f.data_report.quarantined},
         {"extra_channels", f.data_report.extra_channels},
         {"notes", f.data_report.notes}}},
       {"notes", f.notes},
       {"summary", {{"seconds", number(f.seconds)}, {"interrupted", f.interrupted}}},
       {"reproduce", io::reproduce(run.reproduce)}},
      1);
}

std::string diagnose_series_json(const Finding& finding) {
  return io::text(
      {{"schema", "diffnea/diagnose-series/1"},
       {"model", finding.model.name},
       {"joints", list(finding.series,
                       [](const ResidualSeries& s) {
                         Json out{{"joint", s.joint}, {"unit", s.unit}};
                         const auto put = [&](const char* key, const std::vector<double>& values) {
                           out[key] = rounded(thinned(values));
                         };
                         put("time", s.time);
                         put("measured", s.measured);
                         put("base", s.base);
                         put("extended", s.extended);
                         put("q", s.q);
                         put("qd", s.qd);
                         put("qdd", s.qdd);
                         return out;
                       })},
       {"simulated", list(finding.simulated.joints,
                          [](const SimulatedSeries& s) {
                            return Json{
                                {"joint", s.joint},        {"unit", s.unit},
                                {"time", rounded(s.time)}, {"measured", rounded(s.measured)},
                                {"base", rounded(s.base)}, {"extended", rounded(s.extended)}};
                          })},
       {"grey_box",
        list(finding.grey_box,
             [](const GreyBox& g) {
               Json at = Json::array();
               for (const std::vector<double>& values : g.at) at.push_back(rounded(values));
               return Json{
                   {"where", g.where}, {"variables", g.variables},    {"units", g.units},
                   {"at", at},         {"torque", rounded(g.torque)}, {"std", rounded(g.std)}};
             })},
       {"ball", io::ball_columns(finding.ball)},
       {"plots", list(finding.plots,
                      [](const EvidencePlot& p) {
                        return Json{{"kind", p.kind},
                                    {"joint", p.joint},
                                    {"effect", p.effect.empty() ? Json() : Json(p.effect)},
                                    {"x_name", p.x_name},
                                    {"x_unit", p.x_unit},
                                    {"y_name", p.y_name},
                                    {"y_unit", p.y_unit},
                                    {"mark", number(p.mark)},
                                    {"x", rounded(p.x)},
                                    {"curves", curves(p)}};
                      })}},
      -1);
}

}  // namespace diffnea
