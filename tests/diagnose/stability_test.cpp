/// Causes that most halves of a recording choose, and one that a moment of it makes up.

#include "diagnose/stability.hpp"

#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>

#include "diagnose/held_out.hpp"
#include "diagnose/refine.hpp"

namespace diffnea::stability_test {
namespace {

/// White noise of 1 N·m at every joint, and viscous friction at the elbow from `begin` to `end`
/// [s].
struct Rubbed {
  Rubbed(double viscous, double begin, double end, double seconds = 40.0)
      : evidence(seconds, false, 1, "armature",
                 [=](Recording& r) {
                   const double dt = r.time[1] - r.time[0];
                   for (long i = 1; i + 1 < r.rows(); ++i)
                     if (r.time[i] >= begin && r.time[i] < end)
                       r.tau(i, 1) += viscous * (r.q(i + 1, 1) - r.q(i - 1, 1)) / (2.0 * dt);
                 }),
        candidates(make_candidates(
            evidence.model, evidence.model,
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
      contenders.push_back(refined(*search, search->term_of(s), {}));
      scores.push_back(s);
    }
  }
  double share(const std::vector<HalfChoice>& halves, const std::string& effect,
               const std::string& where) const {
    const auto at = std::ranges::find_if(contenders, [&](const Term& t) {
      return t.effect.info().name == effect && t.effect.where == where;
    });
    const int index = static_cast<int>(at - contenders.begin());
    return share_of(halves, index, {index});
  }

  test::SwingingEvidence evidence;
  std::vector<Candidate> candidates;
  BasePrior prior;
  std::unique_ptr<Search> search;
  std::vector<Term> contenders;
  std::vector<Score> scores;
};

}  // namespace

TEST_CASE("stability: halves choose what is there all the time, and nothing else", "[diagnose]") {
  const Rubbed rubbed(1.0, 0.0, 40.0);
  const auto halves = choose_on_halves(*rubbed.search, rubbed.contenders, 10.0, 0);
  REQUIRE(halves.size() == 50);
  CHECK(rubbed.share(halves, "viscous_friction", "elbow") == 1.0);
  CHECK(rubbed.share(halves, "quadratic_friction", "elbow") < 0.1);
  CHECK(rubbed.share(halves, "viscous_friction", "shoulder") < 0.1);
}

TEST_CASE("stability: a half that a cause does not show in says nothing of it", "[diagnose]") {
  const std::vector<HalfChoice> halves{{{0}, {9.0}}, {{}, {1.0}}, {{0}, {5.0}}, {{}, {5.0}}};
  CHECK(share_of(halves, 0, {0}) == 2.0 / 3.0);
}

TEST_CASE("HeldOut: shares of causes, the one that removes most first, are a whole", "[diagnose]") {
  const Rubbed rubbed(1.0, 0.0, 40.0);
  std::vector<Term> terms(rubbed.contenders.begin(), rubbed.contenders.begin() + 2);
  std::ranges::reverse(terms);
  rubbed.search->fit(terms);
  const HeldOut held_out(*rubbed.evidence, {}, 0);
  const auto shares = held_out.shares(*rubbed.search, terms);
  REQUIRE(shares.size() == 2);
  CHECK(terms[shares[0].first].effect.info().name == "viscous_friction");
  CHECK(shares[0].second > 0.95);
  CHECK(std::abs(shares[0].second + shares[1].second - 1.0) < 1e-9);
}

TEST_CASE("stability: the same seed draws the same halves", "[diagnose]") {
  const Rubbed rubbed(0.3, 0.0, 40.0);
  const auto halves = choose_on_halves(*rubbed.search, rubbed.contenders, 10.0, 7);
  REQUIRE(!halves.empty());
  const auto again = choose_on_halves(*rubbed.search, rubbed.contenders, 10.0, 7);
  REQUIRE(again.size() == halves.size());
  for (std::size_t h = 0; h < halves.size(); ++h) CHECK(again[h].chosen == halves[h].chosen);
}

}  // namespace diffnea::stability_test
