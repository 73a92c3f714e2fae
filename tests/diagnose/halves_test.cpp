/// Two paths by halves of the samples: as good as one, and of noise that one does not share with
/// the other; what a spring's score makes of it.

#include "diagnose/halves.hpp"

#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/dynamics/rnea.hpp>

#include "diagnose/search.hpp"
#include "diagnose/stretches.hpp"

namespace halves_test {

using namespace diffnea;

namespace {

PreprocessPlan plan_of(int refresh) {
  PreprocessPlan plan;
  plan.dt = 0.002;
  plan.filter_hz = 10.0;
  plan.q_noise = {1e-4};
  plan.refresh = {refresh};
  return plan;
}

RowMatX<double> sine(long rows, double dt, int refresh) {
  RowMatX<double> out(rows, 1);
  for (long k = 0; k < rows; ++k) {
    const long before = k / refresh * refresh, after = before + refresh;
    const double share = static_cast<double>(k - before) / refresh;
    const auto at = [&](long i) { return std::sin(2.0 * M_PI * 2.0 * dt * static_cast<double>(i)); };
    out(k, 0) = (1.0 - share) * at(before) + share * at(after);
  }
  return out;
}

}  // namespace

TEST_CASE("half_of: both halves of a motion are that motion", "[diagnose]") {
  for (const int refresh : {1, 4}) {
    const RowMatX<double> q = sine(801, plan_of(1).dt, refresh);
    for (const bool even : {true, false}) {
      CAPTURE(refresh, even);
      const RowMatX<double> half = half_of(q, plan_of(refresh), even);
      const RowMatX<double> motion = sine(801, plan_of(1).dt, 1);
      // (ωH)⁶ 5/1024 of polynomials of degree 5, H = 4 and 16 ms at 2 Hz; ends by three positions.
      const double error = refresh == 1 ? 1e-9 : 4e-7;
      CHECK((half - motion).middleRows(40, 720).cwiseAbs().maxCoeff() < error);
      CHECK((half - motion).cwiseAbs().maxCoeff() < 1e-2);
    }
  }
}

TEST_CASE("half_of: one half shows nothing of the other's noise", "[diagnose]") {
  const long rows = 400;
  for (const int refresh : {1, 4}) {
    const RowMatX<double> q = sine(rows + 1, plan_of(1).dt, refresh);
    for (const long row : {200L, 204L}) {
      RowMatX<double> other = q;
      for (long k = -refresh + 1; k < refresh; ++k)
        other(row + k, 0) += 1e-3 * (1.0 - std::abs(static_cast<double>(k)) / refresh);
      int changed = 0;
      for (const bool even : {true, false})
        changed += half_of(other, plan_of(refresh), even) != half_of(q, plan_of(refresh), even);
      CAPTURE(refresh, row);
      CHECK(changed == 1);
    }
  }
}

TEST_CASE("joints_alike: even moves over an encoder's steps, unless noise dithers them",
          "[diagnose]") {
  PreprocessPlan plan = plan_of(1);
  plan.filter_hz = 40.0;
  const double step = 1e-5;
  const auto noise_of = [&](double dither) {
    return step * std::sqrt(dither * dither + 1.0 / 12.0);
  };
  RowMatX<double> q(5000, 3);  // at an even speed and back; the same; a sum of sines
  for (long k = 0; k < q.rows(); ++k) {
    const double t = plan.dt * static_cast<double>(k);
    q(k, 0) = q(k, 1) = 0.1003 * std::abs(t - 5.0);
    q(k, 2) = std::sin(2.0 * t) + 0.3 * std::sin(7.1 * t + 1.0) + 0.2 * std::sin(11.3 * t + 2.0);
  }
  plan.refresh = {1, 1, 1};
  plan.q_step = {step, step, step};
  plan.q_noise = {noise_of(0.1), noise_of(0.55), noise_of(0.1)};
  CHECK(joints_alike(plan, {q}) == std::vector<int>{0, 2});
  plan.q_noise[0] = noise_of(0.55);  // a sum of sines needs no dither
  CHECK(joints_alike(plan, {q}).empty());
  plan.filter_hz = 0.3 / plan.dt;  // too fast for halves
  CHECK(joints_alike(plan, {q}) == std::vector<int>{0, 1, 2});
}

TEST_CASE("smooth_more: what shakes above half of the cut-off goes, at the named joints alone",
          "[diagnose]") {
  const PreprocessPlan plan = plan_of(1);  // 10 Hz
  RowMatX<double> q(2001, 2);
  for (long k = 0; k < q.rows(); ++k)
    q.row(k).setConstant(std::sin(2.0 * M_PI * 8.0 * plan.dt * static_cast<double>(k)));
  JointSeries path;
  path.dt = plan.dt;
  set_path(q, plan, path);
  const JointSeries before = path;
  smooth_more(q, plan, {1}, path);
  CHECK(path.q.col(0) == before.q.col(0));
  CHECK(path.qdd.col(0) == before.qdd.col(0));
  // 1/(1 + (8 Hz/5 Hz)⁸) of it is left.
  const auto middle = [](const auto& x) { return x.col(1).segment(500, 1000).norm(); };
  const double left = 1.0 / (1.0 + std::pow(1.6, 8));
  CHECK_THAT(middle(path.qdd) / middle(q) / std::pow(2.0 * M_PI * 8.0, 2),
             Catch::Matchers::WithinRel(left, 0.02));
}

TEST_CASE("halves_suffice: a path needs 2.5 times its cut-off from each", "[diagnose]") {
  PreprocessPlan plan = plan_of(1);
  CHECK(halves_suffice(plan));
  plan.filter_hz = 99.0;
  CHECK(halves_suffice(plan));
  plan.filter_hz = 101.0;
  CHECK_FALSE(halves_suffice(plan));
  plan.filter_hz = 99.0;
  plan.refresh = {2};
  CHECK_FALSE(halves_suffice(plan));
}

namespace {

/// The score of a rotor on a spring at the elbow, of a recording by a rigid robot with noise in its
/// positions, over its standard deviation.
double score(unsigned seed) {
  const test::SwingingEvidence evidence(
      40.0, false, seed, "viscous_friction", [seed](Recording& r) {
        const Model model = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
        const Tree<double> tree = make_tree(model);
        RneaWorkspace<double, double> ws;
        Rng rng(seed + 1000);
        const double h = r.time[1] - r.time[0];
        const RowMatX<double> q = r.q;
        for (long k = 0; k < r.rows(); ++k) {
          const long at = std::clamp(k, 1L, r.rows() - 2);
          const VecX<double> qd = (q.row(at + 1) - q.row(at - 1)).transpose() / (2.0 * h);
          const VecX<double> qdd =
              (q.row(at + 1) - 2.0 * q.row(at) + q.row(at - 1)).transpose() / (h * h);
          r.tau.row(k) =
              (rnea<double, double>(tree, q.row(k).transpose(), qd, qdd, ws) + 0.01 * qd)
                  .transpose() +
              1e-2 * r.tau.row(k);
          for (long j = 0; j < 2; ++j) r.q(k, j) += 5e-4 * rng.normal();
        }
      });
  std::vector<Candidate> candidates =
      make_candidates(evidence.model, evidence.model, {"joint_elasticity@elbow"}, {0}, false);
  const long p = evidence->base().cols();
  BasePrior prior{VecX<double>::Zero(p), {}, MatX<double>::Zero(0, p)};
  prior.x0.head(evidence.layout.prior().size()) = evidence.layout.prior();
  for (int k = 0; k < p; ++k) prior.free.push_back(k);
  Search search(*evidence, candidates, prior, {});
  std::vector<Term> none;
  search.refresh(0.0, none);
  Term spring = term_at(candidates[0], 0, {100.0, 1.0});  // friction turns with the motor
  search.set_columns(spring);  // by its damping and its rotor
  const VecX<double> column = search.projection().expanded(spring.beside).col(1);
  return column.dot(search.projection().residual()) / column.norm();
}

}  // namespace

TEST_CASE("diagnose: without a spring its score is noise, whatever the positions' noise",
          "[diagnose]") {
  constexpr int kSeeds = 40;
  double sum = 0.0, squares = 0.0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const double z = score(static_cast<unsigned>(seed));
    sum += z;
    squares += z * z;
  }
  CAPTURE(sum / kSeeds, squares / kSeeds);
  // Mean of 40 normal numbers, and their sum of squares, χ² of 40: each beyond in one of 1000.
  CHECK(std::abs(sum) < 3.3 * std::sqrt(static_cast<double>(kSeeds)));
  CHECK(squares > 17.9);
  CHECK(squares < 73.4);
}

}  // namespace halves_test
