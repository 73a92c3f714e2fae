/// Rollouts of ball in a cup: the model on SIMD packs against MuJoCo, and a whole search: `make
/// bench`. Rates of one core are of thread CPU time (other programs count less), best of several;
/// scaling is wall-clock, side by side.

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <vector>

#include <mujoco/mujoco.h>

#include <diffnea/core/random.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/effects/ball_network.hpp>
#include <diffnea/experiment/seeds.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/worlds/world.hpp>

using namespace diffnea;

namespace {

constexpr double kEpisode = 2.5;  // [s]
const std::string kModel = DIFFNEA_SOURCE_DIR "/models/wam4_ball.xml";

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}
double wall_seconds(const std::function<void()>& call) {
  const auto start = std::chrono::steady_clock::now();
  call();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}
double median(std::vector<double> x) {
  std::ranges::sort(x);
  return x[x.size() / 2];
}
/// Rollouts a second of thread CPU time, best of several batches.
double best_rate(int rounds, const std::function<long()>& batch) {
  double best = 0.0;
  for (int k = 0; k < rounds; ++k) {
    const double start = cpu_seconds();
    const long count = batch();
    best = std::max(best, static_cast<double>(count) / (cpu_seconds() - start));
  }
  return best;
}

/// As `identify` leaves it: friction and offsets at every joint, drag of the ball.
Model identified() {
  Model model = read_model(kModel);
  for (int j = 1; j <= 4; ++j) {
    const std::string joint = "joint" + std::to_string(j);
    model.effects.push_back({"coulomb_friction", joint, {{"coulomb", 1.0, "N*m"}}});
    model.effects.push_back({"viscous_friction", joint, {{"viscous", 0.8, "N*m*s/rad"}}});
    model.effects.push_back({"torque_offset", joint, {{"offset", 0.1, "N*m"}}});
  }
  model.effects.push_back({"linear_drag", "ball", {{"drag", 0.03, "1/s"}}});
  return model;
}

LearnOptions options(const std::string& isa) {
  LearnOptions out;
  out.promp.duration = kEpisode - out.promp.hold;
  out.simulator.instruction_set = isa;
  return out;
}

/// Random movements of the first iteration, reward included.
double model_rate(const Model& model, const std::string& isa,
                  std::shared_ptr<const BallNetwork> network = nullptr) {
  LearnOptions learn = options(isa);
  learn.simulator.ball_network = std::move(network);
  const BallInCup task = ball_in_cup(model, model, learn);
  Ereps search = first_search(task, 1);
  Rollouts world = rollouts(task, 1);
  return best_rate(15, [&] {
    world.run(search.ask());
    return static_cast<long>(search.options().samples);
  });
}

/// Any network of these sizes.
std::shared_ptr<const BallNetwork> network(int cell, const std::vector<int>& hidden) {
  Rng rng(1);
  const auto layer = [&](int inputs, int outputs) {
    DenseLayer out{inputs, outputs, std::vector<double>(static_cast<std::size_t>(inputs * outputs)),
                   std::vector<double>(static_cast<std::size_t>(outputs))};
    for (double& w : out.weights) w = 0.2 * rng.normal();
    return out;
  };
  auto out = std::make_shared<BallNetwork>();
  out->input_mean.assign(kNetworkInputs, 0.0);
  out->input_scale.assign(kNetworkInputs, 1.0);
  out->output_mean.assign(kNetworkOutputs, 0.0);
  out->output_scale.assign(kNetworkOutputs, 1.0);
  NetworkMember& member = out->members.emplace_back();
  if (cell > 0) member.cells.push_back(layer(kNetworkInputs + cell, 4 * cell));
  int width = cell > 0 ? cell : kNetworkInputs;
  for (const int units : hidden) {
    member.layers.push_back(layer(width, units));
    width = units;
  }
  member.layers.push_back(layer(width, kNetworkOutputs));
  return out;
}

void bench_networks() {
  const Model model = read_model(kModel);
  std::printf("\nball moved by a network, %s [rollouts/s of one core]\n",
              batch_instruction_sets().front().c_str());
  std::printf("  none: string and gravity  %6.0f\n", model_rate(model, ""));
  std::printf("  feed-forward, 2 x 64      %6.0f\n", model_rate(model, "", network(0, {64, 64})));
  std::printf("  LSTM, 32                  %6.0f\n", model_rate(model, "", network(32, {})));
  std::printf("  LSTM, 64                  %6.0f\n", model_rate(model, "", network(64, {})));
}

