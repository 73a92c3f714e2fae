/// Scores of candidates, whatever is kept in memory.

#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>

#include "diagnose/refine.hpp"

namespace search_test {

using namespace diffnea;

TEST_CASE("Search: ripples that are made anew score as those that are kept", "[diagnose]") {
  const test::SwingingEvidence evidence(40.0);
  std::vector<Candidate> candidates =
      make_candidates(evidence.model, evidence.model, {"cogging", "coulomb_friction"}, {0}, false);
  for (Candidate& c : candidates)
    if (c.effect.info().name == "cogging") {
      c.grid.clear();
      for (int k = 0; k < 20; ++k) c.grid.push_back({8.0 + 0.7 * k});
    }
  const long p = evidence->base().cols();
  BasePrior prior{VecX<double>::Zero(p), {}, 1e-3 * MatX<double>::Identity(p, p)};
  for (int k = 0; k < p; ++k) prior.free.push_back(k);

  Search kept(*evidence, candidates, prior, {}), anew(*evidence, candidates, prior, {}, 0.0);
  std::vector<Term> terms_kept, terms_anew;
  for (int round = 0; round < 2; ++round) {  // alone, then beside the best
    CAPTURE(round);
    kept.refresh(0.0, terms_kept);
    anew.refresh(0.0, terms_anew);
    const std::vector<Score> a = kept.scores(terms_kept), b = anew.scores(terms_anew);
    REQUIRE(a.size() == b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      CHECK(a[i].candidate == b[i].candidate);
      CHECK(a[i].variant == b[i].variant);
      CHECK(a[i].delta_bic == b[i].delta_bic);
    }
    terms_kept.push_back(refined(kept, kept.term_of(a.front()), terms_kept));
    terms_anew.push_back(refined(anew, anew.term_of(b.front()), terms_anew));
  }
}

}  // namespace search_test
