#include <algorithm>
#include <cmath>
#include <numeric>

#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/identify_text.hpp>
#include <diffnea/runs/page_data.hpp>

#include "report/ball_section.hpp"
#include "report/fit_words.hpp"
#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea {
namespace {

using namespace report;

/// Charts of a set over time, and the error over velocity, which shows a friction that is wrong.
std::string charts(const std::string& set, const std::vector<TorqueSeries>& list,
                   const std::string& what) {
  std::vector<std::size_t> all(list.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::string out = open_and_folded(set, shown(list), all, {}, what, {});
  for (std::size_t j = 0; j < list.size(); ++j) {
    const TorqueSeries& s = list[j];
    if (s.velocity.empty() || std::ranges::min(s.velocity) == std::ranges::max(s.velocity))
      continue;
    out += "<h4>" + escape(s.joint) +
           ": error over velocity <small>mean and its 95 % interval; equally many samples in each "
           "bin</small></h4>\n" +
           drawing("velocity", {{"set", set}, {"joint", std::to_string(j)}}) + "\n";
  }
  return out;
}

/// A parameter's place on its own scale, before and after.
std::string estimate(double prior, double value, double std) {
  return drawing(
      "estimate",
      {{"prior", number(prior, 7)}, {"value", number(value, 7)}, {"std", number(std, 7)}},
      "drawing", "span");
}

std::string error_table(const IdentifyResult& fit) {
  const bool torque = quantity(fit) == "torque",
             joints =
                 !std::ranges::all_of(fit.errors, [](const JointError& e) { return is_ball(e); });
  std::vector<std::vector<std::string>> rows;
  for (const JointError& e : fit.errors) {
    const double first = before(fit, e), last = after(fit, e);
    const auto [scale, unit_shown] = shown_unit(e);
    const auto value = [scale = scale](double x) { return number(scale * x, 3); };
    std::vector<std::string> row{escape(e.joint), escape(unit_shown), value(first),
                                 "<b>" + value(last) + "</b>"};
    if (torque && is_ball(e))
      row.insert(row.end(), 3, "");
    else if (torque)
      for (const std::string& cell :
           {percent(first / e.torque_rms), "<b>" + percent(last / e.torque_rms) + "</b>",
            value(e.torque_rms)})
        row.push_back(cell);
    row.push_back(value(e.train));
    if (torque) row.push_back(is_ball(e) ? "" : value(e.test_all));
    if (joints) row.push_back(is_ball(e) ? "" : value(e.test_raw));
    rows.push_back(row);
  }
  std::vector<std::string> titles{"joint", "unit", "before", "after"};
  if (torque) titles.insert(titles.end(), {"of torque, before", "after", "rms torque"});
  titles.push_back("after, training data");
  if (torque) titles.push_back("after, with rests");
  if (joints) titles.push_back(torque ? "after, unfiltered" : "after, from the measured state");
  return html_table(titles, rows, {"", "", "n", "n", "n", "n", "n", "n", "n", "n"});
}

std::string parameter_table(const IdentifyResult& fit) {
  std::vector<std::vector<std::string>> seen, unseen;
  for (const ParameterEstimate& p : fit.parameters) {
    const std::string name = escape(p.name), u = escape(unit(p.unit));
    if (p.identifiable && !p.fixed) {
      seen.push_back({name, number(p.prior), estimate(p.prior, p.value, p.std),
                      value_and_std(p.value, p.std), u, p.at_bound ? "at its bound" : ""});
    } else {
      unseen.push_back(
          {name, number(p.prior), number(p.value), u, p.fixed ? "held" : "not visible by itself"});
    }
  }
  std::string out = html_table({"parameter", "before", "", "fitted", "unit", ""}, seen,
                               {"", "n", "", "n", "", ""});
  out +=
      "<p class='faint'>Tick: the model before. Dot: fitted. Bar: two standard errors to either "
      "side. "
      "Each row has its own scale.</p>\n";
  if (unseen.empty()) return out;
  return out + "<details><summary>" + std::to_string(unseen.size()) +
         " parameters that were held, or that the data do not show one by one</summary>\n<div "
         "class='held'>" +
         html_table({"parameter", "before", "value", "unit", ""}, unseen, {"", "n", "n", "", ""}) +
         "</div></details>\n";
}

std::string torque_constants_table(const IdentifyResult& fit) {
  if (fit.torque_constants.empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const TorqueConstant& k : fit.torque_constants)
    rows.push_back({escape(k.joint), number(k.assumed), estimate(k.assumed, k.value, k.std),
                    value_and_std(k.value, k.std), escape(unit(k.unit))});
  return element("h3", "Torque constants") +
         html_table({"joint", "assumed", "", "calibrated", "unit"}, rows, {"", "n", "", "n", ""});
}

std::string base_table(const IdentifyResult& fit) {
  if (fit.base_parameters.empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const BaseParameter& b : fit.base_parameters)
    rows.push_back({escape(b.expression), value_and_std(b.value, b.std)});
  return "<details><summary>" + std::to_string(rows.size()) +
         " combinations of parameters that the data determine (base parameters, SI "
         "units)</summary>\n" +
         html_table({"combination", "value"}, rows, {"wrap", "n"}) + "</details>\n";
}

/// Error over the length of the simulated windows: how long the simulation follows the robot. Of
/// one length the table of errors says it all, unless windows fall apart.
std::string horizon_section(const IdentifyResult& fit) {
  const bool held_out = has_test(fit);
  const bool grows = std::ranges::any_of(fit.horizons, [&](const HorizonError& e) {
    return e.horizon != fit.horizons.front().horizon;
  });
  if (!grows && std::ranges::all_of(fit.horizons, [&](const HorizonError& e) {
        return (held_out ? e.test_apart : e.apart) == 0;
      }))
    return "";
  std::vector<std::string> joints;
  std::vector<std::vector<std::string>> rows;
  for (const HorizonError& e : fit.horizons) {
    if (grows && std::ranges::find(joints, e.joint) == joints.end()) joints.push_back(e.joint);
    const int windows = held_out ? e.test_windows : e.windows;
    const int apart = held_out ? e.test_apart : e.apart;
    rows.push_back({number(e.horizon, 3), escape(e.joint), escape(unit(e.unit)),
                    number(held_out ? e.nominal_test : e.nominal_train, 3),
                    "<b>" + number(held_out ? e.test : e.train, 3) + "</b>", number(e.train, 3),
                    std::to_string(apart) + " of " + std::to_string(windows)});
  }
  std::string drawings;
  for (const std::string& joint : joints)
    drawings += "<figure><figcaption>" + escape(joint) +
                " <small>error over horizon, before and after</small></figcaption>" +
                drawing("horizon", {{"joint", joint}, {"set", held_out ? "test" : "train"}}) +
                "</figure>\n";
  return element("h2", std::string("Error over horizon") + (held_out ? ", held out" : "")) +
         element("p",
                 "The simulation follows the robot over windows of up to " +
                     number(fit.summary.horizon, 3) +
                     " s. Each window starts from a first state of its own, which is estimated.",
                 "faint") +
         "<div class='evidence'>\n" + drawings +
         "</div>\n<details><summary>The figures</summary>\n" +
         html_table({"horizon [s]", "joint", "unit", "before", "after", "after, training data",
                     "windows that fall apart"},
                    rows, {"n", "", "", "n", "n", "n", "n"}) +
         "</details>\n";
}

std::string data_notes(const IdentifyResult& fit) {
  std::vector<std::string> items;
  items.push_back(rows_text(fit));
  if (fit.plan.filter_hz > 0.0)  // not of a ball alone
    items.push_back("positions low-passed at " + number(fit.plan.filter_hz, 3) +
                    " Hz; torques and model decimated to " +
                    number(fit.plan.decimator.rate_hz / fit.plan.decimator.factor, 3) + " Hz");
  if (fit.plan.timing_jitter > 0.01)
    items.push_back(percent(fit.plan.timing_jitter) + " of the sampling intervals are irregular");
  for (const QuarantinedRow& row : fit.data_report.quarantined_rows) {
    if (items.size() > 12) break;
    items.push_back("line " + std::to_string(row.line) + " quarantined: " + row.reason);
  }
  for (const std::string& channel : fit.data_report.extra_channels)
    items.push_back("column " + channel + " is kept, not used");
  for (const std::string& note : notes(fit))
    if (!note.starts_with(kWarning)) items.push_back(note);  // warnings stand on top
  return html_list(items);
}

std::string warnings(const IdentifyResult& fit) {
  std::vector<std::string> items;
  if (fit.summary.interrupted)
    items.push_back("Interrupted: " + fit.summary.termination + ".");
  else if (!fit.summary.converged)
    items.push_back("The fit did not converge: " + fit.summary.termination + ".");
  if (!fit.physically_consistent) items.push_back("Physical consistency was not asked for.");
  if (!has_test(fit))
    items.push_back(
        "No held-out recording (--test) of which a row counts: the errors are of the data that "
        "were fitted.");
  for (const std::string& note : fit.notes)
    if (note.starts_with(kWarning)) items.push_back(note);
  std::string out;
  for (const std::string& item : items) out += element("p", item, "warning");
  return out;
}

}  // namespace

std::string identify_page(const FitRun& run) {
  const IdentifyResult& fit = run.fit;
  const bool held_out = has_test(fit);
  const std::string what = quantity(fit);
  const std::string name = fit.model.name.empty() ? "model" : fit.model.name;
  std::string body = element("h1", "Identification of " + name);
  body += element("p", identify_headline(run), "headline") + warnings(fit);
  body += element("h2", "Error of the " + what + (held_out ? " on held-out data" : ""));
  body += error_table(fit) + horizon_section(fit);
  if (fit.ball) body += ball_section(*fit.ball, {});
  if (fit.test_series.empty() && fit.train_series.empty() && !fit.ball)
    body +=
        element("p", "The folder holds no series.json, so that no chart can be drawn.", "faint");
  if (!fit.test_series.empty())
    body +=
        element("h2", "Held-out " + what + " over time") + charts("test", fit.test_series, what);
  if (!fit.train_series.empty()) {
    const std::string inside = charts("train", fit.train_series, what);
    body += fit.test_series.empty()
                ? element("h2", "The " + what + " over time") + inside
                : "<details><summary>The same for the training data</summary>\n" + inside +
                      "</details>\n";
  }
  body += element("h2", "Parameters") + parameter_table(fit) + torque_constants_table(fit) +
          base_table(fit);
  body += element("h2", "Data and notes") + data_notes(fit);
  body += element("p", "Fit: " + fit.summary.termination + "; " +
                           std::to_string(fit.summary.iterations) + " iterations, " +
                           std::to_string(fit.summary.passes) +
                           (fit.summary.passes == 1 ? " pass" : " passes") + " over the data, " +
                           number(fit.summary.seconds, 2) + " s.");
  return document("Identification of " + name, body + reproduce(run.reproduce), page_data(run));
}

}  // namespace diffnea
