#include <diffnea/runs/ball_network_file.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void ball_network(std::string_view input) {
  const InputFiles files(input, kBallNetworkFile);
  result_or_error([&] { read_ball_network(files[kBallNetworkFile]); });
}

}  // namespace diffnea::fuzz
