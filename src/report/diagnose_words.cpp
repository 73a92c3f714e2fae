#include "report/diagnose_words.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>

#include <diffnea/effects/bound_effect.hpp>

#include "core/number_text.hpp"
#include "report/format.hpp"
#include "report/sentence.hpp"

namespace diffnea::report {

/// ΔBIC that tells apart, and that a candidate needs.
constexpr double kSameClass = 10.0;
/// What windows and states leave to chance.
constexpr double kMotionWorse = 1.5;

std::string plain(std::string name) {
  std::ranges::replace(name, '_', ' ');
  return name;
}

bool at_ball(const std::string& where) {
  return where == "ball" || where == "string" || where == "camera";
}

std::string capital(std::string text) {
  if (!text.empty()) text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return text;
}

std::string at(const std::string& effect, const std::string& where) {
  if (where == "all") return plain(effect) + " at all joints";
  if (!at_ball(where)) return plain(effect) + " at " + where;
  if (effect == "magnus") return "Magnus lift of the ball";
  const std::string name = plain(effect);
  if (name.find(where) != name.npos) return name;  // "string mass", "camera delay"
  const bool acts = name == "wind" || name.ends_with("drag");
  return name + (acts ? " on the " : " of the ") + where;
}

std::vector<RefusedTogether> refused_together(const std::vector<Refusal>& refused) {
  struct Group {
    const Refusal* first;
    std::vector<std::pair<std::string, std::vector<std::string>>> effects;  // and where
  };
  std::vector<Group> groups;
  for (const Refusal& r : refused) {
    auto group = std::ranges::find_if(groups, [&](const Group& g) {
      return g.first->reason == r.reason && g.first->delta_bic == 0.0 && r.delta_bic == 0.0;
    });
    if (group == groups.end()) group = groups.insert(groups.end(), {&r, {}});
    auto effect =
        std::ranges::find(group->effects, r.effect, [](const auto& e) { return e.first; });
    if (effect == group->effects.end())
      effect = group->effects.insert(group->effects.end(), {r.effect, {}});
    if (std::ranges::find(effect->second, r.where) == effect->second.end())
      effect->second.push_back(r.where);
  }
  std::vector<RefusedTogether> out;
  for (const Group& g : groups) {
    out.push_back({"", g.first->reason, g.first->delta_bic});
    for (const auto& [effect, where] : g.effects)
      out.back().what += (out.back().what.empty() ? "" : ", ") + at(effect, where.front()) +
                         (where.size() == 2  ? " and " + where.back()
                          : where.size() > 2 ? " and " + std::to_string(where.size() - 1) + " more"
                                             : "");
  }
  return out;
}

CauseParameter as_read(const std::string& effect, CauseParameter p) {
  const auto scaled = [&p](double by, const char* unit) {
    for (double* x : {&p.value, &p.std, &p.low, &p.high}) *x *= by;
    p.unit = unit;
  };
  if (effect == "string_mass") {
    p.name = "mass";
    scaled(100.0, "% of the ball's");
  } else if (effect == "gravity_scale" || effect == "camera_scale") {
    scaled(100.0, "%");
  } else if (effect == "camera_delay") {
    scaled(1e3, "ms");
  } else if (effect == "camera_rotation") {
    scaled(1e3, "mrad");
  } else if (effect == "camera_offset" || effect == "attachment_offset") {
    scaled(1e3, "mm");
  } else if (effect == "string_extension") {
    scaled(1e3, "mm/N");
  }
  return p;
}

bool is_dry_friction(const std::string& effect) {
  const auto info = std::ranges::find(catalogue(), effect, &EffectInfo::name);
  return info != catalogue().end() &&
         std::ranges::find(info->parameters, "smoothing", &ParameterInfo::name) !=
             info->parameters.end();
}

std::string removes(const Cause& cause) {
  return percent(std::isnan(cause.share) ? 1.0 - std::pow(cause.gain.after / cause.gain.before, 2)
                                         : cause.share);
}

std::string rival_words(const Rival& rival, const std::string& where) {
  const std::string name =
      rival.where == where ? plain(rival.effect) : at(rival.effect, rival.where);
  if (rival.delta_bic < 0.0)
    return name + " (" + (rival.more_general ? "more general, " : "") + "better by " +
           number(-rival.delta_bic, 3) + ")";
  if (rival.delta_bic > kSameClass && rival.stability > 0.0)
    return name + " (chosen on " + percent(rival.stability) + " of the halves)";
  return name + " (" + (rival.more_general ? "more general, " : "") + "worse by " +
         number(rival.delta_bic, 3) + ")";
}

bool is_ball(const JointGain& joint) { return joint.joint == "ball" && joint.unit == "m"; }

bool is_of_positions(const JointGain& joint) {
  return joint.unit == "m" || joint.unit == "rad";
}

bool follows_commands(const Finding& f) {
  return std::ranges::any_of(f.joints, [](const JointGain& j) { return !is_ball(j); }) &&
         std::ranges::all_of(f.joints, is_of_positions);
}

std::string error_of(const Finding& f) {
  if (follows_commands(f)) return "position error";
  const auto balls = std::ranges::count_if(f.joints, [](const JointGain& j) { return is_ball(j); });
  if (balls == 0) return "torque error";
  return balls == std::ssize(f.joints) ? "error of the ball's position" : "error";
}

std::string gained(const Finding& f) {
  const Gain& g = f.gain;
  if (f.causes.empty())
    return "On held-out data the " + error_of(f) + " is " + number(g.before, 3) +
           " times the noise.";
  std::string out = "On held-out data (" + f.held_out + ") the " + error_of(f) + " falls from " +
                    number(g.before, 3) + " to " + number(g.after, 3) +
                    " times the noise: " + percent(beyond_noise(g)) +
                    " of the mean square that is not noise";
  // The same of the ends of the interval, which are of the whole mean square.
  const double removed = 1.0 - std::pow(g.after / g.before, 2),
               scale = removed > 0.0 ? beyond_noise(g) / removed : 1.0;
  if (std::isfinite(g.low) && std::isfinite(g.high))
    out += " (95 %: " + percent(scale * g.low) + " to " + percent(std::min(scale * g.high, 1.0)) +
           ")";
  return out + ".";
}

std::string meaning(Verdict verdict) {
  switch (verdict) {
    case Verdict::kNamed:
      return "every cause has one name";
    case Verdict::kClass:
      return "some cause cannot be told from its rivals with this recording";
    case Verdict::kUnknown:
      return "something is left that no effect that was tried explains";
    case Verdict::kNone:
      return "nothing is left to explain";
    case Verdict::kNotIdentifiable:
      return "the recording cannot show what the model lacks";
  }
  return "";
}

std::string value_and_interval(const CauseParameter& p) {
  return detail::value_and_interval(p.value, p.low, p.high);
}

std::string in_thousandths(double value, const std::string& of) {
  return number(1e3 * value, 3) + " m" + of;
}

std::vector<std::string> fault_warnings(const Finding& f) {
  std::vector<std::string> out;
  for (const ChannelFault& a : f.audit)
    if (a.severity == FaultSeverity::kFault)
      out.push_back(kWarning + a.channel + " is at fault (" + plain(a.fault) +
                    "), correct it first: " + a.evidence);
  return out;
}

std::vector<std::string> reservations(const Finding& f) {
  std::vector<std::string> out = fault_warnings(f);
  for (const SimulatedSeries& s : f.simulated.joints)
    if (!f.causes.empty() && s.extended_rmse > std::max(kMotionWorse * s.base_rmse, s.tolerance))
      out.push_back("Simulated, the motion of " + s.joint +
                    " is further from the measured one with the extension than without (" +
                    number(s.extended_rmse, 3) + " against " + number(s.base_rmse, 3) + " " +
                    s.unit + " rms): believe the motion, and not the causes.");
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
