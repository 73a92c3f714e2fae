/// What few held-out rows tell.

#include "diagnose/held_out.hpp"

#include <cmath>
#include <support/swinging.hpp>

#include <Eigen/QR>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>

#include "diagnose/rows.hpp"

namespace held_out_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;

TEST_CASE("HeldOut: one block of held-out rows is no interval", "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  const HeldOut held_out(*evidence, {}, 0);
  const long second = std::lround(1.0 / evidence->step());
  const auto worth = [&](long from, long instants) {  // a quarter of the mean square is left
    VecX<double> before = VecX<double>::Zero(evidence->rows());
    before.segment(from, instants).setOnes();
    return held_out.compare({before}, {0.5 * before});
  };
  const HeldOutChange little = worth(0, second / 2);
  CHECK(little.before == 1.0);
  CHECK(little.after == 0.25);
  CHECK(little.low <= 0.0);
  CHECK_FALSE(little.helps());
  CHECK(worth(0, 4 * second).helps());  // the same in eight blocks of half a second
}

TEST_CASE("HeldOut: a prediction costs what a fit of all rows costs more than one of the fitted",
          "[diagnose]") {
  // Random torques, and few fitted rows: the base is known badly.
  const test::SwingingEvidence fitted(8.0, false, 1, "viscous_friction", test::slow_down),
      held(20.0, false, 2, "viscous_friction", test::slow_down);
  const std::vector<Candidate> candidates =
      make_candidates(fitted.model, fitted.model, {"coulomb_friction"}, {0}, false);
  const long p = fitted->base().cols();
  BasePrior prior{VecX<double>::Zero(p), {}, 1e-3 * MatX<double>::Identity(p, p)};
  for (int k = 0; k < p; ++k) prior.free.push_back(k);
  Search search(*fitted, candidates, prior, {});
  std::vector<Term> none;
  search.refresh(0.0, none);
  const HeldOut held_out(*held, {}, 0);
  const Prediction of = held_out.predicted(search, none);

  const Whitener& here = search.whitener();
  const Whitener there(*held, here.noise(), {});
  const auto left = [](const MatX<double>& A, const VecX<double>& y) {
    const VecX<double> x = A.completeOrthogonalDecomposition().solve(y);
    return (y - A * x).squaredNorm();
  };
  const long n = fitted->rows(), m = held->rows();
  MatX<double> A(n + p + m, p);
  A << here(fitted->base()), prior.root, there(held->base());
  VecX<double> y(n + p + m);
  y << here(fitted->torque()), VecX<double>::Zero(p), there(held->torque());
  const double more = left(A, y) - left(A.topRows(n + p), y.head(n + p));
  CHECK_THAT(of.left.squaredNorm() + of.moved, Catch::Matchers::WithinRel(more, 1e-6));
  CHECK(of.moved > 1.0);
  CHECK(of.left.norm() < held_out.whitener(search)(held_out.errors(search, none)).norm());
}

TEST_CASE("HeldOut: what the base pays in one of two models counts against it", "[diagnose]") {
  const test::SwingingEvidence evidence(20.0);
  const HeldOut held_out(*evidence, {}, 0);
  const VecX<double> ones = VecX<double>::Ones(evidence->rows());
  const double rows = static_cast<double>(evidence->rows());
  const HeldOutChange change = held_out.compare({ones}, {0.5 * ones, 0.75 * rows});
  CHECK_THAT(change.after, Catch::Matchers::WithinRel(1.0, 1e-12));
  CHECK_FALSE(change.helps());
}

TEST_CASE("HeldOut: a block that goes wrong does not outweigh all others", "[diagnose]") {
  // A gap's flight ends elsewhere than predicted: two blocks of twenty are twice as far off with
  // the cause, in the others half is left.
  const test::SwingingEvidence evidence(20.0);
  const HeldOut held_out(*evidence, {}, 0);
  const long second = std::lround(1.0 / evidence->step());
  const VecX<double> before = VecX<double>::Ones(evidence->rows());
  const auto with = [&](long wrong) {
    VecX<double> after = 0.5 * before;
    for (long k = 0, m = evidence->times(); k * m < after.size(); ++k)
      after.segment(k * m, wrong * second).setConstant(2.0);
    return held_out.compare({before}, {after});
  };
  const HeldOutChange change = with(2);
  CHECK(change.low <= 0.0);
  CHECK(change.after < change.before);
  CHECK(change.helps());
  CHECK_FALSE(with(8).helps());  // more is lost than won
}

