#include "diagnose/joint_diagnosis.hpp"

#include <algorithm>

#include "diagnose/band_diagnosis.hpp"

namespace diffnea {
namespace {

/// The effect that is looked for beyond the first band.
const std::string kGap = "backlash";

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
  const Finding screened = BandDiagnosis(model, train, test, Band::kWide, gaps).examine();
  narrow.seconds += screened.seconds;
  narrow.interrupted |= screened.interrupted;
  if (narrow.interrupted || screened.causes.empty()) return narrow;
  BandDiagnosis again(model, train, test, Band::kWide, options);
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

}  // namespace

Finding diagnose_joints(const Model& model, const RecordingSource& train,
                        const RecordingSource* test, const DiagnoseOptions& options) {
  BandDiagnosis narrow(model, train, test, Band::kInformative, options);
  const Finding& first = narrow.examine();
  if (first.interrupted || !narrow.wider()) return narrow.finish();
  if (first.verdict == Verdict::kNone)
    return with_gap_beyond(model, train, test, options, narrow.finish());
  if (first.verdict != Verdict::kUnknown) return narrow.finish();
  // A stiff loop keeps what is fast out of the positions, not out of the torques.
  BandDiagnosis wide(model, train, test, Band::kWide, options);
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
