#include <algorithm>
#include <cmath>
#include <map>

#include <diffnea/report/identify_text.hpp>

#include "report/format.hpp"

namespace diffnea {
namespace {

using namespace report;

bool has_test(const FitRun& run) {
  return std::ranges::any_of(run.fit.errors,
                             [](const JointError& e) { return std::isfinite(e.test); });
}

/// "forearm.Ixx" → "forearm", "elbow.armature.armature" → "elbow.armature"
std::string owner(const std::string& name) { return name.substr(0, name.rfind('.')); }

std::string parameters_text(const FitRun& run) {
  std::vector<std::vector<std::string>> rows;
  std::vector<std::string> owners;  // in order, of what the data do not see
  std::map<std::string, std::vector<std::string>> unseen;
  std::vector<std::string> held;  // in order, each with the links or joints where
  std::map<std::string, std::string> held_at;
  for (const ParameterEstimate& p : run.fit.parameters) {
    if (!p.identifiable && !p.fixed) {
      if (!unseen.contains(owner(p.name))) owners.push_back(owner(p.name));
      unseen[owner(p.name)].push_back(p.name.substr(p.name.rfind('.') + 1));
      continue;
    }
    if (p.fixed) {
      const std::size_t dot = p.name.find('.');
      const std::string what = p.name.substr(dot + 1), place = p.name.substr(0, dot);
      if (!held_at.contains(what)) held.push_back(what);
      held_at[what] += (held_at[what].empty() ? "" : " ") + place;
      continue;
    }
    rows.push_back({p.name, value_and_std(p.value, p.std), unit(p.unit), number(p.prior),
                    p.at_bound ? "at its bound" : ""});
  }
  std::string out = "parameters that the data determine, ± one standard error\n";
  out += table({"", "value", "<unit", "prior", "<"}, rows);
  if (!owners.empty())
    out += "not visible one by one, at or near the prior (the data see combinations)\n";
  for (const std::string& name : owners) {
    std::string line = "  " + name + ":";
    for (const std::string& p : unseen[name]) line += " " + p;
    out += line + "\n";
  }
  for (const std::string& what : held)
    out += "held at the model's value: " + what + " of " + held_at[what] + "\n";
  return out;
}

std::string errors_text(const FitRun& run) {
  const bool held_out = has_test(run);
  std::vector<std::vector<std::string>> rows;
  for (const JointError& e : run.fit.errors) {
    const double before = held_out ? e.nominal_test : e.nominal_train;
    const double after = held_out ? e.test : e.train;
    rows.push_back({e.joint, unit(e.unit), number(e.torque_rms, 3), number(before, 3),
                    number(after, 3), percent(after / e.torque_rms), number(e.train, 3)});
  }
  return std::string("rms torque error, ") + (held_out ? "held out" : "on the data of the fit") +
         "\n" + table({"", "<unit", "torque", "before", "after", "of torque", "(train)"}, rows);
}

}  // namespace

std::string identify_headline(const FitRun& run) {
  const bool held_out = has_test(run);
  double torque = 0.0, before = 0.0, after = 0.0;
  int joints = 0;
  for (const JointError& e : run.fit.errors) {
    const double b = held_out ? e.nominal_test : e.nominal_train, a = held_out ? e.test : e.train;
    if (!std::isfinite(a) || !(e.torque_rms > 0.0)) continue;
    before += b / e.torque_rms;
    after += a / e.torque_rms;
    torque += 1.0;
    ++joints;
  }
  if (joints == 0) return "No torque was measured, so nothing can be said of the model's error.";
  return std::string(held_out ? "On held-out data the" : "On the data it was fitted to, the") +
         " torque error falls from " + percent(before / torque) + " to " + percent(after / torque) +
         " of the torque" +
         (joints > 1 ? " (mean of " + std::to_string(joints) + " joints)." : ".");
}

std::string identify_text(const FitRun& run) {
  const IdentifyResult& fit = run.fit;
  std::string out = parameters_text(run) + "\n" + errors_text(run);
  std::vector<std::string> notes = fit.notes;
  notes.insert(notes.end(), fit.data_report.notes.begin(), fit.data_report.notes.end());
  if (!notes.empty()) out += "\nnotes\n";
  for (const std::string& note : notes) out += "  " + note + "\n";
  out += "\n" + std::to_string(fit.summary.rows) + " rows, " + number(fit.plan.filter_hz, 3) +
         " Hz low-pass, " + std::to_string(fit.base_parameters.size()) +
         " combinations determined; " + fit.summary.termination + " in " +
         std::to_string(fit.summary.iterations) + " iterations, " + number(fit.summary.seconds, 2) +
         " s\n" + identify_headline(run) + "\n";
  return out;
}

}  // namespace diffnea
