#include <diffnea/io/sidecar.hpp>
#include <diffnea/recording/joints.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void csv_model(std::string_view input) {
  const InputFiles files(input, "data.csv", {"data.json"});
  const std::vector<JointDescription> joints{
      {.name = "a", .lower = -3.0, .upper = 3.0, .effort = 40.0},
      {.name = "b", .prismatic = true},
      {.name = "c", .passive = true}};
  result_or_error([&] {
    ReadOptions options = with_sidecar(files["data.csv"]);
    options.joints = joints;
    std::vector<Recording> recordings = read_recordings(files["data.csv"], options);
    match_joints(joints, recordings);
    find_degrees(joints, recordings);
    blank_absurd_torque(joints, recordings);
    find_excess_torque(joints, recordings);
  });
}

}  // namespace diffnea::fuzz
