#pragma once
/// The choice of what simulated windows lack: causes are added one by one, in pairs or all at once,
/// dropped and exchanged; then each is weighed against its rivals. Internal to diagnose/.

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "diagnose/thresholds.hpp"
#include "diagnose/window_case.hpp"

namespace diffnea {

namespace windows {

inline constexpr int kRefitted = 3;  ///< candidates a round
inline constexpr double kRefitWithin =
    30.0;  ///< ΔBIC behind the best that a rival is refitted from
inline constexpr std::size_t kMostRivals = 6;

template <class Search>
using Tried = std::vector<std::pair<double, typename Search::Solution>>;  ///< with their gain

template <class Search>
void refuse(WindowCase<Search>& c, const EffectSpec& e, const std::string& reason,
            double delta_bic) {
  std::erase_if(c.finding.refused,
                [&](const Refusal& r) { return r.effect == e.effect && r.where == e.where; });
  c.finding.refused.push_back({e.effect, e.where, reason, delta_bic});
}

/// All that were tried at once, of which some are far from linear. What acts at the same impacts
/// can stand for one another: the first to be taken alone would get a value that is not its own,
/// and nothing would be left for the others. What is not needed is dropped again.
template <class Search>
std::optional<typename Search::Solution> together(WindowCase<Search>& c,
                                                  const Tried<Search>& tried) {
  const auto far = std::ranges::count_if(
      tried, [&](const auto& t) { return c.search->is_far_from_linear(t.second.terms.back()); });
  if (far == 0 || tried.size() < 2 || !c.go_on()) return {};
  std::vector<EffectSpec> terms = c.best.terms;
  for (const auto& [gain, more] : tried) terms.push_back(more.terms.back());
  auto all = c.search->solve(terms, &c.best);
  const double gain = c.search->delta_bic(c.best, all),
               others = c.options.accept_delta_bic * static_cast<double>(tried.size() - 1);
  if (gain < std::max(0.0, tried.front().first) + others ||
      !c.search->held_out(c.best, all, c.options.seed).helps())
    return {};
  return all;
}

/// Two causes that help together where neither does alone: a path that is wrong before an impact
/// is no better for the right impact. Of those that were tried, one far from linear.
template <class Search>
std::optional<typename Search::Solution> best_pair(WindowCase<Search>& c,
                                                   const Tried<Search>& tried) {
  std::optional<typename Search::Solution> best;
  double most = 2.0 * c.options.accept_delta_bic;
  for (std::size_t i = 0; i < tried.size(); ++i)
    for (std::size_t j = i + 1; j < tried.size(); ++j) {
      const EffectSpec &a = tried[i].second.terms.back(), &b = tried[j].second.terms.back();
      const bool worth = tried[j].first >= c.options.accept_delta_bic &&
                         (c.search->is_far_from_linear(a) || c.search->is_far_from_linear(b));
      if (!worth || !c.go_on()) continue;
      auto both = c.search->solve(with_effect(tried[i].second.terms, b), &tried[i].second);
      const double gain = c.search->delta_bic(c.best, both);
      if (gain < most || !c.search->held_out(c.best, both, c.options.seed).helps()) continue;
      most = gain;
      best = std::move(both);
    }
  return best;
}

template <class Search>
void drop_redundant(WindowCase<Search>& c) {
  for (bool dropped = c.best.terms.size() > 1; dropped && c.go_on();) {
    dropped = false;
    for (const EffectSpec& t : c.best.terms) {
      auto less = c.search->solve(without_effect(c.best.terms, t), &c.best);
      const double cost = c.search->delta_bic(less, c.best);
      if (cost >= c.options.accept_delta_bic) continue;
      refuse(c, t, "the other causes explain it", cost);
      c.best = std::move(less);
      dropped = c.best.terms.size() > 1;
      break;
    }
  }
}

/// A later cause may show that an earlier one stood for another.
template <class Search>
void exchange(WindowCase<Search>& c) {
  if (c.best.terms.size() < 2) return;
  const std::vector<EffectSpec> terms = c.best.terms;
  for (const EffectSpec& t : terms) {
    const auto less = c.search->solve(without_effect(c.best.terms, t), &c.best);
    for (const WindowScore& s : c.search->scores(less, c.candidates)) {
      if (same_effect(s.effect, t) || !c.go_on()) break;
      if (holds_effect(c.best.terms, s.effect)) continue;
      auto other = c.search->solve(with_effect(less.terms, s.effect), &less,
                                   c.search->reach(less, c.best, 0.0));
      if (!(c.search->delta_bic(c.best, other) > 0.0)) break;
      c.best = std::move(other);
    }
  }
}

/// Where rounds of a selection began. What is dropped may be added again beside other causes; but a
/// round that begins where an earlier one did would lead there for ever.
class Rounds {
 public:
  bool is_new(const std::vector<EffectSpec>& terms, const std::vector<EffectSpec>& candidates,
              double cost) {
    return seen_.insert({names_of(terms), names_of(candidates), cost}).second;
  }

