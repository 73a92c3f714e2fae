#pragma once
/// Diagnosis: which effect a model lacks, judged by recordings.
///
///     const Finding finding = diagnose(read_model("arm.urdf"), train, &test);
///     std::puts(finding.sentence.c_str());
///     write_model(finding.model, "extended.json");
///
/// Method (docs/diagnosis.md): filter torques and every candidate's columns alike; estimate the
/// noise from what a saturated model leaves, whiten; project the base out; score every candidate by
/// what it removes (Lagrange multiplier, BIC); refine shapes; accept what also helps on held-out
/// data; eliminate backward; report what else would do nearly as well, what cannot be seen, and on
/// what the rest depends.

#include <cstdint>

#include <diffnea/core/options.hpp>
#include <diffnea/diagnose/finding.hpp>
#include <diffnea/diagnose/own_candidate.hpp>

namespace diffnea {

/// What diagnosis may re-fit of the base model.
enum class Base {
  kAuto,   ///< kPrior if the model has a posterior that was made of other recordings, else kRefit
  kRefit,  ///< all its parameters
  kPrior,  ///< within the posterior that identification left
  kFixed,  ///< nothing: the model stands accused as it is
};

/// Names in options.
template <>
struct EnumNames<Base> {
  /// All choices.
  static constexpr NamedValue<Base> list[] = {{Base::kAuto, "auto"},
                                              {Base::kRefit, "refit"},
                                              {Base::kPrior, "prior"},
                                              {Base::kFixed, "fixed"}};
};

/// What a diagnosis may re-fit, what it tries, and when it accepts.
struct DiagnoseOptions {
  Base base = Base::kAuto;  ///< what of the model may move beside the causes
  /// Candidates: names, "name@where", or empty for the whole catalogue.
  std::vector<std::string> effects;
  /// The caller's own, beside those.
  std::vector<OwnCandidate> candidates;
  /// With no `effects`: the caller's own alone, nothing of the catalogue.
  bool own_alone = false;
  PreprocessOptions preprocess;  ///< filters and rates; the low-pass is steeper than identify's
  /// Where the verdict is kUnknown, learn what is left as a function of what it depends on.
  bool grey_box = true;
  double accept_delta_bic = 10.0;  ///< ΔBIC that a cause must exceed
  int max_causes = 0;              ///< 0: three for each joint, at least eight
  std::uint64_t seed = 0;          ///< of the bootstrap
  int threads = 1;                 ///< shares of simulated runs; the finding does not depend on it
  /// Called as the search goes on; returns false: stop with the causes found so far. May be empty.
  std::function<bool(const FitProgress&)> progress;

  /// Whether all that the catalogue has is tried.
  bool whole_catalogue() const { return effects.empty() && !own_alone; }

  /// Names and texts (core/options.hpp).
  template <class List>
  void options(List& list) {
    list.option("--base", "base", base,
                "what may be re-fitted of the model: refit (all), prior (within the posterior that "
                "identify left), fixed (nothing), auto (prior if there is one, of other recordings "
                "than this; else refit)");
    list.option("--effects", "effects", effects,
                "candidates: name, name@where or name@joint,joint; default: all that `diffnea "
                "effects` lists",
                {.by_commas = true, .all = true});
    list.option("--grey-box", "grey_box", grey_box,
                "where no effect explains what is left (verdict UNKNOWN), learn it as a torque "
                "without a name");
    list.option("--filter", "filter_hz", preprocess.filter_hz,
                "low-pass of the positions [Hz], 0: chosen", {.least = 0.0});
    list.option("--decimate", "decimate_to_hz", preprocess.decimate_to_hz,
                "rate of the tests [Hz], 0: chosen", {.least = 0.0});
    list.option(nullptr, "max_causes", max_causes,
                "at most so many are named, 0: three for each joint, at least eight");
    list.option(nullptr, "seed", seed, "of the bootstrap");
    list.option(nullptr, "threads", threads, "that share simulated runs");
  }
};

/// @param test  held-out recordings; null: blocks of time are held out, which is weaker
/// @throws DataError, ModelError, FileError before any work starts where the input is at fault,
/// such as an
///         own candidate whose name is taken or whose columns are no (N, parameters) finite numbers
Finding diagnose(const Model& model, const RecordingSource& train, const RecordingSource* test,
                 const DiagnoseOptions& options = {});
/// The same as data alone, without `sentence` and `plots`, which report/ adds. Throws likewise.
Finding find_causes(const Model& model, const RecordingSource& train, const RecordingSource* test,
                    const DiagnoseOptions& options = {});
/// The same from recordings in memory.
Finding diagnose(const Model& model, const std::vector<Recording>& train,
                 const std::vector<Recording>& test, const DiagnoseOptions& options = {});

}  // namespace diffnea
