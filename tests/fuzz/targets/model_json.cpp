#include "fuzz/input_files.hpp"
#include "fuzz/read_model.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void model_json(std::string_view input) {
  const InputFiles files(input, "model.json");
  read_and_keep(files["model.json"]);
}

}  // namespace diffnea::fuzz
