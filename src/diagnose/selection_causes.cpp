/// Describes the causes that stay: sizes, evidence, rivals, gain.

#include <algorithm>
#include <cmath>

#include "diagnose/cause_sizes.hpp"
#include "diagnose/selection.hpp"
#include "diagnose/selection_terms.hpp"
#include "diagnose/stability.hpp"
#include "diagnose/thresholds.hpp"

namespace diffnea {
namespace {

/// Share of the halves in which a rival is chosen, to be of the class of a cause that is not chosen
/// in most of them.
constexpr double kSomeHalves = 0.1;

}  // namespace

void Selection::add_rivals(const std::vector<Term>& terms, std::size_t which, Cause& cause) const {
  const std::vector<Term> rest = without(terms, which);
  const double best = search_.bic(terms);
  const double base = search_.bic(rest);
  const int own = terms[which].num_parameters();
  for (const Offer& offer : rivals(rest)) {
    if (offer.term.candidate == terms[which].candidate) continue;
    // An effect that does something else is no rival, however much the model lacks it.
    const double alike_share = search_.replaced_share(terms[which], offer.term, rest);
    if (alike_share < kStandsIn) continue;
    const Candidate& c = candidates_[offer.term.candidate];
    Rival rival{c.effect.info().name, c.effect.where, base - offer.delta_bic - best};
    if (rival.delta_bic < 0.0) {  // better here, but not where it was not fitted
      std::vector<Term> with = joined(rest, offer.term);
      search_.fit(with);
      if (!helps(rest, with)) continue;
    }
    // A body in the hand is no more general kind of force, however well it does its work.
    // Nor is one that has more, if the base hides what it has more.
    rival.more_general = offer.term.num_parameters() > own &&
                         c.effect.info().port != Port::kModelParameter && alike_share > kChild &&
                         search_.visible_beyond(offer.term, terms[which]) > kAbsorbed;
    if (const auto at = chosen_.find(offer.term.candidate); at != chosen_.end())
      rival.stability = at->second;
    const bool instead = cause.stability < kMostHalves && rival.stability > kSomeHalves;
    const bool alike =
        rival.more_general ? rival.delta_bic < -kNoWorse : rival.delta_bic < kToldApart || instead;
    (alike ? cause.members : cause.rivals).push_back(rival);
  }
  for (auto* list : {&cause.members, &cause.rivals})
    std::ranges::sort(*list, {}, &Rival::delta_bic);
}

std::vector<Cause> Selection::causes(const std::vector<Term>& terms) const {
  std::vector<Cause> out;
  const std::vector<MatX<double>> covariances = diffnea::covariances(search_, terms);
  const double all = search_.gain_of(terms);
  for (const auto& [i, share] : held_out_.shares(search_, terms)) {
    const Term& t = terms[i];
    const std::vector<Term> rest = without(terms, i);
    Cause cause;
    cause.share = share;
    cause.effect = t.effect.info().name;
    cause.where = t.effect.where;
    const double gain_without = search_.gain_of(rest);
    cause.lm = all - gain_without;
    cause.delta_bic = search_.bic(gain_without, rest) - search_.bic(all, terms);
    cause.visible_share = t.visible_share();
    cause.torque_share = search_.torque_share(t);
    cause.parameters =
        of_robot(candidates_[t.candidate], t, sizes(search_, terms, i, covariances[i]));
    const HeldOutChange held = change(rest, terms);
    cause.gain = {std::sqrt(held.before), std::sqrt(held.after), 0.0, 0.0, held.low, held.high};
    cause.gain.explained_share = held.before > 0.0 ? 1.0 - held.after / held.before : 0.0;
    if (const auto at = chosen_.find(t.candidate); at != chosen_.end())
      cause.stability = at->second;
    add_rivals(terms, i, cause);
    cause.verdict = cause.members.empty() ? Verdict::kNamed : Verdict::kClass;
    out.push_back(std::move(cause));
  }
  return out;
}

}  // namespace diffnea
