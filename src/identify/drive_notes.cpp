#include "identify/drive_notes.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/text.hpp>

#include "core/constants.hpp"
#include "identify/drives.hpp"
#include "identify/passes.hpp"

namespace diffnea {
namespace {

/// Share of rows with a saturated drive from which a line says so.
constexpr double kOften = 0.5;
/// Gain over the fitted one that a drive may have whose gain is not told; share of the fitted one
/// between lower bounds that are tried, and below which none is told.
constexpr double kMuchStiffer = 10.0, kWeaker = 0.5, kNoGain = 1e-3;
/// Share of rows, and of the largest error, from which on a command counts as never reached.
constexpr double kAlways = 0.9, kFar = 0.5;
/// Gain over that of the description, or its inverse, that is near.
constexpr double kNear = 3.0;

/// A drive of the fit, its parameters as columns of layout.linear and of layout.shape.
struct FittedDrive {
  const BoundEffect& effect;
  long stiffness = -1, damping = -1, delay = -1, reach = -1, speed = -1;
};

FittedDrive drive_of(const FitLayout& layout, std::size_t effect) {
  FittedDrive out{layout.effects[effect]};
  const auto find = [&](const std::vector<FitParameter>& list, const char* name) {
    for (std::size_t k = 0; k < list.size(); ++k)
      if (list[k].effect == static_cast<int>(effect) && list[k].name.ends_with(name))
        return static_cast<long>(k);
    return -1L;
  };
  out.stiffness = find(layout.linear, ".stiffness");
  out.damping = find(layout.linear, ".damping");
  out.delay = find(layout.shape, ".delay");
  out.reach = find(layout.shape, ".reach");
  out.speed = find(layout.shape, ".speed");
  return out;
}

/// Value of a shape; `none` where the drive has no such shape.
double value_of(const VecX<double>& shape, long k, double none) { return k >= 0 ? shape[k] : none; }

/// A fit, and what is asked of it.
struct Fitted {
  const MotionData& data;
  const MotionClimb& climb;
  const Model& model;
  const MotionOptions& options;
};

/// Tells whether the windows do as well at other numbers.
/// @param fewer  parameters than the fit has
bool do_as_well(const Fitted& of, const VecX<double>& x, const VecX<double>& shape, double fewer) {
  const MotionProblem problem{of.model,     of.climb.layout(),      of.data.train,
                              of.data.runs, of.data.noise.position, of.climb.beginning().scale};
  const MotionFitter other(problem, of.options, x, shape);
  return does_as_well(other, of.climb, fewer);
}

/// Tells whether the windows would do as well without the drive's pull.
bool is_idle(const FittedDrive& drive, const Fitted& of) {
  VecX<double> x = of.climb.fitter().now().x;
  x[drive.stiffness] = 0.0;
  return do_as_well(of, x, of.climb.fitter().now().shape, 1.0);
}

/// Tells whether a drive with that many times the gain, of the same largest torque, does as well.
bool may_have_gain(const FittedDrive& drive, double by, const Fitted& of) {
  VecX<double> x = of.climb.fitter().now().x, shape = of.climb.fitter().now().shape;
  x[drive.stiffness] *= by;
  shape[drive.reach] /= by;
  return do_as_well(of, x, shape, 0.0);
}

/// "1.2 ± 0.01 N*m": torque of a drive at its reach.
std::string largest_torque(const FittedDrive& drive, const FitLayout& layout,
                           const MotionFit& fit) {
  const long r = fit.x.size() + drive.reach;
  const double K = fit.x[drive.stiffness], reach = fit.shape[drive.reach];
  const double variance = reach * reach * fit.covariance(drive.stiffness, drive.stiffness) +
                          K * K * fit.covariance(r, r) +
                          2.0 * K * reach * fit.covariance(drive.stiffness, r);
  const std::string per = layout.linear[static_cast<std::size_t>(drive.stiffness)].unit;
  return format_number(K * reach) + " ± " + format_number(std::sqrt(std::max(variance, 0.0))) +
         " " + per.substr(0, per.find('/'));
}

/// Time in which a drive answers [s]: its overdamped and its undamped one together.
/// @param inertia  that it moves
double answer_time(const FittedDrive& drive, const MotionFit& fit, double inertia) {
  const double K = fit.x[drive.stiffness], B = drive.damping >= 0 ? fit.x[drive.damping] : 0.0;
  return B / K + std::sqrt(inertia / K);
}

}  // namespace

void note_drives(const MotionData& data, const MotionClimb& climb, const Model& model,
                 const MotionOptions& options, ReportedErrors errors,
                 std::vector<std::string>& notes) {
  const FitLayout& layout = climb.layout();
  const MotionFit& fit = climb.fitter().now();
  std::vector<int> untold;  // joints
  std::vector<std::string> at;
  VecX<double> inertia;
  const Fitted of{data, climb, model, options};
  for (std::size_t e = 0; e < layout.effects.size(); ++e) {
    if (!layout.effects[e].info().has(Trait::kReadsCommand)) continue;
    const FittedDrive drive = drive_of(layout, e);
    if (drive.stiffness < 0) continue;
    const FitParameter& gain = layout.linear[static_cast<std::size_t>(drive.stiffness)];
    const int joint = drive.effect.joints.front();
    const std::string& name = drive.effect.where;
    const double K = fit.x[drive.stiffness], error = errors.linear[drive.stiffness];
    if (!gain.fixed && is_idle(drive, of)) {
      errors.identifiable[static_cast<std::size_t>(drive.stiffness)] = false;
      errors.linear[drive.stiffness] = kNaN;
      for (const long shape : {drive.delay, drive.reach, drive.speed})
        if (shape >= 0 && !layout.shape[static_cast<std::size_t>(shape)].fixed)
          errors.shape[shape] = kNaN;
      notes.push_back(kWarning + (name +
                                  " moves as if nothing drove it: without its drive the "
                                  "simulation is as good. Is the torque off (a column "
                                  "torque_enable_" +
                                  name + " says so), qcmd_" + name +
                                  " that of another joint (--map), or the joint passive "
                                  "(--passive " +
                                  name + ")?"));
      continue;
    }
    const double delay = value_of(fit.shape, drive.delay, 0.0),
                 speed = value_of(fit.shape, drive.speed, kNoBound),
                 reach = value_of(fit.shape, drive.reach, kNoBound);
    const double share =
        reach < kNoBound ? saturated_share(data.train, joint, delay, speed, reach) : 0.0;
    bool told =
        gain.fixed || (errors.identifiable[static_cast<std::size_t>(drive.stiffness)] && error < K);
    std::string least;
    if (!gain.fixed && share > kOften &&
        !layout.shape[static_cast<std::size_t>(drive.reach)].fixed &&
        may_have_gain(drive, kMuchStiffer, of)) {
      told = false;
      errors.identifiable[static_cast<std::size_t>(drive.stiffness)] = false;
      errors.linear[drive.stiffness] = errors.shape[drive.reach] = kNaN;
      double by = kWeaker;
      while (by > kNoGain && may_have_gain(drive, by, of)) by *= kWeaker;
      if (by > kNoGain) least = ", the gain at least " + format_number(by * K) + " " + gain.unit;
    }
    if (share > kOften)
      notes.push_back(
          "the drive of " + name + " gives all that it can in " + format_number(100.0 * share) +
          " % of the rows: " + largest_torque(drive, layout, fit) + least +
          (told ? "" : "; its gain and its reach are not told apart, only their product") +
          ". Steps and waves that are smaller show the gain");
    double most = 0.0;
    for (const MotionStretch& stretch : data.train)
      if (stretch.command) most = std::max(most, largest_error(stretch, joint, delay, speed));
    if (share < kOften && saturated_share(data.train, joint, delay, speed, kFar * most) > kAlways)
      notes.push_back(kWarning +
                      (name + " never gets near its commands: a drive that always "
                              "saturates moves as a weaker one, and as one in which more "
                              "friction acts. Record commands that it reaches"));
    if (inertia.size() == 0)
      inertia = link_inertias(model, position_range(data.train, layout.num_dofs));
    double moved = inertia[joint];
    for (std::size_t k = 0; k < layout.linear.size(); ++k)
      if (is_rotor(layout, layout.linear[k]) &&
          layout.effects[static_cast<std::size_t>(layout.linear[k].effect)].joints.front() == joint)
        moved += fit.x[static_cast<long>(k)];
    const double period = data.noise.period[joint], answer = answer_time(drive, fit, moved);
    if (period > answer)
      notes.push_back(kWarning +
                      ("rows are " + format_number(1e3 * period) + " ms apart, and the drive of " +
                       name + " answers in " + format_number(1e3 * answer) +
                       " ms: between two rows anything may happen. Log faster"));
    if (told || share > kOften) continue;
    const bool is_near = gain.prior > 0.0 && K < kNear * gain.prior && K > gain.prior / kNear;
    untold.push_back(joint);
    at.push_back(name + " (" + format_number(K) + " " + gain.unit +
                 (is_near ? ", near that of the description)" : ")"));
  }
  if (untold.empty()) return;
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    const FitParameter& p = layout.linear[k];
    const long column = static_cast<long>(k);
    if (p.fixed || p.effect < 0 || errors.linear[column] < std::abs(fit.x[column])) continue;
    const std::vector<int>& joints = layout.effects[static_cast<std::size_t>(p.effect)].joints;
    if (joints.empty() || std::ranges::find(untold, joints.front()) == untold.end()) continue;
    errors.identifiable[k] = false;
    errors.linear[column] = kNaN;
  }
  notes.push_back("the links do not tell how large the gain of the drive is at " +
                  detail::join(at) +
                  "; ratios to it are told. To set it: --fix \"JOINT.position_servo.stiffness=K\"");
}

}  // namespace diffnea
