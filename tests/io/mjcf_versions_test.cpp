/// Every line of the table of words that are later than MuJoCo 2.2, by documents that have them.

#include "io/mjcf_versions.hpp"

#include <iterator>
#include <sstream>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include "support/mjcf_text.hpp"

namespace mjcf_versions_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;
using io::LaterMeans;
using io::LaterWord;

namespace {

std::vector<std::string> words_of(const char* text) {
  std::istringstream in(text ? text : "");
  return {std::istream_iterator<std::string>(in), {}};
}

/// A value that MuJoCo 2.2 does not read, or that says something.
std::string later_value(const std::string& tag, const std::string& attribute) {
  if (attribute == "integrator") return "implicitfast";
  if (attribute == "dyntype") return "filterexact";
  if (attribute == "gaintype" || attribute == "biastype") return "dcmotor";
  if (attribute == "type") return tag == "geom" ? "sdf" : tag == "site" ? "mesh" : "cable";
  if (attribute == "damping" || attribute == "stiffness" || attribute == "springlength")
    return "1 2";
  if (attribute == "actuatorfrcrange" || attribute == "actuatorforcerange") return "-2 3";
  if (attribute.starts_with("site")) return "s";
  if (attribute == "inertia") return "exact";
  return "1";
}

/// A document that has the element in its place, with the attribute if there is one.
std::string document_with(const std::string& where, const std::string& attribute,
                          const std::string& value) {
  const std::size_t slash = where.find('/');
  const std::string parent = slash == where.npos ? "" : where.substr(0, slash),
                    tag = slash == where.npos ? where : where.substr(slash + 1),
                    said = attribute.empty() ? "" : " " + attribute + "='" + value + "'";
  const auto element = [&](const std::string& rest, const std::string& inside = "") {
    return "<" + tag + said + rest + ">" + inside + "</" + tag + ">";
  };
  const std::string pair = " geom1='g' geom2='h'", tendon = "<site site='s'/><site site='t'/>",
                    in_body = "<geom name='g' size='.1'/>",
                    in_world = "<geom name='h' size='.1'/><site name='t'/>",
                    shape = "<asset><mesh name='m' vertex='0 0 0 1 0 0 0 1 0 0 0 1'";
  const auto weighed = [&](const std::string& assets) {
    return "<mujoco>" + assets + "<worldbody><body><joint/><geom type='mesh' mesh='m'/></body>" +
           "</worldbody></mujoco>";
  };
  if (parent == "default") return one_joint({"<default>" + element("") + "</default>"});
  if (where == "mesh/plugin") return weighed(shape + "><plugin/></mesh></asset>");
  if (parent == "asset") return one_joint({"<asset>" + element("") + "</asset>"});
  if (parent == "worldbody") return one_joint({.in_world = element("")});
  if (where == "geom/plugin") return one_joint({.in_body = "<geom size='1'><plugin/></geom>"});
  if (where == "composite/plugin") return refusal("");  // only below composites that are refused
  if (parent == "actuator")
    return one_joint({.tail = "<actuator>" + element(" joint='j'") + "</actuator>"});
  if (parent == "equality") return one_joint({.tail = "<equality>" + element("") + "</equality>"});
  if (tag == "plugin" || tag == "flexcomp" || tag == "frame")
    return one_joint({.in_body = element("")});
  if (tag == "replicate") return one_joint({.in_body = element(" count='2'")});
  if (tag == "composite")
    return one_joint({.in_body = element(attribute == "type" ? "" : " type='grid'")});
  if (tag == "option" || tag == "compiler" || tag == "extension" || tag == "deformable")
    return one_joint({element("")});
  if (tag == "flag") return one_joint({"<option>" + element("") + "</option>"});
  if (tag == "body") return one_joint({.in_body = element("")});
  if (tag == "joint")
    return "<mujoco><compiler autolimits='true'/><worldbody><body>" + std::string(kInertial) +
           element(" name='j'") + "</body></worldbody></mujoco>";
  if (tag == "freejoint")
    return "<mujoco><worldbody><body name='ball'>" + std::string(kInertial) + element("") +
           "</body></worldbody></mujoco>";
  if (tag == "geom") return one_joint({.in_body = element(" size='.1'")});
  if (tag == "site") return one_joint({.in_body = element("")});
  if (tag == "mesh") return weighed(shape + said + "/></asset>");
  if (tag == "pair")
    return one_joint({.in_body = in_body,
                      .tail = "<contact>" + element(pair) + "</contact>",
                      .in_world = in_world});
  if (tag == "spatial")
    return one_joint(
        {.tail = "<tendon>" + element("", tendon) + "</tendon>", .in_world = in_world});
  if (tag == "fixed")
    return one_joint(
        {.tail = "<tendon>" + element("", "<joint joint='j' coef='1'/>") + "</tendon>"});
  if (tag == "tendon") return one_joint({"<default>" + element("") + "</default>"});
  if (tag == "connect" || tag == "weld")
    return one_joint({.tail = "<equality>" +
                              element(attribute == "site1" ? " site2='t'" : " site1='t'") +
                              "</equality>",
                      .in_world = in_world});
  if (tag == "key") return one_joint({.tail = "<keyframe>" + element("") + "</keyframe>"});
  if (tag == "adhesion")
    return one_joint({.tail = "<actuator>" + element(" body='a' ctrlrange='0 1'") + "</actuator>"});
  if (tag == "muscle" || tag == "general" || tag == "motor" || tag == "position" ||
      tag == "velocity" || tag == "intvelocity" || tag == "damper" || tag == "cylinder") {
    const bool needs = tag == "intvelocity" || tag == "damper";
    const std::string range = tag == "damper" ? " ctrlrange='0 1'" : " actrange='0 1'";
    return one_joint(
        {.tail = "<actuator>" + element(" joint='j'" + (needs ? range : "")) + "</actuator>"});
  }
  FAIL("the test draws no <" << where << ">");
  return "";
}

}  // namespace

TEST_CASE("mjcf: every later word is left out with a note, mapped, or refused with its line",
          "[io]") {
  const auto lines = io::later_words();
  const LaterWord& word = lines[GENERATE_REF(range(std::size_t(0), lines.size()))];
  for (const std::string& element : words_of(word.elements)) {
    if (element == "composite/plugin" || element == "worldbody/plugin") continue;
    if (element == "attach" || element == "asset/model") continue;  // mjcf_attach_test.cpp
    for (const std::string& attribute :
         word.attributes ? words_of(word.attributes) : std::vector<std::string>{""}) {
      const std::size_t slash = element.find('/');
      const std::string tag = slash == element.npos ? element : element.substr(slash + 1);
      std::string value = later_value(tag, attribute);
      if (word.excepts && word.excepts(value)) value = tag == "joint" ? "1 0" : "0";
      const std::string text = document_with(element, attribute, value);
      CAPTURE(text, word.text, word.since);
      const ModelReading reading{.open_loops = true};
      if (word.means == LaterMeans::kRefused) {
        const std::string said = refusal(text, reading);
        CHECK_THAT(said, ContainsSubstring(word.text) && ContainsSubstring("line 1: <" + tag) &&
                             ContainsSubstring(std::string("(MuJoCo ") + word.since + ")"));
      } else {
        const std::string notes = notes_of(model_of(text, reading));
        const std::string said = tag + (attribute.empty() ? "" : " " + attribute) + " (";
        const bool left_out = word.means == LaterMeans::kLeftOut;
        CHECK((notes.find(said) != notes.npos) == left_out);
        if (left_out) CHECK_THAT(notes, ContainsSubstring(word.text));
      }
    }
  }
}

}  // namespace mjcf_versions_test
