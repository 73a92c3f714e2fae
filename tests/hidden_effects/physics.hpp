#pragma once
/// The robot in MuJoCo with what is hidden in it, led by a controller at the sampling rate.

#include <memory>
#include <vector>

#include "mechanism.hpp"
#include "motion.hpp"

namespace hidden {

struct DeleteModel {
  void operator()(mjModel* m) const { mj_deleteModel(m); }
};
struct DeleteData {
  void operator()(mjData* d) const { mj_deleteData(d); }
};
using Model = std::unique_ptr<mjModel, DeleteModel>;
using Data = std::unique_ptr<mjData, DeleteData>;

/// Compiles a document. @throws std::runtime_error with MuJoCo's words
Model compile(const std::string& mjcf);

struct World {
  Robot robot;    ///< without what is hidden
  Robot nominal;  ///< what the model file and the controller say
  std::vector<Mechanism> hidden;
  double coulomb_width = 0.01;  ///< velocity over which declared Coulomb friction turns [rad/s]
};

struct SimulationOptions {
  double rate = 500.0;              ///< of control and recording [Hz]
  double duration = 40.0;           ///< [s]
  double physics_step = 5e-4;       ///< [s]
  double control_bandwidth = 25.0;  ///< [rad/s]
  /// Of the positions that the controller sees; empty: perfect ones. (rows + 2 kPad, joints), first
  /// row at −kPad.
  Eigen::MatrixXd position_noise;
};

/// Rows before the recording begins and after its end: delayed channels need them.
constexpr int kPad = 50;

/// (rows + 2 kPad, joints), first row at −kPad / rate.
struct Series {
  Eigen::VectorXd time;
  Eigen::MatrixXd q, qd, qcmd;  ///< of the links, true
  Eigen::MatrixXd tau;          ///< commanded, held until the next row
  /// Mean over the next control period of what the robot without the hidden effects would have
  /// needed along the motion that the encoders report. tau − needed is the hidden effect.
  Eigen::MatrixXd needed;
  /// Mean over the control period of position, velocity, acceleration.
  Eigen::MatrixXd mean_q, mean_qd, mean_qdd;
};

/// @throws std::runtime_error where the robot leaves its motion
Series simulate(const World& world, const Motion& motion, const SimulationOptions& options);

/// Inverse dynamics of a robot in MuJoCo: rigid bodies and armature.
class Inverse {
 public:
  explicit Inverse(const Robot& robot);
  Eigen::VectorXd torque(const Eigen::VectorXd& q, const Eigen::VectorXd& qd,
                         const Eigen::VectorXd& qdd);
  mjModel& model() { return *model_; }

 private:
  Model model_;
  Data data_;
};

/// Declared friction and what RNEA leaves out: damping, Coulomb friction. [N·m]
Eigen::VectorXd declared_friction(const Robot& robot, const Eigen::VectorXd& qd, double width);

}  // namespace hidden
