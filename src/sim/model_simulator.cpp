#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/sim/model_simulator.hpp>

#include "sim/pack_spec.hpp"
#include "sim/pack_world.hpp"

namespace diffnea {
namespace {

using sim::MakePackWorld;
using sim::PackSpec;

MakePackWorld* kernel(const std::string& instruction_set) {
  const std::vector<std::string> there = batch_instruction_sets();
  const std::string name = instruction_set.empty() ? there.front() : instruction_set;
  if (std::ranges::find(there, name) == there.end()) {
    std::string names;
    for (const std::string& n : there) names += (names.empty() ? "" : ", ") + n;
    throw Error("simulator: this build and processor have no instruction set '" + name +
                "'; choices: " + names);
  }
#ifdef DIFFNEA_HAS_X86_KERNELS
#ifndef DIFFNEA_NO_AVX512_KERNELS
  if (name == "avx512") return sim::avx512::make_pack_world;
#endif
  if (name == "avx2") return sim::avx2::make_pack_world;
  return sim::sse2::make_pack_world;
#else
  return sim::base::make_pack_world;
#endif
}

}  // namespace

struct ModelSimulator::Parts {
  PackSpec spec;
  std::vector<std::string> joints, channels;
  std::vector<int> driven;  ///< degree of freedom of every driven joint
  MakePackWorld* make = nullptr;
  Model controller;
  ControllerOptions control;
  long ball_row = 0;  ///< of x_B in what is seen
  std::unique_ptr<sim::PackWorld> world;
  bool started = false;
  Lanes seen;
  std::vector<std::string> failures;

  void make_world() {
    world = make(spec);
    seen.setZero(static_cast<long>(channels.size()), world->lanes());
    failures.assign(static_cast<std::size_t>(world->lanes()), "");
  }
  /// Rows of all joints; those of passive ones are 0, and not read but at the start.
  Lanes of_all(const Lanes& of_driven) const {
    Lanes out = Lanes::Zero(spec.joints, of_driven.cols());
    for (std::size_t k = 0; k < driven.size(); ++k)
      out.row(driven[k]) = of_driven.row(static_cast<long>(k));
    return out;
  }
  /// Of every start by itself: those that are derived depend on it.
  void gains(const Lanes& q, Lanes& kp, Lanes& kd) const {
    kp.resizeLike(q);
    kd.resizeLike(q);
    for (long k = 0; k < q.cols(); ++k) {
      if (k > 0 && q.col(k) == q.col(k - 1)) {
        kp.col(k) = kp.col(k - 1);
        kd.col(k) = kd.col(k - 1);
        continue;
      }
      const JointGains at = joint_gains(controller, control, q.col(k));
      kp.col(k) = at.kp;
      kd.col(k) = at.kd;
    }
  }
};

ModelSimulator::ModelSimulator(const std::vector<Model>& draws, const Model& controller,
                               const ModelSimulatorOptions& options)
    : parts_(std::make_unique<Parts>()) {
  Parts& p = *parts_;
  p.make = kernel(options.instruction_set);
  p.spec = sim::pack_spec(draws, controller, options);
  const std::vector<std::string> names = joint_names(draws.front());
  for (std::size_t j = 0; j < names.size(); ++j)
    if (!p.spec.passive[j]) {
      p.joints.push_back(names[j]);
      p.driven.push_back(static_cast<int>(j));
    }
  p.channels = channel_names(names, p.spec.has_ball, p.spec.shows_cup, p.spec.cup.has_value());
  p.ball_row = 2 * p.spec.joints;
  p.controller = controller;
  p.control = options.controller;
  joint_gains(controller, p.control, VecX<double>::Zero(p.spec.joints));  // refuses wrong sizes
  p.make_world();
}

ModelSimulator::ModelSimulator(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
ModelSimulator::~ModelSimulator() = default;

const std::vector<std::string>& ModelSimulator::joints() const { return parts_->joints; }
const std::vector<std::string>& ModelSimulator::channels() const { return parts_->channels; }
double ModelSimulator::period() const { return parts_->spec.period; }
int ModelSimulator::lanes() const { return parts_->world->lanes(); }
const Lanes& ModelSimulator::observe() const { return parts_->seen; }
const std::vector<std::string>& ModelSimulator::failures() const { return parts_->failures; }

void ModelSimulator::reset(const Starts& starts) {
  Parts& p = *parts_;
  const long count = starts.q.cols();
  require_size("simulator: starts", starts.q.rows(), static_cast<long>(p.joints.size()), "joint");
  require_size("simulator: seeds", static_cast<long>(starts.seeds.size()), count, "world");
  if (count < 1 || count > lanes())
    throw ShapeError("simulator: got " + std::to_string(count) + " starts, expected 1 to " +
                     std::to_string(lanes()) + " (the lanes)");
  const Lanes q = p.of_all(starts.q);
  Lanes kp, kd;
  p.gains(q, kp, kd);
  p.world->reset(q.data(), kp.data(), kd.data(), static_cast<int>(count), starts.seeds.data());
  p.started = true;
  std::ranges::fill(p.failures, "");
  p.world->observe(p.seen.data());
}

void ModelSimulator::step(const Lanes& q, const Lanes& qd) {
  Parts& p = *parts_;
  if (!p.started) throw Error("simulator: step: it has no start yet; call reset first");
  for (const Lanes* x : {&q, &qd}) {
    require_size("simulator: command", x->rows(), static_cast<long>(p.joints.size()), "joint");
    require_size("simulator: command", x->cols(), lanes(), "lane");
  }
  if (p.joints.size() == p.spec.passive.size())
    p.world->step(q.data(), qd.data());
  else
    p.world->step(p.of_all(q).data(), p.of_all(qd).data());
  p.world->observe(p.seen.data());
  const bool finite = std::isfinite(p.seen.sum());  // quicker than to ask each number
  for (int lane = 0; lane < lanes(); ++lane) {
    if (!p.failures[lane].empty()) continue;
    if (!finite && !p.seen.col(lane).allFinite()) p.failures[lane] = "the integration is unstable";
    if (p.spec.network && !(p.seen.block<3, 1>(p.ball_row, lane).norm() < sim::kFarthestBall))
      p.failures[lane] = "the network's ball flew away";
  }
}

std::unique_ptr<Simulator> ModelSimulator::clone() const {
  auto parts = std::make_unique<Parts>();
  parts->spec = parts_->spec;
  parts->joints = parts_->joints;
  parts->driven = parts_->driven;
  parts->channels = parts_->channels;
  parts->make = parts_->make;
  parts->controller = parts_->controller;
  parts->control = parts_->control;
  parts->ball_row = parts_->ball_row;
  parts->make_world();
  return std::unique_ptr<Simulator>(new ModelSimulator(std::move(parts)));
}

}  // namespace diffnea
