#include "report/diagnose_words.hpp"

#include <algorithm>
#include <cmath>

#include "report/format.hpp"

namespace diffnea::report {

std::string plain(std::string name) {
  std::ranges::replace(name, '_', ' ');
  return name;
}

std::string at(const std::string& effect, const std::string& where) {
  return plain(effect) + (where == "all" ? " at all joints" : " at " + where);
}

std::string pretty(std::string sentence) {
  for (std::size_t k = sentence.find("+-"); k != sentence.npos; k = sentence.find("+-", k))
    sentence.replace(k, 2, "±");
  return unit(sentence);
}

std::string gained(const Finding& f) {
  const Gain& g = f.gain;
  if (f.causes.empty())
    return "On held-out data the torque error is " + number(g.before, 3) + " times the noise.";
  std::string out = "On held-out data (" + f.held_out + ") the torque error falls from " +
                    number(g.before, 3) + " to " + number(g.after, 3) +
                    " times the noise: " + percent(g.explained_share) + " of what can be removed";
  if (std::isfinite(g.low) && std::isfinite(g.high))
    out += "; of the mean square " + percent(1.0 - std::pow(g.after / g.before, 2)) +
           " (95 %: " + percent(g.low) + " to " + percent(g.high) + ")";
  return out + ".";
}

std::string meaning(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNamed:
      return "every cause has one name";
    case Verdict::kClass:
      return "some cause cannot be told from its rivals with this recording";
    case Verdict::kUnknown:
      return "something is left that no effect of the catalogue explains";
    case Verdict::kNone:
      return "nothing is left to explain";
    case Verdict::kNotIdentifiable:
      return "the recording cannot show what the model lacks";
  }
  return "";
}

std::string value_and_interval(const CauseParameter& p) {
  if (!std::isfinite(p.low) || !std::isfinite(p.high)) return number(p.value) + " (held)";
  const double up = p.high - p.value, down = p.value - p.low;
  if (std::abs(up - down) <= 0.1 * (up + down)) return value_and_std(p.value, 0.5 * (up + down));
  return number(p.value, 3) + " (" + number(p.low, 3) + " to " + number(p.high, 3) + ")";
}

std::vector<std::string> reservations(const Finding& f) {
  std::vector<std::string> out;
  if (f.interrupted)
    out.push_back(
        "The search was interrupted: what it had found until then is shown, more may be "
        "hidden.");
  if (f.held_out == "time blocks")
    out.push_back(
        "No held-out recording (--test): every other block of time was held out, which is "
        "weaker, for the motion is the same.");
  for (const std::string& note : f.notes)
    if (note.starts_with(kWarning)) out.push_back(note);
  return out;
}

}  // namespace diffnea::report
