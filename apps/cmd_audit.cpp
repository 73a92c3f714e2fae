#include <cstdio>

#include <diffnea/identify/audit_limits.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/report/audit_text.hpp>
#include <diffnea/runs/audit_result.hpp>

#include "common.hpp"
#include "options.hpp"
#include "recordings.hpp"
#include "robots.hpp"

namespace diffnea::apps {
namespace {

struct AuditCommand {
  CommonOptions common;
  ModelReading reading;
  std::string model;
  std::vector<std::string> data;
  RecordingOptions recording;
  AuditLimits limits;
};

void run_audit(AuditCommand c) {
  AuditRun run{.report = {}, .data = c.data, .model = ""};
  c.recording.quiet = true;  // its sidecars' notes are of no channel
  ProgressLine line(true);
  const RecordingFiles files(c.data, c.recording, line);
  if (!c.model.empty()) {
    Model model = read_model(c.model, c.reading);
    run.model = model.name;
    serve_joints_of(files, RecordingFiles({}, c.recording, line), c.recording, model, line);
    const double significance = c.limits.significance;
    c.limits = audit_limits(model);
    c.limits.significance = significance;
  } else if (!c.recording.choice.joints.empty() || !c.recording.choice.lock.empty()) {
    throw CLI::ValidationError("--joints, --lock", "are of a model; give it with --model");
  }
  run.report = audit_files(files.paths(), c.limits, files.options());
  const std::string text = c.common.json ? audit_result_json(run) : audit_text(run.report);
  std::fwrite(text.data(), 1, text.size(), stdout);
}

}  // namespace

void add_audit(CLI::App& app) {
  auto c = std::make_shared<AuditCommand>();
  CLI::App* command = app.add_subcommand(
      "audit",
      "Find what is wrong with the channels of a recording, before any dynamics.\n"
      "Velocities against dq/dt (sign, scale, lag, swapped joints), the clock (gaps, jitter, "
      "rate),\n"
      "torques at a limit or of the wrong sign or joint, dead, frozen, slow and coarse channels,\n"
      "spikes, degrees, periods. Every fault is named with channel, size ± standard error and\n"
      "evidence; a fault biases what is fitted, a note does not. docs/recordings.md lists them.\n"
      "The exit status is 0 whatever was found: read `audit` of --json to act on it.");
  command
      ->add_option("data", c->data,
                   "recordings of one robot: CSV, or another format (docs/recordings.md)")
      ->required();
  command
      ->add_option("--model", c->model,
                   "robot description, for limits of position and torque: URDF, MJCF or JSON; or "
                   "the name of one that comes along")
      ->transform(robot_file);
  add_options(*command, c->reading);
  add_recording_options(*command, c->recording);
  command
      ->add_option("--significance", c->limits.significance,
                   "least size of a fault over its standard error")
      ->check(CLI::Range(3.0, 1000.0))
      ->capture_default_str();
  add_common(*command, c->common);
  command->callback([c] { run_audit(*c); });
}

}  // namespace diffnea::apps
