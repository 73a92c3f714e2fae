#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/sim/mujoco_simulator.hpp>
#include <diffnea/sim/record.hpp>

#include "sim/joint_controller.hpp"
#include "sim/mujoco_plant.hpp"

namespace diffnea {

/// What all lanes and clones share.
struct MujocoSimulator::World {
  std::shared_ptr<const sim::MujocoRobot> robot;
  Model truth, controller;
  MujocoSimulatorOptions options;
  std::vector<std::string> joints, channels;
  std::vector<int> driven;  ///< degree of freedom of every driven joint
  VecX<double> torque_noise;
};

struct MujocoSimulator::Lane {
  explicit Lane(const World& w)
      : world(w),
        plant(w.robot),
        controller(w.controller, w.truth, w.options.controller,
                   VecX<double>::Zero(w.torque_noise.size())) {}

  VecX<double> noise(const VecX<double>& deviation) {
    VecX<double> out(deviation.size());
    for (long j = 0; j < out.size(); ++j) out[j] = deviation[j] * rng.normal();
    return out;
  }

  /// @return as Plant::step
  std::string step(const VecX<double>& q, const VecX<double>& qd) {
    const VecX<double> each = VecX<double>::Constant(q.size(), world.options.position_noise);
    const VecX<double> read = plant.q() + offset + noise(each);
    return plant.step(controller.torque(read, plant.qd(), q, qd) + noise(world.torque_noise));
  }

  std::string start(const VecX<double>& q0, std::uint64_t seed) {
    rng = Rng(seed);
    offset = noise(VecX<double>::Constant(q0.size(), world.options.encoder_noise));
    controller.start(q0);
    plant.reset(q0 - offset);
    const MujocoSimulatorOptions& o = world.options;
    const VecX<double> still = VecX<double>::Zero(q0.size());
    for (long k = std::lround(o.settle_time * o.controller.control_rate); k > 0; --k)
      if (std::string failure = step(q0, still); !failure.empty()) return failure + " at the start";
    if (o.settle_time > 0.0) plant.hang_ball();
    return "";
  }

  void observe(Lanes::ColXpr out) const {
    long row = 0;
    const auto put = [&](const Vec3<double>& v) {
      for (const double x : {v.x, v.y, v.z}) out[row++] = x;
    };
    const VecX<double> q = plant.q(), qd = plant.qd();
    out.head(q.size()) = q;
    out.segment(q.size(), q.size()) = qd;
    row = 2 * q.size();
    if (const std::optional<Vec3<double>> ball = plant.ball()) {
      put(*ball);
      put(plant.ball_velocity());
    }
    if (plant.has_cup()) {
      const Pose<double> cup = plant.cup();
      put(cup.p);
      put(cup.R.col[2]);
    }
    if (row < out.size()) out[row] = static_cast<double>(BallPhase::kFree);
  }

