#include <string>

#include <CLI/CLI.hpp>

#include "diffnea/version.hpp"

namespace {

/// Exit status of a command line that cannot be understood.
constexpr int kWrongUsage = 2;

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Identify the dynamics of a robot from recordings, and name the effect that its model lacks.",
      "diffnea");
  app.set_version_flag("--version", std::string(diffnea::version()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kWrongUsage;
  }
  return 0;
}
