#include "sim/mujoco_model.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <regex>

#include <diffnea/core/error.hpp>

namespace diffnea::sim {
namespace {

/// MuJoCo's own answer to a warning is a log file in the working folder; the library never writes
/// unasked. Counts of warnings stay readable in mjData. To an error it is such a file as well, and
/// to wait for a key before it ends the process; an end there must be, for its C code cannot be
/// left by an exception.
const bool kQuiet = [] {
  if (!mju_user_warning) mju_user_warning = [](const char*) {};
  if (!mju_user_error)
    mju_user_error = [](const char* message) {
      std::fprintf(stderr, "error: MuJoCo cannot go on: %s\n", message);
      std::fflush(stderr);
      std::_Exit(EXIT_FAILURE);
    };
  return true;
}();

/// MuJoCo's words with the lines' names in place of its numbers: `line 3`, `line = 3, column = 4`.
std::string with_line_names(const std::string& reason, const LineName& line_name) {
  static const std::regex kLine(R"(,? ?line (?:= )?(\d{1,9})(?:, column (?:= )?-?\d+)?$)");
  std::smatch found;
  if (!line_name || !std::regex_search(reason, found, kLine)) return reason;
  const std::string name = line_name(std::stoi(found[1]));
  return found.prefix().str() + (name.empty() ? "" : ", " + name);
}

}  // namespace

MujocoFiles::MujocoFiles() : vfs_(std::make_unique<mjVFS>()) { mj_defaultVFS(vfs_.get()); }
MujocoFiles::~MujocoFiles() { mj_deleteVFS(vfs_.get()); }

void MujocoFiles::add(const std::string& name, std::string_view content, const std::string& where) {
  const int size = static_cast<int>(content.size());
#if mjVERSION_HEADER >= 310
  const int status = mj_addBufferVFS(vfs_.get(), name.c_str(), content.data(), size);
#else
  const int status = mj_makeEmptyFileVFS(vfs_.get(), name.c_str(), size);
  if (status == 0)
    std::memcpy(vfs_->filedata[mj_findFileVFS(vfs_.get(), name.c_str())], content.data(),
                content.size());
#endif
  if (status != 0) throw ModelError(where + ": names too many files");
}

MujocoModel compile_mujoco(std::string_view mjcf, MujocoFiles& files, const std::string& where,
                           const LineName& line_name) {
  static_cast<void>(kQuiet);
  static std::mutex one_at_a_time;  // the compiler keeps the last document in a global
  const std::scoped_lock lock(one_at_a_time);
  files.add("model.xml", mjcf, where);
  char error[1000] = "";
  MujocoModel model;
  try {
    model.reset(mj_loadXML("model.xml", files.get(), error, sizeof error));
  } catch (...) {  // of a C++ library of its own, so that no type of ours would catch it
    throw ModelError(where +
                     ": MuJoCo's compiler broke off: it asks for more memory than there is");
  }
  if (model) return model;
  std::string reason = error;
  std::ranges::replace(reason, '\n', ' ');
  while (!reason.empty() && reason.back() == ' ') reason.pop_back();
  throw ModelError(where + ": MuJoCo cannot compile it: " +
                   (reason.empty() ? "no reason given" : with_line_names(reason, line_name)));
}

}  // namespace diffnea::sim
