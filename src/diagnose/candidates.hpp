#pragma once
/// Which effects are tried, where, and from which shapes a search starts. Internal to diagnose/.

#include <memory>

#include <diffnea/diagnose/own_candidate.hpp>
#include <diffnea/effects/bound_effect.hpp>

namespace diffnea {

/// An effect of the catalogue, or the caller's own in the same clothes.
struct TriedEffect : BoundEffect {
  struct Own : OwnCandidate {
    EffectInfo description;
  };
  std::shared_ptr<const Own> own;  ///< null: of the catalogue
  /// Index of a parameter of no model, which scales its torque: how well its flights are told.
  /// Noise and what is wrong about the base move each impact a little, and by as much as they do
  /// that, the torque that goes with what is missing is smaller than it would be (Fuller 1987, sec.
  /// 1.1). −1: none.
  int told = -1;

  const EffectInfo& info() const { return own ? own->description : BoundEffect::info(); }

  /// Index of a parameter; −1: it has none of the name.
  int index_of(const std::string& name) const;
};

/// Its parameters, without what is of no model.
EffectSpec to_spec(const TriedEffect& effect);

struct Candidate {
  TriedEffect effect;
  std::vector<int> linear;    ///< parameters that a fit solves for, by columns ∂τ/∂p
  std::vector<int> shapes;    ///< parameters that a search moves, by factors if Scale::kLog
  bool nonlinear = false;     ///< the columns change with those parameters
  bool of_reference = false;  ///< they change with the model that they refer to
  std::vector<int> choices;   ///< parameters that are one of ParameterInfo::choices
  std::vector<std::vector<double>> grid;  ///< values of `shapes`, then of `choices`, that the
                                          ///< search starts from; one empty entry if none

  std::vector<double> shape_low, shape_high;  ///< of `shapes`; 0, infinity: no bound
  double rotor = 0.0;                         ///< behind a spring [kg·m²] or [kg]
  bool rotor_assumed = false;                 ///< no model states it
  double swings = 0.0;  ///< inertia behind an encoder at the motor [kg·m²] or [kg]
  double held = 0.0;  ///< relative uncertainty of what is held at the model's word
  /// How recordings bound the first of `shapes`.
  SearchBound bound() const {
    return shapes.empty() ? SearchBound::kNone : effect.parameter_info[shapes[0]].bound;
  }
  /// Sets the shapes and choices of a point of the grid.
  void set(const std::vector<double>& point, BoundEffect& of) const;
  std::string label() const { return effect.info().name + " at " + effect.where; }
};

/// Every effect of the catalogue at every place it suits, or those asked for.
/// @param links  what the joints carry by a fit; the model, where there is none
/// @param asked  names or "name@where"; empty: all
/// @param runs   of the recordings
/// @param base   how many degrees of freedom lead that are a floating base's (UnfoldedBase)
/// @throws ModelError listing the names if an effect or place does not exist
std::vector<Candidate> make_candidates(const Model& model, const Model& links,
                                       const std::vector<std::string>& asked,
                                       const std::vector<int>& runs, bool link_side, int base = 0);

/// @throws ModelError if a name is taken or empty, a place is no joint, or parameters or columns
/// are missing
void add_own_candidates(const std::vector<OwnCandidate>& own, const Model& model,
                        std::vector<Candidate>& candidates);

/// Lets what flies across a gap bounce as it may, and be told in part (TriedEffect::told).
void tell_flights(std::vector<Candidate>& candidates);

}  // namespace diffnea
