#include <algorithm>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <ranges>
#include <system_error>
#include <unistd.h>

#include <diffnea/core/error.hpp>
#include <diffnea/runs/result_folder.hpp>

namespace diffnea {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& path, const std::error_code& error) {
  throw FileError(path.string() + ": results cannot be written there (" + error.message() +
                  "); choose another folder");
}

constexpr std::string_view kStaging = ".partial-";

/// Removes the hidden folders of programs that no longer run: killed, or off with the power.
void remove_abandoned(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> abandoned;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (!name.starts_with(kStaging)) continue;
    const std::string digits = name.substr(kStaging.size());
    pid_t pid = 0;
    const auto [last, wrong] = std::from_chars(digits.data(), digits.data() + digits.size(), pid);
    if (wrong != std::errc() || last != digits.data() + digits.size() || pid <= 0) continue;
    // One of this number can only be left over from before: it is created next.
    if (pid == ::getpid() || (::kill(pid, 0) != 0 && errno == ESRCH))
      abandoned.push_back(it->path());
  }
  for (const fs::path& path : abandoned) fs::remove_all(path, error);
}

}  // namespace

ResultFolder::ResultFolder(const fs::path& path) : path_(path.lexically_normal()) {
  if (path_.empty()) throw FileError("output folder: got an empty name, expected a folder");
  if (path_.has_relative_path() && !path_.has_filename()) path_ = path_.parent_path();  // "run/"
  std::error_code error;
  for (fs::path p = path_; !p.empty() && !fs::exists(p, error); p = p.parent_path())
    created_.insert(created_.begin(), p);
  remove_abandoned(path_);
  staging_ = path_ / (std::string(kStaging) + std::to_string(::getpid()));
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

std::vector<fs::path> ResultFolder::leftovers(const std::vector<std::string>& names) const {
  std::vector<fs::path> out;
  out.reserve(names.size() + created_.size() + 1);
  for (const std::string& name : names) out.push_back(staging_ / name);
  out.push_back(staging_);
  out.insert(out.end(), created_.rbegin(), created_.rend());  // goes if it is empty
  return out;
}

void ResultFolder::publish(const std::vector<std::string>& names) {
  std::error_code error;
  const auto move = [&](const fs::path& name) {
    fs::rename(staging_ / name, path_ / name, error);
    if (error) fail(path_ / name, error);
    files_.push_back(name.string());
  };
  files_.clear();
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
  if (!fs::exists(staging_ / "result.json")) return;
  move("result.json");
  std::ranges::rotate(files_, files_.end() - 1);
}

}  // namespace diffnea
