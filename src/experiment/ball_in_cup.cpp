#include <algorithm>
#include <chrono>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/effects/ball_network.hpp>
#include <diffnea/experiment/ball_in_cup.hpp>
#include <diffnea/experiment/stick_figure.hpp>

namespace diffnea {
namespace {

constexpr double kWideEpsilon = 0.055;  ///< gives rewards of the paper's size [m²]

const ModelFrame& cup_frame(const Model& model) {
  const auto frame = std::ranges::find(model.frames, "cup", &ModelFrame::name);
  if (!model.cup || frame == model.frames.end())
    throw ModelError(
        model.source +
        ": has no cup; expected a frame `cup` (z its axis) and the cup's size (in an "
        "MJCF a site and <numeric name=\"cup\" data=\"inner_radius wall floor rim\"/>)");
  if (!model.ball || !model.ball->string)
    throw ModelError(model.source + ": has no ball on a string (see docs/models.md)");
  return *frame;
}

/// The model with the string that is on the robot.
Model with_string(Model model, double nominal) {
  constexpr double kNear = 0.1;  ///< of the nominal length: more is another string
  if (nominal == 0.0) return model;
  if (!(nominal > 0.0))
    throw Error("ball in a cup: nominal_string: got " + detail::number_text(nominal) +
                " m, expected a positive length");
  StringSpec& string = *model.ball->string;
  if (!(string.length_std > 0.0))  // nobody measured it
    string.length = nominal;
  else if (std::abs(string.length - nominal) > kNear * nominal)
    throw DataError(model.source + ": its string was identified as " +
                    detail::number_text(string.length) + " m, got a nominal length of " +
                    detail::number_text(nominal) +
                    " m, expected one within 10 %; identify with the string that is on the robot, "
                    "or do not name it");
  return model;
}

struct Start {
  Tree<double> tree;
  LinkKinematics<double> links;
  int cup_link;  ///< of the tree
  Pose<double> X_WC;
};

Start at_start(const Model& model, const VecX<double>& q0) {
  const ModelFrame& frame = cup_frame(model);
  Start out{.tree = make_tree(model), .links = {}, .cup_link = -1, .X_WC = frame.X_LF};
  forward_kinematics<double, double>(out.tree, q0, out.links);
  if (frame.link < 0) return out;
  const TreeMap map = map_to_tree(model);
  out.cup_link = map.dof[frame.link];
  out.X_WC = frame_pose(out.links, out.cup_link, map.X_LF[frame.link] * frame.X_LF);
  return out;
}

/// Joints that carry the cup and turn it in one upright plane: the largest set of horizontal axes
/// that are parallel.
std::vector<std::string> plane_joints(const Model& model, const Start& start) {
  constexpr double kAligned = 0.1;  // [rad]
  const std::vector<TreeJoint> joints = tree_joints(model);
  std::vector<std::pair<int, Vec3<double>>> level;
  for (int i = start.cup_link; i >= 0; i = start.tree.links[i].parent) {
    const Link<double>& link = start.tree.links[i];
    const Vec3<double> axis = start.links.links[i].X_WL.R * link.axis;
    if (link.type == JointType::kRevolute && std::abs(axis.z) < kAligned && !joints[i].follows)
      level.emplace_back(i, axis);
  }
  std::vector<std::string> best;
  for (const auto& [i, axis] : level) {
    std::vector<std::string> parallel;
    for (const auto& [j, other] : level)
      if (std::abs(dot(axis, other)) > std::cos(kAligned)) parallel.push_back(joints[j].name);
    if (parallel.size() > best.size()) best = parallel;
  }
  std::ranges::reverse(best);
  return best;
}

/// @throws DataError naming the joint that starts beyond its range
void check_start(const std::vector<std::string>& joints, const VecX<double>& q0,
                 const MotionLimits& limits) {
  for (long j = 0; j < q0.size(); ++j)
    if (!(q0[j] >= limits.lower[j] && q0[j] <= limits.upper[j]))
      throw DataError("start: joint '" + joints[static_cast<std::size_t>(j)] + "' is at " +
                      detail::number_text(q0[j]) + ", expected " +
                      detail::number_text(limits.lower[j]) + " to " +
                      detail::number_text(limits.upper[j]) + " (rad, m), its range");
}

void check(const Model& model, const Start& start, double least_upright) {
  const CupSpec& cup = *model.cup;
  const double upright = start.X_WC.R.col[2].z, string = model.ball->string->length;
  if (upright < least_upright)
    throw DataError(
        "ball in a cup: at the start the cup's axis has z = " + detail::number_text(upright) +
        ", expected " + detail::number_text(least_upright) +
        " or more (the cup opens upward); choose another start posture");
  if (!(model.ball->radius > 0.0 && model.ball->radius < cup.inner_radius))
    throw DataError("ball in a cup: the ball has a radius of " +
                    detail::number_text(model.ball->radius) + " m, the cup " +
                    detail::number_text(cup.inner_radius) +
                    " m inside; expected a ball that fits in");
  if (string < cup.rim + model.ball->radius)
    throw DataError("ball in a cup: the string of " + detail::number_text(string) +
                    " m does not reach over the rim, " + detail::number_text(cup.rim) +
                    " m above the knot; the task cannot be done");
}

/// exp(½ max ψ + ½ ψ_N) of a series, as the task has it but for a ball whose end is known.
double shape(const RolloutTrace& trace, double epsilon, double string, bool in_cup) {
  const RowMatX<double> delta = points_of(trace, "ball") - points_of(trace, "cup");
  const VecX<double> along = delta.cwiseProduct(points_of(trace, "axis")).rowwise().sum();
  const VecX<double> psi =
      along.cwiseQuotient((delta.rowwise().squaredNorm().array() + epsilon).matrix());
  const double hang = -string / (string * string + epsilon), last = psi[psi.size() - 1];
  return std::exp(0.5 * psi.maxCoeff() + 0.5 * (in_cup ? last : std::min(last, hang)));
}

double penalty(const RolloutTrace& trace, const std::vector<std::string>& joints,
               const BallInCupOptions& o) {
  double sum = 0.0;
  for (const std::string& joint : joints) {
    const VecX<double> q = channel_of(trace, "q_" + joint), qd = channel_of(trace, "qd_" + joint);
    sum += o.lambda_q * (q.array() - q[0]).square().mean() +
           o.lambda_qd * qd.squaredNorm() / static_cast<double>(qd.size());
  }
  return sum;
}

/// Draws that a policy is judged in.
constexpr int kJudges = 64;

/// @throws Error if an option makes no sense
RobustOptions completed(RobustOptions o) {
  if (o.draws < 0 || o.each < 0)
    throw Error("robust: draws and each: got " + std::to_string(o.draws) + " and " +
                std::to_string(o.each) + ", expected 0 or more");
  if (o.draws == 0 && (o.each > 0 || o.quantile || !o.vary.empty()))
    throw Error(
        "robust: each, quantile and vary are of draws, of which there are none; ask for some "
        "(--robust)");
  if (o.quantile && !(*o.quantile > 0.0 && *o.quantile <= 1.0))
    throw Error("robust: quantile: got " + detail::number_text(*o.quantile) +
                ", expected above 0, at most 1");
  if (o.each == 0) o.each = o.quantile ? std::min(8, o.draws) : std::min(1, o.draws);
  if (o.each > o.draws)
    throw Error("robust: each: got " + std::to_string(o.each) + ", expected at most the " +
                std::to_string(o.draws) + " draws");
  if (o.quantile && o.each < 2)
    throw Error(
        "robust: quantile: a sample is executed in one draw; expected each to be 2 or more");
  return o;
}

/// Mean or quantile of what one sample got.
double worth(VecX<double> rewards, const std::optional<double>& quantile) {
  if (!quantile) return rewards.mean();
  std::ranges::sort(rewards);
  const double rank = std::ceil(*quantile * static_cast<double>(rewards.size()) - 1e-9);
  return rewards[std::max(0L, static_cast<long>(rank) - 1)];
}

/// All samples of one iteration, in the same draws: what is easy in one is easy for all of them,
/// and makes none look better than another.
struct InAllDraws {
  VecX<double> rewards;  ///< (N)
  double solved_share = 0.0;
};
InAllDraws execute_all(Rollouts& world, const RobustOptions& o, const RowMatX<double>& theta,
                       int iteration) {
  const long n = theta.rows(), each = std::max(o.each, 1);
  InAllDraws out{VecX<double>(n)};
  RowMatX<double> rows(n * each, theta.cols());
  std::vector<std::uint64_t> worlds(static_cast<std::size_t>(n * each), 0);
  for (long i = 0; i < n; ++i)
    for (long k = 0; k < each; ++k) {
      rows.row(i * each + k) = theta.row(i);
      if (o.draws > 0)
        worlds[static_cast<std::size_t>(i * each + k)] =
            1 + static_cast<std::uint64_t>((iteration * each + k) % o.draws);
    }
  const RolloutResult seen = world.run(rows, worlds);
  for (long i = 0; i < n; ++i)
    out.rewards[i] = worth(seen.rewards.segment(i * each, each), o.quantile);
  out.solved_share =
      static_cast<double>(std::ranges::count(seen.solved, 1)) / static_cast<double>(n * each);
  return out;
}

/// A world in which no episode ends: MuJoCo goes on after every touch.
class Watch : public Task {
 public:
  void begin(const Simulator&, int count) override { count_ = count; }
  void look(double, const Lanes&, std::vector<char>&) override {}
  VecX<double> rewards() const override { return VecX<double>::Zero(count_); }
  std::unique_ptr<Task> clone() const override { return std::make_unique<Watch>(*this); }

