#include "outputs.hpp"

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
  if (!fs::exists(folder / "result.json", ignored)) return;
  std::string there;
  try {
    there = run_schema(folder);
  } catch (const Error&) {
    return;  // nothing that could be lost
  }
  if (!there.starts_with(schema))
    throw FileError(folder.string() + ": holds another command's result (" + there +
                    "), which would be lost; choose another folder with -o");
}

}  // namespace diffnea::apps
