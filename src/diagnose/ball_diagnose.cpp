#include "diagnose/ball_diagnose.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "diagnose/ball_case.hpp"
#include "diagnose/ball_next.hpp"
#include "diagnose/ball_witness.hpp"
#include "diagnose/chi_square.hpp"
#include "diagnose/thresholds.hpp"
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

/// Solves the case: rows that cannot be true are left out, `base`, `best` and `first_scores` are
/// set, and the finding is told what was refused.
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

/// Mean square of what is left over the camera's noise, beyond which something is left.
constexpr double kBallLeft = 1.15;

/// What all causes are worth on held-out windows.
struct Worth {
  Gain gain;
  double floor = 0.0;  ///< mean square that nothing removes
  bool left = false;   ///< more than the camera's noise
};

/// Of the camera [m]; where its rows are too few to tell, all that the causes leave.
double noise_of(const BallCase& c) {
  if (c.known_noise) return c.fit.sigma;
  return c.fit.sigma * std::sqrt(c.best.cost / static_cast<double>(c.search->samples()));
}
/// Mean squares that were over the noise of the fits are over noise_of() with it.
double over_noise(const BallCase& c) {
  const double ratio = c.fit.sigma / noise_of(c);
  return ratio * ratio;
}
/// On held-out data, from `less` to the causes.
HeldOutChange change_from(const BallCase& c, const BallSolution& less) {
  HeldOutChange out = c.search->held_out(less, c.best, c.options.seed);
  out.before *= over_noise(c);
  out.after *= over_noise(c);
  return out;
}

/// Standard error of a parameter: rows that hang together count as one.
double std_of(const BallCase& c, Eigen::Index k) {
  return std::sqrt(c.best.fit.covariance(k, k) * c.search->correlation(c.best));
}

Cause cause_of(const BallCase& c, double floor, const EffectSpec& t) {
  const BallSolution less = c.search->solve(without_effect(c.best.terms, t), &c.best);
  Cause out = window_cause(c, t, less);
  out.gain = gain_of(change_from(c, less), floor);
  return out;
}

void add_series(BallCase& c, double floor) {
  const FittedBall before = fit_states(c.base.ball, c.search->test(), c.fit),
                   after = fit_states(c.best.ball, c.search->test(), c.fit);
  BallSeries series = make_ball_series(before, after, c.fit.flight);
  series.held_out = true;
  series.sigma = noise_of(c);
  const std::vector<BallFlag>& fitted = c.search->train().flagged;
  series.flagged.insert(series.flagged.begin(), fitted.begin(), fitted.end());
  c.finding.joints.push_back({"ball", "m", path_spread(c.search->train()), series.base_rms,
                              series.extended_rms, std::sqrt(floor) * noise_of(c)});
  c.finding.noise.push_back(noise_of(c));
  c.finding.ball = std::move(series);
}

/// Causes, candidates, witnesses, series and parameters of a solved case.
Worth describe(BallCase& c) {
  Finding& f = c.finding;
  std::vector<CandidateScore> table;
  for (const WindowScore& s : c.first_scores) {
    if (s.visible_share < kAbsorbed)
      f.absorbed.push_back({s.effect.effect, s.effect.where, s.visible_share});
    else
      table.push_back({s.effect.effect, s.effect.where, s.delta_bic, s.lm, s.visible_share, {}});
  }
  f.candidates.insert(f.candidates.end(), table.begin(), table.end());
  const HeldOutChange change = change_from(c, c.base);
  Worth worth;
  worth.floor = c.known_noise ? std::min(1.0, change.after) : change.after;
  worth.gain = gain_of(change, worth.floor);
  for (const EffectSpec& t : c.best.terms) f.causes.push_back(cause_of(c, worth.floor, t));
  std::ranges::stable_sort(
      f.causes.begin() + static_cast<std::ptrdiff_t>(f.causes.size() - c.best.terms.size()),
      f.causes.end(), std::ranges::greater{}, &Cause::delta_bic);
  worth.left = c.known_noise && change.after > kBallLeft;
  if (worth.left) {
    const FittedBall there = fit_states(c.best.ball, c.search->test(), c.fit);
    for (const Witness& w : ball_witnesses(there, c.fit)) f.witness.push_back(w);
  }
  add_series(c, worth.floor);
  if (worth.left)
    if (const std::string note = held_by_few_windows(*f.ball); !note.empty())
      f.notes.push_back(note);
  f.model = apply_ball(c.model, c.best.ball.layout, c.best.ball.p);
  for (std::size_t k = 0; k < c.base.ball.layout.parameters.size(); ++k) {
    const BallParameter& p = c.best.ball.layout.parameters[k];
    const auto i = static_cast<Eigen::Index>(k);
    const double std = std_of(c, i);
    f.parameters.push_back(
        {p.name, p.unit, c.best.ball.p[i], p.fixed ? 0.0 : std, p.value, !p.fixed, p.fixed, false});
  }
  return worth;
}

void judge(const Worth& worth, BallCase& c) {
  Finding& f = c.finding;
  const auto own = std::span(f.causes).last(c.best.terms.size());
  const bool ambiguous =
      std::ranges::any_of(own, [](const Cause& x) { return x.verdict == Verdict::kClass; });
  Verdict verdict = Verdict::kNamed;
  if (worth.left && worth.gain.explained_share < kExplained)
    verdict = Verdict::kUnknown;
  else if (own.empty())
    verdict = c.first_scores.empty() && c.go_on() ? Verdict::kNotIdentifiable : Verdict::kNone;
  else if (ambiguous)
    verdict = Verdict::kClass;
  // Of arm and ball, the worse.
  const auto rank = [](Verdict v) {
    return v == Verdict::kUnknown ? 4
           : v == Verdict::kClass ? 3
           : v == Verdict::kNamed ? 2
           : v == Verdict::kNone  ? 1
                                  : 0;
  };
  const bool of_arm = !f.series.empty() && f.verdict == Verdict::kUnknown;
  if (!f.series.empty() && rank(f.verdict) > rank(verdict)) verdict = f.verdict;
  f.verdict = verdict;
  if (f.causes.size() == own.size() && !of_arm) f.gain = worth.gain;  // the arm lacks nothing
  if (f.series.empty()) {
    const auto n = static_cast<double>(c.search->samples());
    f.lack_of_fit = over_noise(c) * c.base.cost /
                    std::max(1.0, n - 6.0 * static_cast<double>(c.search->train().windows.size()));
    const double together = c.search->correlation(c.base);  // rows that count as one
    for (const WindowScore& s : c.first_scores)
      f.lack_of_fit_p = std::min(
          f.lack_of_fit_p, static_cast<double>(c.first_scores.size()) *
                               chi_square_tail(s.lm / together, static_cast<int>(s.values.size())));
  }
  if (ambiguous && c.go_on() && !f.next_experiment)
    f.next_experiment = ball_next_experiment(c.best, own, noise_of(c), c.options.seed);
}

}  // namespace

bool fits_string(const Model& model, Base base) {
  const bool is_identified =
      model.ball && model.ball->string && model.ball->string->length_std > 0.0;
  return base == Base::kRefit || (base == Base::kPrior && !is_identified);
}

void diagnose_ball(const std::vector<Recording>& train, const std::vector<Recording>& test,
                   const DiagnoseOptions& options, Base base, Finding& finding) {
  BallCase c(options, finding, fits_string(finding.model, base), finding.model);
  prepare(train, test, c);
  select_causes(c);
  judge(describe(c), c);
}

}  // namespace diffnea
