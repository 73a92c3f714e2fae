#include <cstdio>
#include <filesystem>

#include <diffnea/core/text_file.hpp>
#include <diffnea/runs/diagnosis.hpp>
#include <diffnea/runs/policy_result.hpp>
#include <diffnea/runs/result.hpp>
#include <diffnea/report/diagnose_page.hpp>
#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/learn_page.hpp>
#include <diffnea/report/transfer_page.hpp>

#include "common.hpp"

namespace diffnea::apps {
namespace {

struct ReportOptions {
  CommonOptions common;
  std::string run;
};

void run_report(const ReportOptions& options) {
  const std::filesystem::path page = std::filesystem::path(options.run) / "report.html";
  bool has_charts = false;
  const std::string schema = run_schema(options.run);
  if (schema.starts_with("diffnea/learn/")) {
    const LearnRun run = read_learn_run(options.run);
    has_charts = !run.figures.empty();
    write_file_atomically(page, learn_page(run));
  } else if (schema.starts_with("diffnea/transfer/")) {
    const TransferRun run = read_transfer_run(options.run);
    has_charts = !run.figures.empty();
    write_file_atomically(page, transfer_page(run));
  } else if (schema.starts_with("diffnea/diagnose/")) {
    const DiagnoseRun run = read_diagnose_run(options.run);
    has_charts = !run.finding.series.empty() || run.finding.ball;
    write_file_atomically(page, diagnose_page(run));
  } else {
    const FitRun run = read_fit_run(options.run);
    has_charts = !run.fit.train_series.empty() || run.fit.ball;
    write_file_atomically(page, identify_page(run));
  }
  if (!has_charts && !options.common.quiet)
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
  command->add_option("run", options->run, "folder that a command wrote with -o")->required();
  add_common(*command, options->common);
  command->callback([options] { run_report(*options); });
}

}  // namespace diffnea::apps
