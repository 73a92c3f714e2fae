#pragma once
/// The robots of the study: serial chains, drawn anew for every seed, and their MJCF.

#include <array>
#include <string>
#include <vector>

#include "random.hpp"

namespace hidden {

using Vec3 = std::array<double, 3>;

/// A link and the joint that moves it.
struct Link {
  std::string joint;
  bool slide = false;
  Vec3 axis{0, 0, 1};
  Vec3 pos{0, 0, 0};  ///< of the joint, in the link before [m]
  double mass = 1.0;  ///< [kg]
  Vec3 com{0, 0, 0};  ///< [m]
  Vec3 size{.1, .1,
            .1};  ///< of the homogeneous box about the centre of mass that has its inertia [m]
  std::array<double, 4> turn{1, 0, 0, 0};  ///< of that box
  double centre = 0.0;                     ///< of the motion [rad] or [m]
  double range = 1.0;                      ///< half of the motion's range [rad] or [m]
  // Declared in the model, hence no hidden effects: the fit of the base parameters finds them.
  double armature = 0.0;  ///< [kg·m²] or [kg]
  double damping = 0.0;   ///< [N·m·s/rad] or [N·s/m]
  double coulomb = 0.0;   ///< [N·m] or [N]
};

struct Robot {
  std::string name;
  std::vector<Link> links;
  Vec3 tip{0, 0, 0};               ///< in the last link [m]
  bool first_is_vertical = false;  ///< gravity does not act on the first joint
  Vec3 gravity{0, 0, -9.81};       ///< [m/s²]

  int num_joints() const { return static_cast<int>(links.size()); }
};

/// "planar2", "arm4", "slider" or "arm6", with lengths and inertias drawn.
Robot draw_robot(const std::string& name, Rng& rng);

/// The robot as a data sheet would have it: masses ±20 %, centres of mass, inertias and declared
/// numbers wrong too.
Robot nominal_of(const Robot& robot, Rng& rng);

/// Parts that hidden effects need in the simulated robot alone.
struct Additions {
  /// A motor-side body beside link `joint`, with a joint motor_<joint>.
  std::vector<int> rotors;
  /// Bodies at the base that turn about an axis of their own, with a joint of this name.
  std::vector<std::string> shafts;
  /// Fixed tendons: length = Σ coefficient · position of the named joint.
  struct Tendon {
    std::string name;
    std::vector<std::pair<std::string, double>> terms;
  };
  std::vector<Tendon> tendons;
  /// Homogeneous boxes that are fixed to the last link.
  struct Payload {
    double mass = 0.0;
    Vec3 com{0, 0, 0}, size{.1, .1, .1};
  };
  std::vector<Payload> payloads;
};
std::string motor_joint(const Robot& robot, int joint);

/// @param declared_friction  write damping and Coulomb friction (the model that is seen); the
/// simulated robot has friction of its own making
std::string to_mjcf(const Robot& robot, const Additions& additions, bool declared_friction);

}  // namespace hidden
