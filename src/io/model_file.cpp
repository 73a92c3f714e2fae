#include <algorithm>
#include <charconv>
#include <optional>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/asset_paths.hpp>
#include <diffnea/io/model_file.hpp>

#include "io/mjcf.hpp"
#include "io/mjcf_drawing.hpp"
#include "io/model_parts.hpp"
#include "io/urdf.hpp"
#include "io/urdf_drawing.hpp"
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

struct Original {
  std::string text;
  Format format;
};
/// The document that the model was read from; none if it is not there.
/// @throws FileError, ModelError if it cannot be read, or is no model
std::optional<Original> original_of(const Model& model) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(model.source, ignored)) return std::nullopt;
  std::string text = read_text_file(model.source);
  const Format format = format_of(text, model.source);
  return Original{std::move(text), format};
}

/// Refuses a body that neither format can say: an inertia tensor about a centre of no mass.
void require_masses(const Model& model, const std::string& where) {
  for (const ModelLink& link : model.links)
    if (link.inertia.m == 0.0 && !io::is_zero(link.inertia))
      throw ModelError(where + ": link '" + link.name +
                       "' has an inertia, but no mass to state a centre of; write it as .json");
}

/// What reading a document again brings up; empty if it can be read where it lies now: a run's copy
/// is not beside the original's meshes.
std::string why_unreadable(const std::filesystem::path& document, const ModelReading& reading) {
  try {
    read_model(document, reading);
    return "";
  } catch (const Error& error) {
    return error.what();
  }
}

/// Permissions that a model's document must have been read with: a base that floats there is fixed
/// or free as the model's is; constraints and couplings that the model has not were left out.
ModelReading reading_of(ModelReading reading, const Model& model) {
  reading.fix_base = !model.free_base;
  reading.free_base = model.free_base;
  reading.open_loops =
      model.constraints.empty() &&
      std::ranges::none_of(model.links, [](const ModelLink& link) { return !!link.follows; });
  return reading;
}

/// Tells whether joints of an MJCF were made fixed since it was read: its bodies would have to take
/// other poses, its actuators and key frames other sizes.
bool has_locked_joints(const Model& model) {
  return std::ranges::any_of(model.links, [&](const ModelLink& link) {
    const bool floats = model.free_base && &link == &model.links[0];
    return link.type == ModelJoint::kFixed && !link.joint.empty() && !floats;
  });
}

/// Tells whether actuators of this version of MuJoCo have a delay.
/// @throws ModelError for what is no version from 2.2 on
bool has_delays(const std::string& mujoco) {
  constexpr std::pair kOldest{2, 2}, kDelays{3, 5};
  std::pair<int, int> version{0, 0};
  const char* const end = mujoco.data() + mujoco.size();
  const auto major = std::from_chars(mujoco.data(), end, version.first);
  const bool dot = major.ec == std::errc() && major.ptr != end && *major.ptr == '.';
  if (!dot || std::from_chars(major.ptr + 1, end, version.second).ec != std::errc() ||
      version < kOldest)
    throw ModelError("--mujoco (mujoco=): got '" + mujoco +
                     "'; expected the oldest MuJoCo that has to load the file, e.g. 2.2 (all that "
                     "this project writes) or 3.5 (delays of drives, too)");
  return version >= kDelays;
}

