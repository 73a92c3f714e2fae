#pragma once
/// A model with all its effects as a robot that can be stepped: those of one instant by forward
/// dynamics, those with memory with their states (torque of the drives, states at joints, angles of
/// hidden motors), encoders on what is read. Loops close: constraints act in the dynamics, and what
/// the integration lets them drift is taken back after every period.

#include <diffnea/dynamics/integrators.hpp>
#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/effects/joint_series.hpp>

#include "dynamics/loop_motion.hpp"
#include "sim/control_loop.hpp"
#include "sim/drives.hpp"

namespace diffnea::sim {

class ModelPlant : public Plant {
 public:
  /// @throws ModelError if effects cannot act together: two motors at one joint, or what reads q̈ at
  /// a joint
  ///         with a hidden motor
  ModelPlant(const Model& model, const RecordOptions& options);
  /// @param period        between two torques [s]
  /// @param largest_step  of the integration [s]
  /// @param run           the recording that effects of single recordings see
  ModelPlant(ExtendedTree model, double period, double largest_step, int run);
  ModelPlant(const ModelPlant&) = delete;  // its parts point at its effects
  ModelPlant& operator=(const ModelPlant&) = delete;

  void reset(const VecX<double>& q) override;
  /// In the midst of a motion: hidden motors where the transmitted torques hold them, states and
  /// drives as the rows before have left them.
  /// @param x       motion as logged, on the grid of `period`; time_shift is not undone
  /// @param torque  (N, n) that acts from row k to k+1
  /// @param row     where it starts, 1 … N−2
  void start(const JointSeries& x, const RowMatX<double>& torque, long row);
  VecX<double> q() const override { return encoders_.read(at_encoders(0)); }
  VecX<double> qd() const override { return encoders_.read_velocity(at_encoders(1)); }
  void follow(CommandPath commands) override;
  std::string step(const VecX<double>& torque) override;

 private:
  /// State of an effect at a joint.
  struct JointState {
    const BoundEffect* effect;
    int joint;
    int motor;     ///< of motors_, with which it turns; −1: with the link
    double share;  ///< of the effect's torque
    double state = 0.0;
    double advanced(double way, double h) const;
    double torque(double state, double velocity) const;
  };
  /// A motor behind a spring or a gap. Its angle and velocity are z[2n + k] and z[2n + m + k] of m
  /// motors.
  struct Motor {
    const BoundEffect* effect;
    int joint;
    double inertia;
    double shared_armature;  ///< of the joint, what turns with the link's acceleration in the model
    bool encoder;            ///< positions are read here
  };

  /// @param described  the model, for its constraints; null: none act
  ModelPlant(ExtendedTree model, double period, double largest_step, int run,
             const Model* described);
  ExtendedTree take_apart(ExtendedTree model);
  void hide_motors(Tree<double>& tree);
  void take_servos(std::vector<BoundEffect>& effects);
  void place_states();
  int position_of(const JointState& state) const;
  int velocity_of(const JointState& state) const;
  /// Positions (`order` 0) or velocities (1) of what the encoders sit at.
  VecX<double> at_encoders(int order) const { return at_encoders(z_, order); }
  VecX<double> at_encoders(const VecX<double>& z, int order) const;
  /// Closes the loops of links again. @return empty, or which constraint is open
  std::string close_loops();
  int steps_for_stiffness(const VecX<double>& q) const;
  int steps_for_friction(const VecX<double>& q);
  void slope(double share, const VecX<double>& z, VecX<double>& dz);

  int n_;
  std::optional<LoopMotion> loop_;          ///< of a model with constraints
  std::vector<BoundEffect> series_;         ///< with memory, or of a channel
  std::vector<BoundEffect> motor_effects_;  ///< of one instant, what turns with hidden motors
  std::vector<BoundEffect> servos_;  ///< drives with a loop of their own, fed back from encoders
  std::vector<BoundEffect> laws_;    ///< other parts of the drives' laws
  std::vector<int> integrated_;      ///< joints whose drives integrate their error
  std::vector<BoundEffect> integrators_;  ///< these drives, at degrees of freedom behind all joints
  std::optional<CommandPath> commands_;
  std::vector<JointState> states_;
  std::vector<Motor> motors_;
  ForwardDynamics dynamics_;
  Drives drives_;
  Encoders encoders_;
  double period_, largest_step_, time_ = 0.0, step_ = 0.0;
  int run_ = 0, substeps_ = 1;
  VecX<double> z_, start_;  ///< q, q̇, θ, θ̇, integrals of errors; at the beginning of the step
  RungeKutta4<VecX<double>> integrator_;
};

}  // namespace diffnea::sim
