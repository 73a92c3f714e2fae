#pragma once
/// What every description of a robot goes through, whatever its format.

#include <filesystem>
#include <stdexcept>

#include <diffnea/io/model_file.hpp>
#include <diffnea/io/model_info.hpp>

#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

/// Reads a model; what was read can be told of, and kept as the project's JSON without a change.
/// @throws std::logic_error if it cannot
inline void read_and_keep(const std::filesystem::path& path) {
  Model model;
  if (!result_or_error([&] { model = read_model(path); })) return;
  result_or_error([&] { model_info_text(model); });
  result_or_error([&] { model_info_json(model); });
  const std::string kept = model_to_json(model);
  if (model_to_json(model_from_json(kept, "kept.json")) != kept)
    throw std::logic_error("a model that was written as JSON comes back as another one");
}

}  // namespace diffnea::fuzz
