#include "sim/control_loop.hpp"

#include <algorithm>

#include <Eigen/Geometry>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/effects/joint_series.hpp>
#include <diffnea/effects/stepping.hpp>

#include "core/constants.hpp"
#include "core/number_text.hpp"
#include "sim/desired_motion.hpp"
#include "sim/following_gains.hpp"
#include "sim/joint_controller.hpp"

namespace diffnea::sim {
namespace {

constexpr double kMostRows = 1e7, kMostRowsEach = 100.0;  ///< of a recording; for a desired row

/// Desired motion in the order of the robot's joints, sampled by straight lines between the rows.
class Reference {
 public:
  Reference(const Trajectory& t, const Model& robot) : t_(t) {
    const std::vector<std::string> joints = joint_names(robot);
    const std::vector<int> moving = moving_links(robot);
    for (const std::string& name : t.joint_names) find_joint(robot, name);  // throws
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const auto it = std::ranges::find(t.joint_names, joints[j]);
      if (it == t.joint_names.end() && !robot.links[moving[j]].passive)
        throw DataError(t.source + ": there is no desired motion for joint '" + joints[j] +
                        "' (column qcmd_" + joints[j] + ")");
      column_.push_back(it == t.joint_names.end() ? -1
                                                  : static_cast<int>(it - t.joint_names.begin()));
    }
  }

  /// Writes NaN where a passive joint has no desired motion. Times must not decrease between calls.
  void sample(double time, VecX<double>& q, VecX<double>& qd) {
    while (row_ + 2 < t_.rows() && t_.time[row_ + 1] <= time) ++row_;
    const double s =
        std::clamp((time - t_.time[row_]) / (t_.time[row_ + 1] - t_.time[row_]), 0.0, 1.0);
    for (std::size_t j = 0; j < column_.size(); ++j) {
      const int c = column_[j];
      q[j] = c < 0 ? kNaN : (1.0 - s) * t_.q(row_, c) + s * t_.q(row_ + 1, c);
      qd[j] = c < 0 ? kNaN : (1.0 - s) * t_.qd(row_, c) + s * t_.qd(row_ + 1, c);
    }
  }

 private:
  const Trajectory& t_;
  std::vector<int> column_;
  long row_ = 0;
};

struct Joint {
  bool passive, led;  // led: by a drive with a loop of its own
  double limit, position_noise, torque_noise, actuation_noise;
};

std::vector<Joint> joints_of(const Model& robot, const RecordOptions& o) {
  std::vector<Joint> out;
  for (const int i : moving_links(robot)) {
    const ModelLink& link = robot.links[i];
    const bool led = std::ranges::any_of(robot.effects, [&](const EffectSpec& e) {
      return e.where == link.joint && find_effect(e.effect).has(Trait::kReadsCommand);
    });
    out.push_back({link.passive, led, link.limits.effort,
                   link.type == ModelJoint::kRevolute ? o.position_noise : o.slide_noise,
                   o.torque_noise * torque_scale(link), o.actuation_noise * torque_scale(link)});
  }
  return out;
}

/// Commands of the rows, velocities included, which drives with a loop of their own hold in
/// between.
CommandPath commands_of(Reference reference, const Trajectory& t, long rows, double rate, long n) {
  std::vector<double> time;
  RowMatX<double> q(rows, n), qd(rows, n);
  VecX<double> at(n), velocity(n);
  for (long k = 0; k < rows; ++k) {
    time.push_back(static_cast<double>(k) / rate);
    reference.sample(t.time[0] + time.back(), at, velocity);
    q.row(k) = at;
    qd.row(k) = velocity;
  }
  CommandPath out{std::move(time), std::move(q), VecX<double>::Ones(n)};
  out.set_feed_forward(std::move(qd), {});
  return out;
}

/// What the log, not the encoder, does to the motion: filtered velocities, a clock that is late.
void apply_channels(const std::vector<BoundEffect>& channels, Recording& r) {
  for (const BoundEffect& e : channels)
    for (const int j : e.joints) {
      const double dt = r.rows() > 1 ? r.time[1] - r.time[0] : 0.0;
      if (r.qd.size() > 0) r.qd.col(j) = logged_velocity(e, r.qd.col(j), dt);
      const double late = clock_shift(e);
      if (late == 0.0 || r.rows() < 2) continue;
      r.q.col(j) = shifted(r.q.col(j), dt, -late);
      if (r.qd.size() > 0) r.qd.col(j) = shifted(r.qd.col(j), dt, -late);
    }
}

/// A pose as markers show it.
VecX<double> seen_pose(VecX<double> pose, const RecordOptions& o, Rng& rng) {
  for (int i = 0; i < 3; ++i) pose[i] += o.place_noise * rng.normal();
  Eigen::Quaterniond q(pose[6], pose[3], pose[4], pose[5]);
  const double half = 0.5 * o.turn_noise;
  q *= Eigen::Quaterniond(1.0, half * rng.normal(), half * rng.normal(), half * rng.normal());
  q.normalize();
  pose.tail<4>() << q.x(), q.y(), q.z(), q.w();
  return pose;
}

}  // namespace

