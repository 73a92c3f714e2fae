#pragma once
/// XML documents as trees that can be edited in place. tinyxml2 stays inside src/io.

#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <tinyxml2.h>

namespace diffnea::io {

using XmlDocument = tinyxml2::XMLDocument;
using XmlElement = tinyxml2::XMLElement;

/// Nothing is fetched and no entity of the document's own is put in: those of XML itself and
/// characters by number are all there is. @throws ModelError `where: is not XML: line …`; also for
/// one that no robot needs: more than 200 000 tags or 1000 attributes of one, or text (but for
/// comments) that is not UTF-8
std::unique_ptr<XmlDocument> parse_xml(std::string_view text, const std::string& where);
std::string xml_text(const XmlDocument& document);

/// Where an element was read from; copies of a document know it, too.
struct XmlPlace {
  int file = 0;  ///< number of the file, for whoever reads several into one document
  int line = 0;  ///< from 1; 0: of no file
};
XmlPlace place_of(const XmlElement& element);
/// Gives the element and all below it the lines that they were parsed from.
void set_places(XmlElement& element, int file);
/// A copy with the places, not yet part of `document`'s tree.
XmlElement* clone_with_places(const XmlElement& element, XmlDocument& document);
std::unique_ptr<XmlDocument> copy_with_places(const XmlDocument& document);

/// Attribute, or an empty string.
std::string attribute(const XmlElement& element, const char* name);
/// First child of that name, created (as last child) if there is none.
XmlElement& child(XmlElement& element, const char* name);
/// Element of that tag below `element`, however deep, whose attribute `name` is `name`; or nullptr.
XmlElement* find_named(XmlElement& element, const char* tag, const std::string& name);
void remove_children(XmlElement& element, const char* name);

/// Calls f(child) for every child element of that name (all names: nullptr); f may delete its
/// argument.
template <class F>
void for_each_child(XmlElement& element, const char* name, F&& f) {
  for (XmlElement* e = element.FirstChildElement(name); e != nullptr;) {
    XmlElement* next = e->NextSiblingElement(name);
    f(*e);
    e = next;
  }
}

/// Calls f(e) for the element and all below it; f may delete what is below its argument.
template <class F>
void walk(XmlElement& element, F&& f) {
  f(element);
  for_each_child(element, nullptr, [&](XmlElement& e) { walk(e, f); });
}

inline bool is(const XmlElement& e, const char* name) { return std::strcmp(e.Name(), name) == 0; }

/// A file below `folder`, however `relative` is written and wherever links point.
/// @param allow_outside  it may lie anywhere
/// @throws ModelError if it lies elsewhere; FileError if it does not exist
std::filesystem::path confined_path(const std::filesystem::path& folder,
                                    const std::string& relative, bool allow_outside,
                                    const std::string& where);

}  // namespace diffnea::io
