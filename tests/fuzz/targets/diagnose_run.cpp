#include <diffnea/runs/diagnosis.hpp>
#include <diffnea/report/diagnose_page.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void diagnose_run(std::string_view input) {
  const InputFiles files(input, "result.json", {"series.json"});
  result_or_error([&] { diagnose_page(read_diagnose_run(InputFiles::folder())); });
}

}  // namespace diffnea::fuzz
