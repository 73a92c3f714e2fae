/// Doubts of `info` about masses and inertias; the start of a URDF that lacks them.

#include <algorithm>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/io/model_info.hpp>

#include "support/mjcf_text.hpp"

namespace model_sanity_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Approx;
using Catch::Matchers::ContainsSubstring;

namespace {

std::string inertial(double mass, const std::string& ixx, const std::string& izz) {
  return "<inertial><origin xyz='0 0 -.1'/><mass value='" + std::to_string(mass) +
         "'/><inertia ixx='" + ixx + "' ixy='0' ixz='0' iyy='" + ixx + "' iyz='0' izz='" + izz +
         "'/></inertial>";
}

/// Two links of 0.28 m and more, hanging, with drives of 60 N·m.
std::string arm(const std::string& upper, const std::string& fore) {
  const auto joint = [](const char* name, const char* parent, const char* child, const char* z) {
    return std::string("<joint name='") + name + "' type='revolute'><parent link='" + parent +
           "'/><child link='" + child + "'/><origin xyz='0 0 " + z +
           "'/><axis xyz='0 1 0'/><limit lower='-3' upper='3' effort='60' velocity='3'/></joint>";
  };
  return "<robot name='arm'><link name='base'/><link name='upper'>" + upper +
         "</link><link name='fore'>" + fore + "</link>" + joint("j1", "base", "upper", "0") +
         joint("j2", "upper", "fore", "-.28") + "</robot>";
}

std::string doubts(const std::string& text) {
  std::string out;
  for (const ModelIssue& issue : model_issues(model_of(text)))
    out += issue.link + ": " + issue.text + "\n";
  return out;
}

const std::string kUpper = inertial(0.55, "0.0012", "0.0002");

}  // namespace

TEST_CASE("sanity: an arm as arms are is not doubted", "[io]") {
  CHECK(doubts(arm(kUpper, inertial(0.4, "0.0008", "0.0001"))).empty());
}

TEST_CASE("sanity: a hull that is wider than its joints is not doubted", "[io]") {
  const std::string hull = inertial(8.0, "1.3", "1.3");  // gyration 0.40 m, joints within 0.38 m
  CHECK(doubts(arm(kUpper, hull)).find("gyration") == std::string::npos);
}

TEST_CASE("sanity: wrong units and placeholders are doubted by joint, number and remedy", "[io]") {
  struct Case {
    std::string fore;
    std::vector<std::string> says;
  };
  const Case c = GENERATE(
      Case{inertial(400.0, "0.0008", "0.0001"),
           {"fore: mass is 400 kg (joint 'j2')", "no metal is above", "grams?",
            "upper: gravity takes", "at joint 'j1'", "its effort limit is 60 N·m"}},
      Case{inertial(0.158, "6.887e4", "2.0e4"),
           {"fore: radius of gyration is 660", "(joint 'j2')", "lie within 0.38", "g·mm²"}},
      Case{inertial(0.008, "1", "1"),
           {"fore: inertia is exactly 1, 1, 1 kg·m² (joint 'j2') for a mass of 0.008 kg"}},
      Case{inertial(0.4, "4", "1"), {"fore: radius of gyration is 3.162 m"}});
  const std::string said = doubts(arm(kUpper, c.fore));
  for (const std::string& part : c.says) CHECK_THAT(said, ContainsSubstring(part));
}

TEST_CASE("sanity: a link without mass is doubted where it carries a joint elsewhere", "[io]") {
  const std::string fore = inertial(0.4, "0.0008", "0.0001");
  CHECK_THAT(
      doubts(arm("", fore)),
      ContainsSubstring("upper: link has no mass (joint 'j1'), though it carries a joint 0.28"));
  std::string meeting = arm("", fore);  // axes of one point: a joint drawn as two
  meeting.replace(meeting.find("0 0 -.28"), 8, "0 0 0.0");
  CHECK(doubts(meeting).empty());
}

TEST_CASE("urdf: without any inertia every link starts with one, and a note says so", "[io]") {
  const Model m = model_of(arm("", ""));
  CHECK_THAT(notes_of(m), ContainsSubstring("no moving link states an inertia"));
  CHECK(link_of(m, "j1").inertia.m == Approx(48.0 * 0.28 * 0.28));
  CHECK(link_of(m, "j1").inertia.h.z == Approx(-0.14 * 48.0 * 0.28 * 0.28));
  CHECK(link_of(m, "j2").inertia.m == Approx(10.0 * 0.28 * 0.28));  // an end, as long as the way
  CHECK(check_model(m).empty());
  const Model stated = model_of(arm(kUpper, ""));
  CHECK(stated.notes.empty());
  CHECK(link_of(stated, "j2").inertia.m == 0.0);
}

TEST_CASE("urdf: what other programs write is mended with a note", "[io]") {
  std::string text = arm(kUpper, "<inertial><mass value='0.4'/></inertial>");
  text.replace(text.find(" velocity='3'"), 13, "");
  text.replace(text.find("upper='3'"), 9, "upper='3.14.'");
  text.replace(text.find("xyz='0 0 -.28'"), 14, "xyz='0 0, -.28 0'");
  text += '\0';  // C's end of a text
  const Model m = model_of(text);
  CHECK_THAT(notes_of(m),
             ContainsSubstring("upper = '3.14.' in line 1 is read as '3.14'") &&
                 ContainsSubstring("xyz = '0 0, -.28 0' in line 1 is read as '0 0 -.28'") &&
                 ContainsSubstring("joint 'j1' states no limit of velocity") &&
                 ContainsSubstring("link 'fore' has a mass without <inertia>"));
  CHECK(link_of(m, "j1").limits.upper == 3.14);
  CHECK(!std::isfinite(link_of(m, "j1").limits.velocity));
  CHECK(link_of(m, "j2").X_PJ.p.z == -0.28);
  CHECK(link_of(m, "j2").inertia.m == 0.4);
  // A comma within a number may be a decimal one, and what lies behind three numbers not 0.
  const auto with_place = [&](const std::string& xyz) {
    std::string out = arm(kUpper, "");
    return out.replace(out.find("0 0 -.28"), 8, xyz);
  };
  CHECK_THAT(refusal(with_place("0,5 0 0")), ContainsSubstring("not a valid URDF"));
  CHECK_THAT(refusal(with_place("0 0 1 2")), ContainsSubstring("not a valid URDF"));
}

}  // namespace model_sanity_test
