#pragma once
/// URDF: read by urdfdom, written by editing the original document.

#include <string>
#include <vector>

#include <diffnea/io/model_file.hpp>
#include <diffnea/model/model.hpp>

namespace diffnea::io {

/// @throws ModelError
Model model_from_urdf(const std::string& text, const std::string& where,
                      const ModelReading& reading);

/// The original document with the values of `model` in place. @param notes  what a URDF cannot
/// express
/// @throws ModelError if the document has other links
std::string urdf_with_values(const std::string& original, const std::string& where,
                             const Model& model, std::vector<std::string>& notes);

}  // namespace diffnea::io
