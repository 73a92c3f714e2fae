/// Moves of a selection with the causes that it has: one fewer, another in its place, one for two
/// or several for one.

#include <algorithm>

#include <diffnea/diagnose/verdict.hpp>

#include "diagnose/cause_sizes.hpp"
#include "diagnose/gain.hpp"
#include "diagnose/inexact.hpp"
#include "diagnose/refine.hpp"
#include "diagnose/selection.hpp"
#include "diagnose/selection_terms.hpp"
#include "diagnose/thresholds.hpp"

namespace diffnea {
namespace {

constexpr int kInPlaceOfTwo = 3;  ///< candidates that are refined instead of two causes
constexpr int kMostParts = 4;     ///< simple effects in the place of a compound one
constexpr int kJudged = 3;        ///< pairs in a term's place that are asked of held-out data
constexpr const char* kPredictsWorse =
    "held-out data are predicted worse with it than with what stands in its place";
/// Promise of a shape's derivative, over the gain that it needs, from which it is refined.
constexpr double kPromise = 0.5;

}  // namespace

bool Selection::eliminate(std::vector<Term>& terms) const {
  bool any = false;
  while (!terms.empty()) {
    const double all = search_.gain_of(terms), with = search_.bic(all, terms);
    double least = options_.accept;
    std::size_t drop = terms.size();
    for (std::size_t i = 0; i < terms.size(); ++i) {
      if (stays(terms[i])) continue;
      std::vector<Term> rest = without(terms, i);
      const double kept = search_.fit(rest);
      double worse = search_.bic(kept, rest) - with;
      if (all - kept < inexact_at(search_, terms[i], rest) || is_of_swing(search_, terms[i], rest))
        worse = std::min(worse, 0.0);
      if (worse < least && !shifts_torques(search_, rest)) {
        least = worse;
        drop = i;
      }
    }
    if (drop == terms.size()) break;
    terms = without(terms, drop);
    search_.fit(terms);
    any = true;
  }
  return any;
}

bool Selection::exchange(std::vector<Term>& terms) const {
  const double now = search_.bic(terms);
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (stays(terms[i])) continue;
    std::vector<Term> rest = without(terms, i);
    const double base = search_.bic(rest);
    for (const Offer& offer : offers(rest, 3, standing())) {
      if (offer.term.candidate == terms[i].candidate || base - offer.delta_bic > now - 1.0)
        continue;
      // Parents and children: the child must be better by more than the class's width.
      const bool child = offer.term.num_parameters() > terms[i].num_parameters() &&
                         search_.replaced_share(terms[i], offer.term, rest) > kChild;
      if (child && base - offer.delta_bic > now - kToldApart) continue;
      std::vector<Term> with = joined(rest, offer.term);
      if (!helps(rest, with)) continue;
      search_.fit(with);
      terms = std::move(with);
      return true;
    }
  }
  return false;
}

bool Selection::merge(std::vector<Term>& terms) const {
  const double now = search_.bic(terms);
  for (std::size_t i = 0; i < terms.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      if (stays(terms[i]) || stays(terms[j])) continue;
      if (terms[i].effect.joints != terms[j].effect.joints) continue;
      const std::vector<Term> rest = without(without(terms, i), j);
      const auto at_its_joints = [&](int c) {
        return candidates_[c].effect.joints == terms[i].effect.joints;
      };
      for (const Offer& offer : offers(rest, kInPlaceOfTwo, standing(at_its_joints))) {
        std::vector<Term> with = joined(rest, offer.term);
        if (search_.bic(search_.fit(with), with) > now + kNoWorse && !sharpen(with)) continue;
        if (search_.bic(with) > now + kNoWorse) continue;
        terms = std::move(with);
        return true;
      }
    }
  return false;
}

bool Selection::simplify(std::vector<Term>& terms) const {
  const double now = search_.bic(terms);
  const auto of = [&](const Term& t) -> const Candidate& { return candidates_[t.candidate]; };
  // A shape that the recording does not tell is none that makes an effect simple.
  const auto complexity = [&](const Term& t) {
    return t.linear.size() + of(t).shapes.size() - (t.effect.told >= 0 ? 1 : 0);
  };
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (stays(terms[i])) continue;
    const std::vector<Term> rest = without(terms, i);
    const double base = search_.bic(rest);
    const auto simpler = [&](int candidate) {
      const Candidate& c = candidates_[candidate];
      return std::ranges::any_of(terms[i].effect.joints, [&](int j) {
        return std::ranges::find(c.effect.joints, j) != c.effect.joints.end();
      });
    };
    for (const Offer& offer : offers(rest, kRivals, standing(simpler))) {
      const bool tells_size =
          has_size(of(offer.term), offer.term) && !has_size(of(terms[i]), terms[i]);
      if (complexity(offer.term) >= complexity(terms[i]) ||
          base - offer.delta_bic > now + (tells_size ? kLeastSizeless : kToldApart) ||
          search_.replaced_share(offer.term, terms[i], rest) < (tells_size ? kStandsIn : kChild))
        continue;
      std::vector<Term> with = joined(rest, offer.term);
      search_.fit(with);
      terms = std::move(with);
      return true;
    }
  }
  return false;
}

bool Selection::put_simpler(std::vector<Term>& terms) {
  std::vector<Term> simpler = terms;
  if (!merge(simpler) && !simplify(simpler)) return false;
  // About what the base is beside it, a large offset may be nothing.
  renew(simpler);
  if (std::vector<Term> left = simpler; !eliminate(left)) {
    terms = std::move(simpler);
    return true;
  }
  renew(terms);
  return false;
}

