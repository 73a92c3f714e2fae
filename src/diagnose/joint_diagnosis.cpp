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
  BandDiagnosis screen(of.model, of.train, of.test, Turns::kKept, few);
  if (!came_to_its_end(screen, of, first) || adds_at_turns(first, screen.finding(), stuck).empty())
    return std::nullopt;
  BandDiagnosis again(of.model, of.train, of.test, Turns::kKept, of.options);
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
  BandDiagnosis narrow(of.model, of.train, of.test, Turns::kLeftOut, of.options);
  Finding& first = narrow.examine();
  if (!first.interrupted)
    if (std::optional<Finding> more = with_turns(of, narrow, first)) return *std::move(more);
  return narrow.finish();
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
