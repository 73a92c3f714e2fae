#include "diagnose/ball_selection.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "identify/ball_flags.hpp"
#include "identify/ball_identify.hpp"

namespace diffnea {
namespace {

constexpr int kRefitted = 3;  ///< candidates a round
constexpr std::size_t kMostBallCauses = 6;
/// Rows on end that a camera may get wrong. More of them, on a string, are what is to be explained.
constexpr std::size_t kMostOnEnd = 3;
constexpr int kMostRounds = 2;  ///< of leaving rows out that are far off

/// Whether first order about 0 says little of it: it has starts of its own.
bool is_far_from_linear(const EffectSpec& e) {
  return std::ranges::any_of(find_effect(e.effect).parameters,
                             [](const ParameterInfo& p) { return !p.search.empty(); });
}

/// Leaves out what cannot be true, seen with the best solution so far, and solves anew.
template <class Drop>
bool clean(BallCase& c, const Drop& drop) {
  BallData fitted = c.best.ball.data;
  FittedBall there = fit_states(c.best.ball, c.search->test(), c.fit);
  BallData held_out = there.data;
  const bool here = drop(c.best.ball, fitted), beyond = drop(there, held_out);
  if (!here && !beyond) return false;
  std::unique_ptr<BallSearch> before = std::move(c.search);
  c.search_on(fitted, held_out);
  const std::vector<EffectSpec> terms = c.best.terms;
  BallSolution base = c.search->solve({}, nullptr);
  BallSolution best =
      terms.empty() ? base : c.search->solve(terms, &base);  // from their own starts
  if (!c.go_on()) {  // fits that were stopped are no solutions
    c.search = std::move(before);
    return false;
  }
  c.base = std::move(base);
  c.best = std::move(best);
  return true;
}
void drop_far(BallCase& c) {
  for (int round = 0; round < kMostRounds && c.go_on(); ++round)
    if (!clean(c, [&](const FittedBall& ball, BallData& data) {
          return c.model.ball->string ? drop_far_rows(ball, data, c.fit.flight, kMostOnEnd)
                                      : drop_far_rows(ball, data, c.fit.flight);
        }))
      break;
}
bool drop_spins(BallCase& c) {
  double lift = 0.0;
  const double sigma =
      std::sqrt(c.best.cost / static_cast<double>(c.search->samples())) * c.fit.sigma;
  return clean(c, [&](const FittedBall& ball, BallData& data) {
    return drop_false_spins(ball, data, std::max(sigma, c.fit.sigma), c.fit, lift);
  });
}

void refuse(BallCase& c, const EffectSpec& e, const std::string& reason, double delta_bic) {
  std::erase_if(c.finding.refused,
                [&](const Refusal& r) { return r.effect == e.effect && r.where == e.where; });
  c.finding.refused.push_back({e.effect, e.where, reason, delta_bic});
}

/// All that were tried at once, of which some are far from linear. What acts at the same impacts
/// can stand for one another: the first to be taken alone would get a value that is not its own,
/// and nothing would be left for the others. What is not needed is dropped again.
std::optional<BallSolution> together(BallCase& c,
                                     const std::vector<std::pair<double, BallSolution>>& tried) {
  const auto far = std::ranges::count_if(
      tried, [](const auto& t) { return is_far_from_linear(t.second.terms.back()); });
  if (far == 0 || tried.size() < 2 || !c.go_on()) return {};
  std::vector<EffectSpec> terms = c.best.terms;
  for (const auto& [gain, more] : tried) terms.push_back(more.terms.back());
  BallSolution all = c.search->solve(terms, &c.best);
  const double gain = c.search->delta_bic(c.best, all),
               others = c.options.accept_delta_bic * static_cast<double>(tried.size() - 1);
  if (gain < std::max(0.0, tried.front().first) + others ||
      !c.search->held_out(c.best, all, c.options.seed).helps())
    return {};
  return all;
}

/// Two causes that help together where neither does alone: a path that is wrong before an impact
/// is no better for the right impact. Of those that were tried, one far from linear.
std::optional<BallSolution> best_pair(BallCase& c,
                                      const std::vector<std::pair<double, BallSolution>>& tried) {
  std::optional<BallSolution> best;
  double most = 2.0 * c.options.accept_delta_bic;
  for (std::size_t i = 0; i < tried.size(); ++i)
    for (std::size_t j = i + 1; j < tried.size(); ++j) {
      const EffectSpec &a = tried[i].second.terms.back(), &b = tried[j].second.terms.back();
      const bool worth = tried[j].first >= c.options.accept_delta_bic &&
                         (is_far_from_linear(a) || is_far_from_linear(b));
      if (!worth || !c.go_on()) continue;
      BallSolution both = c.search->solve(with_effect(tried[i].second.terms, b), &tried[i].second);
      const double gain = c.search->delta_bic(c.best, both);
      if (gain < most || !c.search->held_out(c.best, both, c.options.seed).helps()) continue;
      most = gain;
      best = std::move(both);
    }
  return best;
}

void drop_redundant(BallCase& c) {
  for (bool dropped = c.best.terms.size() > 1; dropped && c.go_on();) {
    dropped = false;
    for (const EffectSpec& t : c.best.terms) {
      BallSolution less = c.search->solve(without_effect(c.best.terms, t), &c.best);
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
void exchange(BallCase& c) {
  if (c.best.terms.size() < 2) return;
  const std::vector<EffectSpec> terms = c.best.terms;
  for (const EffectSpec& t : terms) {
    const BallSolution less = c.search->solve(without_effect(c.best.terms, t), &c.best);
    for (const BallScore& s : c.search->scores(less, c.candidates)) {
      if (same_effect(s.effect, t) || !c.go_on()) break;
      if (holds_effect(c.best.terms, s.effect)) continue;
      BallSolution other = c.search->solve(with_effect(less.terms, s.effect), &less);
      if (!(c.search->delta_bic(c.best, other) > 0.0)) break;
      c.best = std::move(other);
    }
  }
}

void select(BallCase& c) {
  std::vector<BallScore> scores = c.first_scores;
  bool spins_checked = !c.spin;
  while (c.best.terms.size() < kMostBallCauses && c.go_on()) {
    const BallSolution* found = nullptr;
    std::vector<std::pair<double, BallSolution>> tried;
    for (const BallScore& s : scores) {
      if (!c.go_on()) break;
      const bool linear =
          s.delta_bic >= c.options.accept_delta_bic && static_cast<int>(tried.size()) < kRefitted;
      if (!linear && !(s.visible_share > kAbsorbedPath && is_far_from_linear(s.effect))) continue;
      BallSolution more = c.search->solve(with_effect(c.best.terms, s.effect), &c.best);
      const double gain = c.search->delta_bic(c.best, more);
      tried.emplace_back(gain, std::move(more));
    }
    std::ranges::stable_sort(tried, std::ranges::greater{},
                             &std::pair<double, BallSolution>::first);
    for (const auto& [gain, more] : tried) {
      if (gain < c.options.accept_delta_bic) break;
      const HeldOutChange change = c.search->held_out(c.best, more, c.options.seed);
      if (change.helps()) {
        found = &more;
        break;
      }
      refuse(c, more.terms.back(), "does not help on held-out data", gain);
    }
    std::optional<BallSolution> several = together(c, tried);
    if (!several && !found) several = best_pair(c, tried);
    if (several) found = &*several;
    if (found) {
      c.best = BallSolution(*found);
      drop_redundant(c);
      exchange(c);
      drop_far(c);
      // Of fewer rows, one may not be needed any more.
      drop_redundant(c);
    } else if (!spins_checked && c.go_on()) {  // before lift is given up
      spins_checked = true;
      if (!drop_spins(c)) break;
      drop_far(c);
    } else {
      break;
    }
    scores = c.search->scores(c.best, c.candidates);
  }
  for (const EffectSpec& t : c.best.terms)
    std::erase_if(c.finding.refused,
                  [&](const Refusal& r) { return r.effect == t.effect && r.where == t.where; });
}

}  // namespace

void select_causes(BallCase& c) {
  c.base = c.best = c.search->solve({}, nullptr);
  drop_far(c);
  c.first_scores = c.search->scores(c.base, c.candidates);
  if (c.go_on()) select(c);
}

}  // namespace diffnea
