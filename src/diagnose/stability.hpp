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

/// One half of the blocks; the next or the one before is the other.
struct HalfChoice {
  std::vector<int> chosen;     ///< contenders, by index
  std::vector<double> square;  ///< (contenders) of the whitened torque that the base leaves
};

/// Repeats the selection among the contenders, base refitted, on random halves of the blocks. A
/// contender is chosen on a half where it is worth half of what it must be worth on the whole.
/// @param contenders  causes and their rivals, each at its shapes and values
/// @param accept      ΔBIC of a cause on the whole recording
/// @return halves in pairs; empty where there are too few blocks to halve
std::vector<HalfChoice> choose_on_halves(const Search& search, const std::vector<Term>& contenders,
                                         double accept, std::uint64_t seed);

/// Share of the halves that choose one of `any`, of those that a contender shows in: a limit that
/// is met once says nothing on the half that does not meet it.
double share_of(const std::vector<HalfChoice>& halves, int contender, const std::vector<int>& any);

}  // namespace diffnea
