#include "io/mjcf_translate.hpp"

#include <algorithm>
#include <map>
#include <sstream>

#include <diffnea/core/error.hpp>
#include <diffnea/model/physical.hpp>

#include "io/mjcf_generated.hpp"
#include "io/mjcf_inertial.hpp"
#include "io/mjcf_limits.hpp"
#include "io/mjcf_pose.hpp"
#include "io/mjcf_versions.hpp"

namespace diffnea::io {
namespace {

/// Sections and elements of any version that no body moves by.
constexpr const char* kUnusedSections[] = {"visual", "statistic", "size", "sensor"};
constexpr const char* kUnusedElements[] = {"camera", "light", "material", "texture",
                                           "skin",   "text",  "tuple"};

/// Takes blanks from the end of a list of numbers: MuJoCo 2.2 takes them for one more.
void trim_end(XmlElement& e, const char* name) {
  std::string numbers = attribute(e, name);
  numbers.erase(numbers.find_last_not_of(" \t\r\n") + 1);
  e.SetAttribute(name, numbers.c_str());
}

void remove_unused(XmlElement& root) {
  for (const char* name : kUnusedSections) remove_children(root, name);
  walk(root, [](XmlElement& e) {
    for (const char* name : kUnusedElements) remove_children(e, name);
    e.DeleteAttribute("material");
    for (const char* name : {kForceRange, kDriveBrakes})
      e.DeleteAttribute(name);  // the user's own numbers
    if (is(e, "size"))
      for (const char* name : {"nuser_jnt", "nuser_actuator"}) e.DeleteAttribute(name);
    if (is(e, "key")) {
      for (const char* name : {"act", "ctrl"}) e.DeleteAttribute(name);
      if (e.Attribute("qpos")) trim_end(e, "qpos");
    }
  });
}

/// Sets the compiler's default of today: ranges are limits. Links stay links: bodies are not fused,
/// and shapes not thrown away that may have mass.
void apply_defaults_of_today(XmlElement& root) {
  bool says = false;
  for_each_child(root, "compiler", [&](XmlElement& c) {
    says |= c.Attribute("autolimits") != nullptr;
    for (const char* name : {"fusestatic", "discardvisual"}) c.DeleteAttribute(name);
  });
  if (!says) child(root, "compiler").SetAttribute("autolimits", "true");
}

/// Inertias about axes of their own: MuJoCo would find these to 1e-7 only. What no body can have is
/// left to MuJoCo to refuse.
void find_principal_axes(XmlElement& root) {
  walk(root, [](XmlElement& body) {
    XmlElement* inertial = body.FirstChildElement("inertial");
    if (!is(body, "body") || !inertial) return;
    const std::vector<double> I = mjcf_numbers(attribute(*inertial, "fullinertia")),
                              m = mjcf_numbers(attribute(*inertial, "mass"));
    if (I.size() != 6 || m.size() != 1 || !(m[0] > 0.0)) return;
    for (const char* name : {"quat", "axisangle", "euler", "xyaxes", "zaxis"})
      if (inertial->Attribute(name)) return;
    const SpatialInertia<double> b =
        inertia_from_com<double>(m[0], mjcf_vec3(attribute(*inertial, "pos"), {0, 0, 0}),
                                 {I[0], I[3], I[4], I[1], I[5], I[2]});
    if (triangle_margin(b) > 0.0) write_mjcf_inertial(body, b);
  });
}

/// Lines of the table by tag.
struct Line {
  std::string parent;  ///< empty: any
  const LaterWord* word;
};
std::multimap<std::string, Line> lines_by_tag() {
  std::multimap<std::string, Line> out;
  for (const LaterWord& word : later_words()) {
    std::istringstream tags(word.elements);
    for (std::string tag; tags >> tag;) {
      const std::size_t slash = tag.find('/');
      if (slash == tag.npos)
        out.emplace(tag, Line{"", &word});
      else
        out.emplace(tag.substr(slash + 1), Line{tag.substr(0, slash), &word});
    }
  }
  return out;
}

class Translator {
 public:
  Translator(const Mjcf& mjcf, std::vector<std::string>& notes) : mjcf_(mjcf), notes_(notes) {}

