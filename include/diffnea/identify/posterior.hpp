#pragma once
/// Models that a recording leaves possible: draws of the Gaussian that identification left in the
/// model (Model::posterior, Laplace's approximation), with all its correlations. The string's
/// length and where it is tied are one block: along the string one makes up for the other, and
/// drawing each by its own standard error would be wrong.
///
/// The arm's parameters are drawn where torques are linear in them. What comes out as a body that
/// cannot be, or as a friction below 0, is replaced by the nearest possible parameters in the
/// metric of the posterior (the convex fit of identify/convex_fit.hpp): directions that the data do
/// not see give way first. Directions that the data do not determine (known worse than what a
/// parameter may well be) stay as fitted: no motion that was recorded tells of them.

#include <cstdint>
#include <string>
#include <vector>

#include <diffnea/core/fields.hpp>
#include <diffnea/model/model.hpp>

namespace diffnea {

/// A parameter that every draw has anywhere within a range: what a model may lack, or has wrongly,
/// and no recording has told of. Uniform.
struct Variation {
  std::string parameter;
  double low = 0.0;
  double high = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Variation", "A parameter that every draw has anywhere within a range.",
              {.exact = true});
    list.field("parameter", &Variation::parameter,
               "As result files name it: ``string.string_mass.mass_ratio``, "
               "``elbow.coulomb_friction.coulomb``, ``string.length``, ``string.attachment_x``.");
    list.field("low", &Variation::low, "Least value, in the parameter's unit.");
    list.field("high", &Variation::high, "Largest value, likewise.");
  }
};
/// "string.string_mass.mass_ratio=0:0.1". @throws Error that says what came and what was expected
Variation parse_variation(const std::string& text);

/// The model with every effect that `vary` names: one that it has not comes with its initial values
/// (of an amplitude 0: it is absent).
/// @throws ModelError naming the choices if there is no such effect, place or parameter
Model with_varied_effects(const Model& model, const std::vector<Variation>& vary);

/// Draws of the posterior, all of one structure (that of with_varied_effects); what is varied takes
/// its range in place of the posterior. The first are the same however many are asked for.
/// @throws ModelError if the model has no posterior and nothing is varied, if it names parameters
///         that the model has not, or a range holds what a parameter cannot be
std::vector<Model> draw_models(const Model& model, int count, std::uint64_t seed,
                               const std::vector<Variation>& vary = {});

/// Whether it says something of the arm; else of a ball, its string and its camera alone.
bool knows_arm(const Posterior& posterior);
/// The arm's part of one and the ball's of the other, which do not correlate: they are of different
/// recordings, or of different columns of one.
Posterior joined(const Posterior* arm, const Posterior* ball);

}  // namespace diffnea
