#pragma once
/// Springs and gaps in gears as parameters of fits that simulate runs: where they begin, and what
/// the rest of the model is without them. Internal to identify/.

#include "identify/motion_climb.hpp"

namespace diffnea {

/// Horizon at which sizes of gears compete [s], as beginnings of drives do: in longer windows what
/// flies free is astray by the time it meets the other flank.
inline constexpr double kTrialOfGears = 1.0;

/// Pieces of windows, no longer than a horizon, spread over them.
std::vector<MotionWindow> some_pieces(const std::vector<MotionStretch>& stretches,
                                      const std::vector<MotionWindow>& windows, double horizon);

/// Tells whether a layout has effects that hide a motor.
bool has_gears(const FitLayout& layout);

/// Stiffness of a joint's drive [N·m/rad] or [N/m]; 0: none leads it. @param x  linear parameters
double drive_gain(const FitLayout& layout, const VecX<double>& x, int joint);

/// Inertia of a joint's rotor [kg·m²] or [kg]; 0: it has none. @param x  linear parameters
double rotor_of(const FitLayout& layout, const VecX<double>& x, int joint);

/// Values at which a gear's size is looked for, those nearest to a rigid one first. Springs: up to
/// where the drive's largest torque winds them up by less than the encoder's noise; gaps: beyond
/// that noise. Those of the catalogue where no drive leads the joint.
/// @param x, shape  linear parameters and shapes of the layout: the joint's drive
std::vector<double> gear_sizes(const BoundEffect& gear, const FitLayout& layout,
                               const VecX<double>& x, const VecX<double>& shape,
                               const MotionData& data);

/// Index of the parameter that gear_sizes() is of.
std::size_t gear_size(const BoundEffect& gear);

/// Sets what windows take for granted of a gear whose file does not say: flanks of a gap that give
/// way little beside what the drive does, and the rotor by which teeth meet.
/// @param gain, rotor  of the joint
void set_flanks(double gain, double rotor, BoundEffect& gear);

/// How much less than its own width the gap of such flanks is [rad] or [m], if true ones do not
/// give way: by what both do under the mean torque of the joint's drive. 0 of a spring.
/// @param gear  with its values  @param x, shape  as for gear_sizes()
double flank_give(const BoundEffect& gear, const FitLayout& layout, const VecX<double>& x,
                  const VecX<double>& shape, const MotionData& data);

/// Effects of the model that hide a motor get the armature of their joint as its inertia.
void set_rotors(Model& model);

/// A layout without some of its effects.
struct LayoutPart {
  FitLayout layout;
  std::vector<int> effects;  ///< for each of its effects, its index in the whole
  std::vector<int> shapes;   ///< for each of its shapes, its index in the whole
};
/// @param leave_out  of none of which a linear parameter is
LayoutPart without(const FitLayout& layout,
                   const std::function<bool(const BoundEffect&)>& leave_out);

/// The best_beginning() of rigid gears, then with each at the size, of those that
/// gear_sizes() has, from which a few steps lead furthest. Sizes that the model or --fix has stay.
MotionBeginning beginning_with_gears(const Model& model, const MotionData& data,
                                     const FitLayout& layout, const std::vector<double>& ladder,
                                     const MotionOptions& options,
                                     const std::function<bool(int, double)>& progress);

}  // namespace diffnea