  void translate(XmlElement& element) {
    const auto [begin, end] = lines_.equal_range(element.Name());
    for (auto line = begin; line != end; ++line) {
      const LaterWord& word = *line->second.word;
      const XmlElement* parent = element.Parent()->ToElement();
      if (!line->second.parent.empty() && !(parent && is(*parent, line->second.parent.c_str())))
        continue;
      if (word.attributes) {
        translate_attributes(element, word);
      } else if (word.means == LaterMeans::kLeftOut) {
        leave_out(element, word, nullptr);
        element.Parent()->DeleteChild(&element);
        return;
      } else {
        apply(element, word, nullptr);
      }
    }
    for_each_child(element, nullptr, [&](XmlElement& e) { translate(e); });
  }

  void write_notes() {
    for (const char* text : order_) {
      std::string note = std::string(text) + " are left out: ";
      for (const Left& left : left_out_[text]) {
        note += left.what + " (";
        if (left.places > 1) note += std::to_string(left.places) + " times, first in ";
        note += left.line + "), ";
      }
      note.resize(note.size() - 2);
      notes_.push_back(note);
    }
  }

 private:
  struct Left {
    std::string what, line;
    int places = 1;
  };

  void translate_attributes(XmlElement& element, const LaterWord& word) {
    std::istringstream names(word.attributes);
    for (std::string name; names >> name;) {
      const char* value = element.Attribute(name.c_str());
      if (!value || (word.excepts && word.excepts(value))) continue;
      if (word.means == LaterMeans::kLeftOut) {
        leave_out(element, word, name.c_str());
        element.DeleteAttribute(name.c_str());
      } else {
        apply(element, word, name.c_str());
      }
    }
  }

  void apply(XmlElement& element, const LaterWord& word, const char* name) {
    if (word.means == LaterMeans::kMapped) {
      if (word.map) word.map(element, name);
      return;
    }
    std::string what = std::string("<") + element.Name() + ">";
    if (attribute(element, "name") != "") what += " '" + attribute(element, "name") + "'";
    if (name) what += std::string(" has ") + name + " = '" + attribute(element, name) + "'";
    throw ModelError(mjcf_.where + ": " + mjcf_.line(element) + ": " + what + " (MuJoCo " +
                     word.since + "): " + word.text);
  }

  void leave_out(const XmlElement& element, const LaterWord& word, const char* name) {
    const std::string what = std::string(element.Name()) + (name ? std::string(" ") + name : "");
    std::vector<Left>& group = left_out_[word.text];
    if (group.empty()) order_.push_back(word.text);
    const auto same = std::ranges::find(group, what, &Left::what);
    if (same != group.end())
      ++same->places;
    else
      group.push_back({what, mjcf_.line(element)});
  }

  const Mjcf& mjcf_;
  std::vector<std::string>& notes_;
  const std::multimap<std::string, Line> lines_ = lines_by_tag();
  std::map<std::string, std::vector<Left>> left_out_;  ///< by the table's text
  std::vector<const char*> order_;
};

/// Takes out free joints, and keyframes, whose numbers have their posture among them.
void fix_base(XmlElement& root, const Mjcf& mjcf, std::vector<std::string>& notes) {
  bool fixed = false;
  walk(root, [&](XmlElement& e) {
    for_each_child(e, nullptr, [&](XmlElement& c) {
      if (!is_free_base(c)) return;
      fixed = true;
      notes.push_back("body '" + attribute(e, "name") + "' floats (" + mjcf.line(c) +
                      "): fixed where the file has it, as asked; keyframes are left out");
      e.DeleteChild(&c);
    });
  });
  if (fixed) remove_children(root, "keyframe");
}

}  // namespace

bool is_free_base(const XmlElement& joint) {
  const bool is_free =
      is(joint, "freejoint") || (is(joint, "joint") && attribute(joint, "type") == "free");
  const XmlElement* body = is_free ? joint.Parent()->ToElement() : nullptr;
  return body && is(*body, "body") && attribute(*body, "name") != "ball";
}

void translate_mjcf(XmlElement& root, const Mjcf& mjcf, LostShape lost,
                    std::vector<std::string>& notes) {
  remove_unused(root);
  apply_defaults_of_today(root);
  expand_generated(root, mjcf);
  check_mjcf(root, mjcf.where);  // once more: with what was generated and turned
  if (mjcf.reading.fix_base) fix_base(root, mjcf, notes);
  strip_looks(root, mjcf, inertia_from_geoms(root), lost, notes);
  Translator translator(mjcf, notes);
  for_each_child(root, nullptr, [&](XmlElement& section) { translator.translate(section); });
  translator.write_notes();
  find_principal_axes(root);
}

}  // namespace diffnea::io
