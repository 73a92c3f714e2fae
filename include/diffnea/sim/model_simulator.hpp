#pragma once
/// The identified model as a world: the arm by forward dynamics with its effects under its
/// controller, the ball on its string with its effects, and the cup as geometry. The lanes are
/// those of a SIMD register; the instruction set is chosen when the program runs.
///
/// The arm moves in steps of a control period or less (torque held, acceleration held, friction
/// implicit: effects that are steep at rest do not ask for smaller steps); the ball in fractions of
/// them (dynamics/string_step.hpp). The string's pull acts on the arm one step later. A ball is
/// caught where it passes the rim's plane from above without touching the rim; any other touch of
/// cup or obstacles ends what the model can tell, and so does a cup that is upside down
/// (BallPhase). A ball that a network moves (ModelSimulatorOptions) knows of none of this.
/// A passive joint starts at 0 and takes no command.

#include <memory>
#include <string>
#include <vector>

#include <diffnea/model/model.hpp>
#include <diffnea/sim/controller.hpp>
#include <diffnea/sim/simulator.hpp>

namespace diffnea {

struct BallNetwork;  // effects/ball_network.hpp

/// Steps and controller of a simulated model.
struct ModelSimulatorOptions {
  ControllerOptions controller;  ///< its period is the simulator's
  double arm_step = 2e-3;        ///< at most [s]
  double ball_step = 1e-3;       ///< at most [s]
  double settle_time = 0.5;      ///< that the arm holds its start before time 0 [s]
  double least_upright = 0.2;    ///< the cup is upside down where its axis' z is less
  std::string instruction_set;   ///< of batch_instruction_sets(); empty: the best
  /// Moves the ball in place of string, gravity and effects: then nothing pulls at the arm, no cup
  /// catches and nothing is touched. Its step is that of the arm.
  std::shared_ptr<const BallNetwork> ball_network;
};

/// A model as a simulator of many trials at once, one in each SIMD lane.
class ModelSimulator : public Simulator {
 public:
  /// @param draws  models of the same structure whose numbers differ, e.g. draws of a posterior;
  ///               the world with seed s is number s mod draws.size()
  /// @param controller  the model that compensates gravity
  /// @throws ModelError if the ball's network has another step than the arm, or nothing to hang on;
  ///         if a model has effects that act on what this does not simulate (gaps, encoders,
  ///         impacts; the message names them), if draws differ in structure, or joints differ
  ModelSimulator(const std::vector<Model>& draws, const Model& controller,
                 const ModelSimulatorOptions& options = {});
  ~ModelSimulator() override;

  const std::vector<std::string>& joints() const override;
  const std::vector<std::string>& channels() const override;
  double period() const override;
  int lanes() const override;
  void reset(const Starts& starts) override;
  void step(const Lanes& q, const Lanes& qd) override;
  const Lanes& observe() const override;
  const std::vector<std::string>& failures() const override;
  std::unique_ptr<Simulator> clone() const override;

 private:
  struct Parts;
  explicit ModelSimulator(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace diffnea
