#pragma once
/// Worlds that a policy acts in: the identified model, MuJoCo, or one of the user's own. Many run
/// side by side, one a lane; what one lane does never depends on the others, nor on how many there
/// are.
///
/// A world is the whole system that follows a desired motion of its joints: arm, controller and
/// whatever the arm moves. Own worlds derive from Simulator; a policy sees nothing else of them.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// (rows × lanes): one row a quantity, the lanes of a row are contiguous.
using Lanes = RowMatX<double>;

/// How the worlds of a batch begin, at rest.
struct Starts {
  Lanes q;                           ///< (joints × n), n ≤ lanes [rad, m]
  std::vector<std::uint64_t> seeds;  ///< (n), of each world's noise
};

/// What executes movements: a model, MuJoCo, or the caller's own world.
class Simulator {
 public:
  virtual ~Simulator() = default;

  /// Joints that are driven, in the order of the rows of a command.
  virtual const std::vector<std::string>& joints() const = 0;
  /// Names of the rows of observe(). Joints are `q_<joint>`, `qd_<joint>` [rad, rad/s]; a ball is
  /// `ball_x` … `ball_vz` [m, m/s], a cup `cup_x` … (its origin, W [m]) and `axis_x` … (its axis,
  /// unit vector in W), `phase` tells of ball and cup (BallPhase).
  virtual const std::vector<std::string>& channels() const = 0;
  virtual double period() const = 0;  ///< between two commands [s]
  virtual int lanes() const = 0;      ///< worlds that run side by side

  /// @throws ShapeError if there are no starts, more than lanes(), or not joints().size() rows
  virtual void reset(const Starts& starts) = 0;
  /// Moves every world by one period.
  /// @param q, qd  (joints × lanes) desired position and velocity [rad, rad/s], [m, m/s]
  /// @throws Error before the first reset, a clone's own included
  virtual void step(const Lanes& q, const Lanes& qd) = 0;
  /// (channels × lanes), valid until the next step; lanes beyond the starts hold anything.
  virtual const Lanes& observe() const = 0;
  /// Lanes that cannot go on (diverged, a solver's warning): empty, or why, (lanes).
  virtual const std::vector<std::string>& failures() const = 0;
  /// Another one like it, for another thread, that was not yet reset.
  virtual std::unique_ptr<Simulator> clone() const = 0;
};

/// What the channel `phase` holds.
enum class BallPhase {
  kFree = 0,
  kCaptured = 1,    ///< in the cup, for good
  kTouched = 2,     ///< hit the cup from outside, its rim, or the arm: the model knows no further
  kUpsideDown = 3,  ///< the cup was: a ball that hangs there would look caught
  // Of a ball that a network moves, which nothing holds or stops:
  kImagined = 4,  ///< outside the cup
  kInside = 5,    ///< inside, for now
};

/// The channels of a world with such joints, a ball, a cup and its phase, in the library's order.
std::vector<std::string> channel_names(const std::vector<std::string>& joints, bool ball, bool cup,
                                       bool phase);

/// Row of a channel. @throws Error that lists the channels there are
int find_channel(const Simulator& simulator, const std::string& name);

}  // namespace diffnea
