/// diagnose() on recordings by MuJoCo, with MuJoCo's own friction and rotors.

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/sim/record.hpp>

#include "support/three_links.hpp"

namespace diagnose_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

TEST_CASE("diagnose: nothing is named where nothing is hidden", "[diagnose]") {
  const Finding finding = diagnose(arm().nominal, {arm().recorded({}, 1)}, {arm().recorded({}, 2)});
  CAPTURE(finding.sentence);
  CHECK(finding.verdict == Verdict::kNone);
  CHECK(finding.causes.empty());
  CHECK(finding.witness.empty());
  CHECK(finding.held_out == "test recording");
  CHECK(finding.base == "refit");
  CHECK(finding.model.effects.empty());
  CHECK_FALSE(finding.interrupted);
}

TEST_CASE("diagnose: without noise the errors of filters and integrators are no cause",
          "[diagnose]") {
  const bool periodic = GENERATE(true, false);
  const auto recorded = [&](const std::vector<EffectSpec>& hidden, unsigned seed) {
    Model truth = arm().nominal;
    truth.effects = hidden;
    FourierOptions motion;
    motion.seed = seed;
    motion.duration = 30.0;
    motion.period = periodic ? 10.0 : 30.0;
    RecordOptions options;
    options.scale_noise(0.0);
    return record_in_mujoco(kArm, truth, arm().nominal, random_fourier(arm().nominal, motion),
                            options)
        .recording;
  };
  const Finding nothing = diagnose(arm().nominal, {recorded({}, 1)}, {recorded({}, 2)});
  CAPTURE(periodic, nothing.sentence);
  CHECK(nothing.verdict == Verdict::kNone);

  const EffectSpec viscous{"viscous_friction", "elbow", {{"viscous", 0.05, ""}}};
  const Finding found = diagnose(arm().nominal, {recorded({viscous}, 1)}, {recorded({viscous}, 2)});
  CAPTURE(found.sentence);
  REQUIRE(found.causes.size() == 1);
  CHECK(found.causes.front().effect == "viscous_friction");
  CHECK(found.causes.front().where == "elbow");
}

TEST_CASE("diagnose: without noise nothing is hidden at a passive joint, whose torques cancel",
          "[diagnose]") {
  const Model model = read_model(DIFFNEA_SOURCE_DIR "/models/cart_pole.xml");
  FourierOptions motion;
  motion.duration = motion.period = 14.0;
  motion.seed = 1;
  RecordOptions options;
  options.scale_noise(0.0);
  const Recording r = record_model(model, model, random_fourier(model, motion), options).recording;
  const Finding finding = diagnose(model, {r}, {});
  CAPTURE(finding.sentence);
  CHECK(finding.verdict == Verdict::kNone);
  CHECK(finding.causes.empty());
}

TEST_CASE("diagnose: what the fitted recording alone holds at some instants is told of",
          "[diagnose]") {
  Recording touched = arm().recorded({}, 1);
  touched.tau.col(2).segment(3000, 100).array() += 20.0;
  touched.tau.col(2).segment(9300, 100).array() -= 20.0;
  const Finding finding = diagnose(arm().nominal, {touched}, {arm().recorded({}, 2)});
  CAPTURE(finding.sentence, finding.notes);
  CHECK(std::ranges::any_of(finding.notes, [](const std::string& note) {
    return note.starts_with("elbow: what is left of the fitted recording");
  }));
  // The blows are above the torque, so that what is not found there says nothing.
  CHECK(finding.verdict == Verdict::kNotIdentifiable);
}

TEST_CASE("diagnose: a torque that is noise is refused in words, never NONE", "[diagnose]") {
  const auto noisy = [](const char* where, unsigned seed) {
    Recording r = arm().recorded({}, seed);
    Rng rng(seed);
    for (std::size_t j = 0; j < r.joint_names.size(); ++j)
      for (double& tau : r.tau.col(static_cast<long>(j)))
        if (where == std::string("all") || r.joint_names[j] == where) tau += 100.0 * rng.normal();
    return r;
  };
  const Recording train = arm().recorded({}, 1), test = arm().recorded({}, 2);
  const auto refused = [&](const Recording& fitted, const Recording& held, const char* rows) {
    CHECK_THROWS_WITH(diagnose(arm().nominal, {fitted}, {held}),
                      ContainsSubstring("noise is more than half of the torque's power") &&
                          ContainsSubstring("elbow: noise of ") && ContainsSubstring(rows));
  };
  refused(noisy("all", 1), test, "fitted rows");
  refused(train, noisy("all", 2), "held-out rows");
  const Finding one = diagnose(arm().nominal, {train}, {noisy("elbow", 2)});
  CAPTURE(one.sentence, one.notes);
  CHECK(one.verdict == Verdict::kNotIdentifiable);
  CHECK(std::ranges::any_of(one.notes, [](const std::string& note) {
    return note.starts_with("WARNING: noise is more than half");
  }));
}

