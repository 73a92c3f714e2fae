#pragma once
/// What a fit may move: the list of parameters, their prior, and the columns of the regression they own.

#include <diffnea/effects/catalogue.hpp>
#include <diffnea/model/model.hpp>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace diffnea {

/// One scalar parameter of a fit.
struct FitParameter {
  std::string name;  ///< "forearm.mass", "elbow.coulomb_friction.coulomb"
  std::string unit;
  Sign sign = Sign::kFree;
  double prior = 0.0;  ///< value in the model before the fit, where what cannot be seen is held
  /// How far from the prior it may well be; sets what counts as identified. NaN: what makes its torque as
  /// large as the joint's.
  double scale = std::numeric_limits<double>::quiet_NaN();
  bool fixed = false;
  int dof = -1;    ///< of a link: the degree of freedom that moves it, else −1
  int theta = -1;  ///< of a link or payload: index in θ, else −1
  int effect = -1;  ///< of an effect: index into FitLayout::effects, else −1
  int index = -1;   ///< of an effect: index into its parameters
};

/// Linear parameters are columns of the regression; shape parameters are not.
struct FitLayout {
  std::vector<FitParameter> linear;
  std::vector<FitParameter> shape;
  std::vector<BoundEffect> effects;  ///< those of the model first, then those asked for
  int num_dofs = 0;

  /// First column of the ten parameters of every link, and of a payload.
  std::vector<int> bodies() const;
  /// Columns that can be nonzero in the torque of joint j, ascending.
  std::vector<int> columns_of_joint(const Tree<double>& tree, int joint) const;
  VecX<double> prior() const;
};

/// What a fit moves, by name.
struct FitChoice {
  /// Any of inertia, armature, effects, shapes. Armature is the effect of that name; `effects` are all
  /// others; `shapes` their shape parameters (needs several passes over the data).
  std::vector<std::string> fit{"inertia", "armature", "effects"};
  /// Effects beyond those of the model: "name" for every joint it suits, or "name@where". Not given: on
  /// the motor side armature, viscous and Coulomb friction and an offset at every joint; on the link side
  /// (torque measured behind the drive) the offset alone.
  std::optional<std::vector<std::string>> effects;
  /// Parameters to hold at the model's value: a name, or a pattern with *, e.g. "forearm.*".
  std::vector<std::string> fix;
  bool link_side = false;  ///< where the torque was measured (contract, torque_side)
};

/// @param runs  numbers of the recordings: effects with one parameter a run get one for each
/// @throws ModelError naming the choices if a group, effect, place or parameter does not exist
FitLayout make_layout(const Model& model, const FitChoice& choice, const std::vector<int>& runs);

/// The model with fitted values in place: inertias, and every effect of the layout.
/// @param linear, shape  values in the order of the layout's lists
Model apply_fit(const Model& model, const FitLayout& layout, const VecX<double>& linear,
                const VecX<double>& shape);

}  // namespace diffnea
