/// A cause of one's own for a diagnosis, and how to find out whether it can be found: plant it in
/// recordings that lack it, and see whether the diagnosis names it.
///
///     own_candidate MODEL TRAIN.csv TEST.csv     a rubber stop at the last joint, from 0.2 rad on

#include <cstdio>
#include <exception>

#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/recording/csv.hpp>

namespace {

constexpr double kStop = 0.2, kStiffness = 3.0;  // [rad], [N·m/rad]

/// Torque for one unit of stiffness, row by row.
diffnea::VecX<double> pressed(const diffnea::RowMatX<double>& q) {
  return (q.rightCols(1).array() - kStop).max(0.0).matrix();
}

std::vector<diffnea::Recording> with_stop(std::vector<diffnea::Recording> runs) {
  for (diffnea::Recording& run : runs) run.tau.rightCols(1) += kStiffness * pressed(run.q);
  return runs;
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s MODEL TRAIN.csv TEST.csv\n", argv[0]);
    return 2;
  }
  const diffnea::Model model = diffnea::read_model(argv[1]);
  const std::vector<diffnea::Recording> train = diffnea::read_recordings(argv[2]),
                                        test = diffnea::read_recordings(argv[3]);

  diffnea::DiagnoseOptions options;
  options.candidates = {{.name = "rubber_stop",
                         .where = train.front().joint_names.back(),
                         .parameters = {{.name = "stiffness",
                                         .unit = "N*m/rad",
                                         .unit_prismatic = "N/m",
                                         .sign = diffnea::Sign::kNonNegative}},
                         .columns = [](const diffnea::JointSeries& x) -> diffnea::RowMatX<double> {
                           return pressed(x.q);
                         }}};

  const diffnea::Finding without = diffnea::diagnose(model, train, test, options);
  std::printf("as recorded: %s\n", without.sentence.c_str());
  const diffnea::Finding with =
      diffnea::diagnose(model, with_stop(train), with_stop(test), options);
  std::printf("planted:     %s\n", with.sentence.c_str());
  for (const diffnea::Cause& cause : with.causes)
    if (cause.effect == "rubber_stop") return 0;
  return 3;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
