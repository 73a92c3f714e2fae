#include "diagnose/ball_diagnose.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>

#include <diffnea/core/error.hpp>

#include "diagnose/ball_next.hpp"
#include "diagnose/ball_search.hpp"
#include "diagnose/ball_witness.hpp"
#include "identify/ball_flags.hpp"
#include "identify/ball_identify.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

constexpr double kAbsorbedShare = 0.01;  ///< of a candidate's path that the base leaves
constexpr double kExplained = 0.8;       ///< below it, the cause is unknown
/// Mean square of what is left over the camera's noise, beyond which something is left.
constexpr double kLeft = 1.15;
constexpr int kRefitted = 3;           ///< candidates a round
constexpr double kRefitWithin = 30.0;  ///< ΔBIC behind the best that a rival is refitted from
constexpr std::size_t kMostRivals = 6;
constexpr std::size_t kMostBallCauses = 6;
/// Rows on end that a camera may get wrong. More of them, on a string, are what is to be explained.
constexpr std::size_t kMostOnEnd = 3;
constexpr int kMostRounds = 2;  ///< of leaving rows out that are far off
constexpr double kNormal95 = 1.96;
/// Every which window is held out where there is no test recording.
constexpr std::size_t kHeldOutWindow = 4;

bool same(const EffectSpec& a, const EffectSpec& b) {
  return a.effect == b.effect && a.where == b.where;
}

/// Whether first order about 0 says little of it: it has starts of its own.
bool is_far_from_linear(const EffectSpec& e) {
  return std::ranges::any_of(info(find_effect(e.effect)).parameters,
                             [](const ParameterInfo& p) { return !p.search.empty(); });
}

class BallDiagnosis {
 public:
  BallDiagnosis(const std::vector<Recording>& train, const std::vector<Recording>& test,
                const DiagnoseOptions& options, Base base, Finding& finding)
      : options_(options),
        fit_string_(fits_string(finding.model, base)),
        finding_(finding),
        model_(finding.model) {
    prepare(train, test);
  }

  void run() {
    base_solution_ = best_ = search_->solve({}, nullptr);
    drop_far();
    first_scores_ = search_->scores(base_solution_, candidates_);
    if (go_on()) select();
    describe();
    judge();
  }

 private:
  bool go_on() const { return !finding_.interrupted; }

  void prepare(const std::vector<Recording>& train, const std::vector<Recording>& test) {
    for (const EffectSpec& e : model_.effects)
      if (acts_on_ball(info(find_effect(e.effect)))) known_.push_back(e);
    BallData fitted = make_ball_data(model_, train, fit_, options_.preprocess), held_out;
    if (!test.empty()) {
      held_out = make_ball_data(model_, test, fit_, options_.preprocess);
      finding_.held_out = "test recording";
    }
    if (fit_string_ && model_.ball->string)
      guess_unknown_string(*model_.ball->string, fitted, model_.gravity);
    fit_.sigma = camera_noise(fitted, fit_.longest_gap);
    known_noise_ = std::isfinite(fit_.sigma);
    if (!known_noise_) {
      BallData data = fitted;
      fit_.sigma = 0.0;
      fit_.sigma =
          fit_ball(model_, make_ball_layout(model_, known_, fit_string_), data, fit_).sigma;
    }
    if (test.empty()) {
      if (fitted.windows.size() < 2 * kHeldOutWindow)
        throw DataError(train.front().source + ": " + std::to_string(fitted.windows.size()) +
                        " stretches of the ball's path are too few to hold some out; give a "
                        "second recording with --test");
      finding_.held_out = "time blocks";
      held_out = fitted;
      held_out.windows.clear();
      std::vector<BallWindow> kept;
      for (std::size_t w = 0; w < fitted.windows.size(); ++w)
        (w % kHeldOutWindow == kHeldOutWindow - 1 ? held_out.windows : kept)
            .push_back(fitted.windows[w]);
      fitted.windows = std::move(kept);
    }
    if (fitted.touching > 0)
      finding_.notes.push_back("ball: " + std::to_string(fitted.touching) +
                               " rows are left out, at which it touches the cup or did so within "
                               "half a second");
    search_for(fitted, held_out);
    add_candidates(fitted);
  }

