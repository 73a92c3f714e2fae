#include "io/mjcf_generated.hpp"

#include <algorithm>
#include <set>

#include <diffnea/core/error.hpp>

#include "io/mjcf_defaults.hpp"
#include "io/mjcf_limits.hpp"
#include "io/mjcf_parts.hpp"
#include "io/mjcf_pose.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Number of elements, itself among them.
double elements_in(XmlElement& e) {
  double out = 0.0;
  walk(e, [&](XmlElement&) { ++out; });
  return out;
}

class Expansion {
 public:
  Expansion(XmlElement& root, const Mjcf& mjcf)
      : root_(root), mjcf_(mjcf), defaults_(root), angles_(root) {}

  /// Innermost first.
  void expand(XmlElement& parent) {
    for_each_child(parent, nullptr, [&](XmlElement& e) {
      expand(e);
      if (is(e, "replicate"))
        replicate(parent, e);
      else if (is(e, "frame"))
        flatten(parent, e);
    });
  }

 private:
  std::string line(const XmlElement& e) const { return mjcf_.where + ": " + mjcf_.line(e) + ": "; }

  /// Counts what is generated, before it is.
  void generate(const XmlElement& replicate, double elements) {
    generated_ += elements;
    if (!(generated_ <= kMaxMjcfElements))
      throw ModelError(line(replicate) + "<replicate> has count = '" +
                       attribute(replicate, "count") + "'; the limit is " +
                       std::to_string(kMaxMjcfElements) + " elements together");
  }

  /// Moves the children of a frame before it, to where it has them, and takes the frame out.
  void flatten(XmlElement& parent, XmlElement& frame) {
    const Pose<double> X = mjcf_pose(frame, defaults_, angles_);
    const std::string childclass = attribute(frame, "childclass");
    for_each_child(frame, nullptr, [&](XmlElement& e) {
      place(e, X);
      const char* name = is(e, "body") || is(e, "replicate") ? "childclass" : "class";
      const bool has_class =
          is(e, "body") || is(e, "joint") || is(e, "geom") || is(e, "site") || is(e, "composite");
      if (!childclass.empty() && has_class && !e.Attribute(name))
        e.SetAttribute(name, childclass.c_str());
      tinyxml2::XMLNode* before = frame.PreviousSibling();
      if (before)
        parent.InsertAfterChild(before, &e);
      else
        parent.InsertFirstChild(&e);
    });
    parent.DeleteChild(&frame);
  }

  void place(XmlElement& e, const Pose<double>& X) {
    const std::string fromto = defaults_.attribute(e, "fromto");
    if (is(e, "joint")) {
      const auto at = mjcf_vec3(defaults_.attribute(e, "pos"), {0, 0, 0});
      const auto axis = mjcf_vec3(defaults_.attribute(e, "axis"), {0, 0, 1});
      e.SetAttribute("pos", exact(X.R * at + X.p).c_str());
      e.SetAttribute("axis", exact(X.R * axis).c_str());
    } else if ((is(e, "geom") || is(e, "site")) && !fromto.empty()) {
      const std::vector<double> v = mjcf_numbers(fromto);
      if (v.size() != 6) return;  // MuJoCo says so
      e.SetAttribute("fromto", (exact(X.R * Vec3<double>{v[0], v[1], v[2]} + X.p) + " " +
                                exact(X.R * Vec3<double>{v[3], v[4], v[5]} + X.p))
                                   .c_str());
    } else if (is(e, "body") || is(e, "geom") || is(e, "site") || is(e, "inertial")) {
      if (e.Attribute("fullinertia"))
        throw ModelError(line(e) +
                         "<inertial> in a <frame> states fullinertia, expected "
                         "diaginertia with quat, or no frame around it");
      set_mjcf_pose(e, X * mjcf_pose(e, defaults_, angles_));
    } else if (is(e, "composite")) {
      throw ModelError(line(e) + "<composite> in a <frame> is not read: draw its bodies out");
    }
  }

