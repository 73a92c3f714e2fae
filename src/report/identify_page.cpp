#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/identify_text.hpp>

#include "report/chart.hpp"
#include "report/fit_words.hpp"
#include "report/format.hpp"
#include "report/html.hpp"

namespace diffnea {
namespace {

using namespace report;

/// Points of all charts together: 4 numbers of some 8 characters each stay below 3 MB.
constexpr std::size_t kMaxPoints = 90'000;
/// Columns of pixels in all drawings together: each some 25 characters in up to 3 lines, below 1
/// MB.
constexpr std::size_t kMaxColumns = 14'000;

/// The shortest step in time, which is that of the decimated grid.
double period(const std::vector<double>& time) {
  double out = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < time.size(); ++k)
    if (time[k] > time[k - 1]) out = std::min(out, time[k] - time[k - 1]);
  return out;
}

/// Every `stride`-th point, runs one after the other on one axis; a gap between them and where rows
/// are missing.
TorqueSeries on_one_axis(const TorqueSeries& in, std::size_t stride) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const double longest = 1.5 * static_cast<double>(stride) * period(in.time);
  TorqueSeries out;
  out.joint = in.joint;
  out.unit = in.unit;
  double offset = 0.0;
  for (std::size_t k = 0; k < in.time.size(); k += stride) {
    double t = in.time[k] + offset;
    const bool next_run = !out.time.empty() && t <= out.time.back();
    if (next_run) {
      offset += out.time.back() + 0.04 * (out.time.back() - out.time.front()) - t;
      t = in.time[k] + offset;
    }
    if (next_run || (!out.time.empty() && t - out.time.back() > longest)) {
      out.time.push_back(0.5 * (out.time.back() + t));
      for (std::vector<double>* y : {&out.measured, &out.fitted, &out.nominal}) y->push_back(kNaN);
    }
    out.time.push_back(t);
    out.measured.push_back(in.measured[k]);
    out.fitted.push_back(in.fitted[k]);
    out.nominal.push_back(in.nominal[k]);
  }
  return out;
}

std::vector<TorqueSeries> on_one_axis(const std::vector<TorqueSeries>& in, std::size_t budget) {
  std::size_t points = 0;
  for (const TorqueSeries& s : in) points += s.time.size();
  const std::size_t stride = std::max<std::size_t>(1, (points + budget - 1) / budget);
  std::vector<TorqueSeries> out;
  for (const TorqueSeries& s : in) out.push_back(on_one_axis(s, stride));
  return out;
}

std::vector<double> difference(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> out(a.size());
  std::ranges::transform(a, b, out.begin(), std::minus<>());
  return out;
}

std::string chart_keys() {
  return "<p class='faint'><span class='key measured'></span>measured"
         "<span class='key fitted'></span>fitted<span class='key nominal'></span>model before"
         "; samples that were left out are gaps"
         "<span class='screen'>; drag to zoom, double-click to see all</span></p>\n";
}

/// What is left over depends on velocity where friction is described wrongly.
std::string velocity_chart(const TorqueSeries& s) {
  constexpr int kBins = 24;
  if (s.velocity.empty()) return "";
  const std::vector<Bin> bins = binned(s.velocity, difference(s.fitted, s.measured), kBins);
  if (bins.size() < 2) return "";
  const std::string speed = s.unit == "N" ? "m/s" : "rad/s";
  return "<h4>error over velocity <small>mean and its 95 % interval; equally many samples in each "
         "bin</small></h4>"
         "\n<div class='binned'>" +
         binned_chart(bins, speed, "error " + unit(s.unit), 150) + "</div>\n";
}

/// @param what  is drawn: "torque"
/// @param all   the same joints with every point, for averages
std::string charts(const std::vector<TorqueSeries>& list, const std::vector<TorqueSeries>& all,
                   const std::string& what, int columns) {
  std::string out;
  double first = std::numeric_limits<double>::infinity(), last = -first;
  for (const TorqueSeries& s : list) {
    if (s.time.empty()) continue;
    first = std::min(first, s.time.front());
    last = std::max(last, s.time.back());
  }
  for (std::size_t j = 0; j < list.size(); ++j) {
    const TorqueSeries& s = list[j];
    const std::string index = std::to_string(j), u = unit(s.unit);
    if (s.time.empty()) {
      out += "<h3>" + escape(s.joint) + " <small>not measured</small></h3>\n";
      continue;
    }
    const std::vector<double> after = difference(s.fitted, s.measured);
    out += "<section class='joint'><h3>" + escape(s.joint) + " <small>" + what +
           ", and the fit's error below [" + escape(u) +
           "]</small></h3>\n<div class='chart torque' data-joint='" + index + "'>" +
           line_chart(s.time,
                      {{"measured", &s.measured}, {"nominal", &s.nominal}, {"fitted", &s.fitted}},
                      {first, last}, u, 210, columns) +
           "</div>\n<div class='chart residual' data-joint='" + index + "'>" +
           line_chart(s.time, {{"fitted", &after}}, {first, last}, "error " + u, 110, columns) +
           "</div>\n" + velocity_chart(all[j]) + "</section>\n";
  }
  return out;
}

