#pragma once
/// What the torques along a motion tell about the base parameters. Internal to excite/.

#include <diffnea/dynamics/regressor.hpp>
#include <diffnea/identify/layout.hpp>

#include "excite/loop_rows.hpp"
#include "excite/recoil.hpp"

namespace diffnea {

/// Torque is linear in the parameters of the default fit (inertias, rotors, friction, offsets, the
/// model's own effects of one instant). Columns that random states within the limits show to be
/// dependent on others are left out: the rest are the base parameters (pivoted QR, Gautier 1991).
/// In a robot with loops rows are those of the leading joints, which D maps all torques to
/// (dynamics/driven_torques.hpp). A robot that floats is in flight, its base gives way (Recoil),
/// and six rows of the wrench on it follow those of the joints.
class Information {
 public:
  /// Columns are scaled to a root mean square of one over those states.
  /// @param loops  of a model with constraints, which outlive it
  Information(const Model& model, const std::vector<JointRange>& ranges, Rng& rng,
              const LoopRows* loops = nullptr);

  int num_parameters() const { return static_cast<int>(base_.size()); }
  /// Joints, and the numbers of the wrench on a base that floats.
  int num_rows() const { return static_cast<int>(noise_.size()); }
  /// Noise of what is measured, (num_rows()) [N·m] or [N]; rows are divided by it.
  void set_noise(const VecX<double>& noise) { noise_ = noise; }

  struct Rows {
    RowMatX<double> columns;  ///< (N · measured, base parameters), divided by the noise
    /// (N, num_rows()) that the model needs [N·m] or [N]; of a base that floats what would hold it.
    RowMatX<double> torque;
  };
  Rows rows(const MotionRows& motion);

 private:
  /// Columns of all parameters and the torque at one sample. @param F (num_rows(), parameters)
  void fill(const double* q, const double* qd, const double* qdd, RowMatX<double>& F,
            VecX<double>& torque);

  Tree<double> tree_;
  FitLayout layout_;
  VecX<double> links_, prior_, noise_;
  const LoopRows* loops_;
  std::optional<Recoil> recoil_;  ///< how a robot that floats gives way
  std::vector<int> measured_, base_;
  VecX<double> scale_;
  std::vector<std::vector<int>> effect_columns_;
  std::vector<double> scratch_;
  RegressorWorkspace<double, double> ws_;
};

/// log det of the information of rows, base parameters in the scale of the rows.
/// @return −∞ where they do not determine all of them
double log_det(const RowMatX<double>& columns);
/// Largest over smallest singular value.
double condition_number(const RowMatX<double>& columns);
/// Standard errors, (base parameters), of rows whose noise is one.
VecX<double> standard_errors(const RowMatX<double>& columns);

}  // namespace diffnea
