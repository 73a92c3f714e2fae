/// The document of an MJCF before MuJoCo compiles it: includes in place, nothing that needs a file
/// without giving mass, meshes from the model's folder alone.

#include <algorithm>
#include <cstring>
#include <set>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>

#include "io/mjcf.hpp"
#include "io/mjcf_attach.hpp"
#include "io/mjcf_limits.hpp"
#include "io/mjcf_meshes.hpp"
#include "io/mjcf_parts.hpp"
#include "io/mjcf_translate.hpp"
#include "io/mjcf_versions.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Includes in includes; a chain this long is a mistake or an attack.
constexpr int kMaxIncludeDepth = 16;

/// @param from  folder of the file that the element is of, in the model's
void expand(XmlElement& element, Mjcf& mjcf, const std::filesystem::path& from,
            std::set<std::filesystem::path>& seen, int depth) {
  if (depth > kMaxIncludeDepth) throw ModelError(mjcf.where + ": includes are nested too deeply");
  for_each_child(element, nullptr, [&](XmlElement& e) {
    if (std::strcmp(e.Name(), "include") != 0) return expand(e, mjcf, from, seen, depth);
    const std::string name = attribute(e, "file"),
                      here = mjcf.where + ": " + mjcf.line(e) + ": <include>";
    if (name.empty()) throw ModelError(here + " names no file");
    const std::filesystem::path path =
        confined_path(mjcf.folder, (from / name).string(), mjcf.reading.allow_outside, here);
    if (!seen.insert(path).second)  // MuJoCo's own rule
      throw ModelError(here + " names '" + name + "', which is included more than once");
    const std::unique_ptr<XmlDocument> included = parse_xml(read_text_file(path), path.string());
    set_places(*included->RootElement(), static_cast<int>(mjcf.files.size()));
    mjcf.files.push_back(name);
    expand(*included->RootElement(), mjcf, from, seen, depth + 1);
    tinyxml2::XMLNode* after = &e;
    for (XmlElement* c = included->RootElement()->FirstChildElement(); c;
         c = c->NextSiblingElement())
      after = element.InsertAfterChild(after, clone_with_places(*c, *element.GetDocument()));
    element.DeleteChild(&e);
  });
}

AttachedFile read_attached(const XmlElement& model, Mjcf& mjcf) {
  const std::filesystem::path file = attribute(model, "file");
  const std::filesystem::path path =
      confined_path(mjcf.folder, file.string(), mjcf.reading.allow_outside,
                    mjcf.where + ": " + mjcf.line(model) + ": <model>");
  AttachedFile out{parse_xml(read_text_file(path), path.string()),
                   mjcf.folder / file.parent_path()};
  set_places(*out.document->RootElement(), static_cast<int>(mjcf.files.size()));
  mjcf.files.push_back(file.string());
  std::set<std::filesystem::path> seen{path};
  expand(*out.document->RootElement(), mjcf, file.parent_path(), seen, 1);
  return out;
}

/// The compiler would simulate an actuator to learn its length, for as long as the document says.
void without_simulation(XmlElement& root) {
  for_each_child(root, "compiler", [](XmlElement& c) { remove_children(c, "lengthrange"); });
  child(child(root, "compiler"), "lengthrange").SetAttribute("mode", "none");
}

/// Place of what is printed on a line of a document's text: parsed again, the same elements come in
/// the same order.
XmlPlace place_of_line(const std::string& text, int line, XmlElement& root) {
  const std::unique_ptr<XmlDocument> printed = parse_xml(text, "MJCF");
  std::vector<int> lines;
  walk(*printed->RootElement(), [&](XmlElement& e) { lines.push_back(e.GetLineNum()); });
  long ahead = std::ranges::find(lines, line) - lines.begin();
  XmlPlace place;
  walk(root, [&](XmlElement& e) {
    if (ahead-- == 0) place = place_of(e);
  });
  return place;
}

/// Words of MuJoCo's about what it does not know.
std::string hint_at_version(const std::string& reason) {
  for (const char* words : {"unrecognized", "invalid keyword", "too much data"})
    if (reason.find(words) != reason.npos)
      return std::string(" (it is MuJoCo ") + mj_versionString() + ", for which words up to " +
             kLatestMjcf + " are translated: one that is misspelt, or later)";
  return "";
}

}  // namespace

Mjcf expand_mjcf(const std::string& text, const std::filesystem::path& folder,
                 const std::string& where, const ModelReading& reading) {
  Mjcf out{.document = parse_xml(text, where),
           .folder = folder.empty() ? std::filesystem::path(".") : folder,
           .where = where,
           .reading = reading,
           .files = {where}};
  set_places(*out.document->RootElement(), 0);
  std::set<std::filesystem::path> seen;
  expand(*out.document->RootElement(), out, "", seen, 0);
  check_mjcf(*out.document->RootElement(), where);
  attach_models(out, [&](const XmlElement& model) { return read_attached(model, out); });
  return out;
}

std::string Mjcf::line(XmlPlace place) const {
  const std::string line = "line " + std::to_string(place.line);
  return place.file == 0 ? line : line + " of " + files[static_cast<std::size_t>(place.file)];
}

std::string Mjcf::line_of(const char* tag, const std::string& name) const {
  XmlElement& root = *document->RootElement();
  const XmlElement* found = nullptr;
  for_each_child(root, "worldbody", [&](XmlElement& world) {
    if (!found) found = find_named(world, tag, name);
  });
  return found ? " (" + line(*found) + ")" : "";
}

MujocoModel compile_mjcf(const Mjcf& mjcf, std::vector<std::string>* notes) {
  const std::unique_ptr<XmlDocument> translation = copy_with_places(*mjcf.document);
  XmlElement& root = *translation->RootElement();
  std::vector<std::string> unasked;
  translate_mjcf(root, mjcf, LostShape::kMarked, notes ? *notes : unasked);
  without_simulation(root);
  sim::MujocoFiles files;
  add_meshes(root, mjcf, files);
  const std::string text = xml_text(*translation);
  const auto line_name = [&](int line) {
    const XmlPlace place = place_of_line(text, line, root);
    return place.line > 0 ? mjcf.line(place) : "";
  };
  try {
    return sim::compile_mujoco(text, files, mjcf.where, line_name);
  } catch (const ModelError& error) {
    throw ModelError(error.what() + hint_at_version(error.what()));
  }
}

}  // namespace diffnea::io
