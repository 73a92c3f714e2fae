#pragma once
/// What `diffnea info` says about a model: for people, and as JSON for programs.

#include <string>
#include <vector>

#include <diffnea/model/model.hpp>

namespace diffnea {

/// check_model, and the effects that the catalogue cannot bind to this model.
std::vector<ModelIssue> model_issues(const Model& model);

/// The tree with masses, centres of mass and limits; effects; frames; what the file says and the
/// model leaves out; what looks wrong, by how much.
std::string model_info_text(const Model& model);

/// The same, schema "diffnea/info/1" (docs/schema/info.md).
std::string model_info_json(const Model& model);

}  // namespace diffnea
