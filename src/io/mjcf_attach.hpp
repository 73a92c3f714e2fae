#pragma once
/// Models inside a model: <attach> becomes the bodies of the model that it names, with all that
/// belongs to them.

#include <functional>
#include <memory>

#include "io/mjcf.hpp"
#include "io/xml.hpp"

namespace diffnea::io {

/// Reads the file that a <model> names, its includes in place.
struct AttachedFile {
  std::unique_ptr<XmlDocument> document;
  std::filesystem::path folder;  ///< from which its own files are named
};
using ReadAttached = std::function<AttachedFile(const XmlElement& model)>;

/// Puts models in the place of <attach> elements, in `mjcf.document`, whose includes are resolved.
/// Names get the prefix; angles, mesh files and default classes go on to mean what they did.
/// @throws ModelError `where: line …` where the two documents' options cannot be one
void attach_models(Mjcf& mjcf, const ReadAttached& read);

}  // namespace diffnea::io
