
#include <diffnea/core/error.hpp>
#include <diffnea/diagnose/diagnose.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/report/diagnose_text.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/runs/diagnosis.hpp>
#include <diffnea/runs/result_folder.hpp>
#include <diffnea/version.hpp>

#include "common.hpp"
#include "effect_names.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "recordings.hpp"
#include "robots.hpp"

namespace diffnea::apps {
namespace {

struct DiagnoseCommand {
  CommonOptions common;
  ModelReading reading;
  RecordingOptions recording;
  std::vector<std::string> command_line;
  std::string model, out;
  std::vector<std::string> data, test;
  DiagnoseOptions options;
};

void run_diagnose(DiagnoseCommand c) {
  refuse_repeated_files(c.data, c.test);
  c.recording.quiet = c.common.quiet;
  c.options.seed = c.common.seed;
  c.options.threads = threads_of(c.common);
  c.options.effects = with_pairs(c.options.effects);
  check_run_folder(c.out, "diagnose");
  Model model = read_model(c.model, c.reading);
  ResultFolder folder(c.out);  // cannot be written: better known now

  const Interruptible interruptible(folder.leftovers(kRunFiles));
  ProgressLine line(c.common.quiet);
  c.options.progress = [&](const FitProgress& progress) {
    line.show(progress);
    return !Interruptible::requested();
  };
  DiagnoseRun run;
  run.reproduce.version = version();
  run.reproduce.command = c.command_line;
  const auto nothing_found = [&] {
    line.clear();
    stop(kInterrupted, "interrupted before anything was found; nothing was written");
  };
  try {
    line.show({"opening", 0, 0, 0.0});
    const RecordingFiles data(c.data, c.recording, line), held_out(c.test, c.recording, line);
    const std::string note = serve_joints_of(data, held_out, c.recording, model, line);
    const std::unique_ptr<RecordingSource> train = data.open(model);
    std::unique_ptr<RecordingSource> test;
    if (!c.test.empty()) test = held_out.open(model);
    run.finding = diagnose(model, *train, test.get(), c.options);
    if (!note.empty()) run.finding.notes.insert(run.finding.notes.begin(), note);
  } catch (const Error&) {  // of the part that had been read
    if (!Interruptible::requested()) throw;
    nothing_found();
  }
  // Without a cause, "nothing is left to explain" would be a claim about what was not tried.
  if (run.finding.interrupted && run.finding.causes.empty()) nothing_found();

  run.reproduce.inputs.push_back(describe_input("model", c.model));
  for (const std::string& file : c.data)
    run.reproduce.inputs.push_back(describe_input("data", file));
  for (const std::string& file : c.test)
    run.reproduce.inputs.push_back(describe_input("test", file));
  publish_diagnose_run(run, folder);
  line.clear();
  show_result(c.common.json ? diagnose_result_json(run) : diagnose_text(run), folder, c.common);
  if (run.finding.interrupted)
    stop(kInterrupted, "interrupted: the result is what had been found until then");
}

}  // namespace

void add_diagnose(CLI::App& app, const std::vector<std::string>& command_line) {
  auto c = std::make_shared<DiagnoseCommand>();
  c->command_line = command_line;
  CLI::App* command = app.add_subcommand(
      "diagnose",
      "Name the effects that a model lacks, with evidence, rivals and the gain on held-out data.");
  add_robot(*command, c->model);
  add_options(*command, c->reading);
  command
      ->add_option("data", c->data,
                   "recordings: time, q_*, tau_*; or ball_x, ball_y, ball_z; CSV or another format "
                   "(docs/recordings.md)")
      ->required();
  command->add_option("--test", c->test,
                      "held-out recordings (.csv); without them blocks of time are held out");
  command->add_option("-o,--output", c->out, "folder for the results")->required();
  add_options(*command, c->options);
  add_recording_options(*command, c->recording);
  add_common(*command, c->common);
  command->callback([c] { run_diagnose(*c); });
}

}  // namespace diffnea::apps
