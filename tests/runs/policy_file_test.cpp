/// Policies and unfinished searches as files: exact both ways, and never of another task.

#include <fstream>
#include <functional>
#include <limits>
#include <string>
#include <support/temporary_folder.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/runs/policy_file.hpp>

namespace diffnea::policy_file_test {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::MessageMatches;

/// @param robust  in draws, of what the description may lack
BallInCup small_task(bool robust = false) {
  static const Model model = read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/wam4_ball.xml");
  LearnOptions options;
  options.ereps.samples = 24;
  options.ereps.iterations = 4;
  if (robust)
    options.robust = {
        .draws = 6,
        .each = 3,
        .quantile = 0.5,
        .vary = {{"string.string_damping.damping", 0.0, 0.5}, {"string.length", 0.39, 0.41}}};
  return ball_in_cup(model, model, options);
}

/// All that policy_json holds, as text: equal texts are equal policies, bit by bit.
std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

}  // namespace

TEST_CASE("policy file: every number comes back exactly", "[policy]") {
  const test::TemporaryFolder folder;
  const bool robust = GENERATE(false, true);
  LearnedPolicy policy = learn(small_task(robust), 18446744073709551615u);
  if (GENERATE(false, true)) policy.expected = -std::numeric_limits<double>::infinity();
  write_policy(policy, folder.path() / "policy.json");
  const LearnedPolicy same = read_policy(folder.path() / "policy.json");
  CHECK(policy_json(same) == policy_json(policy));
  CHECK(same.seed == policy.seed);
  CHECK(same.policy.mean == policy.policy.mean);
  CHECK(same.policy.covariance == policy.policy.covariance);
  CHECK(same.start == policy.start);
  CHECK(same.controller.kp == policy.controller.kp);
  CHECK(same.expected == policy.expected);
  CHECK(same.curve.size() == policy.curve.size());
  CHECK(same.curve.back().entropy == policy.curve.back().entropy);
  CHECK(same.curve.back().iteration == policy.curve.back().iteration);
  CHECK(same.stopped == policy.stopped);
  CHECK(same.in_draws.count == (robust ? 64 : 0));
  CHECK(same.in_draws.caught == policy.in_draws.caught);
  CHECK(same.in_draws.reward == policy.in_draws.reward);
}

TEST_CASE("policy file: what is broken is named", "[policy]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "policy.json";
  const std::string good = policy_json(learn(small_task(), 1));
  struct Case {
    std::string from, to, message;
  };
  const Case c = GENERATE(
      Case{"\"seed\": 1", "\"seed\": -1", "policy.json.seed"},
      Case{"\"mean\"", "\"average\"", "key 'mean' is missing"},
      Case{"\"bases\": 9", "\"bases\": 8", "expected 8 (one per parameter)"},
      Case{"\"bases\": 9", "\"bases\": 1", "at least 2"},
      Case{"\"joint2\",\n  \"joint3\"", "\"wing\",\n  \"joint3\"", "there is no joint 'joint2'"},
      Case{"\"pd\"", "\"pid\"", "choices: pd, computed_torque"},
      Case{"policy/1", "policy/2", "expected diffnea/policy/1"},
      Case{"\"stopped\"", "\"halted\"", "unknown key 'halted'"}, Case{"{", "[", "is not JSON"});
  CAPTURE(c.from, c.to);
  write_file_atomically(path, replaced(good, c.from, c.to));
  CHECK_THROWS_MATCHES(read_policy(path), ModelError, MessageMatches(ContainsSubstring(c.message)));
  CHECK_THROWS_AS(read_policy(folder.path() / "none.json"), FileError);
}

TEST_CASE("checkpoint: a search that goes on from it ends as one without a break", "[policy]") {
  const test::TemporaryFolder folder;
  const BallInCup task = small_task(GENERATE(false, true));
  const std::string id = fingerprint(task);
  const int stop_after = GENERATE(1, 3);
  const LearnedPolicy whole = learn(task, 5);
  learn(task, 5, 1, [&](const SearchState& state) {
    write_checkpoint(state, id, folder.path() / "5.json");
    return state.search.iteration() < stop_after;
  });
  const std::optional<SearchState> resumed =
      read_checkpoint(folder.path() / "5.json", id, first_search(task, 5));
  REQUIRE(resumed);
  CHECK(resumed->search.iteration() == stop_after);
  LearnedPolicy rest = learn(task, 5, 1, {}, &*resumed);
  rest.seconds = whole.seconds;  // of a clock
  CHECK(policy_json(rest) == policy_json(whole));
}

TEST_CASE("checkpoint: of another task, seed or search it is refused, and says what to do",
          "[policy]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "1.json";
  const BallInCup task = small_task();
  const std::string id = fingerprint(task);
  CHECK_FALSE(read_checkpoint(path, id, first_search(task, 1)));
  write_checkpoint({first_search(task, 1)}, id, path);
  REQUIRE(read_checkpoint(path, id, first_search(task, 1)));

  const auto refused = [&](const std::string& with, const Ereps& first, const char* why) {
    CHECK_THROWS_MATCHES(read_checkpoint(path, with, first), ModelError,
                         MessageMatches(ContainsSubstring(why) &&
                                        ContainsSubstring("choose another -o, or --fresh")));
  };
  BallInCup other = task;
  other.model.ball->mass *= 1.0 + 1e-12;
  CHECK(fingerprint(other) != id);
  refused(fingerprint(other), first_search(task, 1), "of another task");
  other = task;
  other.options.ereps.iterations = 1000;
  other.options.ereps.stop_std = 0.01;
  CHECK(fingerprint(other) == id);  // it goes on
  CHECK(read_checkpoint(path, id, first_search(other, 1)));
  other = small_task(true);
  CHECK(fingerprint(other) != id);
  const std::string in_draws = fingerprint(other);
  other.options.robust.vary[0].high = 0.6;
  CHECK(fingerprint(other) != in_draws);
  other = task;
  other.options.reward.lambda_q = 0.03;
  CHECK(fingerprint(other) != id);
  other = task;
  other.options.reward.lambda_slack = 0.1;
  CHECK(fingerprint(other) != id);
  other = task;
  other.controller.gravity.z = -9.8;
  CHECK(fingerprint(other) != id);
  refused(id, first_search(task, 2), "of seed 1, expected 2");
  other = task;
  other.options.ereps.kappa = 0.25;
  refused(id, first_search(other, 1), "kappa 0.5, expected 0.25");
  const std::string text = read_text_file(path);
  write_file_atomically(path, text.substr(0, text.size() / 2));
  refused(id, first_search(task, 1), "is not JSON");
}

}  // namespace diffnea::policy_file_test
