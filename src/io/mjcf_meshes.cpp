#include "io/mjcf_meshes.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <sstream>
#include <string_view>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>

namespace diffnea::io {
namespace {

/// Whether `word` is one from its first to its last character.
template <typename Number>
bool is_number(std::string_view word, Number& value) {
  const auto [end, status] = std::from_chars(word.data(), word.data() + word.size(), value);
  return status == std::errc() && end == word.data() + word.size();
}

constexpr long kMinVertices = 4;  ///< of a body with a volume

void require_volume(long vertices, const std::string& where) {
  if (vertices < kMinVertices)
    throw ModelError(where + ": has " + std::to_string(vertices) + " vertices, expected at least " +
                     std::to_string(kMinVertices) + " (a mesh gives its body mass)");
}

[[noreturn]] void refuse_index(std::string_view index, long count, const char* what,
                               const std::string& where) {
  throw ModelError(where + ": a face names " + what + " '" + std::string(index) + "' of " +
                   std::to_string(count));
}

/// What a face of an OBJ names: vertices, texture coordinates, normals. Counted from 1, or from -1
/// backwards.
constexpr std::array<const char*, 3> kCornerParts = {"vertex", "texture coordinate", "normal"};
using Counts = std::array<long, 3>;

std::string_view next_word(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(" \t"));
  line.remove_prefix(word.size());
  return word;
}

/// Calls visit(keyword, rest of the line, number of the line); lines end as tinyobjloader's do.
template <typename Visit>
void for_each_line(std::string_view text, Visit visit) {
  for (long number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    std::string_view line = text.substr(0, end);
    const std::string_view keyword = next_word(line);
    visit(keyword, line, number);
    text.remove_prefix(end + (text.substr(end, 2) == "\r\n" ? 2 : end < text.size()));
  }
}

/// `corner` is v, v/t, v//n or v/t/n.
void check_corner(std::string_view corner, const Counts& so_far, const Counts& total,
                  const std::string& where) {
  for (std::size_t part = 0; part < kCornerParts.size(); ++part) {
    const std::string_view index = corner.substr(0, corner.find('/'));
    corner.remove_prefix(index.size());
    const bool skipped = part == 1 && index.empty() && corner.size() > 1;
    if (!skipped) {
      long i = 0;
      if (!is_number(index, i) || i == 0 || i > total[part] || i < -so_far[part])
        refuse_index(index, total[part], kCornerParts[part], where);
    }
    if (corner.empty()) return;
    corner.remove_prefix(1);
  }
  throw ModelError(where + ": a face has a corner of more than three indices");
}

void check_obj(std::string_view text, const std::string& where) {
  if (text.find('\0') != text.npos)
    throw ModelError(where + ": holds a NUL byte, expected the text of an OBJ");
  const auto count = [](std::string_view keyword, Counts& counts) {
    const std::array<std::string_view, 3> kKeywords = {"v", "vt", "vn"};
    const auto found = std::ranges::find(kKeywords, keyword);
    if (found != kKeywords.end()) ++counts[static_cast<std::size_t>(found - kKeywords.begin())];
  };
  Counts total{}, so_far{};
  for_each_line(text,
                [&](std::string_view keyword, std::string_view, long) { count(keyword, total); });
  require_volume(total[0], where);
  for_each_line(text, [&](std::string_view keyword, std::string_view rest, long number) {
    count(keyword, so_far);
    if (keyword != "f") return;
    const std::string line = where + ": line " + std::to_string(number);
    for (std::string_view corner = next_word(rest); !corner.empty(); corner = next_word(rest))
      check_corner(corner, so_far, total, line);
  });
}

/// The vertices and faces of an OBJ, which are all that is asked for. Of a corner without a normal,
/// MuJoCo 2.2 reads what lies in memory before the file's normals.
std::string shape_of_obj(std::string_view text) {
  std::string out;
  for_each_line(text, [&](std::string_view keyword, std::string_view rest, long) {
    if (keyword == "vn" || keyword == "vt") return;
    out += keyword;
    if (keyword == "f")
      for (std::string_view corner = next_word(rest); !corner.empty(); corner = next_word(rest))
        out.append(" ").append(corner.substr(0, corner.find('/')));
    else
      out += rest;
    out += '\n';
  });
  return out;
}

/// MuJoCo's own format: counts of vertices, normals, texture coordinates and faces as int32, then
/// 3, 3 and 2 floats each, then 3 int32 a face. What does not fit together it says itself.
void check_msh(std::string_view bytes, const std::string& where) {
  std::array<std::int32_t, 4> counts{};
  if (bytes.size() < sizeof counts) return;
  std::memcpy(counts.data(), bytes.data(), sizeof counts);
  if (std::ranges::any_of(counts, [](std::int32_t n) { return n < 0; })) return;
  const auto [vertices, normals, texcoords, faces] = counts;
  const std::uint64_t begin =
      sizeof counts + sizeof(float) * (3 * (std::uint64_t(vertices) + std::uint64_t(normals)) +
                                       2 * std::uint64_t(texcoords));
  if (bytes.size() != begin + sizeof(std::int32_t) * 3 * std::uint64_t(faces)) return;
  require_volume(vertices, where);
  for (std::uint64_t at = begin; at < bytes.size(); at += sizeof(std::int32_t)) {
    std::int32_t index = 0;
    std::memcpy(&index, bytes.data() + at, sizeof index);
    if (index < 0 || index >= vertices)
      refuse_index(std::to_string(index), vertices, "vertex", where);
  }
}

/// Vertices and faces among the attributes; counted from 0. MuJoCo reads up to the first word that
/// is no number.
void check_inline(const XmlElement& mesh, const std::string& where) {
  long numbers = 0;
  std::string word;
  for (std::istringstream words(attribute(mesh, "vertex")); words >> word; ++numbers)
    if (double value = 0; !is_number(word, value))
      throw ModelError(where + ": vertex holds '" + word + "', expected numbers");
  const long vertices = numbers / 3;
  require_volume(vertices, where);
  for (std::istringstream words(attribute(mesh, "face")); words >> word;)
    if (long index = 0; !is_number(word, index) || index < 0 || index >= vertices)
      refuse_index(word, vertices, "vertex", where);
}

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return text;
}

