/// Stiffness of a link that swings behind its motor's encoder.

#include "diagnose/resonance.hpp"

#include <cmath>
#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/effects/series.hpp>

namespace resonance_test {

using namespace diffnea;

TEST_CASE("narrowed: the stiffness at which a lightly damped link swings, from a grid's step beside",
          "[diagnose]") {
  Model model = test::SwingingEvidence(4.0).model;
  const std::vector<Candidate> candidates =
      make_candidates(model, model, {"joint_elasticity@elbow"}, {0}, false);
  const double inertia = candidates[0].swings, pi = std::acos(-1.0);
  // The elbow moves at up to 1.25 Hz, and its link swings at 3 Hz, for as long as the log lasts.
  const double truth = inertia * std::pow(2.0 * pi * 3.0, 2);
  BoundEffect spring = bind({"joint_elasticity", "elbow", {}}, model);
  spring.parameters = {truth, 2.0 * 0.01 * std::sqrt(truth * inertia), 0.0, 1.0, 1.0};
  const Tree<double> tree = make_tree(model);
  const auto with_spring = [&](Recording& r) {
    JointSeries x;
    x.dt = r.time[1] - r.time[0];
    x.q = r.q;
    x.qd = x.qdd = x.q;
    for (long j = 0; j < r.q.cols(); ++j) {
      x.qd.col(j) = derivative(x.q.col(j), x.dt);
      x.qdd.col(j) = derivative(x.qd.col(j), x.dt);
    }
    predict({tree, {}, {}}, x);
    Rng rng(3);
    r.tau = x.total + series_torque(spring, tree, x, spring.parameters.data());
    for (long i = 0; i < r.tau.size(); ++i) r.tau.data()[i] += 1e-3 * rng.normal();
  };
  const test::SwingingEvidence evidence(20.0, false, 1, "armature", with_spring);
  const long p = evidence->base().cols();
  BasePrior prior{VecX<double>::Zero(p), {}, 1e-3 * MatX<double>::Identity(p, p)};
  for (int k = 0; k < p; ++k) prior.free.push_back(k);
  Search search(*evidence, candidates, prior, {});
  std::vector<Term> none;
  search.refresh(0.0, none);
  for (const double beside : {std::pow(10.0, -0.25), std::pow(10.0, 0.25)}) {
    CAPTURE(truth, beside);
    Term term = term_at(candidates[0], 0, candidates[0].grid.front());
    const double start = truth * beside;  // half of the grid's step
    term.effect.parameters = {start, 2.0 * 0.3 * std::sqrt(start * inertia), 0.0, 1.0, 1.0};
    search.set_columns(term);
    const Term found = narrowed(search, term, none);
    // Steps of the narrowest resonance, 2 · 0.03 of the logarithm, and what the base takes back.
    CHECK_THAT(found.effect.parameters[0], Catch::Matchers::WithinRel(truth, 0.1));
    CHECK(found.effect.parameters[1] < 0.2 * term.effect.parameters[1]);
  }
}

}  // namespace resonance_test
