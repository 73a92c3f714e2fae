#include "diagnose/selection_terms.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

namespace diffnea {

std::vector<Term> without(const std::vector<Term>& terms, std::size_t i) {
  std::vector<Term> out = terms;
  out.erase(out.begin() + static_cast<long>(i));
  return out;
}

std::vector<Term> joined(std::vector<Term> terms, Term more) {
  terms.push_back(std::move(more));
  return terms;
}

std::set<int> names(const std::vector<Term>& terms) {
  std::set<int> out;
  for (const Term& t : terms) out.insert(t.candidate);
  return out;
}

bool stays(const Term& term) { return term.effect.info().has(Trait::kGravity); }

namespace {

/// Tells whether a term shifts the torques of all drives.
bool shifts_all(const Search& search, const Term& term) {
  const std::vector<int>& joints = term.effect.joints;
  const std::vector<int>& all = search.evidence().joints();
  for (std::size_t k = 0; k < all.size(); ++k)
    if (!search.evidence().passive(k) && std::ranges::find(joints, all[k]) == joints.end())
      return false;
  return Search::shift(term) != 0.0;
}

}  // namespace

bool is_no_shift(const Search& search, const std::vector<Term>& terms) {
  const Term& last = terms.back();
  if (!shifts_all(search, last)) return false;
  const auto shifts = [&](const Term& t) { return shifts_all(search, t); };
  return std::any_of(terms.begin(), terms.end() - 1, shifts) ||
         std::ranges::all_of(last.effect.joints,
                             [&](int j) { return search.samples_and_holds(j, terms); });
}

bool is_of_swing(const Search& search, const Term& late, const std::vector<Term>& terms) {
  DrivePath<double> path{0.0, 0.0, 0.0};
  if (!late.effect.own) add_to_drive(late.effect, path);
  const double time = std::abs(Search::shift(late)) + path.lag;
  return time > 0.0 && std::ranges::any_of(terms, [&](const Term& t) {
           if (t.effect.own || t.effect.info().motor != HiddenMotor::kSpring ||
               t.effect.joints != late.effect.joints)
             return false;
           const MotorSpring<double> s = motor_spring(t.effect);
           const double inertia =
               encoder_at_motor(t.effect) ? search.candidate(t).swings : s.inertia;
           return time * time * s.stiffness < inertia;
         });
}

bool shifts_torques(const Search& search, std::vector<Term> terms) {
  for (const Term& t : terms) {
    DrivePath<double> path{0.0, 0.0, 0.0};
    if (!t.effect.own) add_to_drive(t.effect, path);
    if (Search::shift(t) != 0.0 || path.lag != 0.0) return false;
  }
  search.fit(terms);
  return !search.samples_and_holds(terms);
}

}  // namespace diffnea
