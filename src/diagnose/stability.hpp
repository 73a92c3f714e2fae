#pragma once
/// Causes that are chosen whichever half of the recording is looked at: stability selection
/// (Meinshausen, Bühlmann 2010) over blocks of time, in complementary pairs of halves (Shah,
/// Samworth 2013). Products of columns add up over blocks, so that a repetition costs no pass over
/// the rows. Internal to diagnose/.

#include <cstdint>

#include "diagnose/search.hpp"

namespace diffnea {

/// Repetitions of which a cause must be chosen in so many. Of p candidates, q of which a repetition
/// chooses, at most q²/((2·share − 1) p) are then false on average (Meinshausen, Bühlmann 2010,
/// thm. 1): with 100 candidates and two causes, a fifth of one.
inline constexpr double kMostHalves = 0.6;

/// Causes and their rivals, each at its shapes, and how often each one is chosen.
struct Contender {
  Term term;
  double chosen = 0.0;  ///< share of the halves
};

/// Repeats the selection among the contenders, base refitted, on random halves of the blocks.
/// @param accept  ΔBIC of a cause on the whole recording; half of it on a half
/// @return false, and nothing else, where there are too few blocks to halve
bool choose_on_halves(const Search& search, double accept, std::uint64_t seed,
                      std::vector<Contender>& contenders);

}  // namespace diffnea
