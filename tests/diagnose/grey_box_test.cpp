/// The grey box on MuJoCo's arm: torques are hidden by closed formulas that are no sums of bumps.

#include "diagnose/grey_box.hpp"

#include <algorithm>
#include <cmath>
#include <support/mujoco_arm.hpp>
#include <support/swinging.hpp>

#include <Eigen/QR>
#include <catch2/catch_test_macros.hpp>

#include <diffnea/diagnose/diagnose.hpp>

#include "diagnose/refine.hpp"
#include "support/kept_diagnosis.hpp"

namespace grey_box_test {

using namespace diffnea;

namespace {

constexpr const char* kArm = R"(<mujoco model="arm">
  <compiler angle="radian" inertiafromgeom="false"/>
  <worldbody>
    <body name="upper" pos="0 0 0.4">
      <inertial pos="0.2 0.01 0" mass="3" diaginertia="0.01 0.05 0.05"/>
      <joint name="shoulder" axis="0 1 0" limited="true" range="-1.5 1.5"/>
      <body name="fore" pos="0.4 0 0">
        <inertial pos="0.15 0 0.01" mass="2" diaginertia="0.005 0.02 0.02"/>
        <joint name="elbow" axis="0 1 0" limited="true" range="-2 2"/>
      </body>
    </body>
  </worldbody>
</mujoco>
)";

/// Torque of a magnet that holds the elbow at 0.3 rad [N·m].
double hold(double q, double detent) {
  const double x = (q - 0.3) / 0.15;
  return detent * x * std::exp(-x * x);
}

const test::MujocoArm& arm() {
  static const test::MujocoArm kOne(kArm);
  return kOne;
}

Recording recorded(const std::vector<EffectSpec>& hidden, double detent, unsigned seed) {
  Recording out = arm().recorded(hidden, seed);
  for (long i = 0; i < out.rows(); ++i) out.tau(i, 1) += hold(out.q(i, 1), detent);
  return out;
}

Finding diagnosed(const std::vector<EffectSpec>& hidden, double detent,
                  const DiagnoseOptions& options = {}) {
  return diagnose(arm().nominal, {recorded(hidden, detent, 1)}, {recorded(hidden, detent, 2)},
                  options);
}

/// Without them in the catalogue, ripples and springs do not stand in for a magnet.
DiagnoseOptions frictions() {
  DiagnoseOptions options;
  options.effects = {"coulomb_friction", "viscous_friction", "torque_offset"};
  return options;
}

const EffectSpec kCoulomb{"coulomb_friction", "elbow", {{"coulomb", 0.4, ""}}};

const Cause* find(const Finding& f, const std::string& effect) {
  const auto at = std::ranges::find(f.causes, effect, &Cause::effect);
  return at == f.causes.end() ? nullptr : &*at;
}

}  // namespace

TEST_CASE("grey box: what no candidate explains is learned, and stays without a name",
          "[diagnose]") {
  DiagnoseOptions options = frictions();
  const Finding with = diagnosed({}, 1.0, options);
  options.grey_box = false;
  const Finding without = diagnosed({}, 1.0, options);
  CAPTURE(with.sentence, without.sentence);
  REQUIRE(without.verdict == Verdict::kUnknown);
  CHECK(without.grey_box.empty());
  // The base that is simulated is that without anything beside it.
  REQUIRE(with.simulated.joints.size() == without.simulated.joints.size());
  REQUIRE_FALSE(with.simulated.horizons.empty());
  CHECK(with.simulated.horizons.front().base_rmse == without.simulated.horizons.front().base_rmse);
  CHECK(with.simulated.base_follows == without.simulated.base_follows);
  CHECK(with.verdict == Verdict::kUnknown);
  REQUIRE(with.grey_box.size() == 1);
  const GreyBox& box = with.grey_box.front();
  CHECK(box.where == "elbow");
  CHECK(box.after < 0.5 * box.before);
  REQUIRE(find(with, "residual"));
  CHECK(find(with, "residual")->verdict == Verdict::kUnknown);
  CHECK(find(with, "residual")->gain.low > 0.0);
  CHECK(with.sentence.find("names no cause") != std::string::npos);
  CHECK(box.effective_parameters < box.bumps + 1e-9);
  CHECK(test::kept_page(with).find("data-draw='greyBox'") != std::string::npos);  // the curve

  // The extended model holds it: 0 outside the data, and no more than what was hidden at its most.
  const auto spec = std::ranges::find(with.model.effects, "residual", &EffectSpec::effect);
  REQUIRE(spec != with.model.effects.end());
  const BoundEffect effect = bind(*spec, with.model);
  double most = 0.0;
  for (double q = -2.0; q < 2.0; q += 0.01) most = std::max(most, std::abs(hold(q, 1.0)));
  for (const double q : {-50.0, -10.0, -0.5, 0.0, 0.2, 0.45, 10.0, 50.0})
    for (const double qd : {-200.0, -1.0, 0.0, 1.0, 200.0}) {
      const VecX<double> x = VecX<double>::Constant(2, q), xd = VecX<double>::Constant(2, qd);
      VecX<double> tau = VecX<double>::Zero(2);
      JointSample<double> sample;
      sample.q = x.data();
      sample.qd = xd.data();
      add_torque(effect, sample, effect.parameters.data(), tau.data());
      CHECK(std::abs(tau[1]) <= box.bound);
      if (std::abs(q) >= 10.0) CHECK(tau[1] == 0.0);
    }
  // It undoes what the base has borne of it, too; that is no more than what was hidden, twice.
  CHECK(box.bound < 3.0 * most);
  CHECK_FALSE(with.simulated.joints.empty());
}