void Plant::launch(const VecX<double>&, const VecX<double>&, const Launch&) {
  throw ModelError("simulate: the base is fixed, and is to be thrown; expected one that floats");
}

void Plant::follow(CommandPath) {
  throw ModelError(
      "simulate: position_servo acts in no MuJoCo world; leave --world out, and the model itself "
      "is "
      "simulated");
}

SimulatedRecording run_control_loop(Plant& plant, const Model& robot, const Model& controller,
                                    const Trajectory& trajectory, const RecordOptions& o,
                                    const Launch* thrown) {
  if (!(o.control_rate > 0.0) || !(o.physics_step > 0.0) || !(o.camera_rate > 0.0))
    throw Error("record: control_rate, camera_rate and physics_step must be positive");
  if (trajectory.rows() < 2)
    throw DataError(trajectory.source + ": a trajectory needs two rows or more");

  const std::vector<Joint> joints = joints_of(robot, o);
  const int n = static_cast<int>(joints.size());
  const std::vector<BoundEffect> channels = extend(robot, {0}).series;
  const bool log_velocity = std::ranges::any_of(
      channels, [](const BoundEffect& e) { return e.info().has(Trait::kLogsVelocity); });
  Reference reference(trajectory, robot);
  Rng rng(o.seed);

  VecX<double> qcmd(n), qdcmd(n), measured(n);
  const double start = trajectory.time[0];
  reference.sample(start, qcmd, qdcmd);
  VecX<double> q0 = qcmd.array().isNaN().select(0.0, qcmd);
  if (!robot.constraints.empty()) {  // joints that follow begin where the loop closes
    const LoopMotion loop("simulate", robot);
    q0 = desired_motion(trajectory, joint_names(robot), &loop).q.row(0).transpose();
  }
  ControllerOptions law = o;
  if (o.follow) {
    // Towards a dead point a loop weighs more and more at its drives, in some directions: no gains
    // of single joints hold it on its way.
    if (!robot.constraints.empty() && o.kp.size() == 0 && o.kd.size() == 0)
      law.law = ControlLaw::kComputedTorque;
    const JointGains gains = following_gains(robot, controller, trajectory, law, q0);
    law.kp = gains.kp;
    law.kd = gains.kd;
  }
  JointController control(controller, robot, law, q0);

  const double duration = trajectory.time[trajectory.rows() - 1] - start;
  // Two rows can be years apart; what is long and has as many rows is meant.
  if (!(duration * o.control_rate <=
        std::max(kMostRows, kMostRowsEach * static_cast<double>(trajectory.rows()))))
    throw DataError(trajectory.source + ": lasts " + detail::number_text(duration, 6) +
                    " s, which is " + detail::number_text(duration * o.control_rate, 6) +
                    " rows at " + detail::number_text(o.control_rate, 6) + " Hz; the limit is " +
                    detail::number_text(kMostRows, 6) + " (is its time in s?)");
  const long rows = static_cast<long>(std::floor(duration * o.control_rate + 1e-6)) + 1;
  SimulatedRecording out;
  Recording& r = out.recording;
  r.joint_names = joint_names(robot);
  r.time.resize(rows);
  r.q.resize(rows, n);
  if (log_velocity) r.qd.resize(rows, n);
  r.qcmd.resize(rows, n);
  const bool fed = std::ranges::any_of(robot.effects, [](const EffectSpec& e) {
    return find_effect(e.effect).has(Trait::kFedForward);
  });
  if (fed) r.qdcmd.resize(rows, n);
  r.tau.resize(rows, n);
  r.info.torque_side = TorqueSide::kMotor;
  r.info.torque_sampling = TorqueSampling::kHold;
  r.info.period = o.period;
  for (int j = 0; j < n; ++j) {
    r.has_tau.push_back(!joints[j].passive && !joints[j].led);
    if (joints[j].passive) {
      r.info.passive.push_back(r.joint_names[j]);
      continue;
    }
    if (joints[j].led) continue;
    if (law.law == ControlLaw::kPd) {  // the gains of other laws are no stiffness and damping
      r.info.controller.push_back({r.joint_names[j], "kp", control.gains().kp[j]});
      r.info.controller.push_back({r.joint_names[j], "kd", control.gains().kd[j]});
    }
    if (std::isfinite(joints[j].limit))
      r.info.controller.push_back({r.joint_names[j], "limit", joints[j].limit});
  }

  if (std::ranges::any_of(joints, &Joint::led))
    plant.follow(commands_of(Reference(trajectory, robot), trajectory, rows, o.control_rate, n));
  if (thrown)
    plant.launch(q0, qdcmd.array().isNaN().select(0.0, qdcmd), *thrown);
  else
    plant.reset(q0);
  // Noises of camera, drives and base are streams of their own: arms without them keep theirs.
  Rng camera(o.seed ^ 0x63616d657261ULL), drives(o.seed ^ 0x647269766573ULL),
      markers(o.seed ^ 0x6d61726b657273ULL);
  const long shown_every = std::max(1L, std::lround(o.control_rate / o.camera_rate));
  if (plant.ball()) r.ball.setConstant(rows, 3, kNaN);
  if (plant.base().size() > 0) r.base.resize(rows, 7);
  long row = 0;
  for (; row < rows && out.failure.empty(); ++row) {
    const double time = static_cast<double>(row) / o.control_rate;
    reference.sample(start + time, qcmd, qdcmd);
    measured = plant.q();
    for (int j = 0; j < n; ++j) measured[j] += joints[j].position_noise * rng.normal();
    const VecX<double> velocity = plant.qd();
    VecX<double> u = control.torque(measured, velocity, qcmd, qdcmd);
    if (!control.failure().empty()) {
      out.failure = control.failure() + " at t = " + detail::number_text(time) + " s";
      break;
    }
    for (int j = 0; j < n; ++j) u[j] = joints[j].led ? 0.0 : u[j];
    for (int j = 0; j < n; ++j)
      r.tau(row, j) =
          joints[j].passive || joints[j].led ? kNaN : u[j] + joints[j].torque_noise * rng.normal();
    out.saturated += control.saturated();
    r.time[row] = time;
    r.q.row(row) = measured;
    if (log_velocity) r.qd.row(row) = velocity;
    if (const auto ball = plant.ball(); ball && row % shown_every == 0) {
      const double noise = o.camera_noise;
      r.ball.row(row) << ball->x + noise * camera.normal(), ball->y + noise * camera.normal(),
          ball->z + noise * camera.normal();
    }
    if (r.base.size() > 0) r.base.row(row) = seen_pose(plant.base(), o, markers).transpose();
    r.qcmd.row(row) = qcmd;
    if (fed) r.qdcmd.row(row) = qdcmd;
    VecX<double> acting = u;
    for (int j = 0; j < n && o.actuation_noise > 0.0; ++j)
      if (!joints[j].passive && !joints[j].led)
        acting[j] += joints[j].actuation_noise * drives.normal();
    out.failure = plant.step(acting);
    if (!out.failure.empty()) out.failure += " at t = " + detail::number_text(time) + " s";
  }
  r.time.conservativeResize(row);
  r.q.conservativeResize(row, n);
  if (log_velocity) r.qd.conservativeResize(row, n);
  r.qcmd.conservativeResize(row, n);
  if (fed) r.qdcmd.conservativeResize(row, n);
  r.tau.conservativeResize(row, n);
  if (r.ball.size() > 0) r.ball.conservativeResize(row, 3);
  if (r.base.size() > 0) r.base.conservativeResize(row, 7);
  apply_channels(channels, r);
  return out;
}

}  // namespace diffnea::sim
