#include <algorithm>
#include <cmath>
#include <ctime>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/policy/ball_in_cup.hpp>

namespace ball_in_cup_reward_test {

using namespace diffnea;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;

namespace {

/// Only names: what is seen comes from the test.
class Names : public Simulator {
 public:
  explicit Names(std::vector<std::string> channels) : channels_(std::move(channels)) {}
  const std::vector<std::string>& joints() const override { return joints_; }
  const std::vector<std::string>& channels() const override { return channels_; }
  double period() const override { return 0.002; }
  int lanes() const override { return 64; }
  void reset(const Starts&) override {}
  void step(const Lanes&, const Lanes&) override {}
  const Lanes& observe() const override { return seen_; }
  const std::vector<std::string>& failures() const override { return failures_; }
  std::unique_ptr<Simulator> clone() const override { return std::make_unique<Names>(*this); }

 private:
  std::vector<std::string> joints_ = {"a", "b"}, channels_, failures_;
  Lanes seen_;
};

// Not in the order in which the task looks for them.
const std::vector<std::string> kChannels = {"phase",  "qd_b",   "axis_x", "axis_y", "axis_z",
                                            "cup_x",  "cup_y",  "cup_z",  "q_a",    "q_b",
                                            "ball_x", "ball_y", "ball_z", "qd_a"};

double code(BallPhase phase) { return static_cast<double>(phase); }

/// (channels × lanes) of a ball somewhere about a cup.
Lanes random_look(long lanes, Rng& rng) {
  Lanes out(static_cast<long>(kChannels.size()), lanes);
  for (double& x : out.reshaped()) x = rng.uniform(-0.3, 0.3);
  out.row(0).setZero();
  for (long i = 0; i < lanes; ++i) {
    out(4, i) += 1.0;
    out.col(i).segment(2, 3).normalize();
  }
  return out;
}

/// The rules for one lane, one row a look (channels as above), apart from the library's loops.
double reward_of(const RowMatX<double>& rows, const BallInCupOptions& o) {
  double most = -1e9, last = 0.0, penalty = 0.0;
  long looks = 0;
  bool over = false;
  for (long i = 0; i < rows.rows() && !over; ++i, ++looks) {
    const Eigen::Vector3d axis = rows.row(i).segment(2, 3), cup = rows.row(i).segment(5, 3),
                          ball = rows.row(i).segment(10, 3), delta = ball - cup;
    const Eigen::Vector2d q(rows(i, 8), rows(i, 9)), q0(rows(0, 8), rows(0, 9)),
        qd(rows(i, 13), rows(i, 1));
    last = delta.dot(axis) / (delta.squaredNorm() + o.epsilon);
    most = std::max(most, last);
    penalty += o.lambda_q * (q - q0).squaredNorm() + o.lambda_qd * qd.squaredNorm();
    over = rows(i, 0) >= 2.0;
  }
  if (rows(looks - 1, 0) != 1.0)
    last = std::min(last, -o.string / (o.string * o.string + o.epsilon));
  return std::exp(0.5 * most + 0.5 * last) - penalty / static_cast<double>(looks);
}

/// What the task says of looks, with NaN shown where an episode is over.
struct Judged {
  VecX<double> rewards;
  std::vector<char> solved, ended;
};
Judged judge(BallInCupTask& task, const std::vector<Lanes>& looks, long count) {
  Judged out;
  out.ended.assign(static_cast<std::size_t>(count), 0);
  task.begin(Names(kChannels), static_cast<int>(count));
  double time = 0.0;
  for (Lanes seen : looks) {
    for (long i = 0; i < count; ++i)
      if (out.ended[static_cast<std::size_t>(i)]) seen.col(i).setConstant(std::nan(""));
    task.look(time, seen, out.ended);
    time += 0.002;
  }
  out.rewards = task.rewards();
  out.solved = task.solved();
  return out;
}

}  // namespace

TEST_CASE("ball in a cup: the reward equals one computed from each lane's trace", "[policy]") {
  const unsigned seed = GENERATE(range(0u, 20u));
  CAPTURE(seed);
  Rng rng(seed);
  const long lanes = 9, count = 7;  // two more are shown than there are worlds
  BallInCupOptions options;
  options.epsilon = seed % 2 == 0 ? 0.01 : 0.055;
  options.string = 0.35;
  std::vector<Lanes> looks;
  for (int i = 0; i < 50; ++i) looks.push_back(random_look(lanes, rng));
  // Lane 0 never, 1 caught, 2 touched, 3 upside down, 4 touched at the first look, 5 caught last,
  // 6 never.
  for (std::size_t i = 0; i < looks.size(); ++i) {
    Lanes& x = looks[i];
    if (i >= 20) x(0, 1) = code(BallPhase::kCaptured);
    if (i == 17) x(0, 2) = code(BallPhase::kTouched);
    if (i >= 30) x(0, 3) = code(BallPhase::kUpsideDown);
    x(0, 4) = code(BallPhase::kTouched);
    if (i == 49) x(0, 5) = code(BallPhase::kCaptured);
  }
  BallInCupTask task(options);
  const Judged judged = judge(task, looks, count);
  CHECK(judged.ended == std::vector<char>{0, 0, 1, 1, 1, 0, 0});
  CHECK(judged.solved == std::vector<char>{0, 1, 0, 0, 0, 1, 0});
  for (long lane = 0; lane < count; ++lane) {
    CAPTURE(lane);
    RowMatX<double> rows(50, static_cast<long>(kChannels.size()));
    for (long i = 0; i < 50; ++i) rows.row(i) = looks[static_cast<std::size_t>(i)].col(lane);
    constexpr double kRoundingTol = 1e-13;  // sums of fifty terms of order 1
    CHECK(judged.rewards[lane] == Approx(reward_of(rows, options)).epsilon(kRoundingTol));
    // Alone it is worth the same bit for bit, from a clone that has seen other worlds.
    std::vector<Lanes> alone;
    for (const Lanes& x : looks) alone.push_back(x.col(lane));
    BallInCupTask used(task);
    CHECK(judge(used, alone, 1).rewards[0] == judged.rewards[lane]);
    CHECK(judge(dynamic_cast<BallInCupTask&>(*task.clone()), alone, 1).rewards[0] ==
          judged.rewards[lane]);
  }
}

TEST_CASE("ball in a cup: hovering over the cup at the end is worth no more than hanging",
          "[policy]") {
  const auto at_height = [](double h, BallPhase phase) {
    Lanes x = Lanes::Zero(static_cast<long>(kChannels.size()), 1);
    x(4, 0) = 1.0;
    x(12, 0) = h;
    x(0, 0) = code(phase);
    return x;
  };
  BallInCupTask task;
  const BallInCupOptions o = task.options();
  const auto worth = [&](const Lanes& at_end) {
    return judge(task,
                 {at_height(-0.4, BallPhase::kFree), at_height(0.1, BallPhase::kFree), at_end}, 1)
        .rewards[0];
  };
  // Closed forms: ψ = h/(h² + ε) on the axis; over the cup at √ε it is 1/(2√ε) = 5.
  const double hanging = -o.string / (o.string * o.string + o.epsilon);
  CHECK(worth(at_height(0.1, BallPhase::kFree)) == Approx(std::exp(2.5 + 0.5 * hanging)));
  CHECK(worth(at_height(0.1, BallPhase::kTouched)) == Approx(std::exp(2.5 + 0.5 * hanging)));
  CHECK(worth(at_height(-0.1, BallPhase::kUpsideDown)) == Approx(std::exp(2.5 - 2.5)));
  const double rest = 0.0345 / (0.0345 * 0.0345 + o.epsilon);
  CHECK(worth(at_height(0.0345, BallPhase::kCaptured)) == Approx(std::exp(2.5 + 0.5 * rest)));
}

TEST_CASE("ball in a cup: speed and distance cost, both", "[policy]") {
  Rng rng(1);
  const Lanes still = random_look(1, rng);
  Lanes far = still, fast = still;
  far(8, 0) += 1.0;
  fast(13, 0) += 5.0;
  BallInCupTask task;
  const double base = judge(task, {still, still}, 1).rewards[0];
  CHECK(judge(task, {still, far}, 1).rewards[0] == Approx(base - 0.5 * 0.02));
  CHECK(judge(task, {still, fast}, 1).rewards[0] < base);
}

TEST_CASE("ball in a cup: a ball that is NaN for once makes the reward NaN", "[policy]") {
  Rng rng(2);
  std::vector<Lanes> looks = {random_look(3, rng), random_look(3, rng), random_look(3, rng)};
  looks[1](11, 1) = std::nan("");
  BallInCupTask task;
  const VecX<double> rewards = judge(task, looks, 3).rewards;
  CHECK(std::isnan(rewards[1]));
  CHECK((std::isfinite(rewards[0]) && std::isfinite(rewards[2])));
}

TEST_CASE("ball in a cup: a simulator without a ball, or options without sense, are refused",
          "[policy]") {
  std::vector<std::string> channels = kChannels;
  std::erase(channels, "ball_y");
  BallInCupTask task;
  CHECK_THROWS_WITH(task.begin(Names(channels), 1), ContainsSubstring("'ball_y'"));
  CHECK_THROWS_AS(BallInCupTask({.epsilon = 0.0}), Error);
  CHECK_THROWS_AS(BallInCupTask({.lambda_qd = -1.0}), Error);
  CHECK_THROWS_AS(BallInCupTask({.string = std::nan("")}), Error);
}

TEST_CASE("ball in a cup: cost of a look", "[.benchmark]") {
  Rng rng(1);
  for (const long lanes : {1L, 8L, 64L}) {
    const Lanes seen = random_look(lanes, rng);
    std::vector<char> ended(static_cast<std::size_t>(lanes), 0);
    BallInCupTask task;
    task.begin(Names(kChannels), static_cast<int>(lanes));
    const int looks = 100000;
    const std::clock_t from = std::clock();  // of this process: others may run
    for (int i = 0; i < looks; ++i) task.look(0.0, seen, ended);
    const double took = 1e9 * static_cast<double>(std::clock() - from) / CLOCKS_PER_SEC;  // [ns]
    WARN(lanes << " lanes: " << took / looks / static_cast<double>(lanes)
               << " ns a lane and look, reward " << task.rewards()[0]);
  }
}

}  // namespace ball_in_cup_reward_test