 private:
  int count_ = 0;
};

}  // namespace

MotionLimits motion_limits(const Model& model) {
  const std::vector<int> moving = moving_links(model);
  MotionLimits out;
  out.lower.resize(static_cast<long>(moving.size()));
  out.upper = out.velocity = out.lower;
  for (std::size_t j = 0; j < moving.size(); ++j) {
    const JointLimits& limits = model.links[moving[j]].limits;
    out.lower[j] = limits.lower;
    out.upper[j] = limits.upper;
    out.velocity[j] = limits.velocity;
  }
  return out;
}

BallInCup ball_in_cup(const Model& described, const Model& controller, LearnOptions o) {
  cup_frame(described);
  const Model model = with_string(described, o.nominal_string);
  const int n = static_cast<int>(joint_names(model).size());
  if (o.start.size() == 0) {
    o.start = VecX<double>::Zero(n);
    if (static_cast<int>(model.home.size()) == n)
      o.start = Eigen::Map<const VecX<double>>(model.home.data(), n);
  }
  require_size("ball in a cup: start", o.start.size(), n, "joint");
  check_start(joint_names(model), o.start, motion_limits(model));
  const Start start = at_start(model, o.start);
  check(model, start, o.simulator.least_upright);
  for (const std::string& joint : o.joints) find_joint(model, joint);  // throws
  if (o.joints.empty()) o.joints = plane_joints(model, start);
  if (o.joints.empty())
    throw ModelError(model.source + ": no joint moves the cup in an upright plane; name joints");
  o.promp.joints = o.joints;
  o.reward.string = model.ball->string->length;
  const JointGains gains = joint_gains(controller, o.simulator.controller, o.start);
  o.simulator.controller.kp = gains.kp;
  o.simulator.controller.kd = gains.kd;
  const VecX<double> q0 = o.start;
  o.robust = completed(o.robust);
  BallInCup out{.model = model, .controller = controller, .options = std::move(o), .start = q0};
  const RobustOptions& robust = out.options.robust;
  if (robust.draws > 0)
    out.draws = draw_models(model, robust.draws + kJudges, robust.seed, robust.vary);
  return out;
}

Rollouts rollouts(const BallInCup& task, int threads) {
  std::vector<Model> models{with_varied_effects(task.model, task.options.robust.vary)};
  models.insert(models.end(), task.draws.begin(), task.draws.end());
  const ModelSimulator simulator(models, task.controller, task.options.simulator);
  return Rollouts(simulator, BallInCupTask(task.options.reward), Promp(task.options.promp),
                  task.start, motion_limits(task.model), threads);
}

Ereps first_search(const BallInCup& task, std::uint64_t seed) {
  const int d = Promp(task.options.promp).size();
  const double variance = task.options.weight_std * task.options.weight_std;
  return Ereps(
      {.mean = VecX<double>::Zero(d), .covariance = variance * MatX<double>::Identity(d, d)},
      task.options.ereps, seed);
}

NetworkSource network_source(const BallInCup& task) {
  const auto& network = task.options.simulator.ball_network;
  return network ? NetworkSource{network->source, network->sha256} : NetworkSource{};
}

LearnedPolicy found_policy(const BallInCup& task, const Ereps& search) {
  LearnedPolicy out;
  out.seed = search.seed();
  out.promp = task.options.promp;
  out.policy = search.policy();
  out.joints = joint_names(task.model);
  out.start = task.start;
  out.controller = task.options.simulator.controller;
  out.reward = task.options.reward;
  out.curve = search.history();
  out.stopped = search.stop_reason();
  out.ball_network = network_source(task);
  return out;
}

LearnedPolicy learn(const BallInCup& task, std::uint64_t seed, int threads,
                    const LearnProgress& progress, const SearchState* from) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point begin = Clock::now();
  Rollouts world = rollouts(task, threads);
  SearchState state = from ? *from : SearchState{first_search(task, seed)};
  Ereps& search = state.search;
  const long rollouts_before = state.rollouts;
  const double seconds_before = state.seconds;
  const auto count = [&] {
    state.rollouts = rollouts_before + world.count();
    state.seconds = seconds_before + std::chrono::duration<double>(Clock::now() - begin).count();
  };
  bool stopped = false;
  while (!search.done() && !stopped) {
    const InAllDraws seen =
        execute_all(world, task.options.robust, search.ask(), search.iteration());
    search.tell(seen.rewards);
    search.history().back().solved_share = seen.solved_share;
    count();
    stopped = progress && !progress(state);
  }
  LearnedPolicy out = found_policy(task, search);
  RowMatX<double> mean(1, search.policy().size());
  mean.row(0) = search.policy().mean.transpose();
  const RolloutResult last = world.run(mean);
  out.expected = last.rewards[0];
  out.solved = !last.solved.empty() && last.solved[0] != 0;
  out.rollouts = state.rollouts;
  out.seconds = state.seconds;
  if (const RobustOptions& robust = task.options.robust; robust.draws > 0) {
    std::vector<std::uint64_t> worlds;
    for (int k = 0; k < kJudges; ++k)
      worlds.push_back(1 + static_cast<std::uint64_t>(robust.draws + k));
    const RolloutResult judged = world.run(mean.replicate(kJudges, 1), worlds);
    out.in_draws = {kJudges, static_cast<int>(std::ranges::count(judged.solved, 1)),
                    worth(judged.rewards, robust.quantile)};
  }
  return out;
}

