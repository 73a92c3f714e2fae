#include <cmath>

#include <diffnea/report/diagnose_text.hpp>

#include "report/format.hpp"

namespace diffnea {
namespace {

using namespace report;

std::string causes_text(const Finding& f) {
  std::vector<std::vector<std::string>> rows;
  for (const Cause& c : f.causes) {
    std::string values, members;
    for (const CauseParameter& p : c.parameters)
      if (!std::isnan(p.std))
        values += (values.empty() ? "" : ", ") + p.name + " " + value_and_std(p.value, p.std) +
                  " " + unit(p.unit);
    for (const Rival& r : c.members)
      members += (members.empty() ? "" : ", ") + r.effect + " at " + r.where;
    rows.push_back({c.effect, c.where, values, number(c.delta_bic, 3),
                    percent(c.gain.explained_share), members});
  }
  if (rows.empty()) return "";
  return table({"cause", "<where", "<parameters ± one standard error", "ΔBIC", "held-out error²",
                "<or"},
               rows) +
         "\n";
}

std::string joints_text(const Finding& f) {
  std::vector<std::vector<std::string>> rows;
  for (const JointGain& j : f.joints)
    rows.push_back({j.joint, unit(j.unit), number(j.torque_rms, 3), number(j.base, 3),
                    number(j.extended, 3), number(j.noise_floor, 3)});
  return "torque error on held-out data (" + f.held_out + "), filtered and decimated\n" +
         table({"", "<", "torque", "base model", "extended", "noise"}, rows);
}

std::string rest_text(const Finding& f) {
  std::string out;
  for (const Witness& w : f.witness) {
    std::string variables;
    for (const std::string& v : w.variables) variables += (variables.empty() ? "" : ", ") + v;
    out += "left unexplained: the error of " + w.where + " depends on " + variables + " (" +
           percent(w.share) + ")\n";
  }
  for (const Refusal& r : f.refused)
    out += "refused: " + r.effect + " at " + r.where + ": " + r.reason + "\n";
  std::string absorbed;
  for (const Absorbed& a : f.absorbed)
    absorbed += (absorbed.empty() ? "" : ", ") + a.effect + " at " + a.where;
  if (!absorbed.empty()) out += "not visible beside the base parameters: " + absorbed + "\n";
  for (const std::string& note : f.notes) out += "note: " + note + "\n";
  return out.empty() ? "" : "\n" + out;
}

}  // namespace

std::string diagnose_text(const DiagnoseRun& run) {
  const Finding& f = run.finding;
  return std::string(name_of(f.verdict)) + ": " + f.sentence + "\n\n" + causes_text(f) +
         joints_text(f) + rest_text(f);
}

}  // namespace diffnea
