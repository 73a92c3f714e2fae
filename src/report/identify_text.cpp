#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <diffnea/report/identify_text.hpp>

#include "report/ball_section.hpp"
#include "report/fit_words.hpp"
#include "report/format.hpp"

namespace diffnea {
namespace {

using namespace report;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

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
    out +=
        "not visible one by one (the data see combinations; a single value may have moved far and "
        "means nothing)\n";
  for (const std::string& name : owners) {
    std::string line = "  " + name + ":";
    for (const std::string& p : unseen[name]) line += " " + p;
    out += line + "\n";
  }
  for (const std::string& what : held)
    out += "held at the model's value: " + what + " of " + held_at[what] + "\n";
  return out;
}

std::string torque_constants_text(const IdentifyResult& fit) {
  if (fit.torque_constants.empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const TorqueConstant& k : fit.torque_constants)
    rows.push_back({k.joint, number(k.assumed), value_and_std(k.value, k.std), unit(k.unit)});
  return "\ntorque constants, ± one standard error\n" +
         table({"", "assumed", "calibrated", "<unit"}, rows);
}

std::string errors_text(const IdentifyResult& fit) {
  const bool torque = quantity(fit) == "torque";
  std::vector<std::vector<std::string>> rows;
  for (const JointError& e : fit.errors) {
    const auto [scale, unit_shown] = shown_unit(e);
    const auto value = [scale = scale](double x) { return number(scale * x, 3); };
    const bool of_torque = torque && !is_ball(e);
    std::vector<std::string> row{e.joint, unit_shown};
    if (torque) row.push_back(of_torque ? value(e.torque_rms) : "");
    row.push_back(value(before(fit, e)));
    row.push_back(value(after(fit, e)));
    if (torque) row.push_back(of_torque ? percent(after(fit, e) / e.torque_rms) : "");
    if (torque) row.push_back(of_torque ? value(e.test_all) : "");
    row.push_back(value(e.train));
    rows.push_back(row);
  }
  const std::vector<std::string> titles =
      torque ? std::vector<std::string>{"",      "<unit",     "torque",       "before",
                                        "after", "of torque", "(with rests)", "(train)"}
             : std::vector<std::string>{"", "<unit", "before", "after", "(train)"};
  return "rms " + quantity(fit) + " error, " +
         (has_test(fit) ? "held out" : "on the data of the fit") + "\n" + table(titles, rows);
}

/// "falls from 0.5 to 0.1 rad", as far as the digits shown can tell. @param unit  with what follows
std::string from_to(const std::string& from, const std::string& to, bool rises,
                    const std::string& unit) {
  if (from == number(kNaN))
    return "is " + to + unit + " (that of the model before cannot be computed)";
  if (from == to) return "stays at " + to + unit;
  return (rises ? "rises from " : "falls from ") + from + " to " + to + unit;
}

std::string torque_sentence(const IdentifyResult& fit) {
  double first = 0.0, last = 0.0, with_rests = 0.0;
  int joints = 0;
  for (const JointError& e : fit.errors) {
    if (is_ball(e) || !std::isfinite(after(fit, e)) || !(e.torque_rms > 0.0)) continue;
    first += before(fit, e) / e.torque_rms;
    last += after(fit, e) / e.torque_rms;
    with_rests += (std::isfinite(e.test_all) ? e.test_all : after(fit, e)) / e.torque_rms;
    ++joints;
  }
  if (joints == 0) return "";
  return "torque error " +
         from_to(percent(first / joints), percent(last / joints), last > first, " of the torque") +
         (joints > 1 ? " (mean of " + std::to_string(joints) + " joints)" : "") +
         (with_rests > 1.1 * last
              ? "; " + percent(with_rests / joints) + " with the samples at which a joint rests."
              : ".");
}

/// "0.1–0.3" of several numbers, "0.1" where all are alike to the digits shown.
std::string range_text(const std::vector<double>& values) {
  const auto [low, high] = std::ranges::minmax(values);
  const std::string from = number(low, 3), to = number(high, 3);
  return from == to ? from : from + "–" + to;
}

std::string position_sentence(const IdentifyResult& fit) {
  constexpr std::size_t kNamed = 3;  // joints that a sentence names one by one
  struct Group {
    std::string unit;
    bool rises;
    std::vector<const JointError*> joints;
  };
  std::vector<Group> groups;  // joints of one unit that fall, or rise
  std::size_t told = 0;
  for (const JointError& e : fit.errors) {
    if (!std::isfinite(after(fit, e)) || is_ball(e)) continue;
    ++told;
    const bool rises = after(fit, e) > before(fit, e);
    const auto same = std::ranges::find_if(
        groups, [&](const Group& g) { return g.unit == e.unit && g.rises == rises; });
    if (same != groups.end())
      same->joints.push_back(&e);
    else
      groups.push_back({e.unit, rises, {&e}});
  }
  const double horizon =
      std::isfinite(fit.summary.test_horizon) ? fit.summary.test_horizon : fit.summary.horizon;
  std::string out;
  const auto say = [&](const std::string& words) {
    out += (out.empty() ? "error of positions simulated for " + number(horizon, 3) + " s "
                        : std::string(", ")) +
           words;
  };
  for (const Group& g : groups) {
    std::vector<double> first, last;
    for (const JointError* e : g.joints) {
      first.push_back(before(fit, *e));
      last.push_back(after(fit, *e));
    }
    const bool known = std::ranges::all_of(first, [](double x) { return std::isfinite(x); });
    if (known && g.joints.size() > kNamed)
      say(from_to(range_text(first), range_text(last), g.rises, " " + g.unit) + " (" +
          (g.joints.size() == told ? "all " : "") + std::to_string(g.joints.size()) + " joints)");
    else
      for (std::size_t k = 0; k < g.joints.size(); ++k)
        say(from_to(number(first[k], 3), number(last[k], 3), g.rises,
                    " " + g.unit + " (" + g.joints[k]->joint + ")"));
  }
  return out.empty() ? out : out + ".";
}

/// The ball's error, of the table where there is no series.
std::string ball_words(const IdentifyResult& fit) {
  for (const JointError& e : fit.errors) {
    if (!is_ball(e) || !std::isfinite(after(fit, e))) continue;
    const auto [scale, unit_shown] = shown_unit(e);
    const double first = scale * before(fit, e), last = scale * after(fit, e);
    return "error of the ball's position " +
           from_to(number(first, 3), number(last, 3), last > first, " " + unit_shown) + ".";
  }
  return "";
}

std::string flagged_text(const IdentifyResult& fit) {
  if (!fit.ball || fit.ball->flagged.empty()) return "";
  std::string out = "\nof the ball, flagged: what cannot be true if the model is\n";
  for (const std::string& line : flagged_lines(*fit.ball)) out += "  " + line + "\n";
  return out;
}

}  // namespace

