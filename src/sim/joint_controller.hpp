#pragma once
/// The torque of one robot's controller, one period after the other. Of a robot with loops the
/// drives give what all joints need (LoopMotion::torque_map).

#include <optional>

#include <diffnea/dynamics/rnea.hpp>
#include <diffnea/sim/controller.hpp>

#include "dynamics/loop_motion.hpp"

namespace diffnea::sim {

class JointController {
 public:
  /// @param robot  whose motors and effort limits there are; joints as in the nominal model
  /// @throws ModelError if the joints differ, and as LoopMotion; Error if the rate is not positive;
  /// ShapeError as joint_gains
  JointController(const Model& nominal, const Model& robot, const ControllerOptions& options,
                  const VecX<double>& q0);

  /// Derives the gains anew and forgets the velocity that was desired last.
  void start(const VecX<double>& q0);
  /// Torque within the limits, 0 at passive joints, (n) [N·m] or [N], valid until the next call.
  /// @param q, qd  (n) measured
  /// @param desired_q, desired_qd  (n), those of passive joints are not read
  const VecX<double>& torque(const VecX<double>& q, const VecX<double>& qd,
                             const VecX<double>& desired_q, const VecX<double>& desired_qd);
  bool saturated() const { return saturated_; }  ///< whether a limit was met in the last call
  /// Empty, or why the last torque is none: the drives do not hold the loop there.
  const std::string& failure() const { return failure_; }
  const JointGains& gains() const { return gains_; }

 private:
  Model nominal_;
  ControllerOptions options_;
  Tree<double> tree_;
  std::optional<LoopMotion> loop_;  ///< of a nominal model with constraints
  std::vector<bool> passive_;
  VecX<double> limit_;
  JointGains gains_;
  RneaWorkspace<double, double> ws_;
  VecX<double> last_qd_;  ///< desired in the last call; empty before the first
  VecX<double> qdd_, u_;
  bool saturated_ = false;
  std::string failure_;
};

}  // namespace diffnea::sim
