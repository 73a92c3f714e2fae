#pragma once
/// Robots as commands take them: files, or names of those that come along.

#include <string>

#include <CLI/CLI.hpp>

namespace diffnea::apps {

/// A word without a folder or an ending that is no file here, as the file of the model that comes
/// along under that name; anything else as it is.
/// @throws FileError listing the models there are
std::string robot_file(const std::string& given);

/// The robot, as most commands take it: the first argument.
CLI::Option* add_robot(CLI::App& command, std::string& model);

}  // namespace diffnea::apps
