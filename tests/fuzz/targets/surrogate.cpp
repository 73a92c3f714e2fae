#include <diffnea/worlds/surrogate.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void surrogate(std::string_view input) {
  const InputFiles files(input, "ranges.json");
  result_or_error([&] { read_surrogate(files["ranges.json"]); });
}

}  // namespace diffnea::fuzz
