#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "diffnea/version.hpp"
#include <diffnea/core/error.hpp>

#include "common.hpp"

int main(int argc, char** argv) {
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on files is an error of the write, not the end
  CLI::App app(
      "Identify the dynamics of a robot from recordings, name the effect that its model lacks, and "
      "learn a policy in the model.",
      "diffnea");
  app.set_version_flag("--version", std::string(diffnea::version()));
  app.require_subcommand(1);
  // One line per command, sorted.
  diffnea::apps::add_audit(app);
  diffnea::apps::add_compare(app);
  diffnea::apps::add_completion(app);
  const std::vector<std::string> command_line(argv, argv + argc);
  diffnea::apps::add_diagnose(app, command_line);
  diffnea::apps::add_effects(app);
  diffnea::apps::add_excite(app);
  diffnea::apps::add_experiment(app, command_line);
  diffnea::apps::add_export(app);
  diffnea::apps::add_identify(app, command_line);
  diffnea::apps::add_info(app);
  diffnea::apps::add_learn(app, command_line);
  diffnea::apps::add_report(app);
  diffnea::apps::add_simulate(app);
  diffnea::apps::add_transfer(app, command_line);
  diffnea::apps::add_worlds(app);
  try {
    app.parse(argc, argv);                    // runs the command
  } catch (const CLI::RuntimeError& error) {  // a command's own exit status
    return error.get_exit_code();
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : diffnea::apps::kWrongUsage;
  } catch (const diffnea::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return diffnea::apps::kBadInput;
  } catch (const std::filesystem::filesystem_error& error) {  // a folder that cannot be made, say
    std::fprintf(stderr, "%s: %s\n", error.path1().c_str(), error.code().message().c_str());
    return diffnea::apps::kBadInput;
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "diffnea: there is not enough memory for this\n");
    return diffnea::apps::kBadInput;
  } catch (const std::exception& error) {  // a mistake of ours: say so, but do not crash
    std::fprintf(stderr, "diffnea: internal error: %s\n", error.what());
    return diffnea::apps::kBadInput;
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    std::fprintf(stderr,
                 "diffnea: standard output cannot be written; the results did not reach it\n");
    return diffnea::apps::kBadInput;
  }
  return 0;
}