/// In the document that the model was read from, if that has the form; else drawn anew.
std::string text_in_form(const Model& model, Format form, const std::string& where,
                         const ModelReading& reading, const ModelWriting& writing,
                         std::vector<std::string>& notes) {
  const std::optional<Original> original = original_of(model);
  const bool delays = has_delays(writing.mujoco);
  std::string lost;  // why the document cannot be kept
  if (original && original->format == form && form == Format::kMjcf && has_locked_joints(model))
    lost = ", in which joints were locked";
  else if (original && original->format == form)
    if (const std::string why = why_unreadable(model.source, reading_of(reading, model));
        !why.empty())
      lost = ", which cannot be read (" + why + ")";
  if (original && original->format == form && lost.empty()) {
    const std::filesystem::path folder = std::filesystem::path(model.source).parent_path();
    const std::string text =
        form == Format::kUrdf
            ? io::urdf_with_values(original->text, model.source, model, notes)
            : io::mjcf_with_values(
                  io::expand_mjcf(original->text, folder, model.source, reading_of(reading, model)),
                  model, delays, notes);
    return with_moved_paths(text, model.source, folder, std::filesystem::path(where).parent_path());
  }
  io::validate(model, where);
  require_masses(model, where);
  if (original && original->format != Format::kJson)
    notes.push_back("looks and shapes of the original document" + lost);
  if (form == Format::kUrdf) return io::draw_urdf(model, notes);
  const std::string text = io::draw_mjcf(model, delays, notes);
  io::compile_mjcf(io::expand_mjcf(text, "", where));  // MuJoCo refuses inertias that cannot be
  return text;
}

}  // namespace

Model read_model(const std::filesystem::path& path, const ModelReading& reading) {
  const std::string text = read_text_file(path), where = path.string();
  if (reading.fix_base && reading.free_base)
    throw ModelError(where +
                     ": --fix-base (fix_base=True) and --free-base (free_base=True) "
                     "contradict each other; choose one");
  switch (format_of(text, where)) {
    case Format::kUrdf:
      return io::model_from_urdf(text, where, reading);
    case Format::kMjcf:
      return io::model_from_mjcf(text, path.parent_path(), where, reading);
    case Format::kJson:
      break;
  }
  Model model = model_from_json(text, where);
  if (reading.free_base) let_base_float(model, where);
  if (reading.fix_base && model.free_base) {
    model.free_base = false;
    model.notes.push_back("base '" + model.links[0].name +
                          "' floats: fixed where the file has it, as asked");
  }
  return model;
}

Model read_model_or_run(const std::filesystem::path& path, const ModelReading& reading) {
  if (!std::filesystem::is_directory(path)) return read_model(path, reading);
  const std::filesystem::path fitted = path / "model.json";
  if (!std::filesystem::is_regular_file(fitted))
    throw FileError(path.string() + ": is a folder without model.json, so no run of a robot");
  Model model = read_model(fitted, reading);
  for (const char* name : {"model.urdf", "model.xml"}) {
    const std::filesystem::path document = path / name;
    if (std::filesystem::is_regular_file(document)) model.source = document.string();
  }
  return model;
}

std::string document_extension(const Model& model) {
  const std::optional<Original> original = original_of(model);
  if (!original || original->format == Format::kJson) return "";
  return original->format == Format::kUrdf ? ".urdf" : ".xml";
}

std::string read_mjcf(const std::filesystem::path& path, const ModelReading& reading) {
  const std::string text = read_text_file(path), where = path.string();
  if (format_of(text, where) != Format::kMjcf)
    throw ModelError(where +
                     ": is no MJCF (<mujoco>), which a simulated world needs; `diffnea export " +
                     where + " -o robot.xml` writes one");
  return io::self_contained_mjcf(io::expand_mjcf(text, path.parent_path(), where, reading));
}

void check_model_path(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  if (extension != ".json" && extension != ".urdf" && extension != ".xml" && extension != ".mjcf")
    throw ModelError(path.string() +
                     ": its extension names no format; choices: .json, .urdf, .xml");
}

std::vector<std::string> write_model(const Model& model, const std::filesystem::path& path,
                                     const ModelReading& reading, const ModelWriting& writing) {
  check_model_path(path);
  const std::string extension = path.extension().string();
  std::vector<std::string> notes;
  if (extension == ".json") {
    write_file_atomically(path, model_to_json(model));
    return notes;
  }
  const Format wanted = extension == ".urdf" ? Format::kUrdf : Format::kMjcf;
  write_file_atomically(path, text_in_form(model, wanted, path.string(), reading, writing, notes));
  return notes;
}

}  // namespace diffnea