/// MuJoCo's own loop, as lean as it can be written: the same arm and controller, tendon or chain.
double mujoco_rate(const std::string& xml, double step, int integrator) {
  char error[500] = "";
  mjVFS* vfs = new mjVFS;
  mj_defaultVFS(vfs);
  mj_makeEmptyFileVFS(vfs, "m.xml", static_cast<int>(xml.size()));
  std::copy(xml.begin(), xml.end(), static_cast<char*>(vfs->filedata[0]));
  mjModel* m = mj_loadXML("m.xml", vfs, error, sizeof error);
  mj_deleteVFS(vfs);
  delete vfs;
  if (!m) {
    std::printf("%s\n", error);
    return 0.0;
  }
  m->opt.timestep = step;
  m->opt.integrator = integrator;
  mjData* d = mj_makeData(m);
  const double kp[] = {200, 300, 100, 100}, kd[] = {7, 15, 5, 2.5}, home[] = {0, 0.6, 0, 1.25};
  const int each = static_cast<int>(std::lround(0.002 / step));
  const double rate = best_rate(3, [&] {
    mj_resetData(m, d);
    for (int j = 0; j < 4; ++j) d->qpos[j] = home[j];
    for (int k = 0; k < static_cast<int>(kEpisode / 0.002); ++k) {
      const double t = 0.002 * k, move = t < 1.5 ? 0.3 * std::pow(std::sin(M_PI * t / 1.5), 2) : 0;
      mj_forward(m, d);
      for (int j = 0; j < 4; ++j)
        d->qfrc_applied[j] =
            d->qfrc_bias[j] +
            kp[j] * (home[j] + (j % 2 ? move * std::sin(8 * t) : 0.0) - d->qpos[j]) -
            kd[j] * d->qvel[j];
      for (int i = 0; i < each; ++i) mj_step(m, d);
    }
    return 1L;
  });
  mj_deleteData(d);
  mj_deleteModel(m);
  return rate;
}

void bench_rates() {
  std::printf("Ball in a cup, %.1f s episodes, 500 Hz control, one core [rollouts/s]\n", kEpisode);
  std::printf(
      "  the model: arm 2 ms (torque and acceleration held, friction implicit), ball 1 ms "
      "(one-sided RATTLE), reward included\n");
  const Model nominal = read_model(kModel), friction = identified();
  double fastest = 0.0;
  for (const std::string& isa : batch_instruction_sets()) {
    const ModelSimulator lanes({nominal}, nominal, options(isa).simulator);
    const double bare = model_rate(nominal, isa), full = model_rate(friction, isa);
    std::printf("    %-7s %2d lanes   nominal %8.0f   with friction, offsets, drag %8.0f\n",
                isa.c_str(), lanes.lanes(), bare, full);
    fastest = std::max(fastest, bare);
  }
  std::printf("  MuJoCo %s, the same movement, its own loop\n", mj_versionString());
  const std::string tendon = read_mjcf(kModel);
  struct Case {
    const char* name;
    double step;
    int integrator;
  };
  for (const Case& c : {Case{"tendon, Euler 2 ms", 2e-3, mjINT_EULER},
                        Case{"tendon, Euler 1 ms", 1e-3, mjINT_EULER},
                        Case{"tendon, RK4 0.5 ms", 5e-4, mjINT_RK4}}) {
    const double rate = mujoco_rate(tendon, c.step, c.integrator);
    std::printf("    %-22s %8.1f   ratio %7.0f\n", c.name, rate, fastest / rate);
  }
  const WorldSpec chain = parse_world("mujoco:" + kModel + ",perturb=none,rope=mid");
  MujocoSimulatorOptions o;
  o.settle_time = 0.0;
  const auto world = make_simulator(chain, nominal, o, 0);
  const BallInCup task = ball_in_cup(nominal, nominal, {});
  const Gaussian still = first_search(task, 1).policy();
  LearnedPolicy policy{.promp = task.options.promp,
                       .policy = still,
                       .joints = world->joints(),
                       .start = task.start,
                       .controller = {},
                       .reward = task.options.reward,
                       .curve = {},
                       .stopped = {},
                       .ball_network = {}};
  const double rate = best_rate(3, [&] {
    execute(policy, *world, motion_limits(nominal), *nominal.cup, 0);
    return 1L;
  });
  std::printf("    %-22s %8.2f   ratio %7.0f   (the world that policies are tried in)\n",
              "chain, RK4 0.5 ms", rate, fastest / rate);
}

void bench_search() {
  const Model model = identified();
  const BallInCup task = ball_in_cup(model, model, {});
  constexpr int kSeeds = 8;
  std::vector<std::uint64_t> seeds;
  std::vector<double> each, counts;
  int solved = 0;
  for (std::uint64_t s = 1; s <= kSeeds; ++s) {
    seeds.push_back(s);
    LearnedPolicy policy;
    each.push_back(wall_seconds([&] { policy = learn(task, s, 2); }));
    counts.push_back(static_cast<double>(policy.rollouts));
    solved += policy.solved;
  }
  std::printf(
      "\nOne search from scratch, model with friction, 2 threads: median %.2f s, %.0f rollouts, "
      "%d of %d solved\n",
      median(each), median(counts), solved, kSeeds);
  std::vector<double> one, two, rollouts_one, rollouts_two;
  RowMatX<double> theta = first_search(task, 1).policy().mean.transpose().replicate(960, 1);
  Rollouts alone = rollouts(task, 1), both = rollouts(task, 2);
  for (int round = 0; round < 5; ++round) {  // side by side
    one.push_back(wall_seconds([&] { learn_seeds(task, seeds, 1); }));
    two.push_back(wall_seconds([&] { learn_seeds(task, seeds, 2); }));
    rollouts_one.push_back(wall_seconds([&] { alone.run(theta); }));
    rollouts_two.push_back(wall_seconds([&] { both.run(theta); }));
  }
  std::printf("  %d seeds on 1 thread %.2f s, on 2 threads %.2f s: %.2f times as fast\n", kSeeds,
              median(one), median(two), median(one) / median(two));
  std::printf("  960 rollouts on 1 thread %.3f s, on 2 threads %.3f s: %.2f times as fast\n",
              median(rollouts_one), median(rollouts_two),
              median(rollouts_one) / median(rollouts_two));
}

}  // namespace

int main() {
  bench_rates();
  bench_networks();
  bench_search();
}
