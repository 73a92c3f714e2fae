#include <algorithm>
#include <cmath>
#include <set>

#include <diffnea/report/diagnose_page.hpp>
#include <diffnea/runs/page_data.hpp>

#include "report/ball_section.hpp"
#include "report/diagnose_sections.hpp"
#include "report/diagnose_words.hpp"
#include "report/drive_words.hpp"
#include "report/follows_words.hpp"
#include "report/format.hpp"
#include "report/html.hpp"
#include "report/sentence.hpp"

namespace diffnea {
namespace {

using namespace report;

constexpr double kSameClass = 10.0;     ///< ΔBIC that a candidate needs, and that tells apart
constexpr std::size_t kMostBars = 16;   ///< candidates that are drawn
constexpr std::size_t kMostJoints = 2;  ///< that are open
constexpr std::size_t kMostRivals = 3;  ///< of a cause that are listed

bool is_cause(const Finding& f, const std::string& effect, const std::string& where) {
  return std::ranges::any_of(
      f.causes, [&](const Cause& c) { return c.effect == effect && c.where == where; });
}

bool is_member(const Finding& f, const std::string& effect, const std::string& where) {
  return std::ranges::any_of(f.causes, [&](const Cause& c) {
    return std::ranges::any_of(
        c.members, [&](const Rival& r) { return r.effect == effect && r.where == where; });
  });
}

std::string badge(Verdict verdict) {
  const char* css = verdict == Verdict::kNamed     ? "named"
                    : verdict == Verdict::kClass   ? "class"
                    : verdict == Verdict::kUnknown ? "unknown"
                                                   : "none";
  std::string text = name_of(verdict);
  return std::string("<span class='badge ") + css + "' title='" + escape(meaning(verdict)) + "'>" +
         escape(plain(text)) + "</span>";
}

/// @param most  that are listed, nearest first
std::string rival_list(const std::vector<Rival>& rivals, const std::string& where,
                       std::size_t most = kMostRivals) {
  std::string out;
  for (std::size_t k = 0; k < std::min(most, rivals.size()); ++k)
    out += (k > 0 ? ", " : "") + rival_words(rivals[k], where);
  if (rivals.size() > most) out += " and " + std::to_string(rivals.size() - most) + " more";
  return out.empty() ? "none" : out;
}

/// What a reader of several causes wants at once: what, how large, how much of the error.
std::string causes_at_once(const Finding& f) {
  if (f.causes.size() < 2) return "";
  std::vector<std::vector<std::string>> rows;
  for (const Cause& c : f.causes) {
    std::string size;
    std::size_t shown = 0;
    for (const CauseParameter& parameter : c.parameters) {
      const CauseParameter p = as_read(c.effect, parameter);
      if (std::isnan(p.std) || p.name == "smoothing" || ++shown > 2) continue;
      size += (size.empty() ? "" : ", ") + plain(p.name) + " " + value_and_interval(p) +
              (p.unit == "1" ? "" : " " + unit(p.unit));
    }
    rows.push_back({"<b>" + escape(at(c.effect, c.where)) + "</b>", escape(size), removes(c),
                    number(c.delta_bic, 3), escape(rival_list(c.members, c.where, 2))});
  }
  const bool named =
      std::ranges::all_of(f.causes, [](const Cause& c) { return c.members.empty(); });
  return html_table({"cause", "size and its 95 % interval", "removes, of what all remove held out",
                     "evidence (ΔBIC)", named ? "" : "cannot be told from"},
                    rows, {"wrap", "wrap", "n", "n", named ? "" : "wrap"}) +
         element("p",
                 "In the order in which each removes most of what those above it leave. ΔBIC: how "
                 "much worse the model is without the cause, and with another in its place; above "
                 "10 is decisive.",
                 "faint");
}

std::string head(const Finding& f, const std::string& name) {
  std::string out = element("h1", "Diagnosis of " + name);
  if (const std::string follows = follows_sentence(f); !follows.empty())
    out += element("p", follows, "verdict");
  out += "<p class='verdict'>" + badge(f.verdict) + escape(unit(verdict_sentence(f))) + "</p>\n";
  const std::string ball = f.ball ? ball_sentence(*f.ball, f.causes.empty()) : "";
  out += element("p", gained(f) + (ball.empty() ? "" : " " + capital(ball) + "."), "gained");
  for (const std::string& text : reservations(f)) out += element("p", text, "warning");
  return out + causes_at_once(f);
}

// --- over time

/// Series of the few joints that show it best, and of the others.
std::pair<std::vector<std::size_t>, std::vector<std::size_t>> affected(const Finding& f) {
  std::set<std::string> named;
  for (const Cause& c : f.causes)
    for (std::size_t begin = 0; begin <= c.where.size();) {
      const std::size_t end = std::min(c.where.find(',', begin), c.where.size());
      named.insert(c.where.substr(begin, end - begin));
      begin = end + 1;
    }
  for (const Witness& w : f.witness) named.insert(w.where);
  std::vector<std::size_t> first, rest;
  for (std::size_t j = 0; j < f.series.size(); ++j)
    (named.contains(f.series[j].joint) ? first : rest).push_back(j);
  // Those that changed most, of the named ones or of all where none is named (the tip, the base).
  const auto ratio = [&](std::size_t j) {
    for (const JointGain& g : f.joints)
      if (g.joint == f.series[j].joint) return g.base > 0.0 ? g.extended / g.base : 1.0;
    return 1.0;
  };
  if (first.empty()) std::swap(first, rest);
  std::ranges::stable_sort(first, {}, ratio);
  const std::size_t most = f.causes.empty() && f.witness.empty() ? 1 : kMostJoints;
  while (first.size() > most) {
    rest.push_back(first.back());
    first.pop_back();
  }
  std::ranges::sort(first);
  std::ranges::sort(rest);
  return {first, rest};
}

std::string over_time(const Finding& f) {
  if (f.series.empty() && (f.ball || follows_commands(f))) return "";
  if (f.series.empty())
    return element("p", "The folder holds no series.json, so that no chart can be drawn.", "faint");
  const auto [open, folded] = affected(f);
  return element("h2", "Torque on held-out data, measured and simulated") +
         open_and_folded("joints", shown(f.series), open, folded, "torque", names_of(f));
}

// --- evidence

std::string evidence(const Finding& f) {
  if (f.plots.empty()) return "";
  std::string out =
      element("h2", "Evidence") +
      "<p class='faint'>What the model lacks (measured − model) on held-out data: <span class='key "
      "nominal'></span>base model" +
      (f.causes.empty() ? "" : "<span class='key fitted'></span>extended model") +
      ". Bands: 95 % of the mean; " +
      (f.causes.empty()
           ? "where they hold zero, nothing is missing."
           : "where the blue line stays at zero, the cause explains what was missing.") +
      "</p>\n<div class='evidence'>\n";
  for (std::size_t k = 0; k < f.plots.size(); ++k) {
    const EvidencePlot& p = f.plots[k];
    const std::string title = p.kind == "correlation" ? "with the torque's rate, over the lag"
                              : p.kind == "spectrum"  ? "spectrum over position"
                                                      : "over " + p.x_name;
    out += "<figure><figcaption>" + escape(p.joint) + " <small>" + escape(p.y_name) + " " +
           escape(p.kind.ends_with("reversal") ? "around reversals" : title) +
           (p.effect.empty() ? "" : ": " + escape(plain(p.effect))) + "</small></figcaption>" +
           drawing("evidence", {{"index", std::to_string(k)}}) + "</figure>\n";
  }
  return out + "</div>\n";
}

// --- candidates

std::string candidates(const Finding& f) {
  std::string out = element("h2", "Candidates and rivals");
  std::vector<Bar> list;
  for (const CandidateScore& c : f.candidates) {
    if (list.size() >= kMostBars || (c.delta_bic < 0.0 && list.size() >= 5)) break;
    list.push_back({at(c.effect, c.where), number(c.delta_bic, 3), 0.0, std::max(c.delta_bic, 0.0),
                    is_cause(f, c.effect, c.where)    ? "cause"
                    : is_member(f, c.effect, c.where) ? "member"
                                                      : ""});
  }
  if (list.empty()) {
    out += element("p", "No candidate could be tested.");
  } else {
    out +=
        "<p class='faint'>How much better one effect alone makes the base model (ΔBIC, first "
        "step, scale logarithmic above 10; the dashed line is 10, below which nothing is "
        "accepted). Dark blue: named as a cause in the end; light blue: in the class of one. " +
        std::to_string(f.candidates.size()) + " candidates were tested.</p>\n" +
        bars(list, kSameClass);
  }
  if (f.causes.empty()) return out;
  const bool halves =
      std::ranges::any_of(f.causes, [](const Cause& c) { return !std::isnan(c.stability); });
  std::vector<std::vector<std::string>> rows;
  for (const Cause& c : f.causes) {
    rows.push_back({"<b>" + escape(at(c.effect, c.where)) + "</b>", number(c.delta_bic, 3),
                    percent(c.visible_share)});
    if (halves) rows.back().push_back(std::isnan(c.stability) ? "" : percent(c.stability));
    rows.back().push_back(escape(rival_list(c.members, c.where, c.members.size())));
    rows.back().push_back(escape(rival_list(c.rivals, c.where)));
  }
  std::vector<std::string> titles{"cause", "ΔBIC of leaving it out", "visible beside the base"};
  std::vector<const char*> kinds{"", "n", "n"};
  if (halves) {
    titles.push_back("chosen on halves of the recording");
    kinds.push_back("n");
  }
  titles.insert(titles.end(), {"cannot be told from", "rivals in its place"});
  kinds.insert(kinds.end(), {"wrap", "wrap"});
  out += html_table(titles, rows, kinds) +
         element("p",
                 "Visible: the share of what the cause does that the base parameters cannot take "
                 "over. " +
                     std::string(halves ? "Halves: the choice among a cause and its rivals is "
                                          "repeated on 50 random halves of the recording; what "
                                          "most of them do not choose is one of a class. "
                                        : "") +
                     "A rival is better or worse by that ΔBIC in the cause's place.",
                 "faint");
  return out;
}

// --- what is left open

std::string next_experiment(const Finding& f) {
  if (!f.next_experiment) return "";
  const NextExperiment& next = *f.next_experiment;
  std::vector<std::vector<std::string>> rows;
  for (const ExperimentPair& p : next.pairs)
    rows.push_back({escape(at(p.effect, p.where)), escape(at(p.rival, p.rival_where)),
                    number(p.delta_bic, 3), number(p.expected_delta_bic, 3)});
  return element("h3", "Next experiment") + element("p", next.sentence, "gained") +
         html_table({"cause", "rival", "ΔBIC now", "ΔBIC expected"}, rows, {"", "", "n", "n"}) +
         (next.trajectory.empty()
              ? ""
              : element("p", "The motion is " + next.trajectory +
                                 ", beside this page; collisions were not looked at."));
}

std::string left_open(const Finding& f) {
  std::vector<std::string> items;
  for (const Cause& c : f.causes)
    if (!c.members.empty())
      items.push_back(at(c.effect, c.where) + " cannot be told from " +
                      rival_list(c.members, c.where, c.members.size()) + " with this recording.");
  for (const Witness& w : f.witness)
    items.push_back("What is left of the error of " + w.where + " " + witness_clause(w) + ": " +
                    percent(w.share) + " of its mean square" +
                    (std::isnan(w.delta_bic) ? "" : " (ΔBIC " + number(w.delta_bic, 3) + ")") +
                    ".");
  std::string out = element("h2", "What this recording leaves open");
  const std::string next = next_experiment(f);
  if (items.empty() && next.empty() && f.refused.empty() && f.absorbed.empty())
    return out + element("p",
                         "Nothing: every effect that was tried is visible, and no rival is "
                         "within reach.");
  if (!items.empty()) out += html_list(items);
  out += next;
  if (!f.refused.empty()) {
    std::vector<std::vector<std::string>> rows;
    for (const RefusedTogether& r : refused_together(f.refused))
      rows.push_back({escape(r.what), escape(r.reason), number(r.delta_bic, 3)});
    out += element("h3", "Refused") +
           html_table({"candidate", "reason", "ΔBIC"}, rows, {"", "wrap", "n"});
  }
  if (!f.absorbed.empty()) {
    std::vector<std::vector<std::string>> rows;
    for (const Absorbed& a : f.absorbed)
      rows.push_back({escape(at(a.effect, a.where)), percent(a.visible_share)});
    out += "<details" + std::string(f.absorbed.size() <= 6 ? " open" : "") + "><summary>" +
           std::to_string(rows.size()) +
           " effects that this recording cannot show: the base parameters take them "
           "over</summary>\n" +
           html_table({"effect", "visible beside the base"}, rows, {"", "n"}) + "</details>\n";
  }
  return out;
}

// --- parameters

std::string parameters(const Finding& f) {
  if (f.causes.empty()) return "";
  std::vector<std::vector<std::string>> rows;
  for (const Cause& c : f.causes)
    for (std::size_t k = 0; k < c.parameters.size(); ++k) {
      const CauseParameter p = as_read(c.effect, c.parameters[k]);
      rows.push_back(
          {k == 0 ? "<b>" + escape(at(c.effect, c.where)) + "</b>" : "", escape(plain(p.name)),
           number(p.value),
           std::isfinite(p.low) ? number(p.low) + " … " + number(p.high) : "held, or not told",
           escape(p.unit == "1" ? "" : unit(p.unit))});
    }
  return element("h2", "Parameters of the causes") +
         html_table({"cause", "parameter", "value", "95 % interval", "unit"}, rows,
                    {"", "", "n", "n", ""}) +
         element("p", "model.json holds the extended model: identify, simulate and Python load it.",
                 "faint");
}

std::string drives(const Finding& f) {
  if (f.drives.empty()) return "";
  std::vector<std::vector<std::string>> rows = drive_rows(f);
  for (std::vector<std::string>& row : rows)
    for (std::string& cell : row) cell = escape(cell);
  return element("h2", "Drives that differ from the description") +
         html_table({"joint", "number", "described", "fitted, ± one standard error", "unit"}, rows,
                    {"", "", "n", "n", ""});
}

// --- data

std::string data(const Finding& f) {
  std::string out = element("h2", "Data and notes");
  if (!f.audit.empty()) {
    std::vector<std::vector<std::string>> rows;
    for (const ChannelFault& a : f.audit)
      rows.push_back(
          {escape(a.severity == FaultSeverity::kFault ? "fault" : "note"), escape(plain(a.fault)),
           escape(a.channel.empty() ? a.where : a.channel),
           value_and_std(a.value, a.std) + " " + escape(unit(a.unit == "1" ? "" : a.unit)),
           escape(a.evidence)});
    out += element("h3", "Audit of the channels") +
           html_table({"", "what", "channel", "size", "evidence"}, rows, {"", "", "", "n", "wrap"});
  }
  std::vector<std::string> items;
  if (f.plan.filter_hz > 0.0)  // not of a ball alone
    items.push_back("positions low-passed at " + number(f.plan.filter_hz, 3) +
                    " Hz; torques and every candidate's columns alike, decimated to " +
                    number(f.plan.decimator.rate_hz / f.plan.decimator.factor, 3) + " Hz");
  items.push_back("base: " + f.base + "; held out: " + f.held_out);
  items.push_back(
      "noise-weighted residual of the base model: " + number(f.lack_of_fit, 3) +
      " (1: noise alone); chance that noise alone makes the best candidate as good: " +
      (f.lack_of_fit_p < 1e-12 ? std::string("below 1e-12") : "p = " + number(f.lack_of_fit_p, 2)));
  if (f.data_report.quarantined > 0)
    items.push_back(std::to_string(f.data_report.quarantined) + " rows were quarantined");
  for (const std::string& channel : f.data_report.extra_channels)
    items.push_back("column " + channel + " is kept, not used");
  for (const std::string& note : f.data_report.notes) items.push_back(note);
  for (const std::string& note : f.notes)
    if (!note.starts_with(kWarning)) items.push_back(note);
  items.push_back("took " + number(f.seconds, 2) + " s");
  return out + html_list(items);
}

}  // namespace

std::string diagnose_page(const DiagnoseRun& run) {
  const Finding& f = run.finding;
  const std::string name = f.model.name.empty() ? "model" : f.model.name;
  const std::string ball = f.ball ? ball_section(*f.ball, names_of(f)) : "";
  const bool of_ball =
      std::ranges::any_of(f.causes, [](const Cause& c) { return at_ball(c.where); });
  const std::string body = head(f, name) + (of_ball ? ball : "") + follows_section(f) +
                           over_time(f) + (of_ball ? "" : ball) + evidence(f) +
                           grey_box_section(f) + candidates(f) + left_open(f) + gain_section(f) +
                           parameters(f) + drives(f) + data(f) + reproduce(run.reproduce);
  return document("Diagnosis of " + name, body, page_data(run));
}

}  // namespace diffnea
