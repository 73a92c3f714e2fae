/// A policy for many models: what a sample is worth in draws, and that one model drawn again and
/// again is no other than the model.

#include <algorithm>
#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/experiment/ball_in_cup.hpp>
#include <diffnea/io/model_file.hpp>

namespace diffnea::robust_test {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinRel;

BallInCup small_task(const RobustOptions& robust) {
  static const Model model = read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/wam4_ball.xml");
  LearnOptions options;
  options.ereps.samples = 16;
  options.ereps.iterations = 3;
  options.robust = robust;
  return ball_in_cup(model, model, options);
}

const std::vector<Variation> kVary{{"string.string_damping.damping", 0.0, 2.0},
                                   {"string.length", 0.38, 0.42}};

}  // namespace

TEST_CASE("robust: a sample is worth the mean, or the quantile, of what it gets in its draws",
          "[policy]") {
  constexpr int kDraws = 5;
  // Of five rewards: the smallest but one that at least 0.4 of them do not pass, and the mean.
  const std::optional<double> quantile =
      GENERATE(std::optional<double>(), std::optional<double>(0.4));
  const BallInCup task =
      small_task({.draws = kDraws, .each = kDraws, .quantile = quantile, .vary = kVary});
  double said = 0.0;
  long executed = 0;
  learn(task, 4, 1, [&](const SearchState& state) {
    said = state.search.history().back().reward_mean;
    executed = state.rollouts;
    return false;
  });
  Rollouts world = rollouts(task, 1);
  const RowMatX<double> theta = first_search(task, 4).ask();
  double sum = 0.0;
  int differ = 0;
  for (long i = 0; i < theta.rows(); ++i) {
    VecX<double> rewards(kDraws);
    for (int k = 0; k < kDraws; ++k)
      rewards[k] = world.run(theta.row(i), {static_cast<std::uint64_t>(k + 1)}).rewards[0];
    std::ranges::sort(rewards);
    differ += rewards[0] < rewards[kDraws - 1] ? 1 : 0;
    sum += quantile ? rewards[1] : rewards.mean();
  }
  CHECK(differ > theta.rows() / 2);  // those beyond the limits are the same everywhere
  CHECK(executed == world.count());
  CHECK_THAT(said, WithinRel(sum / static_cast<double>(theta.rows()), 1e-12));  // another order
}

TEST_CASE("robust: in draws that are the model the search is that in the model", "[policy]") {
  const BallInCup plain = small_task({});
  const double length = plain.model.ball->string->length;
  const BallInCup same = small_task({.draws = 7, .vary = {{"string.length", length, length}}});
  const LearnedPolicy a = learn(plain, 2), b = learn(same, 2);
  CHECK(a.policy.mean == b.policy.mean);
  CHECK(a.policy.covariance == b.policy.covariance);
  CHECK(a.rollouts == b.rollouts);
  CHECK(a.in_draws.count == 0);
  CHECK(b.in_draws.count == 64);
  CHECK((b.in_draws.caught == 64) == b.solved);
  CHECK_THAT(b.in_draws.reward, WithinRel(b.expected, 1e-12));
}

TEST_CASE("robust: what is imagined is of the model itself, whatever varies", "[policy]") {
  const BallInCup plain = small_task({}), varied = small_task({.draws = 3, .vary = kVary});
  const VecX<double> theta = first_search(plain, 1).ask().row(0).transpose();
  const RolloutTrace a = rollouts(plain, 1).trace(theta), b = rollouts(varied, 1).trace(theta);
  REQUIRE(a.values.rows() > 10);
  CHECK(a.values == b.values);
}

TEST_CASE("robust: options that make no sense are refused", "[policy]") {
  const auto refused = [](const RobustOptions& o, const char* why) {
    CHECK_THROWS_WITH(small_task(o), ContainsSubstring(why));
  };
  refused({.draws = 4}, "has no posterior");
  refused({.draws = -1, .vary = kVary}, "draws and each: got -1");
  refused({.vary = kVary}, "--robust");
  refused({.quantile = 0.1}, "--robust");
  refused({.draws = 4, .each = 5, .vary = kVary}, "at most the 4 draws");
  refused({.draws = 4, .each = 1, .quantile = 0.1, .vary = kVary}, "2 or more");
  refused({.draws = 4, .quantile = 0.0, .vary = kVary}, "above 0");
  refused({.draws = 4, .quantile = 1.1, .vary = kVary}, "above 0");
  const BallInCup completed = small_task({.draws = 4, .quantile = 0.1, .vary = kVary});
  CHECK(completed.options.robust.each == 4);
}

}  // namespace diffnea::robust_test