  void search_for(BallData fitted, BallData held_out) {
    search_ = std::make_unique<BallSearch>(
        model_, known_, fit_string_, std::move(fitted), std::move(held_out), fit_,
        [this](const std::string& stage) {
          if (options_.progress && !options_.progress({stage, ++steps_, 0, 0.0}))
            finding_.interrupted = true;
          return go_on();
        });
  }

  /// Leaves out what cannot be true, seen with the best solution so far, and solves anew.
  template <class Drop>
  bool clean(const Drop& drop) {
    BallData fitted = best_.ball.data;
    FittedBall there = fit_states(best_.ball, search_->test(), fit_);
    BallData held_out = there.data;
    const bool here = drop(best_.ball, fitted), beyond = drop(there, held_out);
    if (!here && !beyond) return false;
    search_for(fitted, held_out);
    const std::vector<EffectSpec> terms = best_.terms;
    base_solution_ = search_->solve({}, nullptr);
    best_ = terms.empty() ? base_solution_ : search_->solve(terms, nullptr);
    return true;
  }
  void drop_far() {
    for (int round = 0; round < kMostRounds && go_on(); ++round)
      if (!clean([&](const FittedBall& ball, BallData& data) {
            return model_.ball->string ? drop_far_rows(ball, data, fit_.flight, kMostOnEnd)
                                       : drop_far_rows(ball, data, fit_.flight);
          }))
        break;
  }
  bool drop_spins() {
    double lift = 0.0;
    const double sigma =
        std::sqrt(best_.cost / static_cast<double>(search_->samples())) * fit_.sigma;
    return clean([&](const FittedBall& ball, BallData& data) {
      return drop_false_spins(ball, data, std::max(sigma, fit_.sigma), fit_, lift);
    });
  }

  void add_candidates(const BallData& data) {
    if (std::ranges::any_of(options_.effects,
                            [](const std::string& e) { return e.starts_with("magnus"); }))
      require_spin(data);
    spin_ = has_spin(data);
    if (spin_ && !has_spin(search_->test())) {
      spin_ = false;
      finding_.notes.push_back(
          "the held-out recordings hold no spin (spin_x, spin_y, spin_z): lift cannot be tried");
    }
    for (const EffectInfo& i : catalogue()) {
      if (!acts_on_ball(i) || i.port == Port::kBallImpact) continue;
      if (i.name == "magnus" && !spin_) continue;
      if (i.name == "attachment_offset" && fit_string_) continue;
      for (const std::string& where : places(i, model_)) {
        const auto asked = [&](const std::string& entry) {
          return entry == i.name || entry == i.name + "@" + where;
        };
        if (!options_.effects.empty() && std::ranges::none_of(options_.effects, asked)) continue;
        const EffectSpec spec{i.name, where, {}};
        // What the base has, and fits, is no candidate.
        if (std::ranges::any_of(known_, [&](const EffectSpec& e) { return same(e, spec); }))
          continue;
        candidates_.push_back(spec);
      }
    }
  }

  /// Standard error of a parameter: rows that hang together count as one.
  double std_of(Eigen::Index k) const {
    return std::sqrt(best_.fit.covariance(k, k) * search_->correlation(best_));
  }
  /// The terms of a solution with one more.
  static std::vector<EffectSpec> with(std::vector<EffectSpec> terms, const EffectSpec& more) {
    terms.push_back(more);
    return terms;
  }
  static std::vector<EffectSpec> without(std::vector<EffectSpec> terms, const EffectSpec& less) {
    std::erase_if(terms, [&](const EffectSpec& t) { return same(t, less); });
    return terms;
  }
  void refuse(const EffectSpec& e, const std::string& reason, double delta_bic) {
    std::erase_if(finding_.refused,
                  [&](const Refusal& r) { return r.effect == e.effect && r.where == e.where; });
    finding_.refused.push_back({e.effect, e.where, reason, delta_bic});
  }

