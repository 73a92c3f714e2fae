#include <diffnea/io/model_file.hpp>
#include <diffnea/worlds/world.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/read_model.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void mjcf(std::string_view input) {
  const InputFiles files(input, "model.xml", {"part.xml", "mesh.stl", "mesh.obj", "mesh.msh"});
  const InputFiles written("", "written.xml");
  read_and_keep(files["model.xml"]);
  result_or_error([&] { write_model(read_model(files["model.xml"]), written["written.xml"]); });
  result_or_error([&] { read_mjcf(files["model.xml"]); });
}

}  // namespace diffnea::fuzz
