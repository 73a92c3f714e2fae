#include "diagnose/ball_selection.hpp"

#include <algorithm>
#include <cmath>

#include "diagnose/window_selection.hpp"
#include "identify/ball_flags.hpp"
#include "identify/ball_identify.hpp"

namespace diffnea {
namespace {

constexpr std::size_t kMostBallCauses = 6;
/// Rows on end that a camera may get wrong. More of them, on a string, are what is to be explained.
constexpr std::size_t kMostOnEnd = 3;
constexpr int kMostRounds = 2;  ///< of leaving rows out that are far off

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

}  // namespace

void select_causes(BallCase& c) {
  c.base = c.best = c.search->solve({}, nullptr);
  drop_far(c);
  c.first_scores = c.search->scores(c.base, c.candidates);
  if (!c.go_on()) return;
  select_windows(
      c, kMostBallCauses, [&] { drop_far(c); },
      [&] {  // before lift is given up
        if (!c.spin || !drop_spins(c)) return false;
        drop_far(c);
        return true;
      });
}

}  // namespace diffnea
