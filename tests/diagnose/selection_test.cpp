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
#include "motion/free_swing.hpp"

namespace diffnea::selection_test {
namespace {

/// White noise of 1 N·m at every joint, and at the elbow friction that is nine times as large in
/// one direction.
struct OneSided {
  explicit OneSided(double viscous,
                    const std::vector<std::string>& effects = {"viscous_friction@elbow",
                                                               "asymmetric_viscous@elbow"})
      : evidence(40.0, false, 1, "armature",
                 [viscous](Recording& r) {
                   const double dt = r.time[1] - r.time[0];
                   for (long i = 1; i + 1 < r.rows(); ++i) {
                     const double v = (r.q(i + 1, 1) - r.q(i - 1, 1)) / (2.0 * dt);
                     r.tau(i, 1) += viscous * (v > 0.0 ? 1.8 : 0.2) * v;
                   }
                 }),
        candidates(make_candidates(evidence.model, evidence.model, effects, {0}, false)),
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
    Selection selection(*of.search, held_out, options);
    const std::vector<Term> terms = selection.run();
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

TEST_CASE("Selection: what falls does not stand again, and what is left stands otherwise",
          "[diagnose]") {
  OneSided of(3.0);
  const HeldOut held_out(*of.evidence, {}, 0);
  Selection selection(*of.search, held_out, {});
  const auto stand = [](const std::vector<Term>& terms) {
    std::vector<std::string> out;
    for (const Term& t : terms) out.push_back(t.effect.info().name);
    return out;
  };
  std::vector<Term> terms = selection.run();
  REQUIRE(stand(terms) == std::vector<std::string>{"asymmetric_viscous"});
  selection.resume(terms, 0, "because");
  CHECK(stand(terms) == std::vector<std::string>{"viscous_friction"});
  REQUIRE_FALSE(selection.refused().empty());
  CHECK(selection.refused().back().effect == "asymmetric_viscous");
  CHECK(selection.refused().back().reason == "because");
  // It is still told as what does better.
  const std::vector<Cause> causes = selection.causes(terms);
  REQUIRE(causes.size() == 1);
  std::vector<Rival> all = causes[0].members;
  all.insert(all.end(), causes[0].rivals.begin(), causes[0].rivals.end());
  REQUIRE(all.size() == 1);
  CHECK(all[0].effect == "asymmetric_viscous");
  CHECK(all[0].delta_bic < 0.0);
}

TEST_CASE("Selection: held-out motion tells frictions apart that fit the others alike",
          "[diagnose]") {
  // In 15 s at ± 0.8 rad dry friction with drag dissipates as a viscous one; at ± 0.35 rad it does
  // not.
  test::FreeSwing swing{.coulomb = 3.7e-4, .quadratic = 3.3e-5, .q0 = 0.8};
  const Recording train = free_swing(swing, test::even_times(0.0, 15.0, 100.0));
  swing.q0 = 0.35;
  swing.seed = 2;
  const Recording late = free_swing(swing, test::even_times(0.0, 50.0, 100.0));
  const auto left = [](const Finding& f) { return f.gain.after / f.gain.before; };
  DiagnoseOptions options;
  options.grey_box = false;
  options.effects = {"viscous_friction"};
  const Finding viscous = diagnose(test::swing_model(), {train}, {late}, options);
  REQUIRE(viscous.verdict == Verdict::kUnknown);
  options.effects = {};
  const Finding finding = diagnose(test::swing_model(), {train}, {late}, options);
  CAPTURE(finding.sentence);
  CHECK(finding.verdict == Verdict::kClass);
  REQUIRE_FALSE(finding.causes.empty());
  CHECK(std::ranges::none_of(finding.causes, [](const Cause& c) {
    return c.effect == "viscous_friction" || c.effect == "asymmetric_viscous";
  }));
  CHECK(left(finding) < 0.3 * left(viscous));
  const auto refusal = std::ranges::find(finding.refused, "viscous_friction", &Refusal::effect);
  REQUIRE(refusal != finding.refused.end());
  CHECK(refusal->reason.starts_with("held-out data are predicted worse"));
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

TEST_CASE("Selection: a clock and a delay of all joints are one, and stand for each other alone",
          "[diagnose]") {
  OneSided of(3.0, {"time_shift@all", "actuator_delay@all", "actuator_delay@elbow"});
  const auto term = [&](const char* effect, std::size_t joints, double seconds) {
    for (std::size_t k = 0; k < of.candidates.size(); ++k) {
      const Candidate& c = of.candidates[k];
      if (c.effect.info().name != effect || c.effect.joints.size() != joints) continue;
      Term out = term_at(c, static_cast<int>(k), c.grid.front());
      out.effect.parameters[0] = seconds;
      of.search->set_columns(out);
      return out;
    }
    FAIL(effect);
    return Term{};
  };
  // Five rows: more than a drive that samples and holds may have.
  const Term clock = term("time_shift", 2, -0.05), delay = term("actuator_delay", 2, 0.05),
             one = term("actuator_delay", 1, 0.05);
  CHECK_FALSE(is_no_shift(*of.search, {clock}));
  CHECK_FALSE(is_no_shift(*of.search, {delay}));
  CHECK(is_no_shift(*of.search, {delay, clock}));
  CHECK(is_no_shift(*of.search, {clock, delay}));
  CHECK_FALSE(is_no_shift(*of.search, {one, clock}));
}

}  // namespace diffnea::selection_test
