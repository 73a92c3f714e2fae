#include "outputs.hpp"

#include <cstdio>

#include <diffnea/core/error.hpp>
#include <diffnea/io/result.hpp>
#include <diffnea/report/run_folder.hpp>

namespace diffnea::apps {

namespace fs = std::filesystem;

void refuse_overwriting(const std::string& output, const std::vector<std::string>& inputs) {
  for (const std::string& input : inputs) {
    std::error_code ignored;
    if (fs::equivalent(output, input, ignored))
      throw FileError(output +
                      ": is an input, which the output would overwrite; choose another name with "
                      "-o");
  }
}

void refuse_own_inputs(const fs::path& folder, const std::vector<std::string>& inputs) {
  std::error_code ignored;
  if (fs::exists(folder / "result.json", ignored)) return;  // an earlier run's own
  for (const std::string& name : kRunFiles) refuse_overwriting((folder / name).string(), inputs);
}

void refuse_other_runs(const fs::path& folder, const std::string& schema) {
  std::error_code ignored;
  const auto refuse_foreign = [](const fs::path& file) {
    throw FileError(file.string() +
                    ": was not left by diffnea, whose result would replace it; choose another "
                    "folder with -o");
  };
  if (!fs::exists(folder / "result.json", ignored)) {
    if (fs::exists(folder / "series.json", ignored)) return;  // a killed run's, which comes first
    for (const std::string& name : kRunFiles)
      if (fs::exists(folder / name, ignored)) refuse_foreign(folder / name);
    return;
  }
  std::string there;
  try {
    there = run_schema(folder);
  } catch (const Error&) {
    refuse_foreign(folder / "result.json");
  }
  if (!there.starts_with(schema))
    throw FileError(folder.string() + ": holds another command's result (" + there +
                    "), which would be lost; choose another folder with -o");
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
