#include <cmath>
#include <limits>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/policy/rollouts.hpp>

namespace rollouts_test {

using namespace diffnea;
using Catch::Matchers::ContainsSubstring;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Three unit masses, each pulled to its desired position by a noisy spring. Fails where the second
/// passes `fails_beyond`.
class PointMasses : public Simulator {
 public:
  explicit PointMasses(int lanes, double fails_beyond = kInfinity)
      : lanes_(lanes), fails_beyond_(fails_beyond) {}

  const std::vector<std::string>& joints() const override { return joints_; }
  const std::vector<std::string>& channels() const override { return channels_; }
  double period() const override { return 0.01; }
  int lanes() const override { return lanes_; }
  void reset(const Starts& starts) override {
    if (starts.q.cols() < 1 || starts.q.cols() > lanes_) throw ShapeError("PointMasses");
    seen_ = Lanes::Constant(6, lanes_, std::nan(""));
    seen_.topLeftCorner(3, starts.q.cols()) = starts.q;
    seen_.bottomLeftCorner(3, starts.q.cols()).setZero();
    noise_.clear();
    for (const std::uint64_t s : starts.seeds) noise_.emplace_back(s);
    failures_.clear();
  }
  void step(const Lanes& q, const Lanes& qd) override {
    if (q.cols() != lanes_ || qd.cols() != lanes_) throw ShapeError("PointMasses");
    for (std::size_t i = 0; i < noise_.size(); ++i)
      for (long j = 0; j < 3; ++j) {
        const long lane = static_cast<long>(i);
        double &x = seen_(j, lane), &v = seen_(3 + j, lane);
        v += period() *
             (400.0 * (q(j, lane) - x) + 30.0 * (qd(j, lane) - v) + 0.1 * noise_[i].normal());
        x += period() * v;
        if (j != 1 || x <= fails_beyond_) continue;
        failures_.resize(static_cast<std::size_t>(lanes_));
        failures_[i] = "went too far";
      }
  }
  const Lanes& observe() const override { return seen_; }
  const std::vector<std::string>& failures() const override { return failures_; }
  std::unique_ptr<Simulator> clone() const override { return std::make_unique<PointMasses>(*this); }

 private:
  std::vector<std::string> joints_ = {"a", "b", "c"};
  std::vector<std::string> channels_ = {"q_a", "q_b", "q_c", "qd_a", "qd_b", "qd_c"};
  int lanes_;
  double fails_beyond_;
  Lanes seen_;
  std::vector<Rng> noise_;
  std::vector<std::string> failures_;
};

/// Sums what it sees; an episode ends where joint b leaves ±0.3, and that is its task.
class Sum : public Task {
 public:
  void begin(const Simulator& simulator, int count) override {
    row_ = find_channel(simulator, "q_b");
    sum_.setZero(count);
    done_.assign(static_cast<std::size_t>(count), 0);
  }
  void look(double time, const Lanes& seen, std::vector<char>& ended) override {
    for (std::size_t i = 0; i < ended.size(); ++i) {
      if (ended[i]) continue;
      const double b = seen(row_, static_cast<long>(i));
      sum_[static_cast<long>(i)] += time * b + seen.col(static_cast<long>(i)).squaredNorm();
      if (std::abs(b) > 0.3) ended[i] = done_[i] = 1;
    }
  }
  VecX<double> rewards() const override { return sum_; }
  std::vector<char> solved() const override { return done_; }
  std::unique_ptr<Task> clone() const override { return std::make_unique<Sum>(); }

 private:
  int row_ = 0;
  VecX<double> sum_;
  std::vector<char> done_;
};

/// Cannot say what a motion is worth, and throws if it is to.
class Broken : public Sum {
 public:
  explicit Broken(bool throws) : throws_(throws) {}
  VecX<double> rewards() const override {
    if (throws_) throw ModelError("broken task");
    return VecX<double>::Constant(Sum::rewards().size(), std::nan(""));
  }
  std::vector<char> solved() const override { return {}; }
  std::unique_ptr<Task> clone() const override { return std::make_unique<Broken>(throws_); }

