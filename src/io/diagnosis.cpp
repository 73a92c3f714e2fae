#include <diffnea/io/diagnosis.hpp>

#include "io/json_numbers.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::number;
using io::rounded;

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
                   {"visible_share", number(c.visible_share)}});
  return out;
}

template <class T, class F>
Json list(const std::vector<T>& items, F item) {
  Json out = Json::array();
  for (const T& i : items) out.push_back(item(i));
  return out;
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
       {"audit", list(f.audit, [](const ChannelFault& c) {
          return Json{{"fault", c.fault}, {"where", c.where}, {"value", number(c.value)}, {"unit", c.unit}, {"evidence", c.evidence}};
        })},
       {"causes", causes(f)},
       {"witness", list(f.witness,
                        [](const Witness& w) {
                          return Json{{"where", w.where},
                                      {"variables", w.variables},
                                      {"share", number(w.share)},
                                      {"delta_bic", number(w.delta_bic)}};
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
       {"joints", list(f.joints,
                       [](const JointGain& j) {
                         return Json{{"joint", j.joint},
                                     {"unit", j.unit},
                                     {"torque_rms", number(j.torque_rms)},
                                     {"base", number(j.base)},
                                     {"extended", number(j.extended)},
                                     {"noise_floor", number(j.noise_floor)}};
                       })},
       {"lack_of_fit", {{"f", number(f.lack_of_fit)}, {"p", number(f.lack_of_fit_p)}}},
       {"preprocessing",
        {{"filter_hz", number(f.plan.filter_hz)},
         {"decimated_to_hz", number(f.plan.decimator.rate_hz / f.plan.decimator.factor)},
         {"quarantined", f.data_report.quarantined}}},
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
                         return Json{{"joint", s.joint},        {"unit", s.unit},
                                     {"time", rounded(s.time)}, {"measured", rounded(s.measured)},
                                     {"base", rounded(s.base)}, {"extended", rounded(s.extended)},
                                     {"q", rounded(s.q)},       {"qd", rounded(s.qd)},
                                     {"qdd", rounded(s.qdd)}};
                       })}},
      -1);
}

}  // namespace diffnea