Execution execute(const LearnedPolicy& policy, const Simulator& world, const MotionLimits& limits,
                  const CupSpec& cup, std::uint64_t seed, const SuccessOptions& options) {
  if (world.joints() != policy.joints)
    throw ModelError("execute: the world's joints are not those of the policy");
  check_start(policy.joints, policy.start, limits);
  Rollouts runner(world, Watch(), Promp(policy.promp), policy.start, limits, 1);
  Execution out;
  out.seed = seed;
  out.trace = runner.trace(policy.policy.mean, seed);
  out.failure = out.trace.failure;
  if (out.trace.time.size() == 0) {  // not executed
    out.failure = "the motion breaks a limit: " + out.trace.failure;
    out.reward = out.reward_wide = out.trace.reward;
    return out;
  }
  const RowMatX<double> ball = points_of(out.trace, "ball");
  if (out.failure.empty())
    out.verdict = judge_ball(out.trace.time, ball, points_of(out.trace, "cup"),
                             points_of(out.trace, "axis"), cup, options);
  const bool in_cup = out.success();
  const double effort = penalty(out.trace, policy.joints, policy.reward);
  out.reward = shape(out.trace, policy.reward.epsilon, policy.reward.string, in_cup) - effort;
  out.reward_wide = shape(out.trace, kWideEpsilon, policy.reward.string, in_cup) - effort;
  out.trace.reward = out.reward;
  out.trace.solved = in_cup;
  return out;
}

