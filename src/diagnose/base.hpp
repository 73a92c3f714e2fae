#pragma once
/// What the base model may do beside effects, and what it does in the end. Internal to diagnose/.

#include <diffnea/diagnose/diagnose.hpp>

#include "diagnose/search.hpp"

namespace diffnea {

/// Rows of the inverse square root of a posterior's covariance (--base prior), and a weak pull on
/// what it says nothing of.
BasePrior base_prior(Base base, const Model& model, const FitLayout& layout,
                     const Evidence& evidence);

/// Where no torque is known but zeros, all masses times any number are as good a base: holds the
/// parameter that the most torque hangs on at the model's value.
/// @return its name; empty if a torque is known, or one is held
std::string hold_scale(const Evidence& evidence, FitLayout& layout);

/// Moves how sharply the base's friction turns (the v₀ of `layout`), and how early, to where the
/// recording has it, where that is far: the columns of `evidence` are straight lines about both.
/// @param torque  of the evidence, without what causes take of it, (rows())
/// @param early   Linearisation::early, by which `evidence` was read
/// @return whether it has; the evidence is then to be read anew
bool fit_turns(Base base, const Evidence& evidence, const VecX<double>& torque, FitLayout& layout,
               VecX<double>& early);

/// The model at the base parameters that fit the rows without any cause; as it is, unless its base
/// is refitted.
Model refitted(Base base, const Model& model, const FitLayout& layout, const Evidence& evidence);

/// Tells whether joints are so much heavier, or lighter, than those of the model `before`, about
/// which the filters of `evidence` were linearised, that these weigh its rows wrongly: no result
/// hangs on the unit of the file's masses, or on rotors that it lacks.
bool is_heavier(const Model& model, const Model& before, const Evidence& evidence);

/// The base parameters that go with the causes, physically consistent where all of them may move.
/// @param beside  a torque beside the terms, (rows()); empty: none
/// @param fit     written with --base refit
VecX<double> final_base(Base base, const FitLayout& layout, const Search& search,
                        const std::vector<Term>& terms, const VecX<double>& beside, LinearFit& fit);

}  // namespace diffnea
