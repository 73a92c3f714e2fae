#pragma once
/// Simulated windows of one limb's joints: output errors, and their sensitivities to the first
/// state and to free parameters. Internal to the library.

#include <span>
#include <vector>

#include <diffnea/core/triangular_factor.hpp>
#include <diffnea/dynamics/derivatives.hpp>
#include <diffnea/dynamics/regressor.hpp>

#include "motion/limbs.hpp"
#include "motion/path.hpp"

namespace diffnea {

/// A parameter that windows are differentiated by: one of a link, or one of an effect.
struct MotionParameter {
  int dof = -1;              ///< index of the link, or −1
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

/// A limb at given parameters. Stretches, windows and all that has a number for each joint are
/// those of the whole robot; the limb reads and writes its own. Not thread-safe; no allocation
/// after the first window.
class LimbWindows {
 public:
  /// @param models      of the limb at these parameters, one at least
  /// @param effects     of the limb, with these values; those that `parameters` name
  /// @param parameters  of the limb
  /// @throws ModelError if an effect has no forward form, or a parameter no derivative
  LimbWindows(const Limb& limb, std::vector<ModelOfRuns> models, std::vector<BoundEffect> effects,
              const std::vector<MotionParameter>& parameters, const SteppingOptions& options);

  /// Adds the rows (q̂ − q)/σ of a window, (·, 2n + f + 1) of the limb's n joints and f parameters,
  /// to one factor for each part of the window; parts follow one another and are as long.
  /// @return whether the simulation reached the window's end
  bool linearise(const MotionStretch& stretch, const MotionWindow& window,
                 const VecX<double>& sigma, std::span<TriangularFactor> rows);
  /// ½ Σ (residual/σ)²; +∞ if it blew up.
  double cost(const MotionStretch& stretch, const MotionWindow& window, const VecX<double>& sigma);
  /// Writes positions until the simulation blows up.
  void positions(const MotionStretch& stretch, const MotionWindow& window, RowMatX<double>& q);
  /// Writes the state at a row of the window, (2n); false if the simulation blew up before.
  bool state_at(const MotionStretch& stretch, const MotionWindow& window, long row,
                VecX<double>& out);
  /// Writes the standard deviation of the positions at the window's end that noise of the torque
  /// alone makes, (n). @param density  (n) of the torque's noise
  void torque_noise_reach(const MotionStretch& stretch, const MotionWindow& window,
                          const VecX<double>& density, VecX<double>& out);

 private:
  void add_parameter(const MotionParameter& p, int column);
  /// Takes the model of that run.
  MotionPath& enter(int run);
  void slope(int run, const VecX<double>& u, const MatX<double>& A, MatX<double>& dA);
  void columns(int run, const MatX<double>& A);
  void add_columns(std::size_t effect, const JointSample<double>& x, const JointSample<JetD>& jets);
  const HiddenRotors& rotors() const { return models_[now_].path.rotors(); }
  void begin(const MotionStretch& stretch, const MotionWindow& window);
  void begin_integrators(const MotionStretch& stretch, const MotionWindow& window);
  void begin_hidden(const HiddenRotor& rotor);

  struct OfRuns {
    std::vector<int> runs;
    MotionPath path;
    Tree<double> geometry;
  };
  std::vector<OfRuns> models_;
  std::size_t now_ = 0;       ///< of the models
  std::vector<char> acting_;  ///< per effect, in the present run
  int first_;                 ///< joint of the robot that is the limb's first
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
  RowMatX<double> block_;          // rows that wait for the factor
  RegressorWorkspace<double, double> ws_;
  RneaDerivatives hanging_;  ///< torques that hold the links where a window begins
  MatX<double> A_, C_;
  VecX<double> q_, qd_;
  std::vector<std::pair<int, int>> moved_;  // parameters of an effect, as OfEffect has them
  std::vector<double> scratch_;
  std::vector<JetD> jet_q_, jet_qd_, jet_qdd_, jet_load_, jet_p_, jet_tau_;
};

}  // namespace diffnea
