#include <diffnea/runs/result.hpp>
#include <diffnea/report/identify_page.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void fit_run(std::string_view input) {
  const InputFiles files(input, "result.json", {"series.json", "model.json"});
  result_or_error([&] { run_schema(InputFiles::folder()); });
  result_or_error([&] { identify_page(read_fit_run(InputFiles::folder())); });
}

}  // namespace diffnea::fuzz
