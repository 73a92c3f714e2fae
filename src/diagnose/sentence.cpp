#include "diagnose/sentence.hpp"

#include <cmath>

#include "identify/passes.hpp"

namespace diffnea {
namespace {

std::string percent(double share) {
  return format_number(std::round(1000.0 * share) / 10.0) + " %";
}

std::string name(const std::string& effect) {
  std::string out = effect;
  for (char& c : out)
    if (c == '_') c = ' ';
  return out;
}

/// "coulomb 0.53 ± 0.02 N*m"
std::string values(const Cause& cause) {
  std::string out;
  for (const CauseParameter& p : cause.parameters) {
    if (std::isnan(p.std)) continue;
    out += (out.empty() ? "" : ", ") + p.name + " " + format_number(p.value) + " +- " +
           format_number(1.96 * p.std) + (p.unit == "1" ? "" : " " + p.unit);
  }
  return out;
}

std::string listed(const std::vector<std::string>& items, const std::string& last) {
  std::string out;
  for (std::size_t i = 0; i < items.size(); ++i)
    out += (i == 0 ? "" : i + 1 == items.size() ? last : ", ") + items[i];
  return out;
}

std::string cause_words(const Cause& cause) {
  std::string out = name(cause.effect) + " at " + cause.where + " (" + values(cause) + ")";
  if (cause.members.empty()) return out;
  std::vector<std::string> others;
  for (const Rival& r : cause.members)
    others.push_back(name(r.effect) + (r.where == cause.where ? "" : " at " + r.where));
  return out + ", which this recording cannot tell from " + listed(others, " or ");
}

std::string witness_words(const Finding& f) {
  const Witness& w = f.witness.front();
  return "the torque error of " + w.where + " depends on " + listed(w.variables, " and ") + " (" +
         percent(w.share) + " of its mean square)";
}

}  // namespace

std::string sentence(const Finding& f) {
  switch (f.verdict) {
    case Verdict::kNone:
      return "Nothing is left to explain: no effect of the catalogue improves the model beyond its "
             "noise.";
    case Verdict::kNotIdentifiable:
      return "This recording cannot show what the model lacks: every candidate is absorbed by the "
             "base parameters or "
             "never excited.";
    case Verdict::kUnknown: {
      std::string out = "The cause is not in the catalogue: " + witness_words(f);
      if (!f.causes.empty()) {
        std::vector<std::string> words;
        for (const Cause& c : f.causes) words.push_back(cause_words(c));
        out += "; the nearest effects are " + listed(words, " and ") + ", and they explain " +
               percent(f.gain.explained_share) + " of the held-out error that can be removed";
      }
      return out + ".";
    }
    case Verdict::kNamed:
    case Verdict::kClass:
      break;
  }
  std::vector<std::string> words;
  for (const Cause& c : f.causes) words.push_back(cause_words(c));
  std::string out =
      "The model lacks " + listed(words, " and ") + ". The extension removes " +
      percent(f.gain.explained_share) + " of the held-out error that can be removed (error " +
      format_number(f.gain.before) + " to " + format_number(f.gain.after) + " times the noise)";
  const Cause& first = f.causes.front();
  if (!first.rivals.empty())
    out += "; the next rival, " + name(first.rivals.front().effect) + " at " +
           first.rivals.front().where + ", is worse by " +
           format_number(first.rivals.front().delta_bic) + " in BIC";
  return out + ".";
}

}  // namespace diffnea
