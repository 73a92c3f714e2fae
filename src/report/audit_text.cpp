#include <algorithm>
#include <cmath>

#include <diffnea/report/audit_text.hpp>

#include "report/format.hpp"

namespace diffnea {
namespace {

using namespace report;

/// Words of `text` in lines of 96 characters, each behind four blanks.
std::string wrapped(const std::string& text) {
  std::string out, line;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t space = std::min(text.find(' ', at), text.size());
    const std::string word = text.substr(at, space - at);
    if (!line.empty() && width(line) + 1 + width(word) > 96) {
      out += "    " + line + "\n";
      line.clear();
    }
    line += (line.empty() ? "" : " ") + word;
    at = space + 1;
  }
  return out + "    " + line + "\n";
}

std::string size_of(const ChannelFault& f) {
  std::string text = value_and_std(f.value, std::isnan(f.std) ? 0.0 : f.std);
  if (std::isnan(f.std)) text = number(f.value);
  return f.unit == "1" ? text : text + " " + unit(f.unit);
}

std::string list(const AuditReport& report, FaultSeverity severity) {
  std::string out;
  for (const ChannelFault& f : report.faults) {
    if (f.severity != severity) continue;
    out += "\n  " + f.fault + "  " + f.channel + "  " + size_of(f) + "\n";
    out += wrapped((f.source.empty() ? "" : f.source + ": ") + f.evidence);
  }
  return out;
}

}  // namespace

std::string audit_text(const AuditReport& report) {
  const auto faults = static_cast<std::size_t>(
      std::ranges::count(report.faults, FaultSeverity::kFault, &ChannelFault::severity));
  const std::size_t notes = report.faults.size() - faults;
  std::string out =
      faults == 0 ? "no channel fault" : counted(faults, "channel fault", "channel faults");
  if (notes > 0) out += ", " + counted(notes, "note", "notes");
  out += " in " + std::to_string(report.rows) + " rows";
  if (report.rate_hz > 0.0) out += " at " + number(report.rate_hz) + " Hz";
  out += "\n";
  if (faults > 0)
    out += "\nfaults: these bias what is fitted" + list(report, FaultSeverity::kFault);
  if (notes > 0)
    out += "\nnotes: identification copes with these" + list(report, FaultSeverity::kNote);
  const bool any_period =
      std::ranges::any_of(report.periods, [](const Period& p) { return p.seconds > 0.0; });
  if (any_period) out += "\n";
  for (std::size_t k = 0; k < report.periods.size(); ++k) {
    const Period& p = report.periods[k];
    if (p.seconds <= 0.0) continue;
    out += "the motion repeats every " + value_and_std(p.seconds, p.std) + " s (" +
           number(p.repeats, 3) + " times, to " + number(100.0 * p.mismatch, 2) + " %" + ")";
    if (report.periods.size() > 1) out += ", recording " + std::to_string(k + 1);
    out += "\n";
  }
  out += "\nchecked\n";
  for (const AuditCheck& c : report.checks)
    out += "  " + std::string(c.done ? "" : "not: ") + c.name + ": " + c.text + "\n";
  return out;
}

}  // namespace diffnea
