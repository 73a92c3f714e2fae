#include "recording/foreign_file.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include <diffnea/core/error.hpp>

namespace diffnea::detail {
namespace {

constexpr std::pair<const char*, const char*> kForeign[] = {
    {".mcap", "a ROS 2 bag"},  {".db3", "a ROS 2 bag"},        {".bag", "a ROS 1 bag"},
    {".mat", "a MATLAB file"}, {".parquet", "a Parquet file"}, {".npz", "an NPZ file"}};

constexpr std::array<std::string_view, 4> kDescriptions{".urdf", ".xml", ".mjcf", ".json"};

/// As a shell takes it.
std::string shell_quoted(const std::string& text) {
  constexpr const char* kPlain =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./,:+@%=";
  if (!text.empty() && text.find_first_not_of(kPlain) == std::string::npos) return text;
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

}  // namespace

void refuse_foreign_file(const std::filesystem::path& path, const std::string& name) {
  std::error_code ignored;
  std::string kind;
  std::filesystem::path csv = path;
  if (std::filesystem::is_directory(path, ignored)) {
    if (!std::filesystem::exists(path / "metadata.yaml", ignored)) return;
    kind = "the folder of a ROS 2 bag";
    csv = path.has_filename() ? path : path.parent_path();
    csv += ".csv";
  }
  for (const auto& [ending, what] : kForeign)
    if (kind.empty() && path.extension() == ending) {
      kind = what;
      csv.replace_extension(".csv");
    }
  const bool exists = std::filesystem::exists(path, ignored);
  if (exists && std::ranges::find(kDescriptions, path.extension()) != kDescriptions.end())
    throw FileError(name + ": is no recording (.csv); a robot description is given as the model (" +
                    "first, or as --model)");
  if (kind.empty()) return;
  throw FileError(name + ": is " + kind +
                  "; CSV is read here. Convert it first: python -m diffnea.convert " +
                  shell_quoted(path.string()) + " -o " + shell_quoted(csv.string()));
}

}  // namespace diffnea::detail