TEST_CASE("diagnose: Coulomb friction is named at its joint, the truth in its interval",
          "[diagnose]") {
  const Finding finding =
      diagnose(arm().nominal, {arm().recorded({kCoulomb}, 1)}, {arm().recorded({kCoulomb}, 2)});
  CAPTURE(finding.sentence);
  REQUIRE(finding.causes.size() == 1);
  const Cause& cause = finding.causes.front();
  CHECK(finding.verdict == Verdict::kNamed);
  CHECK(cause.effect == "coulomb_friction");
  CHECK(cause.where == "elbow");
  // Of 0.4 N·m while the joint moves; the filter rounds its jumps.
  const RowMatX<double> tau = arm().recorded({kCoulomb}, 1).tau;
  const double share = 0.4 / std::sqrt(tau.col(2).squaredNorm() / static_cast<double>(tau.rows()));
  CHECK(cause.torque_share > 0.85 * share);
  CHECK(cause.torque_share < 1.02 * share);
  const auto coulomb = std::ranges::find(cause.parameters, "coulomb", &CauseParameter::name);
  REQUIRE(coulomb != cause.parameters.end());
  CHECK(coulomb->low <= 0.4);
  CHECK(coulomb->high >= 0.4);
  CHECK(coulomb->high - coulomb->low < 0.1);
  CHECK(cause.delta_bic > 10.0);
  CHECK(finding.gain.low > 0.0);
  CHECK_THAT(finding.sentence, ContainsSubstring("oulomb friction at elbow"));

  const auto elbow = std::ranges::find(finding.joints, "elbow", &JointGain::joint);
  REQUIRE(elbow != finding.joints.end());
  CHECK(elbow->extended < 0.1 * elbow->base);
  CHECK(elbow->extended < 3.0 * elbow->noise_floor);  // reversals count here, not in the noise
  REQUIRE(finding.model.effects.size() == 1);
  CHECK(finding.model.effects.front().effect == "coulomb_friction");
}

TEST_CASE("diagnose: a rotor that the links absorb is declared, not named", "[diagnose]") {
  const EffectSpec rotor{"armature", "yaw", {{"armature", 0.2, ""}}};
  const Finding finding =
      diagnose(arm().nominal, {arm().recorded({rotor}, 1)}, {arm().recorded({rotor}, 2)});
  CAPTURE(finding.sentence);
  CHECK(finding.causes.empty());
  CHECK(finding.verdict == Verdict::kNone);
  const bool declared = std::ranges::any_of(finding.absorbed, [](const Absorbed& a) {
    return a.effect == "armature" && a.where == "yaw";
  });
  CHECK(declared);
}

TEST_CASE("diagnose: without repeats, what the model lacks is not whitened away as its noise",
          "[diagnose]") {
  // Friction is most of the torque, and the motion is new at every instant.
  const Model nominal = read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml");
  Model truth = nominal;
  for (const char* joint : {"joint1", "joint2", "joint3", "joint4"}) {
    truth.effects.push_back({"coulomb_friction", joint, {{"coulomb", 1.0, ""}}});
    truth.effects.push_back({"viscous_friction", joint, {{"viscous", 1.0, ""}}});
  }
  const auto recorded = [&](std::uint64_t seed) {
    FourierOptions motion;
    motion.duration = motion.period = 20.0;
    motion.seed = seed;
    RecordOptions options;
    options.seed = seed;
    return record_model(truth, nominal, random_fourier(nominal, motion), options).recording;
  };
  const Finding finding = diagnose(nominal, {recorded(1)}, {recorded(2)});
  CAPTURE(finding.sentence);
  REQUIRE(finding.joints.size() == 4);
  for (const JointGain& j : finding.joints) {
    CAPTURE(j.joint, j.base, j.extended);
    CHECK(j.base > 0.8);  // [N·m]
    CHECK(j.extended < 0.1 * j.base);
  }
}

