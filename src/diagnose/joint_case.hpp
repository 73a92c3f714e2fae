#pragma once
/// What the joints' part of a diagnosis works on: rows that are fitted and held out, the base and
/// the candidates. Internal to diagnose/.

#include <memory>
#include <vector>

#include <diffnea/diagnose/diagnose.hpp>

#include "diagnose/held_out.hpp"
#include "diagnose/reference.hpp"
#include "diagnose/rows.hpp"
#include "diagnose/unfolded_base.hpp"

namespace diffnea {

/// Stays where it is: its parts refer to each other.
struct JointCase {
  const Model& model;
  const RecordingSource& train_source;
  const RecordingSource* test_source;  ///< null: rows of `train` are held out
  DiagnoseOptions options;
  Linearisation about;                   ///< without widths, links move to a fit
  const UnfoldedBase* floats = nullptr;  ///< whose model and sources these are; null: none
  Finding finding = {};

  Base base = Base::kRefit;
  FitLayout layout = {};
  BasePrior prior = {};
  double period = 0.0;  ///< of the motion [s]; 0: it does not repeat
  PreprocessPlan test_plan = {};
  bool link_side = false;
  bool drowned = false;  ///< more than half of some joint's torque is noise
  std::vector<bool> fitted_rows = {}, held_rows = {};
  std::unique_ptr<Evidence> train = {}, test = {};
  std::vector<Candidate> candidates = {};
  std::unique_ptr<Reference> reference = {};
  std::unique_ptr<HeldOut> held_out = {};
  std::unique_ptr<Search> search = {};

  /// Degrees of freedom that lead and are a floating base's.
  int base_joints() const { return floats ? kBaseJoints : 0; }
};

/// Fills in what does not depend on causes. The finding is told of the data and of candidates that
/// are refused.
/// @param c  model, sources and options are given
void prepare(JointCase& c);

IdentifyOptions reading_options(const DiagnoseOptions& options);

}  // namespace diffnea