std::string error_table(const IdentifyResult& fit) {
  const bool torque = quantity(fit) == "torque";
  std::vector<std::vector<std::string>> rows;
  for (const JointError& e : fit.errors) {
    const double first = before(fit, e), last = after(fit, e);
    std::vector<std::string> row{escape(e.joint), escape(unit(e.unit)), number(first, 3),
                                 "<b>" + number(last, 3) + "</b>"};
    if (torque)
      for (const std::string& cell :
           {percent(first / e.torque_rms), "<b>" + percent(last / e.torque_rms) + "</b>",
            number(e.torque_rms, 3)})
        row.push_back(cell);
    row.push_back(number(e.train, 3));
    if (torque) row.push_back(number(e.test_all, 3));
    row.push_back(number(e.test_raw, 3));
    rows.push_back(row);
  }
  std::vector<std::string> titles{"joint", "unit", "before", "after"};
  if (torque) titles.insert(titles.end(), {"of torque, before", "after", "rms torque"});
  titles.push_back("after, training data");
  if (torque) titles.push_back("after, with rests");
  titles.push_back(torque ? "after, unfiltered" : "after, from the measured state");
  return html_table(titles, rows, {"", "", "n", "n", "n", "n", "n", "n", "n", "n"});
}

std::string parameter_table(const IdentifyResult& fit) {
  std::vector<std::vector<std::string>> seen, unseen;
  for (const ParameterEstimate& p : fit.parameters) {
    const std::string name = escape(p.name), u = escape(unit(p.unit));
    if (p.identifiable && !p.fixed) {
      seen.push_back({name, number(p.prior), error_bar(p.prior, p.value, p.std),
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
    rows.push_back({escape(k.joint), number(k.assumed), error_bar(k.assumed, k.value, k.std),
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

std::string list(const std::vector<std::string>& items) {
  std::string out = "<ul>\n";
  for (const std::string& item : items) out += element("li", item);
  return out + "</ul>\n";
}

std::string data_notes(const IdentifyResult& fit) {
  std::vector<std::string> items;
  items.push_back(rows_text(fit));
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
  return list(items);
}

/// An argument as a shell takes it.
std::string quoted(const std::string& argument) {
  if (!argument.empty() &&
      argument.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                                 "-_./=,:@+%") == std::string::npos)
    return argument;
  std::string out = "'";
  for (const char c : argument) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string reproduce(const Reproduce& r) {
  std::string command;
  for (const std::string& argument : r.command)
    command += (command.empty() ? "" : " ") + quoted(argument);
  std::vector<std::vector<std::string>> rows;
  for (const RunInput& i : r.inputs)
    rows.push_back({escape(i.role), "<code>" + escape(i.path) + "</code>", std::to_string(i.bytes),
                    "<code>" + escape(i.sha256) + "</code>"});
  return element("pre", command) +
         html_table({"", "file", "bytes", "SHA-256"}, rows, {"", "wrap", "n", "wrap"}) +
         "<p class='faint'>diffnea " + escape(r.version) + "</p>\n";
}

std::string warnings(const IdentifyResult& fit) {
  std::vector<std::string> items;
  if (fit.summary.interrupted)
    items.push_back("The fit was interrupted: " + fit.summary.termination + ".");
  else if (!fit.summary.converged)
    items.push_back("The fit did not converge: " + fit.summary.termination + ".");
  if (!fit.physically_consistent) items.push_back("Physical consistency was not asked for.");
  if (!has_test(fit))
    items.push_back("No held-out recording (--test): the errors are of the data that were fitted.");
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
  IdentifyResult shown;  // what the charts need
  shown.test_series = on_one_axis(fit.test_series, kMaxPoints / 2);
  shown.train_series = on_one_axis(fit.train_series, kMaxPoints / 2);
  const std::size_t drawings = 2 * (shown.test_series.size() + shown.train_series.size());
  const int columns = static_cast<int>(
      std::clamp<std::size_t>(kMaxColumns / std::max<std::size_t>(drawings, 1), 120, 800));

  const std::string name = fit.model.name.empty() ? "model" : fit.model.name;
  std::string body = element("h1", "Identification of " + name);
  body += element("p", identify_headline(run), "headline") + warnings(fit);
  body += element("h2", "Error of the " + what + (held_out ? " on held-out data" : ""));
  body += error_table(fit);
  if (fit.test_series.empty() && fit.train_series.empty())
    body +=
        element("p", "The folder holds no series.json, so that no chart can be drawn.", "faint");
  if (!shown.test_series.empty())
    body += "<div data-set='test'>" + element("h2", "Held-out " + what + " over time") +
            chart_keys() + charts(shown.test_series, fit.test_series, what, columns) + "</div>\n";
  if (!shown.train_series.empty()) {
    const std::string inside =
        chart_keys() + charts(shown.train_series, fit.train_series, what, columns);
    if (shown.test_series.empty())
      body += "<div data-set='train'>" + element("h2", "The " + what + " over time") + inside +
              "</div>\n";
    else
      body += "<details data-set='train'><summary>The same for the training data</summary>\n" +
              inside + "</details>\n";
  }
  body += element("h2", "Parameters") + parameter_table(fit) + torque_constants_table(fit) +
          base_table(fit);
  body += element("h2", "Data and notes") + data_notes(fit);
  body += element("p", "Fit: " + fit.summary.termination + "; " +
                           std::to_string(fit.summary.iterations) + " iterations, " +
                           std::to_string(fit.summary.passes) +
                           (fit.summary.passes == 1 ? " pass" : " passes") + " over the data, " +
                           number(fit.summary.seconds, 2) + " s.");
  body += element("h2", "How to get this again") + reproduce(run.reproduce);
  return document("Identification of " + name, body, series_json(shown));
}

}  // namespace diffnea
