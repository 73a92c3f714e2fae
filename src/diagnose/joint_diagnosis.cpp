#include "diagnose/joint_diagnosis.hpp"

#include <algorithm>
#include <optional>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/bound_effect.hpp>

#include "diagnose/band_diagnosis.hpp"

namespace diffnea {
namespace {

/// Names of the catalogue's effects that have a trait.
std::vector<std::string> effects_with(Trait trait) {
  std::vector<std::string> out;
  for (const EffectInfo& info : catalogue())
    if (info.has(trait)) out.push_back(info.name);
  return out;
}

/// Tells whether an effect, as `diagnose --effects` names it, is looked for beyond the first band.
bool is_in_wide_band(const std::string& effect) {
  const EffectInfo* info = known_effect(effect.substr(0, effect.find('@')));
  return info && info->has(Trait::kInWideBand);
}

/// What is looked at, and the seconds of looks that are not shown.
struct Question {
  const Model& model;
  const RecordingSource& train;
  const RecordingSource* test;
  const DiagnoseOptions& options;
  double spent = 0.0;
};

/// Whether a second look came to its end; the first one's finding is then told of an interruption.
bool came_to_its_end(BandDiagnosis& second, Question& of, Finding& first) {
  try {
    second.examine();
  } catch (const Error&) {  // of too few rows: what an interruption left
    if (!second.finding().interrupted) throw;
  }
  of.spent += second.finding().seconds;
  first.interrupted |= second.finding().interrupted;
  return !second.finding().interrupted;
}

/// Where nothing was found, a gap is looked for in the wider band: there the positions' noise, as a
/// torque, drowns any smooth effect, but a step of a position has as wide a spectrum. It has to be
/// the only cause, beside all candidates.
Finding with_gap_beyond(Question& of, Finding narrow) {
  if (narrow.interrupted) return narrow;
  DiagnoseOptions gaps = of.options;
  gaps.candidates.clear();
  if (of.options.whole_catalogue()) gaps.effects = effects_with(Trait::kInWideBand);
  std::erase_if(gaps.effects, [](const std::string& e) { return !is_in_wide_band(e); });
  if (gaps.effects.empty()) return narrow;
  gaps.grey_box = false;
  BandDiagnosis screen(of.model, of.train, of.test, Band::kWide, Turns::kLeftOut, gaps);
  if (!came_to_its_end(screen, of, narrow) || screen.finding().causes.empty()) return narrow;
  BandDiagnosis again(of.model, of.train, of.test, Band::kWide, Turns::kLeftOut, of.options);
  if (!came_to_its_end(again, of, narrow) || again.finding().causes.empty() ||
      std::ranges::any_of(again.finding().causes,
                          [](const Cause& c) { return !is_in_wide_band(c.effect); }))
    return narrow;
  of.spent += narrow.seconds - again.finding().seconds;
  Finding wide = again.finish();
  wide.notes.push_back("up to " + format_number(narrow.plan.filter_hz) +
                       " Hz nothing was left to explain: the gap shows up to " +
                       format_number(wide.plan.filter_hz) + " Hz");
  return wide;
}

bool same(const Cause& a, const Cause& b) { return a.effect == b.effect && a.where == b.where; }

/// Whether a cause of `first` is one of `second` with parameters that do not contradict it.
bool stands(const Cause& cause, const Finding& second) {
  const auto it =
      std::ranges::find_if(second.causes, [&](const Cause& c) { return same(c, cause); });
  if (it == second.causes.end()) return false;
  for (std::size_t k = 0; k < cause.parameters.size(); ++k) {
    const double value = cause.parameters[k].value;
    if (value < it->parameters[k].low || value > it->parameters[k].high) return false;
  }
  return true;
}

/// What of `stuck` ("effect@joint") is among the causes of `second`, if that is all it adds. With
/// turns of joints that stick, other effects stand for what holds the joint meanwhile.
std::vector<std::string> adds_at_turns(const Finding& first, const Finding& second,
                                       const std::vector<std::string>& stuck) {
  std::vector<std::string> out;
  if (!std::ranges::all_of(first.causes, [&](const Cause& c) { return stands(c, second); }))
    return out;
  for (const Cause& c : second.causes) {
    if (std::ranges::any_of(first.causes, [&](const Cause& f) { return same(f, c); })) continue;
    if (std::ranges::find(stuck, c.effect + "@" + c.where) == stuck.end()) return {};
    std::string name = c.effect;
    std::ranges::replace(name, '_', ' ');
    out.push_back(name + " at " + c.where);
  }
  return out;
}

/// What shows at the turns alone, where those of joints that stick were left out: of the causes and
/// that, then of all candidates, it must be what is added.
std::optional<Finding> with_turns(Question& of, BandDiagnosis& narrow, Finding& first) {
  std::vector<std::string> stuck = narrow.without_turns(effects_with(Trait::kAtTurns));
  std::erase_if(stuck, [&](const std::string& s) {
    return std::ranges::any_of(first.causes,
                               [&](const Cause& c) { return s == c.effect + "@" + c.where; });
  });
  // What is told of an unknown cause hangs on its turns, too.
  if (stuck.empty() || first.verdict == Verdict::kUnknown) return std::nullopt;
  DiagnoseOptions few = of.options;
  few.effects = stuck;
  for (const Cause& c : first.causes)
    if (std::ranges::none_of(of.options.candidates,
                             [&](const OwnCandidate& own) { return own.name == c.effect; }))
      few.effects.push_back(c.effect + "@" + c.where);
  few.grey_box = false;
  BandDiagnosis screen(of.model, of.train, of.test, Band::kInformative, Turns::kKept, few);
  if (!came_to_its_end(screen, of, first) || adds_at_turns(first, screen.finding(), stuck).empty())
    return std::nullopt;
  BandDiagnosis again(of.model, of.train, of.test, Band::kInformative, Turns::kKept, of.options);
  if (!came_to_its_end(again, of, first) || again.finding().verdict == Verdict::kUnknown)
    return std::nullopt;
  const std::vector<std::string> at = adds_at_turns(first, again.finding(), stuck);
  if (at.empty()) return std::nullopt;
  of.spent += first.seconds - again.finding().seconds;
  Finding finding = again.finish();
  std::string what;
  for (const std::string& effect : at) what += (what.empty() ? "" : ", ") + effect;
  finding.notes.push_back(what +
                          " does not show without the turns of a joint that sticks wherever it "
                          "turns back: it was looked for with them");
  return finding;
}

Finding look(Question& of) {
  BandDiagnosis narrow(of.model, of.train, of.test, Band::kInformative, Turns::kLeftOut,
                       of.options);
  Finding& first = narrow.examine();
  if (!first.interrupted)
    if (std::optional<Finding> more = with_turns(of, narrow, first)) return *std::move(more);
  if (first.interrupted || !narrow.wider()) return narrow.finish();
  const bool nothing = first.verdict == Verdict::kNone,
             named_first = !nothing && first.verdict != Verdict::kUnknown;
  if (nothing && !(first.gain.before > kUneasy) && !narrow.blind())
    return with_gap_beyond(of, narrow.finish());
  if (named_first && !(first.gain.after > kUneasy)) return narrow.finish();
  // A stiff loop keeps what is fast out of the positions, not out of the torques.
  BandDiagnosis wide(of.model, of.train, of.test, Band::kWide, Turns::kLeftOut, of.options);
  if (!came_to_its_end(wide, of, first)) return narrow.finish();
  const Finding& second = wide.finding();
  const bool named = second.verdict == Verdict::kNamed || second.verdict == Verdict::kClass;
  if (nothing && !named) return with_gap_beyond(of, narrow.finish());
  if (named_first && !(named && second.gain.after < kUneasy)) return narrow.finish();
  const bool says_more = second.verdict != Verdict::kUnknown ||
                         (first.witness.empty() && !second.witness.empty()) ||
                         second.gain.explained_share > first.gain.explained_share;
  if (!says_more) return narrow.finish();
  of.spent += first.seconds - second.seconds;
  Finding finding = wide.finish();
  finding.notes.push_back("up to " + format_number(first.plan.filter_hz) +
                          " Hz no effect that was tried explained " +
                          (named_first ? "the whole error" : "the error") + ": looked at up to " +
                          format_number(finding.plan.filter_hz) + " Hz");
  return finding;
}

}  // namespace

Finding diagnose_joints(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options) {
  Question of{model, train, test, options};
  Finding out = look(of);
  out.seconds += of.spent;
  return out;
}

}  // namespace diffnea
