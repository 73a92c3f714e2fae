#pragma once
/// Where no effect explains what is left: what of it is a smooth function of the variables that a
/// witness names, as the effect `residual`. Internal to diagnose/.
///
/// y = A x + S ψ + Φ w + noise, whitened: A the base within its prior, S the columns of the named
/// effects with the tangents of their shapes, Φ bumps on a grid where there is data, w ~ N(0, s²
/// I): a sparse Gaussian process (Quiñonero-Candela and Rasmussen 2005). The grid's widths and s
/// maximise the marginal likelihood. x, ψ and w are fitted together, with (P S)ᵀ Φ w = 0, P what
/// the base leaves (an orthogonal process: Plumlee 2017). Then the normal equations of ψ hold no w:
/// the named effects' estimates are the same with and without it. The base has no such shield, but
/// the flat prior that it has against any effect: it bears what the unknown torque has done to it,
/// and a residual that may not undo that does not help on held-out data (docs/diagnosis.md has
/// figures). The torque ends where the data end, for w weighs bumps and nothing else.

#include <diffnea/diagnose/cause.hpp>
#include <diffnea/diagnose/remainder.hpp>
#include <diffnea/diagnose/tried.hpp>

#include "diagnose/held_out.hpp"
#include "diagnose/witness.hpp"

namespace diffnea {

/// A torque beside the terms: on the fitted rows, and on held-out ones.
struct BesideTerms {
  VecX<double> there, here;
};

/// What was learned at one joint.
struct Remainder {
  TriedEffect effect;  ///< residual, with its table
  GreyBox description;
  Cause cause;  ///< kUnknown
  BesideTerms torque;
};

struct GreyBoxResult {
  std::vector<Remainder> joints;  ///< in the order in which they were accepted
  std::vector<Refusal> refused;
  BesideTerms torque;  ///< of all
};

/// Tries every joint, on the variables of its witness, without one on its own position and
/// velocity. Accepted is what has ΔBIC > accept, parameters as the fit spends them, more than the
/// named effects' columns may be wrong by, and helps on held-out data.
/// @param model    that effects are bound to
/// @param witness  best first
/// @param base     how many degrees of freedom lead that are a floating base's, and have no joint
GreyBoxResult grey_box(const Model& model, const Search& search, const std::vector<Term>& terms,
                       const HeldOut& held_out, const std::vector<WitnessScore>& witness,
                       double accept, int base = 0);

}  // namespace diffnea