TEST_CASE("diagnose: a drift that no cause has is unknown and goes with the time, not noise",
          "[diagnose]") {
  const Model nominal = read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml");
  const auto recorded = [&](std::uint64_t seed) {
    FourierOptions motion;
    motion.duration = motion.period = 20.0;  // nothing repeats
    motion.seed = seed;
    RecordOptions options;
    options.seed = seed;
    options.torque_noise = 0.05;
    Recording out =
        record_model(nominal, nominal, random_fourier(nominal, motion), options).recording;
    for (long i = 0; i < out.rows(); ++i)
      out.tau(i, 1) += 0.4 * std::pow(out.time[i] / motion.duration, 2.0);
    return out;
  };
  const Finding finding = diagnose(nominal, {recorded(1)}, {recorded(2)});
  CAPTURE(finding.sentence);
  CHECK(finding.verdict == Verdict::kUnknown);
  REQUIRE(finding.witness.size() == 1);
  CHECK(finding.witness[0].variables == std::vector<std::string>{"time"});
}

TEST_CASE("diagnose: a recording in which nothing moves is refused", "[diagnose]") {
  Recording still = arm().recorded({}, 1);
  still.q.rowwise() = Eigen::RowVectorXd(still.q.row(0));
  if (still.qd.size() > 0) still.qd.setZero();
  CHECK_THROWS_WITH(diagnose(arm().nominal, {still}, {arm().recorded({}, 2)}),
                    ContainsSubstring("no joint whose torque is recorded moves"));
}

TEST_CASE("diagnose: what comes back in every period and has no cause is unknown, not nothing",
          "[diagnose]") {
  // A torque of the clock, whatever the arm does: no effect, and no function of the motion.
  const auto with_clockwork = [](Recording r) {
    for (long i = 0; i < r.rows(); ++i) {
      const double turns = r.time[i] / FourierOptions{}.period;
      r.tau(i, 1) += 0.3 * std::sin(2.0 * M_PI * 11.0 * turns) * std::sin(2.0 * M_PI * 3.0 * turns);
    }
    return r;
  };
  const Finding finding = diagnose(arm().nominal, {with_clockwork(arm().recorded({}, 1))},
                                   {with_clockwork(arm().recorded({}, 2))});
  CAPTURE(finding.sentence, finding.lack_of_fit, finding.causes.size());
  CHECK(finding.lack_of_fit > 1.3);
  CHECK(finding.verdict == Verdict::kUnknown);
  CHECK(finding.gain.explained_share < 0.8);
}

TEST_CASE("diagnose: a tilted base is named alone, with the first link's masses unknown",
          "[diagnose]") {
  // About a vertical axis a level base hides where the first link's mass is.
  Model other = arm().nominal;
  SpatialInertia<double>& column = other.links[0].inertia;
  column = SpatialInertia<double>::from_theta([&] {
    Theta<double> t = column.theta();
    t[1] += 0.15;  // [kg m]
    return t;
  }());
  const EffectSpec tilt{"base_tilt", "base", {{"gravity_x", 0.15, ""}, {"gravity_y", -0.1, ""}}};
  const Finding finding = diagnose(other, {arm().recorded({tilt}, 1)}, {arm().recorded({tilt}, 2)});
  CAPTURE(finding.sentence);
  REQUIRE(finding.causes.size() == 1);
  CHECK(finding.causes[0].effect == "base_tilt");
  for (const CauseParameter& p : finding.causes[0].parameters) {
    const double truth = p.name == "gravity_x" ? 0.15 : -0.1;
    CAPTURE(p.name, p.value, p.std);
    CHECK(std::abs(p.value - truth) < 3.0 * p.std);
  }
}

