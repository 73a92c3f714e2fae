#pragma once
/// A diagnosis of the joints that looks at rows up to one frequency. Internal to diagnose/.

#include <vector>

#include "diagnose/grey_box.hpp"
#include "diagnose/joint_case.hpp"

namespace diffnea {

class BandDiagnosis {
 public:
  /// @param test  null: rows of `train` are held out
  BandDiagnosis(const Model& model, const RecordingSource& train, const RecordingSource* test,
                Turns turns, const DiagnoseOptions& options);
  BandDiagnosis(const BandDiagnosis&) = delete;
  BandDiagnosis& operator=(const BandDiagnosis&) = delete;

  /// Verdict and causes; finish() adds what goes with them.
  Finding& examine();
  /// What there is of it.
  const Finding& finding() const { return case_.finding; }

  Finding finish();

  /// Those of `effects` that are candidates at a joint whose turns were left out, "effect@joint".
  std::vector<std::string> without_turns(const std::vector<std::string>& effects) const;

 private:
  void select();
  /// That a base whose drives have no dry friction is better identified first.
  void note_friction();
  /// Says where torques act at other instants than the sidecar tells.
  void note_instant();
  void describe();
  void judge();
  /// Errors, parameters and motion of the extended model.
  void complete();
  /// @param alone  the base's parameters without causes
  void simulate(const VecX<double>& alone);
  /// Only where something is left to tell apart: it takes a few seconds.
  void plan_next();
  void add_grey_box();

  JointCase case_;
  double level_sum_ = 0.0;  ///< χ² of the base alone, before any cause
  bool misfit_ = false;     ///< more than noise is left
  std::vector<Score> first_scores_;
  std::vector<Term> terms_;
  std::vector<WitnessScore> witness_;
  GreyBoxResult grey_;
};

}  // namespace diffnea
