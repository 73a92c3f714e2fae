#include <diffnea/runs/policy_result.hpp>
#include <diffnea/report/transfer_page.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void transfer_run(std::string_view input) {
  const InputFiles files(input, "result.json",
                         {"series.json", "model.json", "controller.json", "ball_network.json",
                          "policy_0.json", "policy_1.json"});
  result_or_error([&] { transfer_page(read_transfer_run(InputFiles::folder())); });
}

}  // namespace diffnea::fuzz
