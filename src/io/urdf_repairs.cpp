#include "io/urdf_repairs.hpp"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <optional>
#include <sstream>

namespace diffnea::io {
namespace {

/// Attributes that hold one number, or three.
constexpr const char* kNumbers[] = {"lower",  "upper", "effort", "velocity", "multiplier",
                                    "offset", "value", "ixx",    "ixy",      "ixz",
                                    "iyy",    "iyz",   "izz",    "damping",  "friction"};
constexpr const char* kVectors[] = {"xyz", "rpy"};

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> out;
  for (std::string word; in >> word;) out.push_back(word);
  return out;
}

std::string joined(const std::vector<std::string>& words) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : " ") + word;
  return out;
}

/// The number that a word is.
std::optional<double> number_of(const std::string& word) {
  const char* begin = word.data() + (word.starts_with('+') ? 1 : 0);
  const char* end = word.data() + word.size();
  double x = 0.0;
  const auto [last, error] = std::from_chars(begin, end, x);
  if (begin == end || last != end || error == std::errc::invalid_argument) return std::nullopt;
  return x;
}

class Repairs {
 public:
  Repairs(XmlElement& robot, std::vector<std::string>& notes) : robot_(robot), notes_(notes) {}

  void numbers() {
    const auto mend_all = [&](XmlElement& e) {
      for (const char* name : kNumbers) mend(e, name, 1);
      for (const char* name : kVectors) mend(e, name, 3);
    };
    for_each_child(robot_, "joint", [&](XmlElement& joint) { walk(joint, mend_all); });
    for_each_child(robot_, "link", [&](XmlElement& link) {
      for_each_child(link, "inertial", [&](XmlElement& inertial) { walk(inertial, mend_all); });
    });
  }

  void limits() {
    for_each_child(robot_, "joint", [&](XmlElement& joint) {
      XmlElement* limit = joint.FirstChildElement("limit");
      if (!limit) return;
      for (const char* name : {"effort", "velocity"}) {
        if (limit->Attribute(name)) continue;
        limit->SetAttribute(name, "0");
        notes_.push_back("joint '" + attribute(joint, "name") + "' states no limit of " + name);
      }
    });
  }

  void inertials() {
    for_each_child(robot_, "link", [&](XmlElement& link) {
      XmlElement* inertial = link.FirstChildElement("inertial");
      if (!inertial) return;
      const std::string here = "link '" + attribute(link, "name") + "' ";
      if (!inertial->FirstChildElement("mass")) {
        notes_.push_back(here + "has an <inertial> without <mass>: left out");
        link.DeleteChild(inertial);
      } else if (!inertial->FirstChildElement("inertia")) {
        notes_.push_back(here + "has a mass without <inertia>: a point mass here");
        XmlElement& inertia = child(*inertial, "inertia");
        for (const char* name : {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"})
          inertia.SetAttribute(name, "0");
      }
    });
  }

 private:
  void mend(XmlElement& e, const char* name, std::size_t count) {
    const char* text = e.Attribute(name);
    if (!text) return;
    const std::vector<std::string> words = words_of(text);
    std::vector<std::string> numbers = words;
    for (std::string& n : numbers)  // a comma within one may be a decimal point
      if (!number_of(n) && (n.ends_with(',') || n.ends_with('.'))) n.pop_back();
    if (numbers.size() < count ||
        !std::ranges::all_of(numbers, [](const auto& n) { return number_of(n).has_value(); }) ||
        !std::all_of(numbers.begin() + static_cast<long>(count), numbers.end(),
                     [](const auto& n) { return number_of(n) == 0.0; }))
      return;  // urdfdom says what it is
    numbers.resize(count);
    if (numbers == words) return;
    const std::string mended = joined(numbers);
    notes_.push_back(std::string(name) + " = '" + joined(words) + "' in line " +
                     std::to_string(e.GetLineNum()) + " is read as '" + mended + "'");
    e.SetAttribute(name, mended.c_str());
  }

  XmlElement& robot_;
  std::vector<std::string>& notes_;
};

}  // namespace

void repair_urdf(XmlElement& robot, const std::string& where, std::vector<std::string>& notes) {
  if (attribute(robot, "name").empty())
    robot.SetAttribute("name", std::filesystem::path(where).stem().string().c_str());
  Repairs repairs(robot, notes);
  repairs.numbers();
  repairs.limits();
  repairs.inertials();
}

}  // namespace diffnea::io
