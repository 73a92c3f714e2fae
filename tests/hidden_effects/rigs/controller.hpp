#pragma once
/// Cascade or computed torque, at ticks of its own.

#include "plant.hpp"

namespace rigs {

class Controller {
 public:
  /// @param middle  (n) position that a cascade takes its inertias from
  Controller(const Rig& rig, const Eigen::VectorXd& middle);

  /// Torque to hold until the next tick [N·m], (n); zero at joints without a drive.
  Eigen::VectorXd torque(const Eigen::VectorXd& position, const Desired& wanted);

 private:
  const Rig& rig_;
  Rigid model_;
  Eigen::VectorXd inertia_, sum_, before_, speed_;
};

}  // namespace rigs