/// An STL of MuJoCo's has triangles of their own vertices, and no indices.
void check_content(std::string_view content, const std::string& extension,
                   const std::string& where) {
  if (content.empty()) throw ModelError(where + ": is an empty file, expected a mesh");
  if (extension == ".obj") check_obj(content, where);
  if (extension == ".msh") check_msh(content, where);
}

/// Body whose mass the mesh is part of, for a message; empty if there is none.
std::string weighed_by(XmlElement& root, const std::string& mesh, const Mjcf& mjcf) {
  std::string out;
  walk(root, [&](XmlElement& geom) {
    if (!out.empty() || !is(geom, "geom") || attribute(geom, "mesh") != mesh) return;
    const XmlElement& body = *geom.Parent()->ToElement();
    out = "body '" + attribute(body, "name") + "' (" + mjcf.line(body) + ")";
  });
  return out;
}

}  // namespace

std::filesystem::path mesh_folder(XmlElement& root) {
  std::string folder;
  for_each_child(root, "compiler", [&](XmlElement& c) {
    for (const char* name : {"assetdir", "meshdir"})
      if (c.Attribute(name)) folder = attribute(c, name);
  });
  return folder;
}

std::string mesh_name(const XmlElement& mesh) {
  const std::string name = attribute(mesh, "name");
  return name.empty() ? std::filesystem::path(attribute(mesh, "file")).stem().string() : name;
}

void add_meshes(XmlElement& root, const Mjcf& mjcf, sim::MujocoFiles& files) {
  const std::filesystem::path folder = mesh_folder(root);
  for_each_child(root, "compiler", [](XmlElement& c) {  // all files are found in memory
    for (const char* name : {"meshdir", "texturedir"}) c.DeleteAttribute(name);
  });
  int count = 0;
  walk(root, [&](XmlElement& mesh) {
    if (!is(mesh, "mesh")) return;
    const std::filesystem::path file = attribute(mesh, "file");
    if (mesh.Attribute("file")) mesh.SetAttribute("name", mesh_name(mesh).c_str());
    const std::string name = attribute(mesh, "name"), here = mjcf.where + ": mesh '" + name + "'";
    const bool stated = mesh.Attribute("vertex") || mesh.Attribute("face");
    if (stated) check_inline(mesh, here);
    if (!mesh.Attribute("file")) return;
    if (stated)
      throw ModelError(here + ": names a file and states vertices or faces, expected one of both");
    std::filesystem::path path;
    try {
      path = confined_path(mjcf.folder, (folder / file).string(), mjcf.reading.allow_outside, here);
    } catch (const FileError& error) {
      throw FileError(std::string(error.what()) + "; it gives " + weighed_by(root, name, mjcf) +
                      " mass: put it there, or state the body's <inertial>");
    }
    const std::string extension = path.extension().string(), kind = lower(extension);
    std::string content = read_text_file(path);
    check_content(content, kind, here + " (" + file.string() + ")");
    if (kind == ".obj") content = shape_of_obj(content);
    const std::string flat = "mesh" + std::to_string(count++) + extension;
    files.add(flat, content, mjcf.where);
    mesh.SetAttribute("file", flat.c_str());
  });
}

}  // namespace diffnea::io
