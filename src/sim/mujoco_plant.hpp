#pragma once
/// A MuJoCo document with a truth's numbers as a robot that can be stepped.

#include <vector>

#include <diffnea/effects/forward_dynamics.hpp>

#include "sim/control_loop.hpp"
#include "sim/drives.hpp"
#include "sim/mujoco_ball.hpp"
#include "sim/mujoco_model.hpp"

namespace diffnea::sim {

/// The document compiled, with inertias, friction, rotors, springs, ball and the pose of the cup of
/// a truth. Const once it is made: any number of plants run in it.
class MujocoRobot {
 public:
  /// @param rate          of the controller [Hz]
  /// @param largest_step  of the integration [s]
  /// @throws ModelError as record_in_mujoco
  MujocoRobot(const std::string& mjcf, const Model& truth, double rate, double largest_step);

 private:
  friend class MujocoPlant;
  void apply(const ModelLink& link);
  void apply(const EffectSpec& effect, const Model& truth);
  void apply_gains();
  void place_cup(const Model& truth);

  MujocoModel model_;
  MujocoBall ball_;
  int cup_ = -1;  ///< site; −1: none
  int substeps_ = 1;
  std::vector<int> joint_, qpos_, dof_;
  std::vector<BoundEffect> effects_, series_, gain_effects_;
  VecX<double> gains_;  ///< recorded over true torque
};

class MujocoPlant : public Plant {
 public:
  explicit MujocoPlant(std::shared_ptr<const MujocoRobot> robot);

  /// The ball hangs below where it is tied.
  void reset(const VecX<double>& reading) override;
  /// Lets the ball hang at rest again, whatever it did.
  void hang_ball();
  VecX<double> q() const override { return encoders_.read(q_); }
  VecX<double> qd() const override { return encoders_.read_velocity(qd_); }
  std::optional<Vec3<double>> ball() const override;
  std::string step(const VecX<double>& torque) override;

  bool has_ball() const { return robot_->ball_.exists(); }
  Vec3<double> ball_velocity() const;  ///< of its centre, W [m/s]
  bool has_cup() const { return robot_->cup_ >= 0; }
  Pose<double> cup() const;  ///< X_WC of the site `cup`

 private:
  void read_state();

  std::shared_ptr<const MujocoRobot> robot_;
  MujocoData data_;
  Drives drives_;
  Encoders encoders_;
  VecX<double> q_, qd_, extra_;
};

}  // namespace diffnea::sim
