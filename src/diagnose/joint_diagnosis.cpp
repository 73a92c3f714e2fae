#include "diagnose/joint_diagnosis.hpp"

#include <algorithm>

#include "diagnose/band_diagnosis.hpp"

namespace diffnea {
namespace {

/// The effect that is looked for beyond the first band.
const std::string kGap = "backlash";
/// The one that shows where a joint turns back, and is looked for there at joints that stick.
const std::string kAtTurns = "stribeck_friction";

/// Where nothing was found, a gap is looked for in the wider band: there the positions' noise, as a
/// torque, drowns any smooth effect, but a step of a position has as wide a spectrum. It has to be
/// the only cause, beside all candidates.
Finding with_gap_beyond(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options,
                        Finding narrow) {
  DiagnoseOptions gaps = options;
  gaps.candidates.clear();
  if (options.effects.empty()) gaps.effects = {kGap};
  std::erase_if(gaps.effects, [](const std::string& e) { return !e.starts_with(kGap); });
  if (gaps.effects.empty()) return narrow;
  gaps.grey_box = false;
  const Finding screened =
      BandDiagnosis(model, train, test, Band::kWide, Turns::kLeftOut, gaps).examine();
  narrow.seconds += screened.seconds;
  narrow.interrupted |= screened.interrupted;
  if (narrow.interrupted || screened.causes.empty()) return narrow;
  BandDiagnosis again(model, train, test, Band::kWide, Turns::kLeftOut, options);
  const Finding& seen = again.examine();
  narrow.interrupted |= seen.interrupted;
  if (seen.interrupted || seen.causes.empty() ||
      std::ranges::any_of(seen.causes, [](const Cause& c) { return c.effect != kGap; }))
    return narrow;
  Finding wide = again.finish();
  wide.seconds += narrow.seconds;
  wide.notes.push_back("up to " + format_number(narrow.plan.filter_hz) +
                       " Hz nothing was left to explain: the gap shows up to " +
                       format_number(wide.plan.filter_hz) + " Hz");
  return wide;
}

/// Whether the causes are those of `first` and friction of the turns at some of `joints`. With
/// turns of joints that stick, other effects stand for what holds the joint meanwhile.
bool adds_only_friction_of_turns(const Finding& first, const Finding& second,
                                 const std::vector<std::string>& joints) {
  const auto among = [](const Cause& cause, const std::vector<Cause>& causes) {
    return std::ranges::any_of(
        causes, [&](const Cause& c) { return c.effect == cause.effect && c.where == cause.where; });
  };
  return second.causes.size() > first.causes.size() &&
         std::ranges::all_of(first.causes,
                             [&](const Cause& c) { return among(c, second.causes); }) &&
         std::ranges::all_of(second.causes, [&](const Cause& c) {
           return among(c, first.causes) ||
                  (c.effect == kAtTurns && std::ranges::find(joints, c.where) != joints.end());
         });
}

}  // namespace

Finding diagnose_joints(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options) {
  BandDiagnosis narrow(model, train, test, Band::kInformative, Turns::kLeftOut, options);
  const Finding& first = narrow.examine();
  const std::vector<std::string> stuck = narrow.without_turns(kAtTurns);
  if (!first.interrupted && !stuck.empty()) {
    BandDiagnosis turns(model, train, test, Band::kInformative, Turns::kKept, options);
    const Finding& second = turns.examine();
    if (second.interrupted) return narrow.finish(true);
    if (adds_only_friction_of_turns(first, second, stuck)) {
      Finding finding = turns.finish();
      finding.seconds += first.seconds;
      finding.notes.push_back(
          "without the turns of joints that stick wherever they turn back, this friction does not "
          "show: it was looked for with them");
      return finding;
    }
  }
  if (first.interrupted || !narrow.wider()) return narrow.finish();
  if (first.verdict == Verdict::kNone)
    return with_gap_beyond(model, train, test, options, narrow.finish());
  if (first.verdict != Verdict::kUnknown) return narrow.finish();
  // A stiff loop keeps what is fast out of the positions, not out of the torques.
  BandDiagnosis wide(model, train, test, Band::kWide, Turns::kLeftOut, options);
  const Finding& second = wide.examine();
  const bool says_more = second.verdict != Verdict::kUnknown ||
                         (first.witness.empty() && !second.witness.empty()) ||
                         second.gain.explained_share > first.gain.explained_share;
  if (second.interrupted || !says_more) return narrow.finish(second.interrupted);
  Finding finding = wide.finish();
  finding.seconds += first.seconds;
  finding.notes.push_back("up to " + format_number(first.plan.filter_hz) +
                          " Hz no effect of the catalogue explained the error: looked at up to " +
                          format_number(finding.plan.filter_hz) + " Hz");
  return finding;
}

}  // namespace diffnea
