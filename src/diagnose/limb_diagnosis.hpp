#pragma once
/// Diagnosis of one limb whose drives follow commands: what others do has no part in its motion.
/// Internal to diagnose/.

#include <memory>
#include <optional>

#include "diagnose/motion_search.hpp"
#include "identify/limb_robots.hpp"

namespace diffnea {

/// Joints that drives of the model lead, (n).
std::vector<bool> led_joints(const Model& model);

/// Search for what a limb lacks, then its description.
class LimbDiagnosis {
 public:
  /// @param robot    of the fitted base
  /// @param base     its fit, of the whole robot; outlives it
  /// @param choice   of the limb's parameters
  /// @param asked    effects that are tried, "name@where"; none: all of the catalogue
  /// @param options  outlive it
  LimbDiagnosis(LimbRobot robot, const IdentifyResult& base, FitChoice choice,
                std::optional<std::vector<std::string>> asked, const RecordingSource& train,
                const RecordingSource* test, const MotionOptions& motion,
                const DiagnoseOptions& options);
  LimbDiagnosis(const LimbDiagnosis&) = delete;
  LimbDiagnosis& operator=(const LimbDiagnosis&) = delete;

  /// Fits the base, and what it lacks.
  void search();
  /// ΔBIC of the cause that it lacks least; +∞: none is left.
  double least();
  /// Leaves that one out.
  void drop_least();
  /// Fills finding(): causes with rivals and gains, candidates, parameters, errors of its joints.
  void describe();

  /// Tells whether no effect could be tried; after search().
  bool tries_nothing() const { return case_.candidates.empty(); }
  const LimbRobot& robot() const { return robot_; }
  const Finding& finding() const { return finding_; }
  const MotionSolution& base() const { return case_.base; }
  const MotionSolution& best() const { return case_.best; }
  double samples() const { return case_.search->samples(); }
  /// Held-out errors of the base and of the best.
  HeldOutBlocks held_out() const { return case_.search->held_out_blocks(base(), best()); }

 private:
  MotionSolution without(const EffectSpec& cause);

  LimbRobot robot_;
  std::optional<std::vector<std::string>> asked_;
  std::unique_ptr<RecordingSource> train_, test_;
  MotionSearchData of_;
  Finding finding_;
  const IdentifyResult& described_;
  WindowCase<MotionSearch> case_;
};

}  // namespace diffnea
