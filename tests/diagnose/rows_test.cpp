/// How many rows a second a diagnosis makes of a recording.

#include "diagnose/rows.hpp"

#include <support/swinging.hpp>

#include <catch2/catch_test_macros.hpp>

namespace diffnea::rows_test {
namespace {

/// Rows a second of the double pendulum and its path's cut-off [Hz].
/// @param q_noise [rad] @param tau_noise [N·m]
std::pair<double, double> rows_and_path(double q_noise, double tau_noise) {
  const Model model = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  Recording r = test::swinging(model, 60.0, false, 1);
  Rng rng(5);
  for (double& q : r.q.reshaped()) q += q_noise * rng.normal();
  for (double& tau : r.tau.reshaped()) tau *= tau_noise;  // was of size 1
  const PreprocessPlan plan = plan_rows(model, {r}, 0.0, {});
  return {1.0 / (plan.dt * plan.decimator.factor), plan.filter_hz};
}

}  // namespace

TEST_CASE("plan_rows: as fast as torques tell, however slow the path", "[diagnose]") {
  // A quieter position tells of faster torques: the frequency is √(σ_τ/(M σ_q))/2π.
  const auto [coarse, coarse_path] = rows_and_path(1e-2, 1e-2);
  const auto [fine, fine_path] = rows_and_path(1e-3, 1.0);
  CAPTURE(coarse, coarse_path, fine, fine_path);
  CHECK(coarse >= 9.0);  // ten, by whole samples
  CHECK(fine > coarse);
  CHECK(fine > 3.0 * fine_path);  // twice the path's cut-off was the most
  CHECK(rows_and_path(1e-5, 1.0).first <= 50.0 + 1e-9);
}

TEST_CASE("plan_rows: two paths where they cost no more than a fifth of the cut-off",
          "[diagnose]") {
  const Model model = read_model(DIFFNEA_SOURCE_DIR "/models/double_pendulum.urdf");
  const double rate = 100.0;
  const auto humming = [&](double hz) {
    Recording r = test::swinging(model, 60.0, false, 1);
    Rng rng(5);
    for (long i = 0; i < r.rows(); ++i)
      for (double& q : r.q.row(i))
        q += 1e-3 * std::sin(2.0 * M_PI * hz * r.time[i]) + 1e-5 * rng.normal();
    return r;
  };
  const Recording slow = humming(12.0), fast = humming(40.0);
  const double own = plan_preprocess({slow}, {}).filter_hz;
  CAPTURE(own);
  REQUIRE(own > 0.2 * rate);
  REQUIRE(own < 0.25 * rate);
  CHECK(plan_rows(model, {slow}, 0.0, {}).filter_hz == 0.2 * rate);
  PreprocessOptions asked;
  asked.filter_hz = 0.24 * rate;  // at the user's word
  CHECK(plan_rows(model, {slow}, 0.0, asked).filter_hz == 0.24 * rate);
  // The highest there is: what moves above it is no noise, and halves would not follow it.
  REQUIRE(plan_preprocess({fast}, {}).filter_hz == 0.25 * rate);
  CHECK(plan_rows(model, {fast}, 0.0, {}).filter_hz == 0.25 * rate);
}

}  // namespace diffnea::rows_test