TEST_CASE("diagnose: torques that are late by more than a drive holds them are a clock's shift",
          "[diagnose]") {
  // Close to what a drive may hold, the base's own instant could explain them, too.
  const long samples = GENERATE(2, 3);
  const auto late = [&](unsigned seed) {
    Recording r = arm().recorded({}, seed);
    r.tau.bottomRows(r.rows() - samples) = r.tau.topRows(r.rows() - samples).eval();
    return r;
  };
  const Recording fitted = late(1);
  const Finding finding = diagnose(arm().nominal, {fitted}, {late(2)});
  CAPTURE(samples, finding.sentence, finding.notes);
  REQUIRE(finding.causes.size() == 1);
  CHECK(finding.causes[0].effect == "time_shift");
  CHECK(finding.causes[0].where == "all");
  const double dt = fitted.time[1] - fitted.time[0];
  CHECK(std::abs(finding.causes[0].parameters[0].value + static_cast<double>(samples) * dt) <
        0.5 * dt);
}

TEST_CASE("diagnose: one joint's clock is told off the others' by less than a sample",
          "[diagnose]") {
  // Drives may hold all torques so much later; no drive has its joint's alone.
  constexpr double kShift = 0.9;  // samples: a drive may hold its torques for one
  const auto shifted = [&](unsigned seed) {
    Recording r = arm().recorded({}, seed);
    const long n = r.rows() - 1;
    for (RowMatX<double>* x : {&r.q, &r.qd})
      if (x->size() > 0)
        x->col(0).head(n) =
            ((1.0 - kShift) * x->col(0).head(n) + kShift * x->col(0).tail(n)).eval();
    return r;
  };
  const Recording fitted = shifted(1);
  const Finding finding = diagnose(arm().nominal, {fitted}, {shifted(2)});
  CAPTURE(finding.sentence);
  REQUIRE(finding.causes.size() == 1);
  CHECK(finding.causes[0].effect == "time_shift");
  CHECK(finding.causes[0].where == fitted.joint_names[0]);
  const double dt = fitted.time[1] - fitted.time[0];
  CHECK(std::abs(std::abs(finding.causes[0].parameters[0].value) - kShift * dt) < 0.15 * dt);
}

TEST_CASE("diagnose: two causes that one effect explains are that one", "[diagnose]") {
  // At the vertical axis nothing hides an offset: Coulomb friction and an offset are the same.
  const EffectSpec hidden{
      "asymmetric_coulomb", "yaw", {{"coulomb_positive", 0.5, ""}, {"coulomb_negative", 0.35, ""}}};
  const Finding finding =
      diagnose(arm().nominal, {arm().recorded({hidden}, 1)}, {arm().recorded({hidden}, 2)});
  CAPTURE(finding.sentence);
  REQUIRE(finding.causes.size() == 1);
  CHECK(finding.causes[0].effect == "asymmetric_coulomb");
}

TEST_CASE("diagnose: an offset that changed between the recordings is told, not named",
          "[diagnose]") {
  Recording later = arm().recorded({}, 2);
  later.tau.col(1).array() += 0.2;  // [N·m]
  const std::string joint = later.joint_names[1];
  const Finding finding = diagnose(arm().nominal, {arm().recorded({}, 1)}, {later});
  CAPTURE(finding.sentence, finding.notes);
  CHECK(finding.causes.empty());
  CHECK(std::ranges::any_of(finding.notes, [&](const std::string& note) {
    const std::string off = joint + ": on held-out data the torque is off by ";
    return note.starts_with(off) && std::abs(std::stod(note.substr(off.size())) - 0.2) < 5e-3;
  }));
}

TEST_CASE("diagnose: without test data blocks of time are held out", "[diagnose]") {
  const Finding finding = diagnose(arm().nominal, {arm().recorded({kCoulomb}, 1)}, {});
  CAPTURE(finding.sentence);
  CHECK(finding.held_out == "time blocks");
  // Blocks of the same motion hold out less: a small ripple may stand beside the cause
  // (docs/diagnosis.md).
  REQUIRE_FALSE(finding.causes.empty());
  CHECK(finding.causes.front().effect == "coulomb_friction");
  CHECK(finding.causes.front().where == "elbow");
}

TEST_CASE("diagnose: chosen candidates are the only ones", "[diagnose]") {
  DiagnoseOptions options;
  options.effects = {"viscous_friction", "coulomb_friction@yaw"};
  const Finding finding = diagnose(arm().nominal, {arm().recorded({kCoulomb}, 1)},
                                   {arm().recorded({kCoulomb}, 2)}, options);
  CHECK(finding.candidates.size() == 4);
  for (const CandidateScore& c : finding.candidates)
    CHECK((c.effect == "viscous_friction" || (c.effect == "coulomb_friction" && c.where == "yaw")));
}