  void select() {
    std::vector<BallScore> scores = first_scores_;
    bool spins_checked = !spin_;
    while (best_.terms.size() < kMostBallCauses && go_on()) {
      const BallSolution* found = nullptr;
      std::vector<std::pair<double, BallSolution>> tried;
      for (const BallScore& s : scores) {
        if (!go_on()) break;
        const bool linear =
            s.delta_bic >= options_.accept_delta_bic && static_cast<int>(tried.size()) < kRefitted;
        if (!linear && !(s.visible_share > kAbsorbedShare && is_far_from_linear(s.effect)))
          continue;
        BallSolution more = search_->solve(with(best_.terms, s.effect), &best_);
        const double gain = search_->delta_bic(best_, more);
        tried.emplace_back(gain, std::move(more));
      }
      std::ranges::stable_sort(tried, std::ranges::greater{},
                               &std::pair<double, BallSolution>::first);
      for (const auto& [gain, more] : tried) {
        if (gain < options_.accept_delta_bic) break;
        const HeldOutChange change = search_->held_out(best_, more, options_.seed);
        if (change.helps()) {
          found = &more;
          break;
        }
        refuse(more.terms.back(), "does not help on held-out data", gain);
      }
      std::optional<BallSolution> several = together(tried);
      if (!several && !found) several = best_pair(tried);
      if (several) found = &*several;
      if (found) {
        best_ = BallSolution(*found);
        drop_redundant();
        exchange();
        drop_far();
        // Of fewer rows, one may not be needed any more.
        drop_redundant();
      } else if (!spins_checked && go_on()) {  // before lift is given up
        spins_checked = true;
        if (!drop_spins()) break;
        drop_far();
      } else {
        break;
      }
      scores = search_->scores(best_, candidates_);
    }
    for (const EffectSpec& t : best_.terms)
      std::erase_if(finding_.refused,
                    [&](const Refusal& r) { return r.effect == t.effect && r.where == t.where; });
  }

  /// All that were tried at once, of which some are far from linear. What acts at the same impacts
  /// can stand for one another: the first to be taken alone would get a value that is not its own,
  /// and nothing would be left for the others. What is not needed is dropped again.
  std::optional<BallSolution> together(
      const std::vector<std::pair<double, BallSolution>>& tried) const {
    const auto far = std::ranges::count_if(
        tried, [](const auto& t) { return is_far_from_linear(t.second.terms.back()); });
    if (far == 0 || tried.size() < 2 || !go_on()) return {};
    std::vector<EffectSpec> terms = best_.terms;
    for (const auto& [gain, more] : tried) terms.push_back(more.terms.back());
    BallSolution all = search_->solve(terms, &best_);
    const double gain = search_->delta_bic(best_, all),
                 others = options_.accept_delta_bic * static_cast<double>(tried.size() - 1);
    if (gain < std::max(0.0, tried.front().first) + others ||
        !search_->held_out(best_, all, options_.seed).helps())
      return {};
    return all;
  }

  /// Two causes that help together where neither does alone: a path that is wrong before an impact
  /// is no better for the right impact. Of those that were tried, one far from linear.
  std::optional<BallSolution> best_pair(const std::vector<std::pair<double, BallSolution>>& tried) {
    std::optional<BallSolution> best;
    double most = 2.0 * options_.accept_delta_bic;
    for (std::size_t i = 0; i < tried.size(); ++i)
      for (std::size_t j = i + 1; j < tried.size(); ++j) {
        const EffectSpec &a = tried[i].second.terms.back(), &b = tried[j].second.terms.back();
        const bool worth = tried[j].first >= options_.accept_delta_bic &&
                           (is_far_from_linear(a) || is_far_from_linear(b));
        if (!worth || !go_on()) continue;
        BallSolution both = search_->solve(with(tried[i].second.terms, b), &tried[i].second);
        const double gain = search_->delta_bic(best_, both);
        if (gain < most || !search_->held_out(best_, both, options_.seed).helps()) continue;
        most = gain;
        best = std::move(both);
      }
    return best;
  }

  void drop_redundant() {
    for (bool dropped = best_.terms.size() > 1; dropped && go_on();) {
      dropped = false;
      for (const EffectSpec& t : best_.terms) {
        BallSolution less = search_->solve(without(best_.terms, t), &best_);
        const double cost = search_->delta_bic(less, best_);
        if (cost >= options_.accept_delta_bic) continue;
        refuse(t, "the other causes explain it", cost);
        best_ = std::move(less);
        dropped = best_.terms.size() > 1;
        break;
      }
    }
  }

