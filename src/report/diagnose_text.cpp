#include <algorithm>
#include <cmath>

#include <diffnea/report/diagnose_text.hpp>

#include "report/ball_section.hpp"
#include "report/diagnose_words.hpp"
#include "report/drive_words.hpp"
#include "report/follows_words.hpp"
#include "report/format.hpp"
#include "report/sentence.hpp"

namespace diffnea {
namespace {

using namespace report;

/// Parameters of one cause that the terminal shows; a payload has ten.
constexpr std::size_t kMostParameters = 4;
/// Names in a row of what cannot be seen.
constexpr std::size_t kMostAbsorbed = 8;

std::string listed(const std::vector<Rival>& rivals, const std::string& where) {
  std::string out;
  for (const Rival& r : rivals)
    out += (out.empty() ? "" : ", ") + (r.where == where ? plain(r.effect) : at(r.effect, r.where));
  return out;
}

std::string causes_text(const Finding& f) {
  if (f.causes.empty()) return "";
  std::vector<std::vector<std::string>> rows, values;
  for (const Cause& c : f.causes) {
    rows.push_back({at(c.effect, c.where), number(c.delta_bic, 3), removes(c),
                    percent(c.visible_share), listed(c.members, c.where)});
    std::size_t shown = 0;
    for (const CauseParameter& parameter : c.parameters) {
      const CauseParameter p = as_read(c.effect, parameter);
      if (std::isnan(p.std)) continue;  // held
      if (++shown > kMostParameters) continue;
      values.push_back({shown == 1 ? at(c.effect, c.where) : "", plain(p.name),
                        value_and_interval(p), p.unit == "1" ? "" : unit(p.unit)});
    }
    if (shown > kMostParameters)
      values.push_back(
          {"", "and " + std::to_string(shown - kMostParameters) + " more", "in result.json", ""});
  }
  return table({"cause", "ΔBIC", "removes", "visible", "<or"}, rows) + "\n" +
         table({"parameter", "<", "<value and its 95 % interval", "<"}, values) + "\n";
}

std::string joints_text(const Finding& f) {
  std::vector<std::vector<std::string>> rows;
  bool torque = false;
  for (const JointGain& j : f.joints) {
    const bool position = is_of_positions(j);
    const double scale = position ? 1e3 : 1.0;
    torque = torque || !position;
    rows.push_back({j.joint, position ? "m" + j.unit : unit(j.unit),
                    is_ball(j) ? "" : number(scale * j.torque_rms, 3), number(scale * j.base, 3),
                    number(scale * j.extended, 3), number(scale * j.noise_floor, 3)});
  }
  return error_of(f) + " on held-out data (" + f.held_out + ")" +
         (torque ? ", filtered and decimated\n" : "\n") +
         table({"", "<",
                torque                ? "torque"
                : follows_commands(f) ? "motion"
                                      : "",
                "base model", "extended", "noise"},
               rows);
}

std::string drives_text(const Finding& f) {
  if (f.drives.empty()) return "";
  return "\nnumbers of the description that the recordings refute, ± one standard error\n" +
         table({"", "<", "described", "fitted", "<"}, drive_rows(f));
}

std::string ball_text(const Finding& f) {
  if (!f.ball) return "";
  const std::string words = ball_sentence(*f.ball, f.causes.empty());
  return words.empty() ? "" : "\n" + capital(words) + ".\n";
}

/// What biases all that follows.
std::string faults_text(const Finding& f) {
  std::string out;
  for (const std::string& warning : fault_warnings(f)) out += warning + "\n";
  for (const std::string& note : f.notes)
    if (note.starts_with(kWarning)) out += note + "\n";
  return out.empty() ? "" : out + "\n";
}

std::string rest_text(const Finding& f) {
  std::string out;
  for (const Witness& w : f.witness)
    out += "left unexplained: the error of " + w.where + " " + witness_clause(w) + " (" +
           percent(w.share) + ")\n";
  for (const Cause& c : f.causes)
    if (!c.rivals.empty())
      out += "next rival of " + at(c.effect, c.where) + ": " +
             rival_words(c.rivals.front(), c.where) + " in BIC\n";
  for (const RefusedTogether& r : refused_together(f.refused))
    out += "refused: " + r.what + ": " + r.reason + "\n";
  std::string absorbed;
  for (std::size_t k = 0; k < std::min(f.absorbed.size(), kMostAbsorbed); ++k)
    absorbed += (k ? ", " : "") + at(f.absorbed[k].effect, f.absorbed[k].where);
  if (f.absorbed.size() > kMostAbsorbed)
    absorbed += " and " + std::to_string(f.absorbed.size() - kMostAbsorbed) + " more";
  if (!absorbed.empty()) out += "not visible beside the base parameters: " + absorbed + "\n";
  if (f.next_experiment)
    out +=
        "next experiment" +
        (f.next_experiment->trajectory.empty() ? "" : " (" + f.next_experiment->trajectory + ")") +
        ": " + f.next_experiment->sentence + "\n";
  if (f.ball)
    for (const std::string& line : flagged_lines(*f.ball)) out += "not fitted: " + line + "\n";
  for (const ChannelFault& a : f.audit)
    if (a.severity == FaultSeverity::kNote) out += a.channel + ": " + a.evidence + "\n";
  for (const std::string& text : reservations(f))
    if (!text.starts_with(kWarning)) out += "note: " + text + "\n";
  for (const std::string& note : f.notes)
    if (!note.starts_with(kWarning)) out += "note: " + note + "\n";
  for (const std::string& note : f.data_report.notes) out += "note: " + note + "\n";
  return out.empty() ? "" : "\n" + out;
}

}  // namespace

std::string diagnose_text(const DiagnoseRun& run) {
  const Finding& f = run.finding;
  const std::string follows = follows_sentence(f), apart = apart_sentence(f);
  return (follows.empty() ? "" : follows + "\n\n") + plain(name_of(f.verdict)) + ": " +
         unit(verdict_sentence(f)) + "\n\n" + faults_text(f) + causes_text(f) + joints_text(f) +
         drives_text(f) + (apart.empty() ? "" : "\n" + apart + "\n") + ball_text(f) + rest_text(f);
}

}  // namespace diffnea
