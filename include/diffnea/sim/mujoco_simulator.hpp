#pragma once
/// MuJoCo as the world that a policy is tried in: the robot of record_in_mujoco, once a lane.
///
///     MujocoSimulator world(read_mjcf("wam4_ball.xml"), truth, nominal, {.lanes = 4});
///     world.reset({q0, seeds});
///     for (…) world.step(q, qd);       // desired positions and velocities, (joints × lanes)
///     world.observe();                 // q_joint1 … ball_x … cup_x … axis_x …

#include <memory>

#include <diffnea/sim/controller.hpp>
#include <diffnea/sim/simulator.hpp>

namespace diffnea {

/// Step, noise and controller of a MuJoCo world.
struct MujocoSimulatorOptions {
  ControllerOptions controller = {};  ///< its period is the simulator's
  double physics_step = 5e-4;         ///< largest step of the integration [s]
  int lanes = 1;                      ///< worlds of one object, which run one after the other
  /// The controller holds the start before time 0 [s]: the arm sags, the ball is at rest again.
  double settle_time = 0.5;
  // Standard deviations. The noises of one lane are drawn from its own seed.
  double position_noise = 0.0;  ///< of every position that the controller reads [rad] or [m]
  double torque_noise = 0.0;    ///< of the torque that acts, times torque_scale [N·m] or [N]
  /// Offset of an encoder that stays from before the start to the end [rad] or [m]: the posture is
  /// off by it, and no settling removes it.
  double encoder_noise = 0.0;
};

/// Channels: `q_*`, `qd_*` of all joints as the truth's encoders show them, without the noises of
/// the options; the ball's centre and velocity, as late as the truth's camera; the site `cup`. A
/// world without ball or cup has no such channels, `phase` needs both. The phase is always kFree:
/// contacts are simulated, and what they come to is judged from the series (ball_in_cup).
///
/// A passive joint starts at 0. Deterministic: the same starts give the same numbers, bit by bit,
/// in any lane. The lanes of one object run one after the other; its clones share the compiled
/// model and may run at the same time.
class MujocoSimulator : public Simulator {
 public:
  /// @param mjcf, truth  as record_in_mujoco
  /// @param controller   the model that the controller compensates gravity with; same joints
  /// @throws ModelError as record_in_mujoco; Error if lanes, control rate or step are not positive,
  /// or a noise or settle_time is negative; ShapeError for the gains
  MujocoSimulator(const std::string& mjcf, const Model& truth, const Model& controller,
                  const MujocoSimulatorOptions& options);
  ~MujocoSimulator() override;

  const std::vector<std::string>& joints() const override;
  const std::vector<std::string>& channels() const override;
  double period() const override;
  int lanes() const override;
  /// Not yet at time 0 a lane may have failed.
  void reset(const Starts& starts) override;
  /// @throws Error before the first reset; ShapeError if there are not joints().size() rows, or
  /// fewer columns than starts
  void step(const Lanes& q, const Lanes& qd) override;
  /// A lane that failed keeps what it showed before.
  const Lanes& observe() const override;
  const std::vector<std::string>& failures() const override;
  std::unique_ptr<Simulator> clone() const override;

 private:
  struct World;
  struct Lane;
  explicit MujocoSimulator(std::shared_ptr<const World> world);

  std::shared_ptr<const World> world_;
  std::vector<std::unique_ptr<Lane>> lanes_;
  int active_ = 0;  ///< lanes that have a start
  Lanes observed_;
  std::vector<std::string> failures_;
};

}  // namespace diffnea
