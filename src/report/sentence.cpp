#include "report/sentence.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>

#include "report/diagnose_words.hpp"
#include "report/drive_words.hpp"
#include "report/follows_words.hpp"
#include "report/format.hpp"

namespace diffnea::report {
namespace {

/// Share of an error from which causes are the answer, and what is left beside them a remark.
constexpr double kMost = 0.5;

/// "5 %", "99.9 %"
std::string share_of(double x) { return number(std::round(1000.0 * x) / 10.0) + " %"; }

/// "coulomb 0.530 ± 0.021 N·m"
std::string values(const Cause& cause) {
  std::string out;
  for (const CauseParameter& p : cause.parameters) {
    if (std::isnan(p.std) || p.name == "smoothing") continue;
    std::string shown = p.unit == "1" ? "" : " " + p.unit;
    for (std::size_t k; (k = shown.find('*')) != std::string::npos;) shown.replace(k, 1, "·");
    out += (out.empty() ? "" : ", ") + p.name + " " + value_and_interval(p) + shown;
  }
  return out;
}

std::string listed(const std::vector<std::string>& items, const std::string& last) {
  std::string out;
  for (std::size_t i = 0; i < items.size(); ++i)
    out += (i == 0 ? "" : i + 1 == items.size() ? last : ", ") + items[i];
  return out;
}

/// Tells whether its class is of dry friction at its joint, and only the kind is open.
bool is_dry_class(const Cause& cause) {
  return is_dry_friction(cause.effect) && !cause.members.empty() &&
         std::ranges::all_of(cause.members, [&](const Rival& r) {
           return r.where == cause.where && is_dry_friction(r.effect);
         });
}

/// Name of a cause for a reader who asks for no kind.
std::string kin(const Cause& cause) {
  return is_dry_friction(cause.effect) ? "dry_friction" : cause.effect;
}

std::string cause_words(const Cause& cause) {
  const std::string sizes = values(cause);
  std::string out = sizes.empty() ? "of no size that this recording tells" : sizes;
  std::vector<std::string> others;
  for (const Rival& r : cause.members)
    others.push_back(r.where == cause.where ? plain(r.effect) : at(r.effect, r.where));
  if (is_dry_class(cause))
    return at("dry_friction", cause.where) + " (" + plain(cause.effect) + ": " + out +
           "; this recording cannot tell it from " + listed(others, " or ") + ")";
  out = at(cause.effect, cause.where) + " (" + out + ")";
  return others.empty()
             ? out
             : out + " [which this recording cannot tell from " + listed(others, " or ") + "]";
}

bool is_named(const Cause& cause) { return cause.verdict != Verdict::kUnknown; }

/// "coulomb friction at elbow, wrist and tool (coulomb 0.12 to 0.53 N·m)", "dry friction at elbow,
/// wrist and tool (coulomb friction at 2 of them, sublinear friction at 1)"
std::string alike_words(const std::vector<const Cause*>& alike) {
  std::vector<std::string> where;
  std::map<std::string, int> kinds;
  double low = std::numeric_limits<double>::infinity(), high = 0.0;
  bool sized = true;
  for (const Cause* c : alike) {
    where.push_back(c->where);
    ++kinds[c->effect];
    const double size = std::abs(c->parameters.front().value);
    sized = sized && !std::isnan(c->parameters.front().std) &&
            c->parameters.front().unit == alike.front()->parameters.front().unit;
    low = std::min(low, size);
    high = std::max(high, size);
  }
  const CauseParameter& first = alike.front()->parameters.front();
  std::string out =
      at(kinds.size() > 1 ? kin(*alike.front()) : alike.front()->effect, listed(where, " and "));
  if (kinds.size() > 1) {
    std::vector<std::string> words;
    for (const auto& [effect, count] : kinds)
      words.push_back(plain(effect) + " at " + std::to_string(count));
    out += " (as " + listed(words, " and ") + ")";
  } else if (sized) {
    out += " (" + plain(first.name) + " " + number(low, 3) + " to " + number(high, 3) +
           (first.unit == "1" ? "" : " " + unit(first.unit)) + ")";
  }
  const auto of_a_class =
      std::ranges::count_if(alike, [](const Cause* c) { return !c->members.empty(); });
  if (of_a_class == 0) return out;
  const bool kind_alone = std::ranges::all_of(
      alike, [](const Cause* c) { return c->members.empty() || is_dry_class(*c); });
  return out + " [at " + (of_a_class == std::ssize(alike) ? "each" : std::to_string(of_a_class)) +
         " of them this recording cannot tell " +
         (kind_alone ? "which kind of dry friction]" : "it from others]");
}

/// Causes that remove most, one effect at several joints in one word; all stand in the table. What
/// has no name is not among them.
std::string causes_words(const Finding& f) {
  constexpr std::size_t kAlike = 3;  // from which on their sizes are a range
  std::vector<const Cause*> worth;
  std::size_t small = 0;
  double small_share = 0.0;
  for (const Cause& c : f.causes) {
    if (!is_named(c)) continue;
    if (worth.empty() || !(c.share < kWorthWords)) {
      worth.push_back(&c);
      continue;
    }
    ++small;
    small_share += c.share;
  }
  std::vector<std::string> words, done;
  for (const Cause* c : worth) {
    std::vector<const Cause*> alike;
    std::ranges::copy_if(worth, std::back_inserter(alike), [&](const Cause* other) {
      return kin(*other) == kin(*c) && !other->parameters.empty();
    });
    if (alike.size() < kAlike) {
      words.push_back(cause_words(*c));
    } else if (std::ranges::find(done, kin(*c)) == done.end()) {
      done.push_back(kin(*c));
      words.push_back(alike_words(alike));
    }
  }
  if (small > 0)
    words.push_back(std::to_string(small) + (small > 1 ? " small ones" : " small one") +
                    (small > 1 ? ", together " : ", ") + share_of(std::max(small_share, 0.0)));
  return listed(words, " and ");
}

/// Mean square of the held-out error that the named effects leave, and that all of them leave.
std::pair<double, double> left_by(const Finding& f) {
  double named = f.gain.after * f.gain.after;
  for (const Cause& c : f.causes)
    if (!is_named(c)) {
      named = c.gain.before * c.gain.before;
      break;
    }
  return {named, f.gain.after * f.gain.after};
}

/// Of the held-out mean square that can be removed, what the named effects remove.
double named_share(const Finding& f) {
  const double before = f.gain.before * f.gain.before,
               floor = f.gain.noise_floor * f.gain.noise_floor;
  const double removed = std::max(before - left_by(f).first, 0.0);
  return removed > 0.0 ? removed / std::max(before - floor, removed) : 0.0;
}

/// "A learned remainder at elbow over q_elbow and qd_elbow, which names no cause, removes …"
std::string grey_words(const Finding& f) {
  std::vector<std::string> where;
  for (const GreyBox& g : f.grey_box)
    where.push_back(g.where + " over " + listed(g.variables, " and "));
  const auto [before, after] = left_by(f);
  return "A learned remainder at " + listed(where, " and at ") +
         ", which names no cause, removes " + share_of(1.0 - after / before) +
         " of the mean square that is left on held-out data (error " + number(std::sqrt(before)) +
         " to " + number(std::sqrt(after)) + " times the noise)";
}

/// Of arm and ball, the ball's path is further from what its noise allows.
bool is_of_ball(const Finding& f, double left_of_arm) {
  return f.ball && (f.series.empty() || !(f.ball->extended_rms < left_of_arm * f.ball->sigma));
}

std::string witness_words(const Finding& f) {
  const double left = std::sqrt(left_by(f).first);
  if (f.witness.empty() && follows_commands(f))
    return "an error of " + number(left) +
           " times the encoders' noise is left on held-out data, and no effect that was tried "
           "explains it; lags of drives are not tried";
  if (f.witness.empty() && is_of_ball(f, left))
    return "an error of " +
           number(f.series.empty() ? f.gain.after : f.ball->extended_rms / f.ball->sigma) +
           " times the camera's noise is left of the ball's held-out path, and no smooth function "
           "of its motion explains it";
  if (f.witness.empty() && left > kFarOff)
    return "an error of " + number(left) +
           " times the noise is left on held-out data, and no smooth function of the motion "
           "explains it; were they recorded under other conditions, or with other units?";
  if (f.witness.empty())
    return "an error of " + number(left) +
           " times the noise comes back in every period, and no smooth function of the motion "
           "explains it on held-out data";
  const Witness& w = f.witness.front();
  return (w.where == "ball" ? "the error of the ball's path "
                            : "the torque error of " + w.where + " ") +
         witness_clause(w) + " (" + share_of(w.share) + " of its mean square)";
}

/// Where parts of one recording are held out: effects that explain the others and do not help
/// there.
std::string none_words(const Finding& f) {
  const std::string no_effect =
      f.tried == Tried::kAll ? "o effect of the catalogue " : "one of the effects that were tried ";
  constexpr std::size_t kInSentence = 3;
  std::vector<std::string> fit;
  for (const Refusal& r : f.refused)
    if (r.delta_bic > 0.0 && r.reason.starts_with("does not help on held-out data"))
      fit.push_back(at(r.effect, r.where));
  if (f.held_out != "time blocks" || fit.empty()) {
    const std::string beyond = "improves the model beyond its noise";
    if (f.gain.before > kUneasy)
      return "N" + no_effect + beyond + ", though on held-out data its error is " +
             number(f.gain.before) + " times that.";
    // The error of one joint may be little beside the others', or told by the rows before.
    const auto times_noise = [](const JointGain& g) {
      return g.noise_floor > 0.0 ? g.extended / g.noise_floor : 0.0;
    };
    const auto worst = std::ranges::max_element(f.joints, {}, times_noise);
    if (worst != f.joints.end() && times_noise(*worst) > kFarOff)
      return "N" + no_effect + beyond + ", though on held-out data the error of " + worst->joint +
             " is " + number(times_noise(*worst)) + " times its noise.";
    return (f.tried == Tried::kAll ? "Nothing is left to explain: n" : "N") + no_effect + beyond +
           ".";
  }
  if (fit.size() > kInSentence) fit.resize(kInSentence);
  return "N" + no_effect + "helps on the parts of the recording that were held out, though " +
         listed(fit, " and ") +
         " would explain some of the others: give a second recording (--test), which can tell.";
}

/// Of what could not be tried, and why.
std::string nothing_words(const Finding& f) {
  const std::string prefix = "not tried: ";
  for (const Refusal& r : f.refused)
    if (r.reason.starts_with(prefix))
      return "Nothing was tried: " + plain(r.effect) + " " + r.reason.substr(prefix.size()) + ".";
  return "Nothing was tried: the effects that were asked for cannot act on what is recorded here.";
}

std::string verdict_words(const Finding& f) {
  if (f.interrupted) {
    Finding rest = f;
    rest.interrupted = false;
    return "Interrupted before all was tried, rivals among it: " + verdict_words(rest);
  }
  switch (f.verdict) {
    case Verdict::kNone:
      return none_words(f);
    case Verdict::kNotIdentifiable:
      if (f.tried == Tried::kNothing) return nothing_words(f);
      return std::string("This recording cannot show what the model lacks: ") +
             (f.candidates.empty()
                  ? "every candidate is absorbed by the base parameters or never excited."
                  : "a channel is mostly noise, or at fault; the warnings name it.");
    case Verdict::kUnknown: {
      const bool any = std::ranges::any_of(f.causes, is_named);
      const bool most = any && named_share(f) > kMost;
      std::string out =
          (most ? "The model lacks " + causes_words(f) + "; that is " + share_of(named_share(f)) +
                      " of the held-out error that can be removed. "
                : std::string()) +
          (most ? "The cause of the rest " : "The cause ") +
          (f.tried == Tried::kAll ? "is not in the catalogue: "
                                  : "is none of the effects that were tried: ") +
          witness_words(f);
      if (any && !most) {
        out += "; the nearest effects are " + causes_words(f) + ", and they explain " +
               share_of(named_share(f)) + " of the held-out error that can be removed";
      }
      if (!f.grey_box.empty()) out += ". " + grey_words(f);
      return out.ends_with("?") ? out : out + ".";
    }
    case Verdict::kNamed:
    case Verdict::kClass:
      break;
  }
  std::string out = "The model lacks " + causes_words(f) + ". The extension removes " +
                    share_of(beyond_noise(f.gain)) +
                    " of the held-out error that is not noise (error " + number(f.gain.before) +
                    " to " + number(f.gain.after) + " times the noise" +
                    (f.gain.after > kUneasy ? "; nothing that was tried explains the rest)" : ")");
  const auto of_ball = [](const Cause& c) { return at_ball(c.where); };
  if (f.ball && !std::ranges::all_of(f.causes, of_ball) && std::ranges::any_of(f.causes, of_ball))
    out += ", and brings the ball's path from " + number(1e3 * f.ball->base_rms) + " to " +
           number(1e3 * f.ball->extended_rms) + " mm of the camera's";
  const Rival* next = nullptr;
  const Cause* of = nullptr;
  for (const Cause& c : f.causes)
    for (const Rival& r : c.rivals)  // below 0, it is a more general one
      if (is_named(c) && r.delta_bic >= 0.0 && (!next || r.delta_bic < next->delta_bic)) {
        next = &r;
        of = &c;
      }
  if (next)
    out += "; the next rival" + (f.causes.size() > 1 ? " of " + at(of->effect, of->where) : "") +
           ", " + at(next->effect, next->where) + ", is worse by " + number(next->delta_bic) +
           " in BIC";
  return out + ".";
}

}  // namespace

double beyond_noise(const Gain& gain) {
  const double before = gain.before * gain.before;
  const double removed = before - gain.after * gain.after;
  return removed > 0.0 ? removed / std::max(before - 1.0, removed) : 0.0;
}

std::string witness_clause(const Witness& w) {
  switch (w.form) {
    case WitnessForm::kOscillation:
      return "oscillates at " + number(w.frequency) + " Hz whatever the motion";
    case WitnessForm::kBursts:
      return "comes in bursts where the same motion is quiet elsewhere";
    case WitnessForm::kExcess:
      return "is more than the noise of its signals gives";
    case WitnessForm::kFunction:
      break;
  }
  return "depends on " + listed(w.variables, " and ");
}

std::string sentence(const Finding& f) {
  const std::string first = follows_sentence(f), drives = drives_sentence(f);
  return (first.empty() ? "" : first + " ") + (drives.empty() ? "" : drives + " ") +
         verdict_words(f);
}

}  // namespace diffnea::report
