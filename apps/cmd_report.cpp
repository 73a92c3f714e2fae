#include <cstdio>
#include <filesystem>

#include <diffnea/io/atomic_file.hpp>
#include <diffnea/io/result.hpp>
#include <diffnea/report/identify_page.hpp>

#include "common.hpp"

namespace diffnea::apps {
namespace {

struct ReportOptions {
  CommonOptions common;
  std::string run;
};

void run_report(const ReportOptions& options) {
  const std::filesystem::path page = std::filesystem::path(options.run) / "report.html";
  const FitRun run = read_fit_run(options.run);
  write_file_atomically(page, identify_page(run));
  if (run.fit.train_series.empty() && !options.common.quiet)
    std::fprintf(stderr, "%s: holds no series.json, so that the page has no charts\n",
                 options.run.c_str());
  if (options.common.json)
    std::fputs(report_result_json(page).c_str(), stdout);
  else if (!options.common.quiet)
    std::printf("%s\n", page.string().c_str());
}

}  // namespace

void add_report(CLI::App& app) {
  auto options = std::make_shared<ReportOptions>();
  CLI::App* command = app.add_subcommand("report", "Rebuild the page of a run from its results.");
  command->add_option("run", options->run, "folder that identify wrote")->required();
  add_common(*command, options->common);
  command->callback([options] { run_report(*options); });
}

}  // namespace diffnea::apps
