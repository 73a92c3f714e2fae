#pragma once
/// Default classes of an MJCF: what an element says through its class.

#include <map>
#include <string>
#include <vector>

#include "io/xml.hpp"

namespace diffnea::io {

/// The classes of a document whose includes are resolved. It keeps pointers into the document.
class MjcfDefaults {
 public:
  explicit MjcfDefaults(XmlElement& root);

  /// The element's own attribute, else that of its class, the nearest `childclass` around it, or
  /// the class above; an empty string if none says it.
  std::string attribute(const XmlElement& element, const char* name) const;

 private:
  struct Class {
    std::string parent;                 ///< empty: none
    std::vector<XmlElement*> sections;  ///< <default> elements, a later one overrules
  };
  void add(XmlElement& section, const std::string& name, const std::string& parent);

  std::map<std::string, Class> classes_;
};

}  // namespace diffnea::io
