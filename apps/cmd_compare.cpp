#include <cstdio>

#include <diffnea/identify/compare.hpp>
#include <diffnea/runs/result.hpp>
#include <diffnea/report/compare_text.hpp>

#include "common.hpp"

namespace diffnea::apps {
namespace {

struct CompareCommand {
  CommonOptions common;
  std::string before, after;
  CompareOptions options;
};

void run_compare(const CompareCommand& c) {
  const Comparison comparison =
      compare(read_fit_run(c.before).fit, read_fit_run(c.after).fit, c.options);
  const std::string text = c.common.json ? comparison_json(comparison) : compare_text(comparison);
  std::fwrite(text.data(), 1, text.size(), stdout);
}

}  // namespace

void add_compare(CLI::App& app) {
  auto c = std::make_shared<CompareCommand>();
  CLI::App* command = app.add_subcommand(
      "compare", "Two fits of one robot: what changed by more than the uncertainties explain.");
  command->add_option("first", c->before, "folder that identify wrote")->required();
  command->add_option("second", c->after, "folder that identify wrote")->required();
  command->add_option("--alpha", c->options.alpha, "chance of any false alarm")
      ->check(in_range(1e-12, 0.5))
      ->capture_default_str();
  add_common(*command, c->common);
  command->callback([c] { run_compare(*c); });
}

}  // namespace diffnea::apps