 private:
  bool throws_;
};

Promp promp() {
  PrompSpec spec;
  spec.joints = {"b", "a"};  // not in the simulator's order
  spec.duration = 0.5;
  spec.hold = 0.2;
  return Promp(spec);
}

const Eigen::Vector3d kStart(0.1, 0.0, -0.2);

MotionLimits no_limits() {
  const VecX<double> far = VecX<double>::Constant(3, kInfinity);
  return {-far, far, far};
}

Rollouts rollouts(int lanes, int threads, const MotionLimits& limits = no_limits(),
                  double fails_beyond = kInfinity) {
  return Rollouts(PointMasses(lanes, fails_beyond), Sum(), promp(), kStart, limits, threads);
}

struct Samples {
  RowMatX<double> theta;
  std::vector<std::uint64_t> seeds;
};
Samples samples(int n, double scale = 0.4) {
  Rng rng(3);
  Samples out{RowMatX<double>(n, promp().size()), {}};
  for (double& x : out.theta.reshaped()) x = scale * rng.normal();
  for (int i = 0; i < n; ++i) out.seeds.push_back(rng.next());
  return out;
}

}  // namespace

TEST_CASE("rollouts: the same bit for bit on any lanes and threads, and in a trace",
          "[policy][threads]") {
  const auto [theta, seeds] = samples(23);
  Rollouts one = rollouts(1, 1);
  const RolloutResult expected = one.run(theta, seeds);
  CHECK(one.count() == 23);
  const int lanes = GENERATE(1, 4, 7, 64), threads = GENERATE(1, 2, 5);
  CAPTURE(lanes, threads);
  Rollouts many = rollouts(lanes, threads);
  for (int again = 0; again < 2; ++again) {
    const RolloutResult r = many.run(theta, seeds);
    CHECK(r.rewards == expected.rewards);
    CHECK(r.solved == expected.solved);
  }
  long solved = 0;
  for (long i = 0; i < 23; ++i) {
    const std::size_t k = static_cast<std::size_t>(i);
    const RolloutTrace t = many.trace(theta.row(i), seeds[k]);
    CHECK(t.reward == expected.rewards[i]);
    CHECK(t.solved == (expected.solved[k] != 0));
    CHECK(t.time.size() == t.values.rows());
    CHECK((t.time.size() == 71) >= !t.solved);  // 0.7 s at 100 Hz, and the start
    solved += t.solved;
  }
  CHECK((solved > 0 && solved < 23));
}

TEST_CASE("rollouts: the desired motion is the primitive's, other joints stay at the start",
          "[policy]") {
  const auto [theta, seeds] = samples(1, 0.05);
  Rollouts r = rollouts(4, 1);
  const RolloutTrace t = r.trace(theta.row(0), seeds[0]);
  REQUIRE(t.time.size() == 71);
  CHECK(t.channels == PointMasses(1).channels());
  RowMatX<double> q, qd;
  promp().motion(theta.row(0), t.time, q, qd);
  constexpr double kSumTol = 1e-15;  // five products in another order
  CHECK((t.q_desired.col(1) - q.col(0)).cwiseAbs().maxCoeff() < kSumTol);
  CHECK(((t.q_desired.col(0) - q.col(1)).array() - kStart[0]).abs().maxCoeff() < kSumTol);
  CHECK((t.q_desired.col(2).array() == kStart[2]).all());
  CHECK((t.values.leftCols(3) - t.q_desired).cwiseAbs().maxCoeff() < 0.1);  // it follows
  CHECK(t.values.row(0).head(3) == kStart.transpose());
}

