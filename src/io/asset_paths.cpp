#include <algorithm>
#include <array>
#include <memory>
#include <string_view>

#include <diffnea/io/asset_paths.hpp>

#include "io/xml.hpp"

namespace diffnea {
namespace {

namespace fs = std::filesystem;

/// Attributes are file, fileup, fileleft …
bool names_file(const io::XmlElement& e) {
  constexpr std::array kAssets{"mesh", "texture", "hfield", "skin"};
  if (std::ranges::none_of(kAssets, [&](const char* tag) { return io::is(e, tag); })) return false;
  for (const tinyxml2::XMLAttribute* a = e.FirstAttribute(); a; a = a->Next())
    if (std::string_view(a->Name()).starts_with("file")) return true;
  return false;
}

/// MuJoCo looks for a mesh in `meshdir` (`assetdir`), and for a texture in `texturedir`.
template <class Moved>
void move_folders(io::XmlElement& root, const Moved& moved) {
  bool any = false;
  io::walk(root, [&](const io::XmlElement& e) { any |= names_file(e); });
  if (!any) return;
  std::array stated{false, false};
  constexpr std::array kKinds{"meshdir", "texturedir"};
  io::for_each_child(root, "compiler", [&](io::XmlElement& c) {
    for (const char* name : {"assetdir", kKinds[0], kKinds[1]}) {
      if (!c.Attribute(name)) continue;
      c.SetAttribute(name, moved(io::attribute(c, name)).c_str());
      for (std::size_t k = 0; k < kKinds.size(); ++k)
        stated[k] |= std::string_view(name) == "assetdir" || std::string_view(name) == kKinds[k];
    }
  });
  for (std::size_t k = 0; k < kKinds.size(); ++k)
    if (!stated[k]) io::child(root, "compiler").SetAttribute(kKinds[k], moved("").c_str());
}

}  // namespace

std::string with_moved_paths(const std::string& text, const std::string& where,
                             const fs::path& from, const fs::path& to) {
  const fs::path old_folder = fs::current_path() / from, new_folder = fs::current_path() / to;
  std::error_code ignored;
  if (fs::equivalent(old_folder, new_folder, ignored)) return text;
  const auto moved = [&](const std::string& path) {
    if (fs::path(path).is_absolute()) return path;
    const fs::path file = old_folder / path, way = fs::relative(file, new_folder, ignored);
    return (way.empty() ? file : way).generic_string();
  };
  const std::unique_ptr<io::XmlDocument> document = io::parse_xml(text, where);
  io::XmlElement& root = *document->RootElement();
  if (io::is(root, "mujoco")) {
    move_folders(root, moved);
  } else {
    io::walk(root, [&](io::XmlElement& e) {
      const std::string file = io::attribute(e, "filename");
      if (!file.empty() && fs::is_regular_file(old_folder / file, ignored))
        e.SetAttribute("filename", moved(file).c_str());
    });
  }
  return io::xml_text(*document);
}

}  // namespace diffnea
