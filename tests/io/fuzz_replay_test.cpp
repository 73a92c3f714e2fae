/// What was fuzzed keeps its contract (fuzz/targets.hpp): the seeds, the models of the tree, and
/// every input that once broke it. Needs no libFuzzer; a sanitizer's build looks closer.

#include <algorithm>
#include <filesystem>
#include <vector>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators_range.hpp>

#include <diffnea/core/text_file.hpp>

#include "fuzz/targets.hpp"

namespace diffnea::fuzz::fuzz_replay_test {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> out;
  if (fs::exists(folder))
    for (const fs::directory_entry& entry : fs::directory_iterator(folder))
      out.push_back(entry.path());
  std::ranges::sort(out);
  return out;
}

TEST_CASE("fuzz: seeds and past findings give a result or an Error", "[fuzz]") {
  const Target target = GENERATE(from_range(kTargets));
  const fs::path source = DIFFNEA_SOURCE_DIR, here = source / "tests" / "fuzz";
  std::vector<fs::path> inputs = files_in(here / "seeds" / target.name);
  CHECK_FALSE(inputs.empty());
  for (const fs::path& past : files_in(here / "crashes" / target.name)) inputs.push_back(past);
  for (const fs::path& model : files_in(source / "models")) inputs.push_back(model);
  for (const fs::path& input : inputs) {
    CAPTURE(input.string());
    CHECK_NOTHROW(target.run(read_text_file(input)));
  }
}

}  // namespace
}  // namespace diffnea::fuzz::fuzz_replay_test
