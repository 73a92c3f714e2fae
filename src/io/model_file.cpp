#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/io/atomic_file.hpp>
#include <diffnea/io/model_file.hpp>

#include "io/mjcf.hpp"
#include "io/urdf.hpp"
#include "io/xml.hpp"

namespace diffnea {
namespace {

enum class Format { kUrdf, kMjcf, kJson };

Format format_of(const std::string& text, const std::string& where) {
  const std::size_t first =
      text.find_first_not_of(" \t\r\n\xEF\xBB\xBF");  // a byte-order mark may lead
  if (first == std::string::npos) throw ModelError(where + ": is empty");
  if (text[first] == '{') return Format::kJson;
  if (text[first] != '<')
    throw ModelError(
        where + ": is no robot description; expected URDF (<robot>), MJCF (<mujoco>) or JSON ({)");
  const std::string root = io::parse_xml(text, where)->RootElement()->Name();
  if (root == "robot") return Format::kUrdf;
  if (root == "mujoco") return Format::kMjcf;
  throw ModelError(
      where + ": its root element is <" + root +
      ">; expected <robot> (URDF) or <mujoco> (MJCF). A xacro or SDF file must be converted first");
}

}  // namespace

Model read_model(const std::filesystem::path& path) {
  const std::string text = read_text_file(path), where = path.string();
  switch (format_of(text, where)) {
    case Format::kUrdf:
      return io::model_from_urdf(text, where);
    case Format::kMjcf:
      return io::model_from_mjcf(text, path.parent_path(), where);
    case Format::kJson:
      break;
  }
  return model_from_json(text, where);
}

std::string read_mjcf(const std::filesystem::path& path) {
  const std::string text = read_text_file(path), where = path.string();
  if (format_of(text, where) != Format::kMjcf)
    throw ModelError(where + ": is no MJCF (<mujoco>), which a simulated world needs");
  return io::self_contained_mjcf(io::expand_mjcf(text, path.parent_path(), where));
}

std::vector<std::string> write_model(const Model& model, const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  std::vector<std::string> notes;
  if (extension == ".json") {
    write_file_atomically(path, model_to_json(model));
    return notes;
  }
  if (extension != ".urdf" && extension != ".xml" && extension != ".mjcf")
    throw ModelError(path.string() +
                     ": its extension names no format; choices: .json, .urdf, .xml");
  const Format wanted = extension == ".urdf" ? Format::kUrdf : Format::kMjcf;
  const std::string original = read_text_file(model.source);
  if (format_of(original, model.source) != wanted)
    throw ModelError(path.string() + ": the model was read from " + model.source +
                     ", which has another format; write it as .json");
  const std::filesystem::path folder = std::filesystem::path(model.source).parent_path();
  write_file_atomically(path,
                        wanted == Format::kUrdf
                            ? io::urdf_with_values(original, model.source, model, notes)
                            : io::mjcf_with_values(original, folder, model.source, model, notes));
  return notes;
}

}  // namespace diffnea