TEST_CASE("grey box: not offered where a candidate explains the data, nor where nothing is hidden",
          "[diagnose]") {
  const Finding named = diagnosed({kCoulomb}, 0.0);
  CAPTURE(named.sentence);
  CHECK(named.verdict == Verdict::kNamed);
  CHECK(named.grey_box.empty());
  const Finding none = diagnosed({}, 0.0);
  CAPTURE(none.sentence);
  CHECK(none.verdict == Verdict::kNone);
  CHECK(none.grey_box.empty());
}

TEST_CASE("grey box: a named effect beside it keeps its estimate, the truth in its interval",
          "[diagnose]") {
  DiagnoseOptions options = frictions();
  const Finding with = diagnosed({kCoulomb}, 1.3, options);
  options.grey_box = false;
  const Finding without = diagnosed({kCoulomb}, 1.3, options);
  CAPTURE(with.sentence, without.sentence);
  REQUIRE(with.verdict == Verdict::kUnknown);
  REQUIRE_FALSE(with.grey_box.empty());
  const Cause *a = find(with, "coulomb_friction"), *b = find(without, "coulomb_friction");
  REQUIRE(a);
  REQUIRE(b);
  CHECK(a->parameters.front().value == b->parameters.front().value);
  CHECK(a->parameters.front().low <= 0.4);
  CHECK(a->parameters.front().high >= 0.4);
}

TEST_CASE("grey box: fitted with it at once, base and effects as before, effects are the same",
          "[diagnose]") {
  // Random torques: everything finds something, nothing has a truth to hide behind.
  const test::SwingingEvidence evidence(40.0, false, 1, "viscous_friction", test::slow_down);
  const std::vector<Candidate> candidates =
      make_candidates(evidence.model, evidence.model, {"coulomb_friction"}, {0}, false);
  const long p = evidence->base().cols();
  BasePrior prior{VecX<double>::Zero(p), {}, 1e-3 * MatX<double>::Identity(p, p)};
  for (int k = 0; k < p; ++k) prior.free.push_back(k);
  Search search(*evidence, candidates, prior, {});
  std::vector<Term> terms;
  search.refresh(0.0, terms);
  const std::vector<Score> scores = search.scores(terms);
  terms.push_back(refined(search, search.term_of(scores.front()), terms));
  search.fit(terms);

  const HeldOut held_out(*evidence, {}, 0);
  const GreyBoxResult grey = grey_box(evidence.model, search, terms, held_out, {}, -1e9);
  REQUIRE_FALSE(grey.joints.empty());
  REQUIRE(grey.torque.there.norm() > 0.0);

  // Least squares on base and effects side by side, as effects see them, of the torque less the
  // residual.
  const Whitener& white = search.whitener();
  const long rows = evidence->rows(), k = terms[0].width();
  MatX<double> A = MatX<double>::Zero(rows + p, p + k);
  A.topRows(rows) << white(evidence->seen_base()), white(terms[0].columns);
  A.bottomLeftCorner(p, p) = prior.root;
  const Eigen::ColPivHouseholderQR<MatX<double>> qr(A);
  const auto solved = [&](const VecX<double>& torque) {
    VecX<double> y = VecX<double>::Zero(rows + p);
    y.head(rows) = white(torque);
    return VecX<double>(qr.solve(y));
  };
  const VecX<double> alone = solved(evidence->torque()),
                     beside = solved(evidence->torque() - grey.torque.there);
  // Rounding of a QR of a thousand rows.
  constexpr double kRounding = 1e-8;
  CHECK((alone - beside).tail(k).norm() < kRounding * alone.tail(k).norm());
  CHECK((alone - beside).head(p).norm() > kRounding * alone.head(p).norm());  // the base gives way
}

}  // namespace grey_box_test