Trajectory desired_motion(const LearnedPolicy& policy, double rate, double still) {
  if (!(rate > 0.0) || !(still >= 0.0))
    throw Error("desired motion: got a rate of " + detail::number_text(rate) + " Hz and " +
                detail::number_text(still) +
                " s of stillness; expected a positive rate and no negative time");
  const Promp promp(policy.promp);
  const long before = std::lround(still * rate),
             rows = before + std::lround((policy.promp.duration + policy.promp.hold) * rate) + 1;
  Trajectory out;
  out.source = "policy " + std::to_string(policy.seed);
  out.joint_names = policy.joints;
  out.time = VecX<double>::LinSpaced(rows, 0.0, static_cast<double>(rows - 1) / rate);
  out.q = policy.start.transpose().replicate(rows, 1);
  out.qd = out.qdd = RowMatX<double>::Zero(rows, policy.start.size());
  RowMatX<double> q, qd;
  promp.motion(policy.policy.mean, out.time.head(rows - before), q, qd);
  for (std::size_t j = 0; j < policy.promp.joints.size(); ++j) {
    const auto at = std::ranges::find(policy.joints, policy.promp.joints[j]);
    const long c = at - policy.joints.begin();
    out.q.col(c).tail(rows - before) += q.col(static_cast<long>(j));
    out.qd.col(c).tail(rows - before) = qd.col(static_cast<long>(j));
  }
  for (long k = 1; k + 1 < rows; ++k)
    out.qdd.row(k) = (out.qd.row(k + 1) - out.qd.row(k - 1)) * (0.5 * rate);
  return out;
}

}  // namespace diffnea
