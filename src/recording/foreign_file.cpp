#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>
#include <utility>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/foreign_file.hpp>

namespace diffnea {
namespace {

constexpr std::pair<const char*, const char*> kForeign[] = {
    {".mcap", "a ROS 2 bag"},  {".db3", "a ROS 2 bag"},        {".bag", "a ROS 1 bag"},
    {".mat", "a MATLAB file"}, {".parquet", "a Parquet file"}, {".npz", "an NPZ file"}};

constexpr std::array<std::string_view, 4> kDescriptions{".urdf", ".xml", ".mjcf", ".json"};

/// A log of BAM names its rows so; its bench, which comes first, takes some hundred bytes.
constexpr std::string_view kEntries = "\"entries\"";
constexpr std::size_t kBeginning = 4096;

bool is_log_of_bam(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string beginning(kBeginning, '\0');
  file.read(beginning.data(), static_cast<std::streamsize>(kBeginning));
  return beginning.find(kEntries) != std::string::npos;
}

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

std::string foreign_kind(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    if (std::filesystem::exists(path / "metadata.yaml", ignored))
      return "the folder of a ROS 2 bag";
    if (std::filesystem::exists(path / "meta" / "info.json", ignored)) return "a LeRobot data set";
    return "";
  }
  for (const auto& [ending, what] : kForeign)
    if (path.extension() == ending) return what;
  if (path.extension() == ".json" && is_log_of_bam(path)) return "a log of BAM";
  return "";
}

void refuse_foreign_file(const std::filesystem::path& path, const std::string& name) {
  std::error_code ignored;
  const std::string kind = foreign_kind(path);
  const bool exists = std::filesystem::exists(path, ignored);
  if (kind.empty() && exists &&
      std::ranges::find(kDescriptions, path.extension()) != kDescriptions.end())
    throw FileError(name + ": is no recording (.csv); a robot description is given as the model (" +
                    "first, or as --model)");
  if (kind.empty()) return;
  std::filesystem::path csv = path;
  if (std::filesystem::is_directory(path, ignored)) {
    csv = path.has_filename() ? path : path.parent_path();
    csv += ".csv";
  } else {
    csv.replace_extension(".csv");
  }
  throw FileError(name + ": is " + kind +
                  "; CSV is read here. Convert it first: python -m diffnea.convert " +
                  shell_quoted(path.string()) + " -o " + shell_quoted(csv.string()));
}

}  // namespace diffnea