  /// A later cause may show that an earlier one stood for another.
  void exchange() {
    if (best_.terms.size() < 2) return;
    const std::vector<EffectSpec> terms = best_.terms;
    for (const EffectSpec& t : terms) {
      const BallSolution less = search_->solve(without(best_.terms, t), &best_);
      for (const BallScore& s : search_->scores(less, candidates_)) {
        if (same(s.effect, t) || !go_on()) break;
        if (std::ranges::any_of(best_.terms, [&](const auto& u) { return same(u, s.effect); }))
          continue;
        BallSolution other = search_->solve(with(less.terms, s.effect), &less);
        if (!(search_->delta_bic(best_, other) > 0.0)) break;
        best_ = std::move(other);
      }
    }
  }

  void describe() {
    Finding& f = finding_;
    std::vector<CandidateScore> table;
    for (const BallScore& s : first_scores_) {
      if (s.visible_share < kAbsorbedShare)
        f.absorbed.push_back({s.effect.effect, s.effect.where, s.visible_share});
      else
        table.push_back({s.effect.effect, s.effect.where, s.delta_bic, s.lm, s.visible_share, {}});
    }
    f.candidates.insert(f.candidates.end(), table.begin(), table.end());
    const HeldOutChange change = search_->held_out(base_solution_, best_, options_.seed);
    floor_ = known_noise_ ? std::min(1.0, change.after) : change.after;
    gain_ = gain_of(change, floor_);
    for (const EffectSpec& t : best_.terms) f.causes.push_back(cause_of(t));
    std::ranges::stable_sort(
        f.causes.begin() + static_cast<std::ptrdiff_t>(f.causes.size() - best_.terms.size()),
        f.causes.end(), std::ranges::greater{}, &Cause::delta_bic);
    left_ = known_noise_ && change.after > kLeft;
    if (left_) {
      const FittedBall there = fit_states(best_.ball, search_->test(), fit_);
      for (const Witness& w : ball_witnesses(there, fit_)) f.witness.push_back(w);
    }
    add_series();
    f.model = apply_ball(model_, best_.ball.layout, best_.ball.p);
    for (std::size_t k = 0; k < base_solution_.ball.layout.parameters.size(); ++k) {
      const BallParameter& p = best_.ball.layout.parameters[k];
      const auto i = static_cast<Eigen::Index>(k);
      const double std = std_of(i);
      f.parameters.push_back({p.name, p.unit, best_.ball.p[i], p.fixed ? 0.0 : std, p.value,
                              !p.fixed, p.fixed, false});
    }
  }

  Cause cause_of(const EffectSpec& t) {
    const BallSolution less = search_->solve(without(best_.terms, t), &best_);
    Cause out;
    out.effect = t.effect;
    out.where = t.where;
    out.delta_bic = search_->delta_bic(less, best_);
    out.lm = less.cost - best_.cost;
    const std::vector<BallScore> rivals = search_->scores(less, candidates_);
    for (const BallScore& s : rivals)
      if (same(s.effect, t)) out.visible_share = s.visible_share;
    out.torque_share = std::sqrt(std::max(0.0, out.lm) / static_cast<double>(search_->samples())) *
                       fit_.sigma / path_spread(search_->train());
    for (std::size_t k = 0; k < best_.ball.layout.parameters.size(); ++k) {
      const BallParameter& p = best_.ball.layout.parameters[k];
      if (p.effect < 0) continue;
      const BoundEffect& e = best_.ball.layout.effects[static_cast<std::size_t>(p.effect)];
      if (e.info().name != t.effect || e.where != t.where) continue;
      const auto i = static_cast<Eigen::Index>(k);
      const double value = best_.ball.p[i], std = std_of(i);
      out.parameters.push_back(
          {e.parameter_info[static_cast<std::size_t>(p.index)].name, p.unit, value, std,
           p.sign == Sign::kFree ? value - kNormal95 * std : std::max(0.0, value - kNormal95 * std),
           value + kNormal95 * std});
    }
    double best_linear = -INFINITY;
    for (const BallScore& s : rivals) best_linear = std::max(best_linear, s.delta_bic);
    for (const BallScore& s : rivals) {
      if (same(s.effect, t) || !go_on() || !(s.lm > 0.0)) continue;
      if (std::ranges::any_of(best_.terms, [&](const auto& u) { return same(u, s.effect); }))
        continue;
      double behind = best_linear - s.delta_bic;
      if (behind < kRefitWithin)
        behind = search_->delta_bic(search_->solve(with(less.terms, s.effect), &less), best_);
      if (behind < options_.accept_delta_bic)
        out.members.push_back({s.effect.effect, s.effect.where, behind});
      else if (out.rivals.size() < kMostRivals)
        out.rivals.push_back({s.effect.effect, s.effect.where, behind});
    }
    std::ranges::stable_sort(out.members, {}, &Rival::delta_bic);
    std::ranges::stable_sort(out.rivals, {}, &Rival::delta_bic);
    if (!out.members.empty()) out.verdict = Verdict::kClass;
    out.gain = gain_of(search_->held_out(less, best_, options_.seed), floor_);
    return out;
  }

