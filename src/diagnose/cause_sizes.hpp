#pragma once
/// How well the sizes of causes are known: what noise leaves, what is left and goes with the
/// motion, and how exact their columns are. Internal to diagnose/.

#include <diffnea/diagnose/cause.hpp>

#include "diagnose/search.hpp"

namespace diffnea {

/// Covariance of each term's parameters, linear ones first, then shapes (of their logarithm).
std::vector<MatX<double>> covariances(const Search& search, const std::vector<Term>& terms);

/// Whether the recording tells how large a cause is: its shapes show, or the model knows a rotor
/// beside which they do.
bool has_size(const Candidate& candidate, const Term& term);

/// Tells whether zero is in every interval of the parameters that a cause is proportional to.
/// @param sizes  of the term
bool may_be_nothing(const Term& term, const std::vector<CauseParameter>& sizes);

/// The parameters of a term with their 95 % intervals; NaN: held, or not told.
/// @param covariance  of terms[which]
std::vector<CauseParameter> sizes(const Search& search, const std::vector<Term>& terms,
                                  std::size_t which, const MatX<double>& covariance);

/// Sizes of the robot among them. What swings behind an encoder is moved by its log, whose
/// noise at the resonance is in no measured torque: to a fit that looks like a damper. So a damping
/// may be none, and the resonance lies within its width, ω² (1 ± ζ) by one standard deviation.
std::vector<CauseParameter> of_robot(const Candidate& candidate, const Term& term,
                                     std::vector<CauseParameter> sizes);

}  // namespace diffnea