std::string identify_headline(const FitRun& run) {
  const IdentifyResult& fit = run.fit;
  std::string sentence = quantity(fit) == "torque" ? torque_sentence(fit) : position_sentence(fit);
  if (const std::string of_ball = ball_words(fit); !of_ball.empty())
    sentence =
        sentence.empty() ? of_ball : sentence.substr(0, sentence.size() - 1) + "; the " + of_ball;
  if (sentence.empty()) return "Nothing was measured that would show the model's error.";
  return (has_test(fit) ? "On held-out data the " : "On the data it was fitted to, the ") +
         sentence;
}

std::string identify_text(const FitRun& run) {
  const IdentifyResult& fit = run.fit;
  std::string out = parameters_text(run) + torque_constants_text(fit) + "\n" + errors_text(fit) +
                    flagged_text(fit);
  const std::vector<std::string> remarks = notes(fit);
  if (!remarks.empty()) out += "\nnotes\n";
  for (const std::string& note : remarks) out += "  " + note + "\n";
  out += "\n" + rows_text(fit) + ", " +
         (fit.plan.filter_hz > 0.0 ? number(fit.plan.filter_hz, 3) + " Hz low-pass, " : "") +
         (fit.base_parameters.empty()
              ? ""
              : std::to_string(fit.base_parameters.size()) + " combinations determined; ") +
         fit.summary.termination + " in " + std::to_string(fit.summary.iterations) +
         " iterations, " + number(fit.summary.seconds, 2) + " s\n" + identify_headline(run) + "\n";
  return out;
}

}  // namespace diffnea
