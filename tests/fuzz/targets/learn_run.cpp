#include <diffnea/runs/policy_result.hpp>
#include <diffnea/report/learn_page.hpp>

#include "fuzz/input_files.hpp"
#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void learn_run(std::string_view input) {
  const InputFiles files(input, "result.json",
                         {"series.json", "model.json", "controller.json", "ball_network.json",
                          "policy_0.json", "policy_1.json"});
  result_or_error([&] { learn_page(read_learn_run(InputFiles::folder())); });
}

}  // namespace diffnea::fuzz
