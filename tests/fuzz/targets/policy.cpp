#include <diffnea/runs/policy_file.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void policy(std::string_view input) {
  const InputFiles files(input, "policy_0.json");
  LearnedPolicy read;
  if (result_or_error([&] { read = read_policy(files["policy_0.json"]); })) policy_json(read);
}

}  // namespace diffnea::fuzz