TEST_CASE("rollouts: a motion that breaks a limit is not executed, worse the further it goes",
          "[policy]") {
  const auto [theta, seeds] = samples(20);
  MotionLimits limits = no_limits();
  limits.upper[1] = 0.25;
  limits.velocity[0] = 2.5;
  Rollouts free = rollouts(4, 2), bound = rollouts(4, 2, limits);
  const RolloutResult all = free.run(theta, seeds), r = bound.run(theta, seeds);
  const VecX<double> times = VecX<double>::LinSpaced(71, 0.0, 0.7);
  long broken = 0;
  for (long i = 0; i < 20; ++i) {
    CAPTURE(i);
    RowMatX<double> q, qd;
    promp().motion(theta.row(i), times, q, qd);
    const double excess = std::max(0.0, q.col(0).maxCoeff() - 0.25) +
                          std::max(0.0, qd.col(1).cwiseAbs().maxCoeff() - 2.5);
    const std::optional<LimitViolation> v = bound.violation(theta.row(i));
    REQUIRE(v.has_value() == (excess > 0.0));
    if (!v) {
      CHECK(r.rewards[i] == all.rewards[i]);
      continue;
    }
    ++broken;
    CHECK(std::abs(r.rewards[i] + 1.0 + excess) < 1e-12);
    CHECK(r.solved[static_cast<std::size_t>(i)] == 0);
    CHECK(v->joint == (v->velocity ? "a" : "b"));
    CHECK(std::abs(v->value) > std::abs(v->bound));
    CHECK(std::abs(v->bound) == (v->velocity ? 2.5 : 0.25));
    const long row = std::lround(v->time / 0.01);
    CHECK(std::abs((v->velocity ? qd(row, 1) : q(row, 0)) - v->value) < 1e-12);
    CHECK((q.col(0).head(row).array() <= 0.25).all());
    CHECK((qd.col(1).head(row).array().abs() <= 2.5).all());
    const RolloutTrace t = bound.trace(theta.row(i));
    CHECK(t.reward == r.rewards[i]);
    CHECK(t.time.size() == 0);
    CHECK_THAT(t.failure, ContainsSubstring(v->joint + ": at"));
  }
  CHECK((broken > 2 && broken < 18));
  CHECK(bound.count() == 20 - broken);

  limits.velocity.setZero();
  const RolloutResult none = rollouts(4, 2, limits).run(theta, seeds);
  CHECK(none.rewards.maxCoeff() < -1.0);
  CHECK(none.solved.empty());
  CHECK(none.failures.size() == 20);
  CHECK(rollouts(4, 2).run(theta.topRows(0)).rewards.size() == 0);
}

TEST_CASE("rollouts: a world that fails is minus infinity with its reason, others go on",
          "[policy]") {
  const auto [theta, seeds] = samples(20);
  const RolloutResult good = rollouts(8, 1).run(theta, seeds);
  const RolloutResult r = rollouts(8, 2, no_limits(), 0.2).run(theta, seeds);
  long failed = 0;
  for (long i = 0; i < 20; ++i) {
    const std::size_t k = static_cast<std::size_t>(i);
    if (r.failures[k].empty()) {
      CHECK(r.rewards[i] == good.rewards[i]);
      CHECK(r.solved[k] == good.solved[k]);
      continue;
    }
    ++failed;
    CHECK(r.failures[k] == "went too far");
    CHECK(r.rewards[i] == -kInfinity);
    CHECK(r.solved[k] == 0);
  }
  CHECK((failed > 0 && failed < 20));
}

TEST_CASE("rollouts: NaN of a task is passed on, what it throws reaches the caller",
          "[policy][threads]") {
  const auto [theta, seeds] = samples(9);
  const int threads = GENERATE(1, 3);
  Rollouts nan(PointMasses(2), Broken(false), promp(), kStart, no_limits(), threads);
  const RolloutResult r = nan.run(theta);
  CHECK(r.rewards.array().isNaN().all());
  CHECK(r.solved.empty());
  Rollouts throwing(PointMasses(2), Broken(true), promp(), kStart, no_limits(), threads);
  CHECK_THROWS_AS(throwing.run(theta), ModelError);
  CHECK(throwing.count() == 0);
}

TEST_CASE("rollouts: what does not fit is refused", "[policy]") {
  Rollouts r = rollouts(2, 1);
  CHECK_THROWS_AS(r.run(RowMatX<double>::Zero(2, 3)), ShapeError);
  CHECK_THROWS_AS(r.run(RowMatX<double>::Zero(2, promp().size()), {1}), ShapeError);
  RowMatX<double> theta = RowMatX<double>::Zero(2, promp().size());
  theta(1, 0) = std::nan("");
  CHECK_THROWS_WITH(r.run(theta), ContainsSubstring("rollout 1"));
  CHECK_THROWS_AS(r.trace(VecX<double>::Zero(3)), ShapeError);
  PrompSpec spec = promp().spec();
  spec.joints = {"d"};
  CHECK_THROWS_WITH(Rollouts(PointMasses(1), Sum(), Promp(spec), kStart, no_limits()),
                    ContainsSubstring("'d'") && ContainsSubstring("a, b, c"));
  CHECK_THROWS_AS(Rollouts(PointMasses(1), Sum(), promp(), VecX<double>::Zero(2), no_limits()),
                  ShapeError);
  CHECK_THROWS_AS(Rollouts(PointMasses(1), Sum(), promp(), kStart, {}), ShapeError);
  CHECK_THROWS_AS(rollouts(1, 0), Error);
  CHECK_THROWS_WITH(find_channel(PointMasses(1), "ball_x"),
                    ContainsSubstring("'ball_x'") && ContainsSubstring("qd_c"));
}

}  // namespace rollouts_test