TEST_CASE("HeldOut: each block tells how much of a gap's flights it has, from none to all",
          "[diagnose]") {
  const test::SwingingEvidence fitted(20.0), held(20.0, false, 2);
  std::vector<Candidate> gaps =
      make_candidates(fitted.model, fitted.model, {"backlash@elbow"}, {0}, false);
  REQUIRE(gaps.size() == 1);
  tell_flights(gaps);
  BasePrior prior{VecX<double>::Zero(fitted->base().cols()), {}, {}};
  Search search(*fitted, gaps, prior, {});
  std::vector<Term> none;
  search.refresh(0.0, none);
  const HeldOut held_out(*held, {}, 0);
  Term gap = term_at(gaps[0], 0, gaps[0].grid.back());  // the largest
  REQUIRE(gap.effect.told >= 0);
  double& told = gap.effect.parameters[static_cast<std::size_t>(gap.effect.told)];
  told = 1.0;
  const VecX<double> flights = held_out.whitener(search)(held->torque_of(gap.effect));
  told = 0.0;  // nothing of it on the fitted rows
  search.set_columns(gap);
  const VecX<double> before = held_out.predicted(search, none).left;
  const Prediction with = held_out.predicted(search, {gap});
  double least = 1.0, most = 0.0;
  for (long i = 0; i < before.size(); ++i) {
    if (std::abs(flights[i]) < 1e-3) continue;
    const double share = (before[i] - with.left[i]) / flights[i];
    least = std::min(least, share);
    most = std::max(most, share);
  }
  CAPTURE(flights.squaredNorm(), before.squaredNorm(), with.left.squaredNorm());
  CHECK(least >= 0.0);
  CHECK(least < 1e-9);  // random torques are no flights, and some blocks go against them
  CHECK(most > 0.01);
  CHECK(most <= 1.0 + 1e-9);
  CHECK(with.left.norm() < before.norm());
  CHECK(with.moved >= 2.0 * 10.0);  // each block pays, and the motion never rests
}

TEST_CASE("HeldOut: a recording of fewer blocks is refused, with what is needed", "[diagnose]") {
  const test::SwingingEvidence enough(20.0), few(1.9);
  require_blocks(*enough, enough.source->sample());
  require_blocks(enough.source->sample());
  CHECK_THROWS_WITH(require_blocks(*few, few.source->sample()),
                    ContainsSubstring("swinging: diagnose: ") && ContainsSubstring(" s or more"));
  CHECK_THROWS_WITH(require_blocks(few.source->sample()), ContainsSubstring("1.89 s"));
}

TEST_CASE("HeldOut: a torque that ends early is named where too few rows are left", "[diagnose]") {
  const test::SwingingEvidence early(20.0, false, 1, "viscous_friction", [](Recording& r) {
    r.tau.col(1).bottomRows(r.rows() - 150).setConstant(std::nan(""));
  });
  CHECK_THROWS_WITH(require_blocks(*early, early.source->sample()),
                    ContainsSubstring("'tau_elbow' ends at 1.49 s"));
}

TEST_CASE("HeldOut: rows a thousand times as far apart are in another unit", "[diagnose]") {
  const Model model = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  const Recording seconds = test::swinging(model, 20.0, false, 1);
  Recording milliseconds = seconds;
  milliseconds.time *= 1e3;
  const auto planned = [&](const Recording& train, const Recording& test) {
    return plan_held_out({test}, plan_rows(model, {train}, 0.0, {}), {});
  };
  CHECK_THROWS_WITH(planned(seconds, milliseconds),
                    ContainsSubstring("is the time of this one in ms?"));
  CHECK_THROWS_WITH(planned(milliseconds, seconds),
                    ContainsSubstring("is the time of the fitted recording in ms?"));
  Recording slow = seconds;
  slow.time *= 40.0;
  CHECK(planned(seconds, slow).dt > 0.39);  // and no error
}

TEST_CASE("HeldOut: rows of another rate are as far apart as those that were fitted",
          "[diagnose]") {
  const Model model = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  PreprocessOptions options;
  options.filter_hz = 8.0;
  options.decimate_to_hz = 25.0;
  const auto noisy = [&](double noise) {
    Recording r = test::swinging(model, 20.0, false, 1);
    Rng rng(7);
    for (double& q : r.q.reshaped()) q += noise * rng.normal();
    return r;
  };
  Recording half = noisy(1e-3);  // every second row, and a coarser sensor
  const auto every_second = Eigen::seq(0, Eigen::last, 2);
  half.time = VecX<double>(half.time(every_second));
  half.q = RowMatX<double>(half.q(every_second, Eigen::all));
  half.tau = RowMatX<double>(half.tau(every_second, Eigen::all));

  const PreprocessPlan fitted = plan_rows(model, {noisy(1e-4)}, 0.0, options);
  const PreprocessPlan held = plan_held_out({half}, fitted, options);
  REQUIRE(held.dt == 2.0 * fitted.dt);
  CHECK(held.dt * held.decimator.factor == fitted.dt * fitted.decimator.factor);
  CHECK(held.decimator.pass_hz == fitted.decimator.pass_hz);
  CHECK(held.q_noise[0] > 5.0 * fitted.q_noise[0]);  // of its own sensor: ten times
}

}  // namespace held_out_test
