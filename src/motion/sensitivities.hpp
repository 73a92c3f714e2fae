#pragma once
/// Simulated windows of a robot's joints: output errors, and their sensitivities to the first state
/// and to free parameters. Internal to the library.

#include <vector>

#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/regressor.hpp>

#include "motion/first_states.hpp"
#include "motion/limbs.hpp"
#include "motion/path.hpp"
#include "motion/window_simulator.hpp"

namespace diffnea {

/// A parameter that windows are differentiated by: one of a link, or one of an effect.
struct MotionParameter {
  int dof = -1;              ///< degree of freedom of the link, or −1
  int theta = -1;            ///< index in θ of a link
  int effect = -1;           ///< index among the effects, or −1
  int index = -1;            ///< index into the effect's parameters
  bool logarithmic = false;  ///< derivative is by its logarithm
};

/// The model as it is in some recordings: with what the robot held there.
struct ModelOfRuns {
  std::vector<int> runs;  ///< empty: in all others
  ExtendedTree model;
};

/// The model at given parameters. Not thread-safe; no allocation after the first window.
class JointWindows : public WindowSimulator {
 public:
  JointWindows(ExtendedTree model, std::vector<BoundEffect> effects,
               const std::vector<MotionParameter>& parameters, const SteppingOptions& options)
      : JointWindows(std::vector<ModelOfRuns>{{{}, std::move(model)}}, std::move(effects),
                     parameters, options) {}
  /// @param models   at these parameters, one at least, of as many joints
  /// @param effects  with these values; those that `parameters` name
  /// @throws ModelError if an effect has no forward form, or a parameter no derivative
  JointWindows(std::vector<ModelOfRuns> models, std::vector<BoundEffect> effects,
               const std::vector<MotionParameter>& parameters, const SteppingOptions& options);

  int states() const override { return 2 * joints_; }
  bool linearise(const MotionStretch& stretch, const MotionWindow& window,
                 const VecX<double>& sigma, TriangularFactor& rows) override;
  double cost(const MotionStretch& stretch, const MotionWindow& window,
              const VecX<double>& sigma) override;
  RowMatX<double> positions(const MotionStretch& stretch, const MotionWindow& window) override;

  /// State at a row of the window, (2n); false if the simulation blew up before.
  bool state_at(const MotionStretch& stretch, const MotionWindow& window, long row,
                VecX<double>& out);

  /// Standard deviation of the positions at the window's end that noise of the torque alone makes,
  /// (n). @param density  (n) of the torque's noise
  VecX<double> torque_noise_reach(const MotionStretch& stretch, const MotionWindow& window,
                                  const VecX<double>& density);

 private:
  /// A limb's part of [z | Z]: no other column moves it.
  struct Part {
    Limb limb;
    std::vector<int> dofs;    // degrees of freedom of the limb
    bool on_end = true;       // they follow one another
    int column = 0;           // first of its columns in A: of q, of q̇, of its parameters
    int parameter = 0;        // first of these among the columns of C
    int parameters = 0;       // number of these
    std::vector<int> to;      // for each column, where it stands in the rows that are handed on
    RowMatX<double> block;    // rows that wait for the factor
    long filled = 0;          // of these
    int width() const { return static_cast<int>(to.size()); }
  };
  void divide(const std::vector<MotionParameter>& parameters);
  void add_parameter(const MotionParameter& p, int column);
  /// Takes the model of that run.
  MotionPath& enter(int run);
  void slope(int run, const VecX<double>& u, const MatX<double>& A, MatX<double>& dA);
  void slope_of_dofs(const Part& part, const MatX<double>& A, MatX<double>& dA);
  void columns(int run, const MatX<double>& A);
  void add_columns(std::size_t effect, const JointSample<double>& x, const JointSample<JetD>& jets);
  const HiddenRotors& rotors() const { return models_[now_].path.rotors(); }
  void begin(const MotionStretch& stretch, const MotionWindow& window);
  void begin_integrators(const MotionStretch& stretch, const MotionWindow& window);
  void begin_hidden(const HiddenRotor& rotor, const Part& part);
  VecX<double> read(const MatX<double>& z) const;

  struct OfRuns {
    std::vector<int> runs;
    MotionPath path;
    Tree<double> geometry;
  };
  std::vector<OfRuns> models_;
  std::size_t now_ = 0;       ///< of the models
  std::vector<char> acting_;  ///< per effect, in the present run
  int joints_, n_, f_;        ///< n; N with hidden rotors; free parameters
  std::vector<BoundEffect> effects_;
  struct OfEffect {
    std::vector<EffectPart> parts;                    // where it acts
    std::vector<std::pair<int, int>> linear, shapes;  // index of the parameter, column of C
    std::vector<double> off;  // parameters, the linear ones 0
  };
  std::vector<OfEffect> of_effect_;
  struct OfLink {
    int column = 0, free = 0;  // columns of the regressor, of C
    int effect = -1;           // owner; a link's own: −1
  };
  std::vector<OfLink> of_link_;
  std::vector<char> logarithmic_;  // per column of C
  std::vector<Part> parts_;
  RegressorWorkspace<double, double> ws_;
  RneaDerivatives hanging_;  ///< torques that hold the links where a window begins
  MatX<double> A_, C_, gathered_q_, gathered_qd_, slope_;
  VecX<double> q_, qd_;
  std::vector<std::pair<int, int>> moved_;  // parameters of an effect, as OfEffect has them
  std::vector<double> scratch_;
  std::vector<JetD> jet_q_, jet_qd_, jet_qdd_, jet_load_, jet_p_, jet_tau_;
};

}  // namespace diffnea
