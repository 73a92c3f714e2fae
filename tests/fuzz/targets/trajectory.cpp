#include <diffnea/io/trajectory_file.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void trajectory(std::string_view input) {
  const InputFiles files(input, "motion.csv");
  result_or_error([&] { read_trajectory(files["motion.csv"]); });
}

}  // namespace diffnea::fuzz
