/// Which effects are taken together, and what each is said to be worth.

#include "diagnose/selection.hpp"

#include <algorithm>
#include <cmath>
#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/sim/record.hpp>

#include "diagnose/selection_terms.hpp"

namespace diffnea::selection_test {
namespace {

/// White noise of 1 N·m at every joint, and at the elbow friction that is nine times as large in
/// one direction.
struct OneSided {
  explicit OneSided(double viscous)
      : evidence(40.0, false, 1, "armature",
                 [viscous](Recording& r) {
                   const double dt = r.time[1] - r.time[0];
                   for (long i = 1; i + 1 < r.rows(); ++i) {
                     const double v = (r.q(i + 1, 1) - r.q(i - 1, 1)) / (2.0 * dt);
                     r.tau(i, 1) += viscous * (v > 0.0 ? 1.8 : 0.2) * v;
                   }
                 }),
        candidates(make_candidates(evidence.model, evidence.model,
                                   {"viscous_friction@elbow", "asymmetric_viscous@elbow"}, {0},
                                   false)),
        prior{VecX<double>::Zero(evidence->base().cols()),
              {},
              1e-3 * MatX<double>::Identity(evidence->base().cols(), evidence->base().cols())} {
    for (int k = 0; k < evidence->base().cols(); ++k) prior.free.push_back(k);
    search = std::make_unique<Search>(*evidence, candidates, prior, std::vector<bool>{});
    std::vector<Term> none;
    search->refresh(0.0, none);
  }

  test::SwingingEvidence evidence;
  std::vector<Candidate> candidates;
  BasePrior prior;
  std::unique_ptr<Search> search;
};

}  // namespace

TEST_CASE("Selection: a clear effect is tried though the simpler one that goes first is not clear",
          "[diagnose]") {
  const SelectionOptions options;
  bool met = false;
  for (double viscous = 0.01; viscous < 1.0 && !met; viscous *= 1.02) {
    OneSided of(viscous);
    double simple = 0.0, child = 0.0;  // ΔBIC
    for (const Score& s : of.search->scores({}))
      (of.candidates[static_cast<std::size_t>(s.candidate)].linear.size() == 1 ? simple : child) =
          s.delta_bic;
    if (!(child > options.accept && simple < options.accept && simple > child - 10.0)) continue;
    met = true;
    CAPTURE(viscous, simple, child);
    const HeldOut held_out(*of.evidence, {}, 0);  // the same rows: what is taken helps there
    Selection selection(*of.search, of.candidates, held_out, options);
    const std::vector<Term> terms = selection.run({});
    // Halves of so little evidence may not choose it after all.
    const auto child_of = [](const auto& x) { return x.effect == "asymmetric_viscous"; };
    if (terms.empty())
      CHECK(std::ranges::any_of(selection.refused(), [&](const Refusal& r) {
        return child_of(r) && r.reason == "chosen on too few halves of the recording";
      }));
    else
      CHECK(terms[0].effect.info().name == "asymmetric_viscous");
  }
  CHECK(met);
}

TEST_CASE("Selection: a cause's held-out gain is over the others as they fit without it",
          "[diagnose]") {
  const Model nominal = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  Model truth = nominal;
  truth.effects = {{"viscous_friction", "elbow", {{"viscous", 0.3, ""}}},
                   {"quadratic_friction", "elbow", {{"quadratic", 0.02, ""}}}};
  const auto record = [&](unsigned seed) {
    FourierOptions motion;
    motion.seed = seed;
    motion.duration = 20.0;
    motion.period = 5.0;
    RecordOptions options;
    options.seed = seed;
    options.period = 5.0;
    options.scale_noise(0.2);
    return record_model(truth, nominal, random_fourier(nominal, motion), options).recording;
  };
  const Recording train = record(1), test = record(2);
  DiagnoseOptions options;
  options.effects = {"viscous_friction@elbow", "quadratic_friction@elbow"};
  const Finding both = diagnose(nominal, {train}, {test}, options);
  options.effects = {"viscous_friction@elbow"};
  const Finding one = diagnose(nominal, {train}, {test}, options);
  CAPTURE(both.sentence, one.sentence);
  const auto quadratic = std::ranges::find(both.causes, "quadratic_friction", &Cause::effect);
  REQUIRE(quadratic != both.causes.end());
  REQUIRE(one.causes.size() == 1);
  REQUIRE(quadratic->gain.before > 1.5 * quadratic->gain.after);
  // In units of a noise that is the signals' where so much is left (without the quadratic friction)
  // and less where it is not: a seventh apart.
  CHECK_THAT(quadratic->gain.before, Catch::Matchers::WithinRel(one.gain.after, 0.2));
}

TEST_CASE("Selection: a spring that rests turns away is an offset, and not named", "[diagnose]") {
  const Model nominal = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  Model truth = nominal;
  truth.effects = {{"torque_offset", "elbow", {{"offset", 1.0, ""}}}};
  const auto record = [&](unsigned seed) {
    FourierOptions motion;
    motion.seed = seed;
    motion.duration = 10.0;
    motion.period = 5.0;
    RecordOptions options;
    options.seed = seed;
    options.period = 5.0;
    return record_model(truth, nominal, random_fourier(nominal, motion), options).recording;
  };
  DiagnoseOptions options;
  options.effects = {"joint_spring@elbow"};
  const Finding alone = diagnose(nominal, {record(1)}, {record(2)}, options);
  CAPTURE(alone.sentence);
  CHECK(std::ranges::find(alone.causes, "joint_spring", &Cause::effect) == alone.causes.end());
  options.effects.push_back("torque_offset@elbow");
  const Finding both = diagnose(nominal, {record(1)}, {record(2)}, options);
  CAPTURE(both.sentence);
  REQUIRE(both.causes.size() == 1);
  CHECK(both.causes[0].effect == "torque_offset");
}

TEST_CASE("Selection: what is late by less than its joint's spring takes to swing is the spring's",
          "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  const std::vector<Candidate> candidates = make_candidates(
      evidence.model, evidence.model,
      {"joint_elasticity@elbow", "actuator_delay@elbow", "actuator_delay@shoulder"}, {0}, false);
  Search search(*evidence, candidates, {VecX<double>::Zero(evidence->base().cols()), {}, {}}, {});
  const auto term = [&](int candidate) {
    const Candidate& c = candidates[static_cast<std::size_t>(candidate)];
    return term_at(c, candidate, c.grid.front());
  };
  Term spring = term(0);
  spring.effect.parameters = {100.0, 0.0, 0.01, 1.0, 0.0};  // 1/ω = 10 ms
  const auto late = [&](int candidate, double delay) {
    Term out = term(candidate);
    out.effect.parameters[0] = delay;
    return is_of_swing(search, out, {spring});
  };
  CHECK(late(1, 9e-3));
  CHECK_FALSE(late(1, 11e-3));
  CHECK_FALSE(late(2, 9e-3));
  CHECK_FALSE(is_of_swing(search, spring, {spring}));
  spring.effect.parameters[4] = 1.0;  // the link swings
  const double slower = std::sqrt(candidates[0].swings / 100.0);
  CHECK(late(1, 0.9 * slower));
  CHECK_FALSE(late(1, 1.1 * slower));
}

}  // namespace diffnea::selection_test
