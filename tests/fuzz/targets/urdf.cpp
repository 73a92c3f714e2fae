#include <diffnea/io/model_file.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/read_model.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void urdf(std::string_view input) {
  const InputFiles files(input, "model.urdf"), written("", "written.urdf");
  read_and_keep(files["model.urdf"]);
  result_or_error([&] { write_model(read_model(files["model.urdf"]), written["written.urdf"]); });
}

}  // namespace diffnea::fuzz