 private:
  std::set<std::tuple<std::vector<std::string>, std::vector<std::string>, double>> seen_;
};

}  // namespace windows

/// Adds to `best` what it lacks, until nothing more helps.
/// @param most         causes
/// @param settle       called after each that was added; may solve the case anew on fewer rows
/// @param last_resort  called once where nothing helps; whether it changed the case
/// @param is_enough    whether `best` leaves nothing to look for
template <class Search>
void select_windows(
    WindowCase<Search>& c, std::size_t most, const std::function<void()>& settle = [] {},
    const std::function<bool()>& last_resort = [] { return false; },
    const std::function<bool()>& is_enough = [] { return false; }) {
  std::vector<WindowScore> scores = c.first_scores;
  bool resorted = false;
  windows::Rounds rounds;
  while (c.best.terms.size() < most && c.tell("testing", 0) && !is_enough() &&
         rounds.is_new(c.best.terms, c.candidates, c.best.cost)) {
    const typename Search::Solution* found = nullptr;
    windows::Tried<Search> tried;
    double to_beat = std::numeric_limits<double>::infinity();  // for one that is to be added
    for (const WindowScore& s : scores) {
      if (!c.go_on()) break;
      const bool linear = s.promise >= c.options.accept_delta_bic &&
                          static_cast<int>(tried.size()) < windows::kRefitted;
      if (!linear && !(s.visible_share > kAbsorbed && c.search->is_far_from_linear(s.effect)))
        continue;
      auto more = c.search->solve(with_effect(c.best.terms, s.effect), &c.best, to_beat);
      const double gain = c.search->delta_bic(c.best, more);
      const double reach = c.search->reach(c.best, more, 0.0);
      if (gain >= c.options.accept_delta_bic && reach < to_beat &&
          c.search->held_out(c.best, more, c.options.seed).helps())
        to_beat = reach;
      tried.emplace_back(gain, std::move(more));
    }
    std::ranges::stable_sort(tried, std::ranges::greater{}, [](const auto& t) { return t.first; });
    for (const auto& [gain, more] : tried) {
      if (gain < c.options.accept_delta_bic) break;
      if (c.search->held_out(c.best, more, c.options.seed).helps()) {
        found = &more;
        break;
      }
      windows::refuse(c, more.terms.back(), "does not help on held-out data", gain);
    }
    std::optional<typename Search::Solution> several = windows::together(c, tried);
    if (!several && !found) several = windows::best_pair(c, tried);
    if (several) found = &*several;
    if (found) {
      c.best = typename Search::Solution(*found);
      windows::drop_redundant(c);
      windows::exchange(c);
      settle();
      // Fewer rows may not need one any more.
      windows::drop_redundant(c);
    } else if (!resorted && c.go_on()) {
      resorted = true;
      if (!last_resort()) break;
    } else {
      break;
    }
    if (!is_enough()) scores = c.search->scores(c.best, c.candidates);
  }
  for (const EffectSpec& t : c.best.terms)
    std::erase_if(c.finding.refused,
                  [&](const Refusal& r) { return r.effect == t.effect && r.where == t.where; });
}

/// A term of `best` with its rivals; its gain is left to the caller, who knows the noise.
/// @param less  `best` without it
template <class Search>
Cause window_cause(const WindowCase<Search>& c, const EffectSpec& t,
                   const typename Search::Solution& less) {
  Cause out;
  out.effect = t.effect;
  out.where = t.where;
  const std::vector<WindowScore> rivals = c.search->scores(less, c.candidates);
  const bool whole = c.go_on();  // stopped, the fit without it says nothing: what it scored first
  for (const WindowScore& s : whole ? rivals : c.first_scores)
    if (same_effect(s.effect, t)) {
      out.visible_share = s.visible_share;
      out.delta_bic = whole ? c.search->delta_bic(less, c.best) : s.delta_bic;
      out.lm = whole ? less.cost - c.best.cost : s.lm;
    }
  out.torque_share = c.search->share_of_motion(out.lm);
  out.parameters = c.search->parameters_of(c.best, t);
  double best_linear = -std::numeric_limits<double>::infinity();
  for (const WindowScore& s : rivals) best_linear = std::max(best_linear, s.delta_bic);
  for (const WindowScore& s : rivals) {
    if (same_effect(s.effect, t) || !c.go_on() || !(s.lm > 0.0)) continue;
    if (holds_effect(c.best.terms, s.effect)) continue;
    double behind = best_linear - s.delta_bic;
    if (behind < windows::kRefitWithin)
      behind = c.search->delta_bic(
          c.search->solve(with_effect(less.terms, s.effect), &less,
                          c.search->reach(less, c.best, c.options.accept_delta_bic)),
          c.best);
    if (behind < c.options.accept_delta_bic)
      out.members.push_back({s.effect.effect, s.effect.where, behind});
    else if (out.rivals.size() < windows::kMostRivals)
      out.rivals.push_back({s.effect.effect, s.effect.where, behind});
  }
  std::ranges::stable_sort(out.members, {}, &Rival::delta_bic);
  std::ranges::stable_sort(out.rivals, {}, &Rival::delta_bic);
  if (!out.members.empty()) out.verdict = Verdict::kClass;
  return out;
}

}  // namespace diffnea
