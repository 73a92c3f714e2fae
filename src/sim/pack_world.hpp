#pragma once
/// A pack of worlds: arm under its controller, ball on a string, cup. Compiled once per instruction
/// set; plain types only cross this line.

#include <memory>
#include <optional>
#include <vector>

#include <diffnea/model/ball.hpp>
#include <diffnea/model/tree.hpp>
#include <diffnea/sim/controller.hpp>

namespace diffnea {
// Not from its header: templates over packs must meet core/pack.hpp before they meet a formula.
struct BoundEffect;
struct BallNetwork;
}  // namespace diffnea

namespace diffnea::sim {

/// Parameters that may differ from lane to lane.
struct PackDraw {
  Tree<double> tree;
  std::vector<std::vector<double>> effects, ball_effects;  ///< as those of PackSpec
  std::vector<std::vector<double>> drives, motor_effects;
  Vec3<double> p_LS{0, 0, 0};
  double length = 0.0;
};

struct PackSpec {
  int joints = 0;
  double period = 0.002;              ///< of control [s]
  int arm_steps = 1, ball_steps = 2;  ///< a period; of the ball: a step of the arm
  double settle_time = 0.5;           ///< that the arm holds its start before time 0 [s]
  // Control.
  Tree<double> nominal;
  bool same_kinematics = true;  ///< the nominal tree's and every draw's
  bool gravity_compensation = true;
  ControlLaw law = ControlLaw::kPd;
  std::vector<double> limit;
  std::vector<bool> passive;
  // Forces beside the tree's.
  std::vector<BoundEffect> effects;        ///< on joints, of one instant
  std::vector<BoundEffect> drives;         ///< on joints, with memory (sim/pack_drives.hpp)
  std::vector<BoundEffect> motor_effects;  ///< of one instant, on motors behind springs
  std::vector<BoundEffect> ball_effects;   ///< on ball and string
  std::vector<PackDraw> draws;             ///< world k takes number seed mod size
  // Ball and cup. Links are those of the tree, −1 the world; poses are in them.
  bool has_ball = false;
  int string_link = -1;
  double ball_mass = 0.0, ball_radius = 0.0;
  std::optional<CupSpec> cup;
  bool shows_cup = false;  ///< there is a frame `cup`
  int cup_link = -1;
  Pose<double> X_LC = Pose<double>::identity();
  std::vector<CapsuleSpec> obstacles;
  double least_upright = 0.2;                  ///< z of the cup's axis in W
  std::shared_ptr<const BallNetwork> network;  ///< that moves the ball; none: string and gravity
};

/// A network's ball that is farther from W's origin has failed [m].
inline constexpr double kFarthestBall = 10.0;

class PackWorld {
 public:
  virtual ~PackWorld() = default;
  virtual int lanes() const = 0;
  /// @param q, kp, kd  (joints × count) starts and the controller's gains; other lanes repeat the
  /// last
  virtual void reset(const double* q, const double* kp, const double* kd, int count,
                     const std::uint64_t* seeds) = 0;
  /// @param q, qd  (joints × lanes) desired
  virtual void step(const double* q, const double* qd) = 0;
  /// @param out  (channels × lanes): q, q̇, then ball x, v, cup x, axis, phase, where there are such
  virtual void observe(double* out) const = 0;
};

using MakePackWorld = std::unique_ptr<PackWorld>(const PackSpec&);

#define DIFFNEA_DECLARE_PACK_WORLD(isa) \
  namespace isa {                       \
  MakePackWorld make_pack_world;        \
  }
#ifdef DIFFNEA_HAS_X86_KERNELS
DIFFNEA_DECLARE_PACK_WORLD(sse2)
DIFFNEA_DECLARE_PACK_WORLD(avx2)
DIFFNEA_DECLARE_PACK_WORLD(avx512)
#else
DIFFNEA_DECLARE_PACK_WORLD(base)
#endif
#undef DIFFNEA_DECLARE_PACK_WORLD

}  // namespace diffnea::sim
