#include "io/xml.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>

#include <diffnea/core/error.hpp>

namespace diffnea::io {

namespace {

/// An element takes a hundred times the memory of its shortest text, and the parser compares every
/// attribute with those before it.
constexpr std::size_t kMaxElements = 200'000, kMaxAttributes = 1000;  // an end tag counts, too

/// Whether the text is UTF-8 without the character 0, at which parsers in C would end it.
bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto c = static_cast<unsigned char>(text[i++]);
    const int more = c < 0x80                ? 0
                     : c >= 0xC2 && c < 0xE0 ? 1
                     : c >= 0xE0 && c < 0xF0 ? 2
                     : c >= 0xF0 && c < 0xF5 ? 3
                                             : -1;
    if (c == 0 || more < 0) return false;
    for (int k = 0; k < more; ++k, ++i)
      if (i == text.size() || (static_cast<unsigned char>(text[i]) & 0xC0) != 0x80) return false;
  }
  return true;
}

/// Before the parser builds anything. Of a text that is not XML any answer will do. Comments may be
/// in any encoding.
void check_xml_limits(std::string_view text, const std::string& where) {
  const auto refuse = [&](const char* what, std::size_t limit) {
    throw ModelError(where + ": " + what + "; the limit is " + std::to_string(limit));
  };
  const auto behind = [&](std::string_view end, std::size_t from) {
    const std::size_t at = text.find(end, from);
    return at == text.npos ? text.size() : at + end.size();
  };
  std::size_t elements = 0, checked = 0;
  const auto check_text = [&](std::size_t end) {
    if (!is_utf8(text.substr(checked, end - checked)))
      throw ModelError(where + ": is not XML: its text is not UTF-8");
  };
  for (std::size_t i = text.find('<'); i < text.size(); i = text.find('<', i)) {
    const std::string_view rest = text.substr(i, 9);
    if (rest.starts_with("<!--")) {
      check_text(i);
      i = checked = behind("-->", i);
    } else if (rest.starts_with("<![CDATA[")) {
      i = behind("]]>", i);
    } else if (rest.starts_with("<!") || rest.starts_with("<?")) {
      i = behind(">", i);
    } else {
      if (++elements > kMaxElements) refuse("has too many elements", kMaxElements);
      std::size_t attributes = 0;
      for (++i; i < text.size() && text[i] != '>'; ++i) {
        if (text[i] == '"' || text[i] == '\'')
          i = behind(text.substr(i, 1), i + 1) - 1;
        else if (text[i] == '=' && ++attributes > kMaxAttributes)
          refuse("has an element with too many attributes", kMaxAttributes);
      }
    }
  }
  check_text(text.size());
}

}  // namespace

std::unique_ptr<XmlDocument> parse_xml(std::string_view text, const std::string& where) {
  while (text.ends_with('\0')) text.remove_suffix(1);  // the end of a text in C, written with it
  check_xml_limits(text, where);
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

// An element's user data are its place: a file's number above a line's.
namespace {

constexpr int kLineBits = 32;
static_assert(sizeof(std::uintptr_t) * 8 > kLineBits);

void copy_places(const XmlElement& from, XmlElement& to) {
  to.SetUserData(from.GetUserData());
  XmlElement* t = to.FirstChildElement();
  for (const XmlElement* f = from.FirstChildElement(); f; f = f->NextSiblingElement()) {
    copy_places(*f, *t);
    t = t->NextSiblingElement();
  }
}

}  // namespace

XmlPlace place_of(const XmlElement& element) {
  const auto data = reinterpret_cast<std::uintptr_t>(element.GetUserData());
  return {static_cast<int>(data >> kLineBits),
          static_cast<int>(data & ((std::uintptr_t(1) << kLineBits) - 1))};
}

void set_places(XmlElement& element, int file) {
  walk(element, [&](XmlElement& e) {
    const auto data = (static_cast<std::uintptr_t>(file) << kLineBits) |
                      static_cast<std::uintptr_t>(e.GetLineNum());
    e.SetUserData(reinterpret_cast<void*>(data));
  });
}

XmlElement* clone_with_places(const XmlElement& element, XmlDocument& document) {
  XmlElement* out = element.DeepClone(&document)->ToElement();
  copy_places(element, *out);
  return out;
}

std::unique_ptr<XmlDocument> copy_with_places(const XmlDocument& document) {
  auto out = std::make_unique<XmlDocument>();
  document.DeepCopy(out.get());
  copy_places(*document.RootElement(), *out->RootElement());
  return out;
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
                                    const std::string& relative, bool allow_outside,
                                    const std::string& where) {
  std::error_code error;
  const std::filesystem::path base = std::filesystem::canonical(folder, error);
  if (error) throw FileError(folder.string() + ": cannot be read (" + error.message() + ")");
  // Weakly: a file that does not exist must not tell whether its folder does.
  const std::filesystem::path target = std::filesystem::weakly_canonical(base / relative, error);
  const auto [end, unused] = std::mismatch(base.begin(), base.end(), target.begin(), target.end());
  if (error || (end != base.end() && !allow_outside))
    throw ModelError(where + ": names the file '" + relative + "' outside the model's folder " +
                     base.string() +
                     "; files must lie in that folder or below, unless --allow-outside "
                     "(allow_outside=True) says that they need not");
  if (!std::filesystem::is_regular_file(target, error))
    throw FileError(where + ": names the file '" + relative + "', which is not there");
  return target;
}

}  // namespace diffnea::io
