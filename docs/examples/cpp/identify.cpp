/// Identify a robot from recordings, and ask the fitted model for torques.
///
///     identify MODEL TRAIN.csv TEST.csv

#include <cstdio>
#include <exception>

#include <diffnea/effects/extended_tree.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/recording/csv.hpp>

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s MODEL TRAIN.csv TEST.csv\n", argv[0]);
    return 2;
  }
  const diffnea::Model model = diffnea::read_model(argv[1]);
  const diffnea::IdentifyResult result = diffnea::identify(model, diffnea::read_recordings(argv[2]),
                                                           diffnea::read_recordings(argv[3]));

  for (const diffnea::ParameterEstimate& p : result.parameters)
    if (p.identifiable && !p.fixed)
      std::printf("%-32s %10.4f ± %.4f %s\n", p.name.c_str(), p.value, p.std, p.unit.c_str());
  for (const diffnea::JointError& e : result.errors)
    std::printf("%s: rms error %.3g %s before, %.3g after (held out)\n", e.joint.c_str(),
                e.nominal_test, e.unit.c_str(), e.test);

  // The fitted model computes: torques that hold the robot still in its zero posture.
  const diffnea::ExtendedTree robot = diffnea::extend(result.model);
  const diffnea::RowMatX<double> still = diffnea::RowMatX<double>::Zero(1, robot.tree.num_dofs());
  const diffnea::RowMatX<double> tau = diffnea::inverse_dynamics(robot, still, still, still);
  for (long j = 0; j < tau.cols(); ++j)
    std::printf("%s%.3f", j == 0 ? "at rest: " : ", ", tau(0, j));
  std::printf(" N·m\n");
  return result.summary.converged ? 0 : 3;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
