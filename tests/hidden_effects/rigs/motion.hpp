#pragma once
/// Motions that a machine is asked to follow.

#include <string>
#include <vector>

#include <Eigen/Core>

#include "arm.hpp"
#include "draw.hpp"

namespace rigs {

struct Desired {
  Eigen::VectorXd q, qd, qdd;
};

/// How the motions of one case are made; each of its runs draws its own.
struct MotionPlan {
  std::string kind;      ///< "multisine", "points", "chirp"
  double period = 0.0;   ///< repeat of a multisine [s]; 0: none
  int waves = 5;         ///< number in a multisine
  double fastest = 1.5;  ///< [Hz]
  double speed = 2.0;    ///< peak [rad/s]
  double push = 12.0;    ///< peak acceleration [rad/s²]
  Eigen::VectorXd centre;
  double reach = 0.8;   ///< largest way from the centre [rad]
  bool smooth = false;  ///< legs between points begin and end without a jump of acceleration
};

class Motion {
 public:
  /// @param seconds  of the run: a chirp reaches its last frequency at its end
  Motion(const Arm& arm, const MotionPlan& plan, double seconds, Draw draw);
  Desired at(double time) const;

 private:
  struct Wave {
    double size, turn, phase;  ///< [rad], [rad/s], [rad]
  };
  struct Sweep {
    double size, speed, push, from, to, phase;
  };
  struct Leg {
    double start, ramp, whole;  ///< [s]; of the ramp at either end, of the motion
    Eigen::VectorXd from, to;
  };
  double swept(int joint, double time) const;

  Eigen::VectorXd centre_;
  double seconds_;
  bool smooth_;
  std::vector<std::vector<Wave>> waves_;
  std::vector<Sweep> sweeps_;
  std::vector<Leg> legs_;
};

}  // namespace rigs
