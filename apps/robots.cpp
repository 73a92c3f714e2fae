#include "robots.hpp"

#include <filesystem>

#include <diffnea/worlds/world.hpp>

namespace diffnea::apps {

std::string robot_file(const std::string& given) {
  const std::filesystem::path path = given;
  std::error_code ignored;
  if (path.has_parent_path() || path.has_extension() || path.empty() ||
      std::filesystem::exists(path, ignored))
    return given;
  return find_model_file(given, {".xml", ".urdf", ".json"}).string();
}

CLI::Option* add_robot(CLI::App& command, std::string& model) {
  return command
      .add_option(
          "model", model,
          "robot description: URDF, MJCF or JSON; or the name of one that comes along: wam4")
      ->required()
      ->transform(robot_file);
}

}  // namespace diffnea::apps