  void add_series() {
    const FittedBall before = fit_states(base_solution_.ball, search_->test(), fit_),
                     after = fit_states(best_.ball, search_->test(), fit_);
    BallSeries series = make_ball_series(before, after, fit_.flight);
    series.held_out = true;
    series.sigma = fit_.sigma;
    const std::vector<BallFlag>& fitted = search_->train().flagged;
    series.flagged.insert(series.flagged.begin(), fitted.begin(), fitted.end());
    finding_.joints.push_back({"ball", "m", path_spread(search_->train()), series.base_rms,
                               series.extended_rms, std::sqrt(floor_) * fit_.sigma});
    finding_.noise.push_back(fit_.sigma);
    finding_.ball = std::move(series);
  }

  void judge() {
    Finding& f = finding_;
    const auto own = std::span(f.causes).last(best_.terms.size());
    const bool ambiguous =
        std::ranges::any_of(own, [](const Cause& c) { return c.verdict == Verdict::kClass; });
    Verdict verdict = Verdict::kNamed;
    if (left_ && gain_.explained_share < kExplained)
      verdict = Verdict::kUnknown;
    else if (own.empty())
      verdict = first_scores_.empty() ? Verdict::kNotIdentifiable : Verdict::kNone;
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
    if (!f.series.empty() && rank(f.verdict) > rank(verdict)) verdict = f.verdict;
    f.verdict = verdict;
    if (f.causes.size() == own.size()) f.gain = gain_;  // the arm lacks nothing
    if (f.series.empty()) {
      const auto n = static_cast<double>(search_->samples());
      f.lack_of_fit = base_solution_.cost /
                      std::max(1.0, n - 6.0 * static_cast<double>(search_->train().windows.size()));
      const double best = first_scores_.empty() ? 0.0 : first_scores_.front().lm;
      f.lack_of_fit_p = std::min(1.0, static_cast<double>(first_scores_.size()) *
                                          std::erfc(std::sqrt(std::max(best, 0.0) / 2.0)));
    }
    if (ambiguous && go_on() && !f.next_experiment)
      f.next_experiment = ball_next_experiment(best_, own, fit_.sigma, options_.seed);
  }

  const DiagnoseOptions& options_;
  bool fit_string_;  ///< and the effects that the model has
  Finding& finding_;
  Model model_;
  BallFitOptions fit_;
  bool known_noise_ = false;
  std::vector<EffectSpec> known_, candidates_;
  std::unique_ptr<BallSearch> search_;
  BallSolution base_solution_, best_;
  std::vector<BallScore> first_scores_;
  Gain gain_;
  double floor_ = 0.0;
  bool left_ = false;
  bool spin_ = false;  ///< is recorded
  int steps_ = 0;
};

}  // namespace

bool fits_string(const Model& model, Base base) {
  const bool is_identified =
      model.ball && model.ball->string && model.ball->string->length_std > 0.0;
  return base == Base::kRefit || (base == Base::kPrior && !is_identified);
}

void diagnose_ball(const std::vector<Recording>& train, const std::vector<Recording>& test,
                   const DiagnoseOptions& options, Base base, Finding& finding) {
  BallDiagnosis(train, test, options, base, finding).run();
}

}  // namespace diffnea
