#include <algorithm>
#include <ranges>
#include <system_error>
#include <unistd.h>

#include <diffnea/core/error.hpp>
#include <diffnea/io/result_folder.hpp>

namespace diffnea {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& path, const std::error_code& error) {
  throw FileError(path.string() + ": results cannot be written there (" + error.message() +
                  "); choose another folder with -o");
}

}  // namespace

ResultFolder::ResultFolder(const fs::path& path) : path_(path.lexically_normal()) {
  if (path_.empty()) throw FileError("output folder: got an empty name, expected a folder");
  if (path_.has_relative_path() && !path_.has_filename()) path_ = path_.parent_path();  // "run/"
  std::error_code error;
  for (fs::path p = path_; !p.empty() && !fs::exists(p, error); p = p.parent_path())
    created_.insert(created_.begin(), p);
  staging_ = path_ / (".partial-" + std::to_string(::getpid()));
  fs::create_directories(staging_, error);
  if (error) {
    const std::error_code reason = error;
    for (const fs::path& p : std::views::reverse(created_)) fs::remove(p, error);
    fail(path_, reason);
  }
}

ResultFolder::~ResultFolder() {
  std::error_code ignored;
  fs::remove_all(staging_, ignored);
  if (published_) return;
  for (const fs::path& p : std::views::reverse(created_)) fs::remove(p, ignored);  // if empty
}

void ResultFolder::publish(const std::vector<std::string>& names) {
  std::error_code error;
  const auto move = [&](const fs::path& name) {
    fs::rename(staging_ / name, path_ / name, error);
    if (error) fail(path_ / name, error);
  };
  fs::remove(path_ / "result.json", error);
  if (error) fail(path_ / "result.json", error);
  for (const std::string& name : names) {
    if (name == "result.json") continue;
    if (fs::exists(staging_ / name)) {
      move(name);
    } else {
      fs::remove(path_ / name, error);
      if (error) fail(path_ / name, error);
    }
  }
  published_ = true;
  if (fs::exists(staging_ / "result.json")) move("result.json");
}

}  // namespace diffnea
