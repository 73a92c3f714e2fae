#include "outputs.hpp"

#include <cstdio>

#include <diffnea/core/atomic_file.hpp>
#include <diffnea/core/error.hpp>

namespace diffnea::apps {

namespace fs = std::filesystem;

void check_output(const std::string& output, const std::vector<std::string>& inputs) {
  if (output.empty()) return;
  std::error_code ignored;
  for (const std::string& input : inputs)
    if (fs::equivalent(output, input, ignored))
      throw FileError(output +
                      ": is an input, which the output would overwrite; choose another name with "
                      "-o");
  const fs::file_status there = fs::status(output, ignored);
  if (fs::is_directory(there)) throw FileError(output + ": is a folder, expected a file's name");
  if (!fs::exists(there) || fs::is_regular_file(there)) AtomicFile probe(output);
}

void check_outputs(const std::vector<std::string>& outputs,
                   const std::vector<std::string>& inputs) {
  std::vector<fs::path> places;
  for (const std::string& output : outputs) {
    if (output.empty()) continue;
    check_output(output, inputs);
    std::error_code unknown;
    const fs::path place = fs::weakly_canonical(fs::absolute(output), unknown);
    if (!unknown && std::ranges::find(places, place) != places.end())
      throw FileError(output +
                      ": two outputs would be written there (beside a recording there is a .json "
                      "of its name); choose another name");
    places.push_back(place);
  }
}

void show_result(const std::string& result, const ResultFolder& folder,
                 const CommonOptions& options) {
  std::fwrite(result.data(), 1, result.size(), stdout);
  if (options.json || options.quiet) return;
  std::vector<std::string> shown;
  for (std::string name : folder.files()) {
    if (name.starts_with("policy_") || name.starts_with("recording_"))  // one a seed
      name = name.substr(0, name.find('_')) + "_*";
    if (std::ranges::find(shown, name) == shown.end()) shown.push_back(name);
  }
  std::printf("\n%s:", folder.path().string().c_str());
  for (const std::string& name : shown)
    std::printf("%s %s", &name == &shown.front() ? "" : ",", name.c_str());
  std::printf("\n");
}

void stop(ExitStatus status, const std::string& why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  throw CLI::RuntimeError(status);
}

}  // namespace diffnea::apps
