#include "foreign_files.hpp"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fcntl.h>
#include <spawn.h>
#include <sstream>
#include <sys/wait.h>
#include <unistd.h>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/core/text_file.hpp>

extern char** environ;

namespace diffnea::apps {
namespace {

namespace fs = std::filesystem;

struct Ended {
  int status = 0;      ///< exit status; −1: it did not start, or was ended by a signal
  std::string errors;  ///< text on standard error
};

/// Runs a program to its end; its standard output goes nowhere.
Ended run(const std::vector<std::string>& command) {
  int pipe_ends[2];
  if (pipe(pipe_ends) != 0) return {-1, std::strerror(errno)};
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&files, pipe_ends[1], STDERR_FILENO);
  posix_spawn_file_actions_addclose(&files, pipe_ends[0]);
  std::vector<char*> words;
  for (const std::string& word : command) words.push_back(const_cast<char*>(word.c_str()));
  words.push_back(nullptr);
  pid_t child = 0;
  const int error = posix_spawnp(&child, words[0], &files, nullptr, words.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  close(pipe_ends[1]);
  Ended out;
  char text[4096];
  for (ssize_t got = 0; error == 0 && (got = read(pipe_ends[0], text, sizeof text)) != 0;) {
    if (got > 0) out.errors.append(text, static_cast<std::size_t>(got));
    if (got < 0 && errno != EINTR) break;
  }
  close(pipe_ends[0]);
  if (error != 0) return {-1, std::strerror(error)};
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  out.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return out;
}

/// Where a Python with the package may be: as asked, beside this command (a virtual environment),
/// on the path.
std::vector<std::string> pythons() {
  if (const char* asked = std::getenv("DIFFNEA_PYTHON"); asked != nullptr && *asked != '\0')
    return {asked};
  std::vector<std::string> out;
  std::error_code unknown;
  const fs::path self = fs::read_symlink("/proc/self/exe", unknown);
  if (!unknown && fs::exists(self.parent_path() / "python3", unknown))
    out.push_back((self.parent_path() / "python3").string());
  out.emplace_back("python3");
  return out;
}

/// The extra of the package that a format needs, in brackets; nothing where NumPy is enough.
std::string extra_of(const std::string& kind) {
  if (kind.find("ROS") != kind.npos) return "[ros]";
  if (kind.find("MATLAB") != kind.npos) return "[matlab]";
  if (kind.find("Parquet") != kind.npos || kind.find("LeRobot") != kind.npos) return "[parquet]";
  return "";
}

/// @throws FileError with what to install
std::string python_with_package(const std::string& file, const std::string& kind) {
  std::vector<std::string> tried;
  for (const std::string& python : pythons()) {
    if (run({python, "-c", "import diffnea.convert"}).status == 0) return python;
    tried.push_back(python);
  }
  throw FileError(file + ": is " + kind +
                  ", which diffnea's package for Python reads, and none was found (tried " +
                  detail::join(tried) + "). Install it from diffnea's folder with pip install '." +
                  extra_of(kind) +
                  "', and call the diffnea beside that Python, or name the Python in "
                  "DIFFNEA_PYTHON");
}

}  // namespace

ForeignFiles::~ForeignFiles() {
  std::error_code ignored;
  if (!folder_.empty()) fs::remove_all(folder_, ignored);
}

ColumnsOfFile ForeignFiles::read(const fs::path& file, const std::string& kind,
                                 const BagOptions& bag) {
  if (std::error_code unknown; !fs::exists(file, unknown))
    throw FileError(file.string() + ": there is no such file");
  if (python_.empty()) python_ = python_with_package(file.string(), kind);
  if (folder_.empty()) {
    std::string name = (fs::temp_directory_path() / "diffnea-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr)
      throw FileError(name + ": cannot be made (" + std::strerror(errno) + ")");
    folder_ = name;
  }
  const fs::path into = folder_ / std::to_string(count_++);
  std::vector<std::string> command{python_, "-m", "diffnea.convert", "--columns-into",
                                   into.string()};
  for (const auto& [option, value] : {std::pair{"--topic", bag.topic},
                                      {"--command-topic", bag.command_topic},
                                      {"--clock", bag.clock}})
    if (!value.empty()) command.insert(command.end(), {option, value});
  command.insert(command.end(), {"--", file.string()});
  Ended ended = run(command);
  while (!ended.errors.empty() && ended.errors.back() == '\n') ended.errors.pop_back();
  if (ended.status != 0)
    throw FileError(ended.errors.empty()
                        ? file.string() + ": " + python_ + " ended while it read " + kind
                        : ended.errors);
  ColumnsOfFile out{into / "columns.csv", {}};
  std::istringstream notes(read_text_file(into / "notes.txt"));
  for (std::string note; std::getline(notes, note);) out.notes.push_back(note);
  return out;
}

}  // namespace diffnea::apps