TEST_CASE("diagnose: a base that is held shows what a refit would hide", "[diagnose]") {
  const EffectSpec rotor{"armature", "yaw", {{"armature", 0.2, ""}}};
  DiagnoseOptions options;
  options.base = Base::kFixed;
  const Finding finding =
      diagnose(arm().nominal, {arm().recorded({rotor}, 1)}, {arm().recorded({rotor}, 2)}, options);
  CAPTURE(finding.sentence);
  CHECK(finding.base == "fixed");
  REQUIRE_FALSE(finding.causes.empty());
  CHECK(std::ranges::any_of(
      finding.causes, [](const Cause& c) { return c.where == "yaw" && c.effect == "armature"; }));
}

TEST_CASE("diagnose: stopped at once, it returns what there is", "[diagnose]") {
  DiagnoseOptions options;
  options.progress = [](const FitProgress& p) { return p.stage != "testing"; };
  const Finding finding = diagnose(arm().nominal, {arm().recorded({kCoulomb}, 1)}, {}, options);
  CHECK(finding.interrupted);
  CHECK(finding.causes.empty());
}

TEST_CASE("diagnose: refuses what cannot be answered", "[diagnose]") {
  const Recording train = arm().recorded({}, 1);
  CHECK_THROWS_WITH(diagnose(arm().nominal, {train}, {train}), ContainsSubstring("same rows"));
  DiagnoseOptions options;
  options.base = Base::kPrior;
  CHECK_THROWS_WITH(diagnose(arm().nominal, {train}, {}, options),
                    ContainsSubstring("no posterior"));
  options.base = Base::kAuto;
  options.effects = {"magic"};
  CHECK_THROWS_WITH(diagnose(arm().nominal, {train}, {}, options),
                    ContainsSubstring("magic") && ContainsSubstring("coulomb_friction"));
  CHECK_THROWS_AS(value_of<Verdict>("MAYBE", "verdict"), ModelError);
  for (const Verdict v : {Verdict::kNamed, Verdict::kClass, Verdict::kUnknown, Verdict::kNone,
                          Verdict::kNotIdentifiable})
    CHECK(value_of<Verdict>(name_of(v), "verdict") == v);
}

TEST_CASE("diagnose: what a held-out recording says of a held body counts there", "[diagnose]") {
  // Runs 0 and 1 of the fit without and with the body, and one held out with it: run 2 of all.
  const SpatialInertia<double> body =
      inertia_from_com<double>(1.2, {0.2, 0.0, 0.05}, {0.01, 0.0, 0.0, 0.01, 0.0, 0.01});
  Model carries = arm().nominal;
  SpatialInertia<double>& last =
      carries.links[static_cast<std::size_t>(moving_links(carries).back())].inertia;
  last = last + body;
  const auto recorded = [&](const Model& robot, unsigned seed) {
    FourierOptions motion;
    motion.seed = seed;
    motion.duration = 30.0;
    RecordOptions options;
    options.seed = seed + 1000;
    return record_model(robot, arm().nominal, random_fourier(arm().nominal, motion), options)
        .recording;
  };
  std::vector<Recording> train{recorded(arm().nominal, 1), recorded(carries, 2)};
  std::vector<Recording> test{recorded(carries, 3)};
  for (Recording* r : {&train[1], &test[0]}) {
    HeldBody held;
    held.name = "weight";
    held.mass = 1.2;
    held.com = std::array{0.2, 0.0, 0.05};
    held.about_com = std::array{0.01, 0.0, 0.0, 0.01, 0.0, 0.01};
    r->info.payload = held;
  }
  DiagnoseOptions fixed;
  fixed.base = Base::kFixed;  // nothing else may stand in for the body
  const Finding finding = diagnose(arm().nominal, train, test, fixed);
  CAPTURE(finding.sentence, finding.gain.before);
  CHECK(finding.verdict == Verdict::kNone);
  CHECK(finding.gain.before < 1.5);  // times the noise; without the body more than 10
}

}  // namespace diagnose_test
