#pragma once
/// The motion that tells apart what a recording could not. Internal to diagnose/.
///
/// Of some families of motions (ordinary, slow, fast up to 5 Hz, of one joint or of all, small,
/// large) it takes argmax over x of the smallest ‖M_b(x) g_a(x)‖² over the pairs of the class
/// (docs/diagnosis.md): g_a(x) is the torque of the cause at its fitted parameters along x,
/// whitened with the recording's noise; M_b projects out the base, the other causes, and the rival
/// b, which may take any parameters (Gauss–Newton).

#include <diffnea/diagnose/cause.hpp>
#include <diffnea/diagnose/next_experiment.hpp>

#include "diagnose/search.hpp"

namespace diffnea {

/// What a diagnosis knows, as far as the choice needs it.
struct ExperimentContext {
  const Model& model;      ///< as it was given: its limits
  const Model& reference;  ///< with the base as fitted, without the causes
  const FitLayout& layout;
  const BasePrior& prior;
  const PreprocessPlan& plan;
  const std::vector<int>& joints;  ///< whose torque is known
  const std::vector<JointNoise>& noise;
  bool link_side = false;
  const std::vector<Candidate>& candidates;
  const std::vector<Term>& terms;
  const std::vector<Cause>& causes;
  std::uint64_t seed = 0;
};

/// Largest number of pairs that one experiment is to separate: those that are hardest to tell.
inline constexpr std::size_t kMostPairs = 6;

/// The motion as a recording that nothing was measured in but the joints' positions.
Recording imaginary_recording(const Trajectory& motion);

/// @return empty where no cause has a rival in its class
/// @throws ModelError where the model's limits leave no motion (see excite/design.hpp), or a joint
///         has no motor: its motion cannot be planned
std::optional<NextExperiment> next_experiment(const ExperimentContext& context);

}  // namespace diffnea
