#include "diagnose/selection.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include <diffnea/effects/stepping.hpp>

#include "diagnose/cause_sizes.hpp"
#include "diagnose/inexact.hpp"
#include "diagnose/refine.hpp"
#include "diagnose/sessions.hpp"
#include "diagnose/stability.hpp"

namespace diffnea {
namespace {

constexpr int kRefined = 5;          ///< candidates whose shapes are refined at each step
constexpr int kRivals = 7;           ///< the same in the place of a cause
constexpr int kInPlaceOfTwo = 3;     ///< candidates that are refined instead of two causes
constexpr int kMostParts = 4;        ///< simple effects in the place of a compound one
constexpr double kSameClass = 10.0;  ///< ΔBIC
constexpr double kNoWorse = 6.0;     ///< ΔBIC, no strong evidence yet (Kass and Raftery 1995)
/// Promise of a shape's derivative, over the gain that it needs, from which it is refined.
constexpr double kPromise = 0.5;
/// ΔBIC of a cause whose size the recording does not tell, at least: any noise has some shape. A
/// motor behind a spring of any stiffness has that of whatever is late.
constexpr double kLeastSizeless = 50.0;
constexpr const char* kSizeless = "of no size that this recording tells";
constexpr const char* kHelpsNot = "does not help on held-out data beside the others";
constexpr const char* kHidden = "hardly visible beside the base parameters";
constexpr const char* kMayBeNothing = "may be of size zero beside the others";
constexpr const char* kImpossible = "comes to a size that no robot has, beside the others";
/// Share of the halves in which a rival is chosen, to be of the class of a cause that is not chosen
/// in most of them.
constexpr double kSomeHalves = 0.1;
/// Chance at which runs that differ no more than their blocks would still be called different.
constexpr double kByChance = 0.005;
constexpr double kStandsIn = 0.5;  ///< share of a cause's torque that a rival takes over, at least
constexpr double kChild = 0.98;  ///< of a cause's column that a more general effect reproduces

std::vector<Term> without(const std::vector<Term>& terms, std::size_t i) {
  std::vector<Term> out = terms;
  out.erase(out.begin() + static_cast<long>(i));
  return out;
}

/// Accepted, a tilt is in the base's columns, too: without it, they would be those of no model.
bool stays(const Term& term) { return term.effect.info().has(Trait::kGravity); }

/// Tells whether a clock that the last of the terms shifts, or a torque that it makes late, is with
/// all that shifts it where a drive that samples and holds its torques may have it.
bool is_no_shift(const Search& search, const std::vector<Term>& terms) {
  return Search::shift(terms.back()) != 0.0 &&
         std::ranges::all_of(terms.back().effect.joints,
                             [&](int j) { return search.samples_and_holds(j, terms); });
}

/// Tells whether terms suffice only where torques act at instants that no drive has, and none of
/// them may take that over.
bool shifts_torques(const Search& search, std::vector<Term> terms) {
  for (const Term& t : terms) {
    DrivePath<double> path{0.0, 0.0, 0.0};
    if (!t.effect.own) add_to_drive(t.effect, path);
    if (Search::shift(t) != 0.0 || path.lag != 0.0) return false;
  }
  search.fit(terms);
  return !search.samples_and_holds(terms);
}

std::set<int> names(const std::vector<Term>& terms) {
  std::set<int> out;
  for (const Term& t : terms) out.insert(t.candidate);
  return out;
}

}  // namespace

Term Selection::offered(const Score& score, const std::vector<Term>& terms) const {
  const auto gain = [&](const Term& t) {
    std::vector<Term> with = terms;
    with.push_back(t);
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
  const double before = search_.bic(search_.gain_of(terms), terms);
  for (const Score& s : search_.scores(terms, wanted)) {
    if (static_cast<int>(out.size()) >= how_many || s.variant < 0 ||
        s.delta_bic < -3.0 * options_.accept)
      break;
    if (present.contains(s.candidate) || is_impossible(s.candidate)) continue;
    std::vector<Term> with = terms;
    with.push_back(offered(s, terms));
    const double gain = search_.fit(with);
    if (!plausible(search_, with.back()) || with.back().visible_share() < kAbsorbed) continue;
    if (is_no_shift(search_, with)) continue;
    out.push_back({with.back(), before - search_.bic(gain, with)});
  }
  std::ranges::stable_sort(out, std::greater<>{}, &Offer::delta_bic);
  // A parent within reach of its child goes first: the simpler name.
  for (std::size_t i = 1; i < out.size(); ++i)
    if (out[0].delta_bic - out[i].delta_bic < kSameClass &&
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
  const std::vector<int>& joints = search_.evidence().joints();
  // A constant for each run always helps there: runs must differ beyond chance as well.
  for (const Term& t : with)
    if (is_of_runs(t.effect) &&
        std::ranges::find(without, t.candidate, &Term::candidate) == without.end())
      if (const auto joint = std::ranges::find(joints, t.effect.joints.front());
          joint == joints.end() ||
          sessions_alike(search_.evidence(), search_.residual(without), search_.whitener().kept(),
                         joint - joints.begin(), options_.seed) > kByChance)
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

void Selection::renew(std::vector<Term>& terms) {
  if (options_.rebase)
    if (const std::vector<bool> moved = options_.rebase(terms); !moved.empty())
      search_.recompute(moved);
  rivals_.clear();
  search_.refresh(options_.period, terms);
  // Beside its spring, a joint's friction is another: which side of it, and how stiff, is asked
  // anew.
  for (std::size_t i = 0; i < terms.size(); ++i)
    if (!candidates_[static_cast<std::size_t>(terms[i].candidate)].choices.empty())
      terms[i] = refined(search_, terms[i], without(terms, i));
  search_.fit(terms);
}

bool Selection::add_one(std::vector<Term>& terms) {
  for (Offer& offer : offers(terms, kRefined)) {
    if (offer.delta_bic <= options_.accept) continue;  // a parent that went first; its child may
    if (std::ranges::find(refused_candidates_, offer.term.candidate) != refused_candidates_.end())
      continue;
    const Candidate& c = candidates_[static_cast<std::size_t>(offer.term.candidate)];
    if (c.effect.info().motor != HiddenMotor::kNone && !has_size(c, offer.term)) {
      note_refusal(c, kSizeless, offer.delta_bic);
      continue;
    }
    std::vector<Term> with = terms;
    with.push_back(offer.term);
    const double gain = search_.fit(with) - search_.gain_of(terms);
    if (gain < inexact_at(search_, offer.term, terms)) continue;
    // The base was fitted without what swings, which bends its inertias as no other effect does.
    const bool swings = c.swings > 0.0 && encoder_at_motor(offer.term.effect);
    const bool helped = helps(terms, with), anew = !helped && swings;
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

void Selection::note_refusal(const Candidate& c, const char* why, double delta_bic) {
  refused_.push_back({c.effect.info().name, c.effect.where, why, delta_bic});
}

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
      if (all - kept < inexact_at(search_, terms[i], rest)) worse = std::min(worse, 0.0);
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

bool Selection::drop_impossible(std::vector<Term>& terms) {
  bool any = false;
  for (auto at = std::ranges::find_if(terms, impossible); at != terms.end();
       at = std::ranges::find_if(terms, impossible)) {
    const Candidate& c = candidates_[static_cast<std::size_t>(at->candidate)];
    const std::vector<Term> rest = without(terms, static_cast<std::size_t>(at - terms.begin()));
    const double worse =
        search_.bic(search_.gain_of(rest), rest) - search_.bic(search_.gain_of(terms), terms);
    impossible_.push_back(at->candidate);
    note_refusal(c, kImpossible, worse);
    terms = rest;
    renew(terms);
    any = true;
  }
  return any;
}

bool Selection::exchange(std::vector<Term>& terms) const {
  const double now = search_.bic(search_.gain_of(terms), terms);
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (stays(terms[i])) continue;
    std::vector<Term> rest = without(terms, i);
    const double base = search_.bic(search_.gain_of(rest), rest);
    for (const Offer& offer : offers(rest, 3)) {
      if (offer.term.candidate == terms[i].candidate || base - offer.delta_bic > now - 1.0)
        continue;
      // Parents and children: the child must be better by more than the class's width.
      const bool child = offer.term.num_parameters() > terms[i].num_parameters() &&
                         search_.replaced_share(terms[i], offer.term, rest) > kChild;
      if (child && base - offer.delta_bic > now - kSameClass) continue;
      std::vector<Term> with = rest;
      with.push_back(offer.term);
      if (!helps(rest, with)) continue;
      search_.fit(with);
      terms = std::move(with);
      return true;
    }
  }
  return false;
}

bool Selection::merge(std::vector<Term>& terms) const {
  const double now = search_.bic(search_.gain_of(terms), terms);
  for (std::size_t i = 0; i < terms.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      if (stays(terms[i]) || stays(terms[j])) continue;
      if (terms[i].effect.joints != terms[j].effect.joints) continue;
      const std::vector<Term> rest = without(without(terms, i), j);
      const auto at_its_joints = [&](int c) {
        return candidates_[static_cast<std::size_t>(c)].effect.joints == terms[i].effect.joints;
      };
      for (const Offer& offer : offers(rest, kInPlaceOfTwo, at_its_joints)) {
        std::vector<Term> with = rest;
        with.push_back(offer.term);
        if (search_.bic(search_.fit(with), with) > now + kNoWorse && !sharpen(with)) continue;
        if (search_.bic(search_.gain_of(with), with) > now + kNoWorse) continue;
        terms = std::move(with);
        return true;
      }
    }
  return false;
}

bool Selection::simplify(std::vector<Term>& terms) const {
  const double now = search_.bic(search_.gain_of(terms), terms);
  const auto of = [&](const Term& t) -> const Candidate& {
    return candidates_[static_cast<std::size_t>(t.candidate)];
  };
  // A shape that the recording does not tell is none that makes an effect simple.
  const auto complexity = [&](const Term& t) { return t.linear.size() + of(t).shapes.size(); };
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (stays(terms[i])) continue;
    const std::vector<Term> rest = without(terms, i);
    const double base = search_.bic(search_.gain_of(rest), rest);
    const auto simpler = [&](int candidate) {
      const Candidate& c = candidates_[static_cast<std::size_t>(candidate)];
      return std::ranges::any_of(terms[i].effect.joints, [&](int j) {
        return std::ranges::find(c.effect.joints, j) != c.effect.joints.end();
      });
    };
    for (const Offer& offer : offers(rest, kRivals, simpler)) {
      const bool tells_size =
          has_size(of(offer.term), offer.term) && !has_size(of(terms[i]), terms[i]);
      if (complexity(offer.term) >= complexity(terms[i]) ||
          base - offer.delta_bic > now + (tells_size ? kLeastSizeless : kSameClass) ||
          search_.replaced_share(offer.term, terms[i], rest) < (tells_size ? kStandsIn : kChild))
        continue;
      std::vector<Term> with = rest;
      with.push_back(offer.term);
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
    const std::vector<ParameterInfo>& info = terms[i].effect.parameter_info;
    const auto smoothing = std::ranges::find(info, "smoothing", &ParameterInfo::name);
    const int k = static_cast<int>(smoothing - info.begin());
    if (smoothing == info.end() || std::ranges::find(terms[i].shapes, k) != terms[i].shapes.end())
      continue;
    const std::vector<Term> rest = without(terms, i);
    Term moved = terms[i];
    moved.shapes.push_back(k);
    if (search_.gain_by_shape(terms, i, k) < kPromise * options_.accept) continue;
    std::vector<Term> with = rest;
    with.push_back(refined(search_, std::move(moved), rest));
    if (search_.bic(search_.fit(with), with) >
        search_.bic(search_.gain_of(terms), terms) - options_.accept)
      continue;
    terms = std::move(with);
    return true;
  }
  return false;
}

bool Selection::split(std::vector<Term>& terms) const {
  for (std::size_t i = 0; i < terms.size(); ++i) {
    if (stays(terms[i])) continue;
    const bool compound = terms[i].num_parameters() > 1;
    const double now = search_.bic(search_.gain_of(terms), terms);
    const std::vector<int>& joints = terms[i].effect.joints;
    std::vector<Term> with = without(terms, i);
    double best = search_.bic(search_.gain_of(with), with);
    const auto part = [&](int candidate) {
      const Candidate& c = candidates_[static_cast<std::size_t>(candidate)];
      return !is_impossible(candidate) && c.effect.info().place == Place::kJoint &&
             c.linear.size() == 1 && c.shapes.empty() && !c.nonlinear &&
             candidate != terms[i].candidate && std::ranges::all_of(c.effect.joints, [&](int j) {
               return std::ranges::find(joints, j) != joints.end();
             });
    };
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

std::vector<Term> Selection::run(const std::function<bool(const FitProgress&)>& progress) {
  std::vector<Term> terms;
  do {
    grow(terms, progress);
    for (int i = 0; i < options_.max_terms; ++i)
      if (!put_simpler(terms)) break;
    drop_impossible(terms);
  } while (drop_needless(terms));  // beside what is left, another may help now
  drop_unstable(terms);
  return terms;
}

void Selection::grow(std::vector<Term>& terms,
                     const std::function<bool(const FitProgress&)>& progress) {
  std::set<std::set<int>> seen;
  for (int step = 0;
       step < 3 * options_.max_terms && static_cast<int>(terms.size()) < options_.max_terms;
       ++step) {
    if (progress && !progress({"testing", step, 0, search_.residual_sum() / 2.0})) break;
    if (!add_one(terms)) break;
    renew(terms);
    eliminate(terms);
    for (int i = 0; i < options_.max_terms && (split(terms) || sharpen(terms) || exchange(terms));
         ++i)
      renew(terms);
    eliminate(terms);
    if (drop_impossible(terms)) continue;  // beside what is left, another may help now
    if (!seen.insert(names(terms)).second) break;
  }
  if (!terms.empty()) renew(terms);
}

bool Selection::drop_needless(std::vector<Term>& terms) {
  bool anew = false;
  for (std::size_t i = terms.size(); i-- > 0;) {
    const std::vector<Term> rest = without(terms, i);
    const Candidate& c = candidates_[static_cast<std::size_t>(terms[i].candidate)];
    const double worse =
        search_.bic(search_.gain_of(rest), rest) - search_.bic(search_.gain_of(terms), terms);
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
        impossible(terms[i])                   ? kImpossible
        : vague                                ? kSizeless
        : terms[i].visible_share() < kAbsorbed ? kHidden
        : may_be_nothing(terms[i], sizes(search_, terms, i, covariances(search_, terms)[i]))
            ? kMayBeNothing
        : shifts_torques(search_, rest) || helps(rest, terms) ? nullptr
                                                              : kHelpsNot;
    if (!why) continue;
    note_refusal(c, why, why == kHelpsNot ? 0.0 : worse);
    if (why == kMayBeNothing) {
      impossible_.push_back(terms[i].candidate);
      anew = true;
    }
    terms = rest;
    search_.fit(terms);
    i = terms.size();  // the others, beside what is left
  }
  return anew;
}

void Selection::drop_unstable(std::vector<Term>& terms) {
  while (!terms.empty()) {
    std::vector<Term> contenders = terms;
    for (std::size_t i = 0; i < terms.size(); ++i) {
      if (stays(terms[i])) continue;
      for (const Offer& offer : rivals(without(terms, i)))
        if (std::ranges::find(contenders, offer.term.candidate, &Term::candidate) ==
            contenders.end())
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
    if (halves.empty()) return;
    chosen_.clear();
    for (std::size_t c = 0; c < contenders.size(); ++c)
      chosen_[contenders[c].candidate] =
          share_of(halves, static_cast<int>(c), {static_cast<int>(c)});
    std::size_t drop = terms.size();
    double least = kMostHalves;
    for (std::size_t i = 0; i < terms.size(); ++i)
      if (const double share = share_of(halves, static_cast<int>(i), stand_for[i]);
          !stays(terms[i]) && share < least)
        least = share, drop = i;
    if (drop == terms.size()) return;
    const Candidate& c = candidates_[static_cast<std::size_t>(terms[drop].candidate)];
    const std::vector<Term> rest = without(terms, drop);
    note_refusal(
        c, "chosen on too few halves of the recording",
        search_.bic(search_.gain_of(rest), rest) - search_.bic(search_.gain_of(terms), terms));
    terms = rest;
    search_.fit(terms);
  }
}

void Selection::add_rivals(const std::vector<Term>& terms, std::size_t which, Cause& cause) const {
  const std::vector<Term> rest = without(terms, which);
  const double best = search_.bic(search_.gain_of(terms), terms);
  const double base = search_.bic(search_.gain_of(rest), rest);
  const int own = terms[which].num_parameters();
  for (const Offer& offer : rivals(rest)) {
    if (offer.term.candidate == terms[which].candidate) continue;
    // An effect that does something else is no rival, however much the model lacks it.
    const double alike_share = search_.replaced_share(terms[which], offer.term, rest);
    if (alike_share < kStandsIn) continue;
    const Candidate& c = candidates_[static_cast<std::size_t>(offer.term.candidate)];
    Rival rival{c.effect.info().name, c.effect.where, base - offer.delta_bic - best};
    if (rival.delta_bic < 0.0) {  // better here, but not where it was not fitted
      std::vector<Term> with = rest;
      with.push_back(offer.term);
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
        rival.more_general ? rival.delta_bic < -kNoWorse : rival.delta_bic < kSameClass || instead;
    (alike ? cause.members : cause.rivals)
        .push_back(rival);
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
    cause.parameters = sizes(search_, terms, i, covariances[i]);
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
