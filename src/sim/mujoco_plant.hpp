#pragma once
/// A MuJoCo document with a truth's numbers as a robot that can be stepped.

#include <deque>
#include <vector>

#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/effects/hidden_motor.hpp>

#include "sim/control_loop.hpp"
#include "sim/drives.hpp"
#include "sim/mujoco_ball.hpp"
#include "sim/mujoco_model.hpp"

namespace diffnea::sim {

/// The document compiled, with inertias, friction, rotors, springs, ball and the pose of the cup of
/// a truth. Const once it is made: any number of plants run in it.
///
/// An elastic joint has its rotor as a joint of its own, whose inertia and friction are MuJoCo's,
/// in a fixed tendon with the link's: its spring. Stiction there raises the bound of the rotor's
/// dry friction, F_c + F_s e^{−(θ̇/v_s)²}: at rest a torque below it does not move the rotor.
class MujocoRobot {
 public:
  /// @param rate          of the controller [Hz]
  /// @param largest_step  of the integration [s]
  /// @throws ModelError as record_in_mujoco
  MujocoRobot(const std::string& mjcf, const Model& truth, double rate, double largest_step);

 private:
  friend class MujocoPlant;
  /// Of an elastic joint.
  struct Rotor {
    int joint;  ///< degree of freedom of the model
    int qpos, dof;
    double stiffness;
    bool encoder;                           ///< positions are read here
    double stiction = 0.0, stribeck = 1.0;  ///< more at rest [N·m], fades with [rad/s]
  };
  /// State of an effect with memory, at a joint or its rotor.
  struct JointState {
    const BoundEffect* effect;
    int joint, dof;
    double share;  ///< of the effect's torque
  };
  /// A joint that follows a degree of freedom, by an equality constraint of the document.
  struct Follower {
    int qpos, dof;
    JointDrive drive;
  };
  void free_base(const Model& truth);
  void tie_followers(const Model& truth);
  void tie_loops(const Model& truth);
  void stiffen(int equality);
  std::pair<int, Pose<double>> in_body(const ConstraintEnd& end, const Model& truth) const;
  void tie_rotor(const BoundEffect& elasticity, const Model& truth);
  void place_states(BoundEffect effect);
  void turn(const BoundEffect& effect);
  Rotor* rotor_at(int joint);
  void apply(const ModelLink& link);
  void apply(const EffectSpec& effect, const Model& truth);
  void apply_to_follower(const BoundEffect& effect);
  void apply_gains();
  void place_cup(const Model& truth);

  MujocoModel model_;
  MujocoBall ball_;
  int cup_ = -1;                        ///< site; −1: none
  int base_qpos_ = -1, base_dof_ = -1;  ///< base that floats; −1: it is fixed
  int substeps_ = 1;
  std::vector<int> joint_, qpos_, dof_;  ///< one a degree of freedom
  std::vector<Follower> followers_;
  std::vector<Rotor> rotors_;
  MotorShares shares_;
  double camera_delay_ = 0.0;
  std::vector<BoundEffect> effects_, series_, gain_effects_;
  std::vector<std::shared_ptr<const BoundEffect>> state_effects_;
  std::vector<JointState> states_;
  std::vector<BoundEffect> rotor_effects_;  ///< torques that turn with rotors
  VecX<double> gains_;                      ///< recorded over true torque
};

class MujocoPlant : public Plant {
 public:
  explicit MujocoPlant(std::shared_ptr<const MujocoRobot> robot);

  /// The ball hangs below where it is tied.
  void reset(const VecX<double>& reading) override;
  /// Springs of elastic drives are slack: no weight winds them up.
  void launch(const VecX<double>& reading, const VecX<double>& velocity,
              const Launch& thrown) override;
  VecX<double> base() const override;
  /// Lets the ball hang at rest again, whatever it did.
  void hang_ball();
  VecX<double> q() const override;
  VecX<double> qd() const override;
  /// Position and velocity W [m, m/s] are those that the camera shows, as late as it is.
  std::optional<Vec3<double>> ball() const override;
  std::string step(const VecX<double>& torque) override;

  bool has_ball() const { return robot_->ball_.exists(); }
  Vec3<double> ball_velocity() const;  ///< of its centre, W [m/s]
  bool has_cup() const { return robot_->cup_ >= 0; }
  Pose<double> cup() const;  ///< X_WC of the site `cup`

 private:
  void place_joints(const VecX<double>& q);
  /// The ball at the end of a control period.
  struct Seen {
    Vec3<double> x, v;
  };

  const mjModel* model() const { return own_ ? own_.get() : robot_->model_.get(); }
  void read_state();
  void push_rotors(const VecX<double>& applied);
  void take_stiction();
  void hold_states();
  void advance_states();
  Seen seen() const;

  std::shared_ptr<const MujocoRobot> robot_;
  MujocoModel own_;  ///< of a robot with stiction, whose bounds change
  MujocoData data_;
  Drives drives_;
  Encoders encoders_;
  VecX<double> q_, qd_, extra_;
  std::vector<double> states_, before_;  ///< states of JointState, and the positions before a step
  VecX<double> rotor_q_, rotor_qd_;      ///< of the links where there is no rotor
  std::deque<Seen> shown_;               ///< where the camera is late, the newest last
};

}  // namespace diffnea::sim