bool Selection::sharpen(std::vector<Term>& terms) const {
  for (std::size_t i = 0; i < terms.size(); ++i) {
    const int k = terms[i].effect.index_of("smoothing");
    if (k < 0 || std::ranges::count(terms[i].shapes, k) > 0 ||
        search_.gain_by_shape(terms, i, k) < kPromise * options_.accept)
      continue;
    const std::vector<Term> rest = without(terms, i);
    Term moved = terms[i];
    moved.shapes.push_back(k);
    std::vector<Term> with = joined(rest, refined(search_, std::move(moved), rest));
    if (search_.bic(search_.fit(with), with) > search_.bic(terms) - options_.accept) continue;
    terms = std::move(with);
    return true;
  }
  return false;
}

Wanted Selection::parts_of(const Term& whole) const {
  return standing([this, own = whole.candidate, joints = whole.effect.joints](int candidate) {
    const Candidate& c = candidates_[candidate];
    return !is_impossible(candidate) && c.effect.info().place == Place::kJoint &&
           c.linear.size() == 1 && c.shapes.empty() && !c.nonlinear && candidate != own &&
           std::ranges::all_of(c.effect.joints,
                               [&](int j) { return std::ranges::find(joints, j) != joints.end(); });
  });
}

std::vector<std::vector<Term>> Selection::pairs_for(const Term& whole,
                                                    const std::vector<Term>& rest) const {
  std::vector<std::pair<double, std::vector<Term>>> found;  // with their BIC
  const Wanted part = parts_of(whole);
  std::set<std::set<int>> seen;
  for (const Score& first : search_.scores(rest, part)) {
    if (first.variant < 0 || names(rest).contains(first.candidate)) continue;
    std::vector<Term> with = joined(rest, offered(first, rest));
    search_.fit(with);
    const std::vector<Score> scores = search_.scores(with, part);
    const auto second = std::ranges::find_if(scores, [&](const Score& s) {
      return s.variant >= 0 && s.delta_bic > options_.accept && !names(with).contains(s.candidate);
    });
    if (second == scores.end()) continue;
    with.push_back(offered(*second, with));
    if (!seen.insert(names(with)).second) continue;
    const double bic = search_.bic(search_.fit(with), with);
    if (plausible(search_, with.back()) && plausible(search_, with[with.size() - 2]))
      found.emplace_back(bic, std::move(with));
  }
  std::ranges::sort(found, {}, [](const auto& pair) { return pair.first; });
  std::vector<std::vector<Term>> out;
  for (auto& [bic, with] : found)
    if (std::ssize(out) < kJudged) out.push_back(std::move(with));
  return out;
}

bool Selection::judge(std::vector<Term>& terms) {
  if (terms.empty()) return false;
  if (const HeldOutChange all = change({}, terms);
      all.after < kFarOff * kFarOff || gain_of(all, 1.0).explained_share >= kExplained)
    return false;
  const double now = search_.bic(terms);
  double most = options_.accept;
  std::vector<Term> best;
  std::vector<std::pair<int, double>> beside_best;  // candidates and their evidence
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (stays(terms[i])) continue;
    const std::vector<Term> rest = without(terms, i);
    std::vector<std::pair<int, double>> alone{{terms[i].candidate, 0.0}};
    bool is_best = false;
    std::vector<std::vector<Term>> others = pairs_for(terms[i], rest);
    for (const Offer& offer : rivals(rest)) {
      if (!standing()(offer.term.candidate) || offer.term.candidate == terms[i].candidate) continue;
      others.push_back(rest);
      others.back().push_back(offer.term);
    }
    for (std::vector<Term>& with : others) {
      const double worse = search_.bic(search_.fit(with), with) - now;
      const double more = change(terms, with).log_low - worse;
      if (with.size() == terms.size()) alone.emplace_back(with.back().candidate, more);
      if (std::vector<Term> left = with; !(more > most) || eliminate(left)) continue;
      most = more;
      best = std::move(with);
      is_best = true;
    }
    if (is_best) beside_best = std::move(alone);
  }
  if (best.empty()) return false;
  const std::set<int> stand = names(best);
  for (const auto& [candidate, evidence] : beside_best) {
    if (stand.contains(candidate) || evidence > most - options_.accept) continue;
    note_refusal(candidates_[candidate], kPredictsWorse, 0.0);
    fallen_.push_back(candidate);
  }
  terms = std::move(best);
  return true;
}

bool Selection::split(std::vector<Term>& terms) const {
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (stays(terms[i])) continue;
    const bool compound = terms[i].num_parameters() > 1;
    const double now = search_.bic(terms);
    std::vector<Term> with = without(terms, i);
    double best = search_.bic(with);
    const Wanted part = parts_of(terms[i]);
    for (int parts = 0; parts < kMostParts; ++parts) {
      const std::vector<Score> scores = search_.scores(with, part);
      const auto next = std::ranges::find_if(scores, [&](const Score& s) {
        return s.variant >= 0 && s.delta_bic > options_.accept &&
               !names(with).contains(s.candidate);
      });
      if (next == scores.end()) break;
      with.push_back(offered(*next, with));
      best = search_.bic(search_.fit(with), with);
    }
    if (best > now - (compound ? 0.0 : options_.accept) || with.size() < terms.size()) continue;
    if (!helps(without(terms, i), with)) continue;
    terms = std::move(with);
    return true;
  }
  return false;
}

}  // namespace diffnea