  const World& world;
  sim::MujocoPlant plant;
  sim::JointController controller;
  Rng rng{0};
  VecX<double> offset;  ///< of the encoders
};

namespace {

void check(const MujocoSimulatorOptions& o) {
  if (o.lanes < 1 || !(o.controller.control_rate > 0.0) || !(o.physics_step > 0.0))
    throw Error("MuJoCo simulator: lanes, control_rate and physics_step must be positive");
  if (!(o.settle_time >= 0.0) || !(o.position_noise >= 0.0) || !(o.torque_noise >= 0.0) ||
      !(o.encoder_noise >= 0.0))
    throw Error("MuJoCo simulator: settle_time and noises must not be negative");
}

}  // namespace

MujocoSimulator::MujocoSimulator(const std::string& mjcf, const Model& truth,
                                 const Model& controller, const MujocoSimulatorOptions& options)
    : MujocoSimulator([&] {
        check(options);
        require_plain_tree("simulator", controller);
        require_fixed_base("simulator", truth);
        World w{.robot = std::make_shared<const sim::MujocoRobot>(
                    mjcf, truth, options.controller.control_rate, options.physics_step),
                .truth = truth,
                .controller = controller,
                .options = options,
                .joints = {},
                .channels = {},
                .driven = {},
                .torque_noise = {}};
        const std::vector<std::string> names = joint_names(truth);
        const std::vector<int> moving = moving_links(truth);
        w.torque_noise.setZero(static_cast<long>(moving.size()));
        for (std::size_t j = 0; j < moving.size(); ++j) {
          const ModelLink& link = truth.links[moving[j]];
          if (link.passive) continue;
          w.joints.push_back(names[j]);
          w.driven.push_back(static_cast<int>(j));
          w.torque_noise[j] = options.torque_noise * torque_scale(link);
        }
        const sim::MujocoPlant plant(w.robot);
        w.channels = channel_names(names, plant.has_ball(), plant.has_cup(),
                                   plant.has_ball() && plant.has_cup());
        return std::make_shared<const World>(std::move(w));
      }()) {}

MujocoSimulator::MujocoSimulator(std::shared_ptr<const World> world) : world_(std::move(world)) {
  for (int k = 0; k < world_->options.lanes; ++k) lanes_.push_back(std::make_unique<Lane>(*world_));
  observed_.setZero(static_cast<long>(world_->channels.size()), world_->options.lanes);
  failures_.resize(lanes_.size());
}

MujocoSimulator::~MujocoSimulator() = default;

const std::vector<std::string>& MujocoSimulator::joints() const { return world_->joints; }
const std::vector<std::string>& MujocoSimulator::channels() const { return world_->channels; }
double MujocoSimulator::period() const { return 1.0 / world_->options.controller.control_rate; }
int MujocoSimulator::lanes() const { return world_->options.lanes; }
const Lanes& MujocoSimulator::observe() const { return observed_; }
const std::vector<std::string>& MujocoSimulator::failures() const { return failures_; }

void MujocoSimulator::reset(const Starts& starts) {
  const long n = starts.q.cols();
  require_size("MuJoCo simulator: starts", starts.q.rows(), static_cast<long>(joints().size()),
               "driven joint");
  require_size("MuJoCo simulator: seeds", static_cast<long>(starts.seeds.size()), n, "start");
  if (n < 1 || n > lanes())
    throw ShapeError("MuJoCo simulator: got " + std::to_string(n) + " starts, expected 1 to " +
                     std::to_string(lanes()) + " (one a lane)");
  active_ = static_cast<int>(n);
  for (int k = 0; k < lanes(); ++k) failures_[k].clear();
  for (int k = 0; k < active_; ++k) {
    VecX<double> q0 = VecX<double>::Zero(world_->torque_noise.size());
    q0(world_->driven) = starts.q.col(k);
    failures_[k] = lanes_[k]->start(q0, starts.seeds[k]);
    lanes_[k]->observe(observed_.col(k));
  }
}

void MujocoSimulator::step(const Lanes& q, const Lanes& qd) {
  if (active_ == 0) throw Error("MuJoCo simulator: step: it has no start yet; call reset first");
  for (const Lanes* x : {&q, &qd}) {
    require_size("MuJoCo simulator: command", x->rows(), static_cast<long>(joints().size()),
                 "driven joint");
    if (x->cols() < active_)
      throw ShapeError("MuJoCo simulator: command: got " + std::to_string(x->cols()) +
                       " columns, expected one a lane that was started, " +
                       std::to_string(active_));
  }
  VecX<double> desired = VecX<double>::Zero(world_->torque_noise.size()), velocity = desired;
  for (int k = 0; k < active_; ++k) {
    if (!failures_[k].empty()) continue;
    desired(world_->driven) = q.col(k);
    velocity(world_->driven) = qd.col(k);
    failures_[k] = lanes_[k]->step(desired, velocity);
    if (failures_[k].empty()) lanes_[k]->observe(observed_.col(k));
  }
}

std::unique_ptr<Simulator> MujocoSimulator::clone() const {
  return std::unique_ptr<Simulator>(new MujocoSimulator(world_));
}

}  // namespace diffnea
