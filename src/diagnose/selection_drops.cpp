/// Which causes do not stay: of a size that no robot has or that nothing tells, of no use on
/// held-out data, or chosen on too few halves of the recording.

#include <algorithm>

#include "diagnose/cause_sizes.hpp"
#include "diagnose/refine.hpp"
#include "diagnose/selection.hpp"
#include "diagnose/selection_terms.hpp"
#include "diagnose/stability.hpp"
#include "diagnose/thresholds.hpp"

namespace diffnea {
namespace {

constexpr const char* kHelpsNot = "does not help on held-out data beside the others";
constexpr const char* kSizeless = "of no size that this recording tells";
constexpr const char* kMayBeNothing = "may be of size zero beside the others";
constexpr const char* kImpossible = "comes to a size that no robot has, beside the others";

}  // namespace

bool Selection::drop_impossible(std::vector<Term>& terms) {
  bool any = false;
  for (auto at = std::ranges::find_if(terms, impossible); at != terms.end();
       at = std::ranges::find_if(terms, impossible)) {
    const Candidate& c = candidates_[at->candidate];
    const std::vector<Term> rest = without(terms, (at - terms.begin()));
    const double worse = search_.bic(rest) - search_.bic(terms);
    impossible_.push_back(at->candidate);
    note_refusal(c, kImpossible, worse);
    terms = rest;
    renew(terms);
    any = true;
  }
  return any;
}

bool Selection::drop_needless(std::vector<Term>& terms) {
  bool anew = false;
  for (std::size_t i = terms.size(); i-- > 0;) {
    const std::vector<Term> rest = without(terms, i);
    const Candidate& c = candidates_[terms[i].candidate];
    const double worse = search_.bic(rest) - search_.bic(terms);
    if (stays(terms[i])) {
      if (worse >= options_.accept && tilt_helps(rest, terms)) continue;
      note_refusal(c, kHelpsNot, worse);
      impossible_.push_back(terms[i].candidate);
      terms.clear();  // the base's columns as they were; another may stand where it stood
      renew(terms);
      return true;
    }
    const bool vague = !has_size(c, terms[i]) &&
                       (c.effect.info().motor != HiddenMotor::kNone || worse < kLeastSizeless);
    const char* why =
        vague ? kSizeless
        : may_be_nothing(terms[i], sizes(search_, terms, i, covariances(search_, terms)[i]))
            ? kMayBeNothing
        : shifts_torques(search_, rest) || helps(rest, terms) ? nullptr
                                                              : kHelpsNot;
    if (!why) continue;
    note_refusal(c, why, why == kHelpsNot ? 0.0 : worse);
    (why == kMayBeNothing ? impossible_ : fallen_).push_back(terms[i].candidate);
    anew |= why == kMayBeNothing;
    terms = rest;
    search_.fit(terms);
    i = terms.size();  // the others, beside what is left
  }
  return anew;
}

bool Selection::drop_unstable(std::vector<Term>& terms) {
  if (terms.empty()) return false;
  std::vector<Term> contenders = terms;
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (stays(terms[i])) continue;
    for (const Offer& offer : rivals(without(terms, i)))
      if (std::ranges::find(contenders, offer.term.candidate, &Term::candidate) == contenders.end())
        contenders.push_back(offer.term);
  }
  // Whoever offered it: a spring that came in the place of a rotor may do an offset's work.
  std::vector<std::vector<int>> stand_for(terms.size());  // contenders, by index
  for (std::size_t i = 0; i < terms.size(); ++i) {
    stand_for[i].push_back(static_cast<int>(i));
    const std::vector<Term> rest = without(terms, i);
    for (std::size_t c = terms.size(); c < contenders.size(); ++c)
      if (search_.replaced_share(terms[i], contenders[c], rest) > kStandsIn)
        stand_for[i].push_back(static_cast<int>(c));
  }
  const std::vector<HalfChoice> halves =
      choose_on_halves(search_, contenders, options_.accept, options_.seed);
  if (halves.empty()) return false;
  chosen_.clear();
  for (std::size_t c = 0; c < contenders.size(); ++c)
    chosen_[contenders[c].candidate] = share_of(halves, static_cast<int>(c), {static_cast<int>(c)});
  std::size_t drop = terms.size();
  double least = kMostHalves;
  for (std::size_t i = 0; i < terms.size(); ++i)
    if (const double share = share_of(halves, static_cast<int>(i), stand_for[i]);
        !stays(terms[i]) && share < least)
      least = share, drop = i;
  if (drop == terms.size()) return false;
  const Candidate& c = candidates_[terms[drop].candidate];
  const std::vector<Term> rest = without(terms, drop);
  note_refusal(c, "chosen on too few halves of the recording",
               search_.bic(rest) - search_.bic(terms));
  fallen_.push_back(terms[drop].candidate);
  terms = rest;
  search_.fit(terms);
  return true;
}

}  // namespace diffnea
