#include "io/mjcf_defaults.hpp"

namespace diffnea::io {
namespace {

constexpr const char* kMain = "main";  ///< the class of elements that name none

/// Name of the class that counts for an element.
std::string class_of(const XmlElement& element) {
  if (element.Attribute("class")) return attribute(element, "class");
  for (const tinyxml2::XMLNode* up = element.Parent(); up; up = up->Parent())
    if (const XmlElement* e = up->ToElement(); e && e->Attribute("childclass"))
      return attribute(*e, "childclass");
  return kMain;
}

}  // namespace

MjcfDefaults::MjcfDefaults(XmlElement& root) {
  for_each_child(root, "default", [&](XmlElement& section) { add(section, kMain, ""); });
}

void MjcfDefaults::add(XmlElement& section, const std::string& name, const std::string& parent) {
  const auto [c, is_new] = classes_.try_emplace(name);
  if (is_new) c->second.parent = parent;  // one that was there before: no circles
  c->second.sections.push_back(&section);
  for_each_child(section, "default",
                 [&](XmlElement& below) { add(below, io::attribute(below, "class"), name); });
}

std::string MjcfDefaults::attribute(const XmlElement& element, const char* name) const {
  if (element.Attribute(name)) return io::attribute(element, name);
  std::string at = class_of(element);
  if (!classes_.contains(at)) at = kMain;
  for (auto c = classes_.find(at); c != classes_.end(); c = classes_.find(c->second.parent)) {
    std::string found;
    for (XmlElement* section : c->second.sections)
      for_each_child(*section, element.Name(), [&](XmlElement& e) {
        if (e.Attribute(name)) found = io::attribute(e, name);
      });
    if (!found.empty() || c->first == kMain) return found;
  }
  return "";
}

}  // namespace diffnea::io
