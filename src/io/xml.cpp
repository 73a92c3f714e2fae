#include "io/xml.hpp"

#include <algorithm>
#include <cstring>

#include <diffnea/core/error.hpp>

namespace diffnea::io {

std::unique_ptr<XmlDocument> parse_xml(std::string_view text, const std::string& where) {
  auto document = std::make_unique<XmlDocument>();
  document->Parse(text.data(), text.size());
  if (document->Error())
    throw ModelError(where + ": is not XML: line " + std::to_string(document->ErrorLineNum()) +
                     ", " + document->ErrorName());
  if (!document->RootElement()) throw ModelError(where + ": is not XML: it holds no element");
  return document;
}

std::string xml_text(const XmlDocument& document) {
  tinyxml2::XMLPrinter printer;
  document.Print(&printer);
  return printer.CStr();
}

std::string attribute(const XmlElement& element, const char* name) {
  const char* value = element.Attribute(name);
  return value ? value : "";
}

XmlElement& child(XmlElement& element, const char* name) {
  XmlElement* found = element.FirstChildElement(name);
  return found ? *found : *element.InsertNewChildElement(name);
}

XmlElement* find_named(XmlElement& element, const char* tag, const std::string& name) {
  for (XmlElement* e = element.FirstChildElement(); e; e = e->NextSiblingElement()) {
    if (std::strcmp(e->Name(), tag) == 0 && attribute(*e, "name") == name) return e;
    if (XmlElement* found = find_named(*e, tag, name)) return found;
  }
  return nullptr;
}

void remove_children(XmlElement& element, const char* name) {
  for_each_child(element, name, [&](XmlElement& e) { element.DeleteChild(&e); });
}

std::filesystem::path confined_path(const std::filesystem::path& folder,
                                    const std::string& relative, const std::string& where) {
  std::error_code error;
  const std::filesystem::path base = std::filesystem::canonical(folder, error);
  if (error) throw FileError(folder.string() + ": cannot be read (" + error.message() + ")");
  // Weakly: a file that does not exist must not tell whether its folder does.
  const std::filesystem::path target = std::filesystem::weakly_canonical(base / relative, error);
  const auto [end, unused] = std::mismatch(base.begin(), base.end(), target.begin(), target.end());
  if (error || end != base.end())
    throw ModelError(where + ": names the file '" + relative + "' outside the model's folder " +
                     base.string() + "; files must lie in that folder or below");
  if (!std::filesystem::is_regular_file(target, error))
    throw FileError(where + ": names the file '" + relative + "', which is not there");
  return target;
}

}  // namespace diffnea::io
