#include "diagnose/selection.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

#include "diagnose/inexact.hpp"
#include "diagnose/refine.hpp"
#include "diagnose/selection_terms.hpp"
#include "diagnose/sessions.hpp"
#include "diagnose/thresholds.hpp"

namespace diffnea {
namespace {

constexpr int kRefined = 5;  ///< candidates whose shapes are refined at each step
/// Chance at which runs that differ no more than their blocks would still be called different.
constexpr double kByChance = 0.005;
constexpr const char* kNoMoreThanInexact =
    "explains no more than what the model computes inexactly";

}  // namespace

std::vector<Term> Selection::run() {
  std::vector<Term> terms;
  go_on(terms);
  for (std::vector<Term> other = terms; judge(other); other = terms) {
    go_on(other);
    for (Term& t : terms) search_.set_columns(t);
    const double worse = search_.bic(other) - search_.bic(search_.fit(terms), terms);
    if (!(change(terms, other).log_low - worse > options_.accept)) {
      renew(terms);
      break;
    }
    terms = std::move(other);
  }
  return terms;
}

void Selection::resume(std::vector<Term>& terms, std::size_t without, const char* why) {
  const int fallen = terms[without].candidate;
  note_refusal(candidates_[fallen], why, 0.0);
  fallen_.push_back(fallen);
  terms = diffnea::without(terms, without);
  go_on(terms);
}

void Selection::go_on(std::vector<Term>& terms) {
  do {
    grow(terms);
    for (int i = 0; i < options_.max_terms; ++i)
      if (!put_simpler(terms)) break;
    drop_impossible(terms);
  } while (drop_needless(terms) || (drop_unstable(terms) && !terms.empty()));
}

void Selection::grow(std::vector<Term>& terms) {
  std::set<std::set<int>> seen;
  if (!terms.empty()) settle(terms);  // beside what fell, another stood for it
  for (int step = 0;
       step < 3 * options_.max_terms && static_cast<int>(terms.size()) < options_.max_terms;
       ++step) {
    if (options_.progress && !options_.progress({"testing", step, 0, search_.residual_sum() / 2.0}))
      break;
    if (!add_one(terms)) break;
    settle(terms);
    if (drop_impossible(terms)) continue;  // beside what is left, another may help now
    if (!seen.insert(names(terms)).second) break;
  }
  if (!terms.empty()) renew(terms);
}

void Selection::settle(std::vector<Term>& terms) {
  renew(terms);
  eliminate(terms);
  for (int i = 0; i < options_.max_terms && (split(terms) || sharpen(terms) || exchange(terms));
       ++i)
    renew(terms);
  eliminate(terms);
}

Wanted Selection::standing(const Wanted& also) const {
  return [this, also](int candidate) {
    return std::ranges::find(fallen_, candidate) == fallen_.end() && (!also || also(candidate));
  };
}

bool Selection::add_one(std::vector<Term>& terms) {
  for (Offer& offer : offers(terms, kRefined, standing())) {
    if (offer.delta_bic <= options_.accept) continue;  // a parent that went first; its child may
    if (std::ranges::find(refused_candidates_, offer.term.candidate) != refused_candidates_.end())
      continue;
    const Candidate& c = candidates_[offer.term.candidate];
    std::vector<Term> with = joined(terms, offer.term);
    const double gain = search_.fit(with) - search_.gain_of(terms);
    if (gain < inexact_at(search_, offer.term, terms)) {
      note_refusal(c, kNoMoreThanInexact, offer.delta_bic);
      continue;
    }
    // The base was fitted to links that follow their motor: what does not bends its inertias as no
    // other effect does.
    const bool helped = helps(terms, with);
    const bool anew = !helped && !offer.term.effect.own && hides_motor(offer.term.effect);
    if (helped || (anew && helps_anew(terms, with))) {
      terms = std::move(with);
      refused_candidates_.clear();  // beside another set it may help
      return true;
    }
    refused_candidates_.push_back(offer.term.candidate);
    note_refusal(c, "does not help on held-out data", offer.delta_bic);
    if (anew) return add_one(terms);  // the others' columns are of another noise
  }
  return false;
}

void Selection::renew(std::vector<Term>& terms) {
  if (options_.rebase)
    if (const std::vector<bool> moved = options_.rebase(terms); !moved.empty())
      search_.recompute(moved);
  rivals_.clear();
  search_.refresh(options_.period, terms);
  // Beside its spring, a joint's friction is another: which side of it, and how stiff, is asked
  // anew.
  for (std::size_t i = 0; i < terms.size(); ++i)
    if (!candidates_[terms[i].candidate].choices.empty())
      terms[i] = refined(search_, terms[i], without(terms, i));
  search_.fit(terms);
}

Term Selection::offered(const Score& score, const std::vector<Term>& terms) const {
  const auto gain = [&](const Term& t) {
    std::vector<Term> with = joined(terms, t);
    return search_.fit(with);
  };
  Term out = search_.term_of(score);
  if (const auto before = refined_.find(score.candidate); before != refined_.end()) {
    Term from = out;
    from.shapes = before->second.shapes;
    from.effect.parameters = before->second.effect.parameters;
    search_.set_columns(from);
    if (gain(from) > gain(out)) out = std::move(from);
  }
  out = with_shapes_refined(search_, std::move(out), terms);
  if (out.shapes.empty()) return out;
  Term& kept = refined_[score.candidate];
  kept.shapes = out.shapes;
  kept.effect.parameters = out.effect.parameters;
  return out;
}

const std::vector<Selection::Offer>& Selection::rivals(const std::vector<Term>& terms) const {
  std::vector<double> key;
  for (const Term& t : terms) {
    key.push_back(t.candidate);
    for (std::size_t k = 0; k < t.effect.parameters.size(); ++k)
      if (t.has_offset() || std::ranges::find(t.linear, static_cast<int>(k)) == t.linear.end())
        key.push_back(t.effect.parameters[k]);
  }
  const auto known = rivals_.find(key);
  return known != rivals_.end() ? known->second
                                : rivals_.emplace(key, offers(terms, kRivals)).first->second;
}

std::vector<Selection::Offer> Selection::offers(const std::vector<Term>& terms, int how_many,
                                                const Wanted& wanted) const {
  std::vector<Offer> out;
  const std::set<int> present = names(terms);
  const double before = search_.bic(terms);
  for (const Score& s : search_.scores(terms, wanted)) {
    if (static_cast<int>(out.size()) >= how_many || s.variant < 0 ||
        s.delta_bic < -3.0 * options_.accept)
      break;
    if (present.contains(s.candidate) || is_impossible(s.candidate)) continue;
    std::vector<Term> with = joined(terms, offered(s, terms));
    const double gain = search_.fit(with);
    if (!plausible(search_, with.back()) || with.back().visible_share() < kAbsorbed) continue;
    if (is_no_shift(search_, with) || is_of_swing(search_, with.back(), terms)) continue;
    out.push_back({with.back(), before - search_.bic(gain, with)});
  }
  std::ranges::stable_sort(out, std::greater<>{}, &Offer::delta_bic);
  // A parent within reach of its child goes first: the simpler name.
  for (std::size_t i = 1; i < out.size(); ++i)
    if (out[0].delta_bic - out[i].delta_bic < kToldApart &&
        out[i].term.num_parameters() < out[0].term.num_parameters() &&
        search_.replaced_share(out[i].term, out[0].term, terms) > kChild) {
      std::rotate(out.begin(), out.begin() + static_cast<long>(i),
                  out.begin() + static_cast<long>(i) + 1);
      break;
    }
  return out;
}

HeldOutChange Selection::change(std::vector<Term> without, std::vector<Term> with) const {
  search_.fit(without);  // without one of them, the others take over what they can
  search_.fit(with);
  return held_out_.compare(held_out_.predicted(search_, without),
                           held_out_.predicted(search_, with));
}

bool Selection::helps(const std::vector<Term>& without, const std::vector<Term>& with) const {
  // A constant for each run always helps there: runs must differ beyond chance as well.
  for (const Term& t : with)
    if (is_of_runs(t.effect) &&
        std::ranges::find(without, t.candidate, &Term::candidate) == without.end())
      if (const long k = search_.evidence().index_of(t.effect.joints.front());
          k < 0 || sessions_alike(search_.evidence(), search_.residual(without),
                                  search_.whitener().kept(), k, options_.seed) > kByChance)
        return false;
  return change(without, with).helps();
}

bool Selection::helps_anew(std::vector<Term>& terms, std::vector<Term>& with) {
  std::vector<Term> before = terms;
  renew(with);
  std::vector<Term> rest = with;
  rest.pop_back();
  if (helps(rest, with)) return true;
  renew(before);
  terms = std::move(before);
  return false;
}

bool Selection::tilt_helps(const std::vector<Term>& rest, std::vector<Term>& terms) {
  std::vector<Term> level = rest;
  renew(level);
  const VecX<double> without = held_out_.errors(search_, level);
  renew(terms);  // both by the noise beside the tilt: beside none, the tilt passes for noise
  return held_out_
      .compare(held_out_.predicted(search_, without), held_out_.predicted(search_, terms))
      .helps();
}

void Selection::note_refusal(const Candidate& c, const char* why, double delta_bic) {
  refused_.push_back({c.effect.info().name, c.effect.where, why, delta_bic});
}

}  // namespace diffnea