  /// Frames with numbered copies of what is in the element, each moved on by the same step, before
  /// it; takes it out.
  void replicate(XmlElement& parent, XmlElement& e) {
    const std::vector<double> said = mjcf_numbers(attribute(e, "count"));
    const double count = said.empty() ? 0.0 : said[0];
    if (!(count >= 1.0))
      throw ModelError(line(e) + "<replicate> has count = '" + attribute(e, "count") +
                       "', expected 1 or more");
    generate(e, count * elements_in(e));
    Pose<double> step = mjcf_pose(e, defaults_, angles_);
    step.p = mjcf_vec3(attribute(e, "offset"), {0, 0, 0});
    std::set<std::string> names;
    walk(e, [&](XmlElement& c) {
      if (c.Attribute("name")) names.insert(attribute(c, "name"));
    });
    const std::size_t digits = std::to_string(static_cast<long>(count) - 1).size();
    std::vector<std::string> suffixes;
    Pose<double> X = Pose<double>::identity();
    tinyxml2::XMLNode* after = &e;
    for (long k = 0; k < static_cast<long>(count); ++k) {
      std::string number = std::to_string(k);
      number.insert(0, digits - number.size(), '0');
      suffixes.push_back(attribute(e, "sep") + number);
      XmlElement* copy = clone_with_places(e, *e.GetDocument());
      copy->SetName("frame");
      for (const char* name : {"count", "offset", "sep", "euler"}) copy->DeleteAttribute(name);
      set_mjcf_pose(*copy, X);
      walk(*copy, [&](XmlElement& c) {
        if (&c != copy && c.Attribute("name"))
          c.SetAttribute("name", (attribute(c, "name") + suffixes.back()).c_str());
      });
      after = parent.InsertAfterChild(after, copy);
      X = X * step;
    }
    replicate_references(e, names, suffixes);
    std::vector<XmlElement*> frames;
    XmlElement* frame = e.NextSiblingElement();
    for (std::size_t k = 0; k < suffixes.size(); ++k, frame = frame->NextSiblingElement())
      frames.push_back(frame);
    parent.DeleteChild(&e);
    for (XmlElement* f : frames) flatten(parent, *f);
  }

  /// Copies elements that name one which is there several times, as often.
  void replicate_references(const XmlElement& replicated, const std::set<std::string>& names,
                            const std::vector<std::string>& suffixes) {
    const auto refer = [&](XmlElement& e, const std::string& suffix) {
      bool found = false;
      walk(e, [&](XmlElement& c) {
        for (const char* name : kReferences)
          if (c.Attribute(name) && names.contains(attribute(c, name))) {
            found = true;
            if (!suffix.empty()) c.SetAttribute(name, (attribute(c, name) + suffix).c_str());
          }
      });
      if (found && !suffix.empty() && e.Attribute("name"))
        e.SetAttribute("name", (attribute(e, "name") + suffix).c_str());
      return found;
    };
    for (const char* section : kSectionsThatRefer)
      for_each_child(root_, section, [&](XmlElement& s) {
        for_each_child(s, nullptr, [&](XmlElement& e) {
          if (!refer(e, "")) return;
          const double copies = static_cast<double>(suffixes.size());
          generate(replicated, copies * elements_in(e));
          tinyxml2::XMLNode* after = &e;
          for (const std::string& suffix : suffixes) {
            XmlElement* copy = clone_with_places(e, *e.GetDocument());
            refer(*copy, suffix);
            after = s.InsertAfterChild(after, copy);
          }
          s.DeleteChild(&e);
        });
      });
  }

  XmlElement& root_;
  const Mjcf& mjcf_;
  MjcfDefaults defaults_;
  MjcfAngles angles_;
  double generated_ = 0.0;
};

}  // namespace

void expand_generated(XmlElement& root, const Mjcf& mjcf) {
  Expansion expansion(root, mjcf);
  for_each_child(root, "worldbody", [&](XmlElement& world) { expansion.expand(world); });
}

}  // namespace diffnea::io
