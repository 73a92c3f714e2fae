#pragma once
/// The machine as it is: rigid links by MuJoCo, everything else written here, led by its drives.
///
/// Leapfrog in time with sets for dry friction and for the flanks of a gap (Moreau): velocities
/// v at half steps obey v' = v + h M⁻¹ (f + Jᵀλ), each λ within its bounds and against its slip. A
/// joint that sticks has velocity 0, exactly.

#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <mujoco/mujoco.h>

#include "motion.hpp"

namespace rigs {

/// Bristles that bend before they slide.
struct Bristles {
  int joint = -1;
  double stiffness = 0.0, damping = 0.0;  ///< [N·m/rad], [N·m·s/rad]
  double coulomb = 0.0, stiction = 0.0;   ///< [N·m]
  double speed = 1.0;                     ///< Stribeck's [rad/s]
};

/// Spring or gap between a joint's motor and its link.
struct Transmission {
  int joint = -1;
  bool gap = false;
  double stiffness = 0.0, damping = 0.0;  ///< spring
  double width = 0.0, restitution = 0.0;  ///< gap
};

/// Shaft that turns with q̇_first + ratio q̇_second.
struct Shaft {
  int first = 0, second = 0;
  double ratio = 1.0, coulomb = 0.0, viscous = 0.0, inertia = 0.0;
};

/// Everything that a rigid machine lacks, in SI units; (n) each.
struct Physics {
  explicit Physics(int n = 0);

  // Dry friction: all of it makes one bound per direction.
  Eigen::VectorXd coulomb_plus, coulomb_minus, sublinear, load, load_braking, stribeck,
      stribeck_speed;
  double bristle_width = 0.0;  ///< dry friction by stiff bristles this long [rad]; 0: by sets
  Eigen::VectorXd viscous_plus, viscous_minus, quadratic, warm, warm_time;
  Eigen::VectorXd rotor;  ///< over what the model declares [kg·m²]
  Eigen::VectorXd spring, rest, ripple_sine, ripple_cosine, ripple_cycles;
  Eigen::VectorXd offset, gain, delay, lag, limit;  ///< drive
  std::vector<Eigen::VectorXd> session;             ///< offset of run k, or empty
  Bristles bristles;
  Transmission transmission;
  std::vector<Shaft> shafts;
  Eigen::Vector3d tip_force = Eigen::Vector3d::Zero();     ///< in the base's frame [N]
  Eigen::Vector3d more_gravity = Eigen::Vector3d::Zero();  ///< [m/s²]
  Eigen::Matrix4d payload = Eigen::Matrix4d::Zero();  ///< pseudo-inertia added to the last link
  Eigen::VectorXd encoder_offset, encoder_scale, wobble, wobble_phase, late;  ///< late [s]
  double torque_late = 0.0;  ///< lateness of the logged torques [s]
  /// Torque that opposes joint `outside_joint`.
  std::function<double(double time, const Eigen::VectorXd& q, const Eigen::VectorXd& qd)> outside;
  int outside_joint = -1;

  bool other_bodies() const { return !more_gravity.isZero() || !payload.isZero(); }
  bool false_positions() const;
};

/// How the drives are led.
struct Control {
  bool computed_torque = false;  ///< else a cascade: position P, velocity PI, maybe gravity
  bool knows_gravity = true;
  double rate = 1000.0;           ///< [Hz]
  double bandwidth = 12.0;        ///< position loop [rad/s]
  double velocity_filter = 40.0;  ///< [Hz]
  double resolution = 2e-6;       ///< motors' encoders [rad]
};

struct Rig {
  Arm arm;         ///< without what is hidden
  Arm controller;  ///< the model of computed torque
  Physics physics;
  Control control;
  bool motor_encoder = false;   ///< positions are logged at the motor, where there is a difference
  Eigen::VectorXd motor_noise;  ///< deviation per joint [N·m], unlogged
  double motor_noise_band = 20.0;  ///< [Hz]
};

/// When rows are taken. Positions are those of `times`; torques belong to the drives' own cycle and
/// are taken at whole periods.
struct Sampling {
  std::vector<double> times;  ///< instants of the rows, ascending [s]
  double period = 0.002;      ///< nominal [s]
  bool middle = false;        ///< torque of the interval's middle; else of its start
  /// Torque of an instant: mean of the commands before and after. Else the command from then on.
  bool centred = false;
};

/// Length of the means that evidence is made of [s].
constexpr double kBin = 0.0025;

struct Track {
  // Rows of the log without noise, (rows, n).
  Eigen::MatrixXd q, qd, tau, qcmd;
  /// Variance of tau against its mean over the row: control that is faster than the log.
  Eigen::VectorXd alias;
  // Means over kBin, (bins, n): motion as reported, torque without the hidden effects, hidden
  // torque, declared friction as it acted (as if of size 1), logged torque.
  Eigen::MatrixXd mean_q, mean_qd, mean_qdd, needed, hidden, dry, mean_tau;
};

/// @param run  number of the run, for offsets of sessions
/// @param begin  time in the motion [s]; what comes before is run in for 1 s
/// @throws std::runtime_error where the machine leaves its motion
Track simulate(const Rig& rig, const Motion& motion, int run, double begin, double seconds,
               const Sampling& sampling, Draw draw);

struct DeleteModel {
  void operator()(mjModel* m) const { mj_deleteModel(m); }
};
struct DeleteData {
  void operator()(mjData* d) const { mj_deleteData(d); }
};

/// Inertia matrix and bias of rigid links by MuJoCo.
class Rigid {
 public:
  explicit Rigid(const Arm& arm);
  /// M (n, n) and h (n) with M q̈ + h = τ.
  void evaluate(const Eigen::VectorXd& q, const Eigen::VectorXd& qd);
  Eigen::VectorXd torque(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                         const Eigen::VectorXd& qdd);
  /// Jᵀ F of a force at a point of the last link; after evaluate.
  Eigen::VectorXd pulled(const Eigen::Vector3d& force, const Eigen::Vector3d& point) const;
  const Eigen::MatrixXd& inertia() const { return inertia_; }
  const Eigen::VectorXd& bias() const { return bias_; }

 private:
  std::unique_ptr<mjModel, DeleteModel> model_;
  std::unique_ptr<mjData, DeleteData> data_;
  Eigen::MatrixXd inertia_;
  Eigen::VectorXd bias_;
};

}  // namespace rigs
