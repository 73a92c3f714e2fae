/// Causes that most halves of a recording choose, and one that a moment of it makes up.

#include "diagnose/stability.hpp"

#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>

#include "diagnose/refine.hpp"

namespace diffnea::stability_test {
namespace {

/// White noise of 1 N·m at every joint, and viscous friction at the elbow from `begin` to `end`
/// [s].
struct Rubbed {
  Rubbed(double viscous, double begin, double end)
      : evidence(40.0, false, 1, "armature",
                 [=](Recording& r) {
                   const double dt = r.time[1] - r.time[0];
                   for (long i = 1; i + 1 < r.rows(); ++i)
                     if (r.time[i] >= begin && r.time[i] < end)
                       r.tau(i, 1) += viscous * (r.q(i + 1, 1) - r.q(i - 1, 1)) / (2.0 * dt);
                 }),
        candidates(make_candidates(
            evidence.model,
            {"viscous_friction@elbow", "quadratic_friction@elbow", "viscous_friction@shoulder"},
            {0}, false)),
        prior{VecX<double>::Zero(evidence->base().cols()),
              {},
              1e-3 * MatX<double>::Identity(evidence->base().cols(), evidence->base().cols())} {
    for (int k = 0; k < evidence->base().cols(); ++k) prior.free.push_back(k);
    search = std::make_unique<Search>(*evidence, candidates, prior, std::vector<bool>{});
    std::vector<Term> none;
    search->refresh(0.0, none);
    for (const Score& s : search->scores({})) {
      contenders.push_back({refined(*search, s, {})});
      scores.push_back(s);
    }
  }
  const Contender& of(const std::string& effect, const std::string& where) const {
    return *std::ranges::find_if(contenders, [&](const Contender& c) {
      return c.term.effect.info().name == effect && c.term.effect.where == where;
    });
  }

  test::SwingingEvidence evidence;
  std::vector<Candidate> candidates;
  BasePrior prior;
  std::unique_ptr<Search> search;
  std::vector<Contender> contenders;
  std::vector<Score> scores;
};

}  // namespace

TEST_CASE("stability: halves choose what is there all the time, and nothing else", "[diagnose]") {
  Rubbed rubbed(1.0, 0.0, 40.0);
  REQUIRE(choose_on_halves(*rubbed.search, 10.0, 0, rubbed.contenders));
  CHECK(rubbed.of("viscous_friction", "elbow").chosen == 1.0);
  CHECK(rubbed.of("quadratic_friction", "elbow").chosen < 0.1);
  CHECK(rubbed.of("viscous_friction", "shoulder").chosen < 0.1);
}

TEST_CASE("stability: what half a second makes up is chosen on no more than half the halves",
          "[diagnose]") {
  Rubbed rubbed(20.0, 20.3, 20.8);
  REQUIRE(rubbed.scores.front().delta_bic > 10.0);  // on the whole it looks like a cause
  REQUIRE(choose_on_halves(*rubbed.search, 10.0, 0, rubbed.contenders));
  for (const Contender& c : rubbed.contenders) CHECK(c.chosen < kMostHalves);
}

TEST_CASE("stability: the same seed draws the same halves", "[diagnose]") {
  Rubbed rubbed(0.3, 0.0, 40.0);
  std::vector<Contender> again = rubbed.contenders;
  REQUIRE(choose_on_halves(*rubbed.search, 10.0, 7, rubbed.contenders));
  REQUIRE(choose_on_halves(*rubbed.search, 10.0, 7, again));
  for (std::size_t c = 0; c < again.size(); ++c)
    CHECK(again[c].chosen == rubbed.contenders[c].chosen);
}

}  // namespace diffnea::stability_test
