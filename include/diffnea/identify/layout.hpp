#pragma once
/// What a fit may move: the list of parameters, their prior, and the columns of the regression they
/// own.

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/model/model.hpp>

namespace diffnea {

/// A torque constant that is known worse than to a factor of 1.5 is not known.
inline constexpr double kGainScale = 0.5;

/// One scalar parameter of a fit.
struct FitParameter {
  std::string name;         ///< "forearm.mass", "elbow.coulomb_friction.coulomb"
  std::string unit;         ///< SI, as effects write it: "kg*m^2"
  Sign sign = Sign::kFree;  ///< that the fit keeps
  double prior = 0.0;  ///< value in the model before the fit, where what cannot be seen is held
  /// How far from the prior it may well be; sets what counts as identified. NaN: what makes its
  /// torque as large as the joint's.
  double scale = std::numeric_limits<double>::quiet_NaN();
  bool fixed = false;     ///< held at `prior`
  bool absorbed = false;  ///< fixed because the links' inertia absorbs it (absorbed_by_links)
  int dof = -1;           ///< index of a link in the tree, else −1
  int theta = -1;         ///< of a link or payload: index in θ, else −1
  int effect = -1;        ///< of an effect: index into FitLayout::effects, else −1
  int index = -1;         ///< of an effect: index into its parameters
  /// Smallest value that a shape takes in a motion fit.
  double least = -std::numeric_limits<double>::infinity();
  bool logarithmic =
      false;  ///< of a shape: it moves by a factor, a step is one of ln η (Scale::kLog)
  /// Of a joint's fixed transform (dof is set too): 0–2 roll, pitch, yaw of a rotation after the
  /// model's own, R_PJ = R₀ R_rpy(φ); 3–5 a step of p_PJ in the parent link. The paper's θ_K about
  /// the model's values.
  int kinematic = -1;
};

/// Linear parameters are columns of the regression; shape parameters are not, and move in passes
/// over the data: shapes of effects, fixed transforms, the tilt of the base (its torque is its
/// product with the links' first moments).
struct FitLayout {
  std::vector<FitParameter> linear;  ///< ten of every moving link, then those of effects
  std::vector<FitParameter> shape;   ///< those of effects, then six of every free transform
  std::vector<BoundEffect> effects;  ///< those of the model first, then those asked for
  int num_dofs = 0;                  ///< n, of the model's joints
  int base_rows = 0;                 ///< 6 where the base floats, else 0

  /// Rows of one instant: the torque of each joint, then of a base that floats its wrench [τ; f].
  int num_rows() const { return num_dofs + base_rows; }

  /// First column of the ten parameters of every link, and of a payload.
  std::vector<int> bodies() const;
  /// Columns that can be nonzero in one row, of num_rows(), ascending: the base carries all links.
  std::vector<int> columns_of_row(const Tree<double>& tree, int row) const;
  /// Values of all linear parameters before the fit.
  VecX<double> prior() const;
};

/// What a fit moves, by name.
struct FitChoice {
  /// Any of inertia, armature, effects, string, shapes, kinematics. Armature is the effect of that
  /// name; `effects` are all others; `shapes` their shape parameters, `kinematics` the fixed
  /// transforms of all joints or, as `kinematics@JOINT`, of one (both need several passes over the
  /// data). `string` is the length of a ball's string and where it is tied.
  std::vector<std::string> fit{"inertia", "armature", "effects", "string"};
  /// Effects beyond those of the model: "name" for every joint it suits, or "name@where". Not
  /// given: on the motor side armature, viscous and Coulomb friction and an offset at every joint;
  /// on the link side (torque measured behind the drive) the offset alone. Of a ball: linear drag
  /// on a string, quadratic drag in free flight.
  std::optional<std::vector<std::string>> effects;
  /// Parameters to hold: a name, or a pattern with *, at the model's value ("forearm.*") or at one
  /// that is given ("tip.payload.mass=2.8").
  std::vector<std::string> fix;
  bool link_side = false;  ///< where the torque was measured (contract, torque_side)
  bool simulated = false;  ///< the loss simulates runs, which have hidden motors (motion loss)
};

/// Name of a row of FitLayout::num_rows(), a joint's or base_tx … base_fz.
std::string row_name(const Model& model, int row);
/// Its unit, N*m or N.
std::string row_unit(const Model& model, int row);

/// @param runs  numbers of the recordings: effects with one parameter a run get one for each
/// @throws ModelError naming the choices if a group, effect, place or parameter does not exist
FitLayout make_layout(const Model& model, const FitChoice& choice, const std::vector<int>& runs);

/// The tree with the layout's fixed transforms at `shape`, in any scalar. `carrier`: R_LF of the
/// links' parents (map_to_tree), which the steps of p_PJ are expressed in.
template <Scalar T>
void move_joints(const FitLayout& layout, const std::vector<Mat3<double>>& carrier, const T* shape,
                 Tree<T>& tree) {
  for (std::size_t s = 0; s + 5 < layout.shape.size(); ++s) {
    if (layout.shape[s].kinematic != 0) continue;  // six in a row
    Pose<T>& X = tree.links[static_cast<std::size_t>(layout.shape[s].dof)].X_PJ;
    const T* d = shape + s;
    X.R = X.R * rotation_from_rpy<T>({d[0], d[1], d[2]});
    X.p = X.p + carrier[static_cast<std::size_t>(layout.shape[s].dof)] * Vec3<T>{d[3], d[4], d[5]};
  }
}
/// R_LP of every joint: its parent link P in the moving link L (or the world) that carries P.
std::vector<Mat3<double>> joint_carriers(const Model& model);

/// The model with fitted values in place: inertias, fixed transforms, and every effect of the
/// layout.
/// @param linear, shape  values in the order of the layout's lists
Model apply_fit(const Model& model, const FitLayout& layout, const VecX<double>& linear,
                const VecX<double>& shape);

}  // namespace diffnea
