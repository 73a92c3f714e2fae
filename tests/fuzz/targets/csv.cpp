#include <diffnea/io/sidecar.hpp>
#include <diffnea/recording/preprocess.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void csv(std::string_view input) {
  const InputFiles files(input, "data.csv", {"data.json"});
  std::vector<Recording> recordings;
  if (!result_or_error([&] {
        recordings = read_recordings(files["data.csv"], with_sidecar(files["data.csv"]));
      }))
    return;
  result_or_error([&] {
    const PreprocessPlan plan = plan_preprocess(recordings);
    for (const Recording& r : recordings) preprocess(r, plan);
  });
}

}  // namespace diffnea::fuzz
