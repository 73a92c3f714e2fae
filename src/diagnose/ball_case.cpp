#include "diagnose/ball_case.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>

#include "diagnose/thresholds.hpp"
#include "identify/ball_flags.hpp"
#include "identify/ball_identify.hpp"

namespace diffnea {
namespace {


void add_candidates(const BallData& data, BallCase& c) {
  const auto needs_spin = [](const std::string& entry) {
    const EffectInfo* info = known_effect(entry.substr(0, entry.find('@')));
    return info && info->has(Trait::kNeedsSpin);
  };
  if (std::ranges::any_of(c.options.effects, needs_spin)) require_spin(data);
  c.spin = has_spin(data);
  if (c.spin && !has_spin(c.search->test())) {
    c.spin = false;
    c.finding.notes.push_back(
        "the held-out recordings hold no spin (spin_x, spin_y, spin_z): lift cannot be tried");
  }
  for (const EffectInfo& i : catalogue()) {
    if (!acts_on_ball(i) || i.port == Port::kBallImpact) continue;
    if (i.has(Trait::kNeedsSpin) && !c.spin) continue;
    if (i.port == Port::kStringAnchor && c.fit_string) continue;
    for (const std::string& where : places(i, c.model)) {
      const auto asked = [&](const std::string& entry) {
        return entry == i.name || entry == i.name + "@" + where;
      };
      if (!c.options.effects.empty() && std::ranges::none_of(c.options.effects, asked)) continue;
      const EffectSpec spec{i.name, where, {}};
      // What the base has, and fits, is no candidate.
      if (holds_effect(c.known, spec)) continue;
      c.candidates.push_back(spec);
    }
  }
}

}  // namespace

void BallCase::search_on(BallData fitted, BallData held_out) {
  search = std::make_unique<BallSearch>(
      model, known, fit_string, std::move(fitted), std::move(held_out), fit,
      [this](const std::string& stage, int more_steps) { return tell(stage, more_steps); });
}

void prepare(const std::vector<Recording>& train, const std::vector<Recording>& test, BallCase& c) {
  for (const EffectSpec& e : c.model.effects)
    if (acts_on_ball(find_effect(e.effect))) c.known.push_back(e);
  BallData fitted = make_ball_data(c.model, train, c.fit, c.options.preprocess), held_out;
  if (!test.empty()) {
    held_out = make_ball_data(c.model, test, c.fit, c.options.preprocess);
    c.finding.held_out = "test recording";
  }
  if (c.fit_string && c.model.ball->string)
    guess_unknown_string(*c.model.ball->string, fitted, c.model.gravity);
  c.fit.sigma = camera_noise(fitted, c.fit.longest_gap);
  c.known_noise = std::isfinite(c.fit.sigma);
  if (!c.known_noise) {
    BallData data = fitted;
    c.fit.sigma = 0.0;
    c.fit.sigma = fit_ball(c.model, make_ball_layout(c.model, c.known, c.fit_string), data, c.fit,
                           [&](int, double) { return c.tell("fitting the ball", 1); })
                      .sigma;
  }
  if (test.empty()) {
    if (fitted.windows.size() < 2 * kHeldOutWindow)
      throw DataError(train.front().source + ": " + std::to_string(fitted.windows.size()) +
                      " stretches of the ball's path are too few to hold some out; give a "
                      "second recording with --test");
    c.finding.held_out = "time blocks";
    held_out = fitted;
    held_out.windows.clear();
    held_out.flagged.clear();  // they are listed with what is fitted
    std::vector<BallWindow> kept;
    for (std::size_t w = 0; w < fitted.windows.size(); ++w)
      (w % kHeldOutWindow == kHeldOutWindow - 1 ? held_out.windows : kept)
          .push_back(fitted.windows[w]);
    fitted.windows = std::move(kept);
  }
  if (fitted.touching > 0)
    c.finding.notes.push_back("ball: " + std::to_string(fitted.touching) +
                              " rows are left out, at which it touches the cup or did so within "
                              "half a second");
  c.search_on(fitted, held_out);
  add_candidates(fitted, c);
}

}  // namespace diffnea
