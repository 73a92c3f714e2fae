/// A ball and its string in model files: read, written back, shown, and refused with a reason.

#include <algorithm>
#include <filesystem>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/model_info.hpp>

#include "support/temporary_folder.hpp"

namespace ball_file_test {

using namespace diffnea;
using namespace diffnea::test;
using Catch::Matchers::ContainsSubstring;

namespace {

/// Positions of order 1 through a sum or two: 1e-16 observed.
constexpr double kRoundTripTol = 1e-14;

const std::string kOpen = R"(<mujoco model="cup">
  <compiler angle="radian"/>
  <worldbody>
    <site name="ceiling" pos="0 0 2"/>
    <body name="arm" pos="0 0 1">
      <inertial pos=".1 0 0" mass="2" diaginertia=".02 .03 .025"/>
      <joint name="yaw" axis="0 0 1" pos=".01 .02 .03"/>
      <body name="hand" pos=".3 0 0" euler="0 0 1">
        <inertial pos="0 0 0" mass=".1" diaginertia="1e-4 1e-4 1e-4"/>
        <site name="cup" pos="0 0 .1"/>
        <site name="anchor" pos=".02 .01 .1"/>
      </body>
    </body>
)";
const std::string kBall = R"(    <body name="ball" pos=".3 0 .5">
      <freejoint/>
      <geom type="sphere" size=".02" mass=".0205"/>
      <site name="centre"/>
      <site name="surface" pos="0 0 .02"/>
    </body>
)";
const std::string kClose = "  </worldbody>\n";
const std::string kString =
    "<tendon><spatial name='string' limited='true' range='0 .3'><site site='anchor'/>"
    "<site site='centre'/></spatial></tendon>";

Model read(const TemporaryFolder& folder, const std::string& text, const char* name = "m.xml") {
  write_file_atomically(folder.path() / name, text);
  return read_model(folder.path() / name);
}

Model read_mjcf_with(const TemporaryFolder& folder, const std::string& ball,
                     const std::string& tendon) {
  return read(folder, kOpen + ball + kClose + tendon + "</mujoco>");
}

std::string json_with(const std::string& links, const std::string& ball) {
  return R"({"schema": "diffnea/model/1", "name": "m", "links": [)" + links + R"(], "ball": )" +
         ball + "}";
}

constexpr const char* kLink =
    R"({"name": "hand", "joint": {"name": "j", "type": "revolute", "axis": [0, 0, 1]},
        "inertia": {"mass": 1, "about_com": [0.01, 0, 0, 0.01, 0, 0.01]}})";

}  // namespace

TEST_CASE("ball: an MJCF's free body and limited tendon are a ball on a string", "[io]") {
  const TemporaryFolder folder;
  const Model m = read_mjcf_with(folder, kBall, kString);
  CHECK(m.notes.empty());
  CHECK(joint_names(m) == std::vector<std::string>{"yaw"});
  REQUIRE(m.ball);
  CHECK(m.ball->mass == 0.0205);
  CHECK(m.ball->radius == 0.02);
  REQUIRE(m.ball->string);
  CHECK(m.links[m.ball->string->link].name == "hand");
  CHECK(m.ball->string->length == 0.3);
  CHECK(m.ball->string->p_LS.x == 0.02);
  CHECK(m.ball->string->p_LS.y == 0.01);
  CHECK(m.ball->string->p_LS.z == 0.1);
  CHECK(m.frames.size() == 3);  // the ball's sites are none of the robot's
}

TEST_CASE("ball: the anchor's link is the joint's, whose origin is the joint's anchor", "[io]") {
  const TemporaryFolder folder;
  std::string text = kOpen + kBall + kClose + kString + "</mujoco>";
  text.replace(text.find("<joint name=\"yaw\""), 0, "<site name='elbow' pos='.11 .22 .33'/>");
  text.replace(text.find("'anchor'/>"), 8, "'elbow'");
  const Model m = read(folder, text);
  REQUIRE(m.ball);
  CHECK(m.links[m.ball->string->link].name == "arm");
  CHECK(std::abs(m.ball->string->p_LS.x - 0.10) < kRoundTripTol);
  CHECK(std::abs(m.ball->string->p_LS.y - 0.20) < kRoundTripTol);
  CHECK(std::abs(m.ball->string->p_LS.z - 0.30) < kRoundTripTol);
}

TEST_CASE("ball: without a tendon it flies freely; a string may hang in the world", "[io]") {
  const TemporaryFolder folder;
  const Model free = read_mjcf_with(folder, kBall, "");
  REQUIRE(free.ball);
  CHECK_FALSE(free.ball->string);
  std::string hung = kString;
  hung.replace(hung.find("anchor"), 6, "ceiling");
  const Model m = read_mjcf_with(folder, kBall, hung);
  REQUIRE((m.ball && m.ball->string));
  CHECK(m.ball->string->link == -1);
  CHECK(m.ball->string->p_LS.z == 2.0);
  // A world of a ball alone is a model, too.
  const Model alone =
      read(folder, "<mujoco model='flight'><worldbody>" + kBall + kClose + "</mujoco>");
  CHECK(alone.links.empty());
  CHECK(alone.ball->mass == 0.0205);
}

TEST_CASE("ball: a string that ends on the ball's surface is counted to its centre", "[io]") {
  const TemporaryFolder folder;
  std::string tendon = kString;
  tendon.replace(tendon.find("centre"), 6, "surface");
  Model m = read_mjcf_with(folder, kBall, tendon);
  CHECK(m.ball->string->length == 0.32);
  REQUIRE(m.notes.size() == 1);
  CHECK_THAT(m.notes[0], ContainsSubstring("0.02 m beside the ball's centre"));
  m.ball->string->length = 0.5;
  CHECK(write_model(m, folder.path() / "new.xml").empty());
  CHECK_THAT(read_text_file(folder.path() / "new.xml"), ContainsSubstring("range=\"0 0.48\""));
}

TEST_CASE("ball: fitted length, attachment and mass land in the MJCF", "[io]") {
  const TemporaryFolder folder;
  Model m = read_mjcf_with(folder, kBall, kString);
  m.ball->string->length = 1.0 / 3.0;
  m.ball->string->p_LS = {0.0123, -0.0456, 0.0789};
  m.ball->mass = 0.025;
  CHECK(write_model(m, folder.path() / "new.xml").empty());
  const Model back = read_model(folder.path() / "new.xml");
  REQUIRE((back.ball && back.ball->string));
  CHECK(back.ball->mass == 0.025);
  CHECK(back.ball->string->length == 1.0 / 3.0);
  CHECK(std::abs(back.ball->string->p_LS.x - 0.0123) < kRoundTripTol);
  CHECK(std::abs(back.ball->string->p_LS.y + 0.0456) < kRoundTripTol);
  CHECK(std::abs(back.ball->string->p_LS.z - 0.0789) < kRoundTripTol);
  CHECK(back.frames[1].X_LF.p.z == 0.1);  // the cup stays
}

TEST_CASE("ball: what an MJCF cannot hold is said when it is written", "[io]") {
  const TemporaryFolder folder;
  const auto notes = [&](const Model& m) { return write_model(m, folder.path() / "new.xml"); };
  using Notes = std::vector<std::string>;
  const Model original = read_mjcf_with(folder, kBall, kString);
  Model m = original;
  m.ball->radius = 0.1;
  m.ball->string->link = 0;
  m.effects.push_back({"quadratic_drag", "ball", {{"drag", 0.01, "N*s^2/m^2"}}});
  CHECK(notes(m) == Notes{"the changed attachment of the string", "the changed radius of the ball",
                          "quadratic_drag at ball"});
  m = original;
  m.ball.reset();
  CHECK(notes(m) == Notes{"that there is no ball"});
  m = original;
  m.ball->string.reset();
  CHECK(notes(m) == Notes{"that the ball has no string"});
  // The cup's own site is not moved with the string that is tied to it.
  std::string at_cup = kString;
  at_cup.replace(at_cup.find("anchor"), 6, "cup");
  m = read_mjcf_with(folder, kBall, at_cup);
  m.ball->string->p_LS.z += 0.01;
  CHECK(notes(m) == Notes{"the changed attachment of the string"});
}

TEST_CASE("ball: an MJCF that means a string and draws none says what was expected", "[io]") {
  const TemporaryFolder folder;
  struct Case {
    const char *tendon, *message;
  };
  const Case c = GENERATE(
      Case{"<spatial name='string'><site site='anchor'/><site site='centre'/></spatial>",
           "has no limit"},
      Case{"<spatial name='string' limited='true' range='0 1'><site site='anchor'/>"
           "<site site='ceiling'/></spatial>",
           "from site 'anchor' to site 'ceiling', of which none is on the ball"},
      Case{"<spatial name='string' limited='true' range='0 1'><site site='centre'/>"
           "<site site='surface'/></spatial>",
           "both are on the ball"},
      Case{"<spatial name='string' limited='true' range='0 1'><site site='anchor'/>"
           "<site site='cup'/><site site='centre'/></spatial>",
           "runs over 3 sites"},
      Case{"<fixed name='string' limited='true' range='0 1'><joint joint='yaw' coef='1'/></fixed>",
           "runs over 1 joints"});
  CAPTURE(c.tendon);
  CHECK_THROWS_WITH(
      read_mjcf_with(folder, kBall, "<tendon>" + std::string(c.tendon) + "</tendon>"),
      ContainsSubstring(c.message) && ContainsSubstring("expected <spatial name='string'"));
}

TEST_CASE("ball: an MJCF's look-alikes are noted", "[io]") {
  const TemporaryFolder folder;
  std::string slides = kBall;
  slides.replace(slides.find("<freejoint/>"), 12, "<joint name='x' type='slide' axis='1 0 0'/>");
  const Model m = read_mjcf_with(folder, slides, kString);
  CHECK_FALSE(m.ball);
  CHECK(joint_names(m) == std::vector<std::string>{"yaw", "x"});
  REQUIRE(m.notes.size() == 2);
  CHECK_THAT(m.notes[0], ContainsSubstring("no <freejoint/>"));
  CHECK_THAT(m.notes[1], ContainsSubstring("tendon 'string' is left out"));
  std::string rope = kString;
  rope.replace(rope.find("name='string'"), 13, "name='rope'");
  const Model other = read_mjcf_with(folder, kBall, rope);
  CHECK_FALSE(other.ball->string);
  REQUIRE(other.notes.size() == 1);
  CHECK_THAT(other.notes[0], ContainsSubstring("a string is a tendon named 'string'"));
}

TEST_CASE("ball: JSON holds every double, effects at ball, string and camera too", "[io]") {
  Model m = model_from_json(json_with(kLink, R"({"mass": 0.02})"), "text");
  m.ball = BallSpec{1.0 / 3.0, 0.1 + 0.2, StringSpec{GENERATE(-1, 0), {1e-300, 1.0 / 7, -3}, 0.7}};
  m.cup = CupSpec{.inner_radius = 0.04, .wall = 0.003, .floor = 0.0145, .rim = 0.095};
  m.frames.push_back({"cup", m.ball->string->link, Pose<double>::identity()});
  for (const EffectInfo& info : catalogue()) {
    if (!acts_on_ball(info)) continue;
    EffectSpec e{info.name, places(info, m).front(), {}};
    for (const ParameterInfo& p : info.parameters)
      e.parameters.push_back({p.name, std::min(1.0, p.most) / 3.0, p.unit});
    m.effects.push_back(e);
  }
  REQUIRE(m.effects.size() > 10);
  const std::string text = model_to_json(m);
  const Model back = model_from_json(text, "text");
  CHECK(model_to_json(back) == text);
  CHECK(model_issues(back).empty());
  REQUIRE((back.ball && back.ball->string));
  CHECK(back.ball->mass == m.ball->mass);
  CHECK(back.ball->radius == m.ball->radius);
  CHECK(back.ball->string->link == m.ball->string->link);
  CHECK(back.ball->string->length == m.ball->string->length);
  CHECK(back.ball->string->p_LS.x == m.ball->string->p_LS.x);
  REQUIRE(back.effects.size() == m.effects.size());
  for (std::size_t i = 0; i < m.effects.size(); ++i) {
    CHECK(back.effects[i].where == m.effects[i].where);
    for (std::size_t k = 0; k < m.effects[i].parameters.size(); ++k)
      CHECK(back.effects[i].parameters[k].unit == m.effects[i].parameters[k].unit);
  }
}

TEST_CASE("ball: a wrong JSON is named with key and choices", "[io]") {
  struct Case {
    const char *ball, *message;
  };
  const Case c = GENERATE(
      Case{"{}", "m.json.ball: key 'mass' is missing"},
      Case{R"({"mass": 0})", "the ball's mass is 0 kg, expected > 0"},
      Case{R"({"mass": 1, "radius": -1})", "the ball's radius is -1 m"},
      Case{R"({"mass": 1, "colour": 1})", "unknown key 'colour'; keys: mass, radius, string"},
      Case{R"({"mass": 1, "string": {"link": "hnad", "length": 1}})",
           "ball.string.link: there is no link 'hnad' (null for the world); links: hand"},
      Case{R"({"mass": 1, "string": {"link": "hand"}})", "key 'length' is missing"},
      Case{R"({"mass": 1, "string": {"link": null, "length": 0}})",
           "the string's length is 0 m, expected > 0"},
      Case{R"({"mass": 1, "string": {"length": 1, "attachment": [1, 2]}})",
           "ball.string.attachment: got 2 numbers, expected 3"});
  CHECK_THROWS_WITH(model_from_json(json_with(kLink, c.ball), "m.json"),
                    ContainsSubstring(c.message));
}

TEST_CASE("ball: a model may be a ball alone", "[io]") {
  const TemporaryFolder folder;
  const Model m = read(folder, json_with("", R"({"mass": 0.0027, "radius": 0.02})"), "ball.json");
  CHECK(m.links.empty());
  CHECK(make_tree(m).num_dofs() == 0);
  CHECK(model_issues(m).empty());
  CHECK(write_model(m, folder.path() / "again.json").empty());
  CHECK(read_model(folder.path() / "again.json").ball->radius == 0.02);
  const std::string text = model_info_text(m);
  CHECK_THAT(text, ContainsSubstring("m: a ball, no links") &&
                       ContainsSubstring("mass 0.0027 kg, radius 0.02 m") &&
                       ContainsSubstring("in free flight") &&
                       ContainsSubstring("nothing looks wrong"));
  CHECK_THAT(model_info_json(m), ContainsSubstring(R"("string": null)"));
}

TEST_CASE("ball: info shows it with its string", "[io]") {
  const Model m = model_from_json(
      json_with(kLink, R"({"mass": 0.5, "string": {"link": "hand", "attachment": [1, 2, 3],
                           "length": 0.25}})"),
      "m.json");
  CHECK_THAT(model_info_text(m), ContainsSubstring("mass 0.5 kg, radius not known") &&
                                     ContainsSubstring("string of 0.25 m from hand at (1 2 3)"));
  const std::string json = model_info_json(m);
  CHECK_THAT(json, ContainsSubstring(R"("radius": null)") &&
                       ContainsSubstring(R"("link": "hand")") &&
                       ContainsSubstring(R"("length": 0.25)"));
}

namespace {

/// An arm whose shapes the ball hits or passes, and a cup.
std::string with_cup(const std::string& numeric, const std::string& shapes = "") {
  std::string text = kOpen + kBall + kClose + kString + numeric + "</mujoco>";
  text.replace(text.find("<joint name=\"yaw\""), 0, shapes);
  text.replace(text.find("<geom type=\"sphere\""), 5, "<geom contype='2' conaffinity='1'");
  return text;
}
const std::string kCup = "<custom><numeric name='cup' data='.04 .003 .0145 .095'/></custom>";

}  // namespace

TEST_CASE("cup: an MJCF's numeric gives the dimensions of the cup at the site", "[io]") {
  const TemporaryFolder folder;
  const Model m = read(folder, with_cup(kCup));
  REQUIRE(m.cup);
  CHECK(m.cup->inner_radius == 0.04);
  CHECK(m.cup->wall == 0.003);
  CHECK(m.cup->floor == 0.0145);
  CHECK(m.cup->rim == 0.095);
  CHECK(m.obstacles.empty());
  CHECK_FALSE(read_mjcf_with(folder, kBall, kString).cup);
  const Model wam = read_model(DIFFNEA_SOURCE_DIR "/models/wam4_ball_in_cup.xml");
  CHECK(wam.name == "wam4_ball_in_cup");
  REQUIRE(wam.cup);
  CHECK(wam.cup->rim == 0.095);
  CHECK(wam.notes.empty());
  REQUIRE(wam.obstacles.size() == 1);
  CHECK(wam.links[wam.obstacles[0].link].name == "forearm");
  CHECK(wam.obstacles[0].radius == 0.035);
  CHECK(std::abs(wam.obstacles[0].p_LA.y + 0.05) < kRoundTripTol);
  CHECK(std::abs(wam.obstacles[0].p_LB.y + 0.35) < kRoundTripTol);
}

TEST_CASE("cup: capsules and spheres that the ball hits are obstacles in the frame of their link",
          "[io]") {
  const TemporaryFolder folder;
  const Model m =
      read(folder, with_cup(kCup,
                            "<geom type='capsule' size='.03' fromto='.11 .12 .13 .41 .12 .53' "
                            "conaffinity='2' contype='0'/>"
                            "<geom type='sphere' size='.05' pos='.01 .02 .04' contype='1' "
                            "conaffinity='0'/>"
                            "<geom type='sphere' size='.05' contype='4' conaffinity='4'/>"
                            "<geom type='box' size='.1 .1 .1' contype='1'/>"));
  REQUIRE(m.obstacles.size() == 2);
  const CapsuleSpec &capsule = m.obstacles[0], &sphere = m.obstacles[1];
  // The link's origin is the joint's anchor, (.01, .02, .03) in the body.
  const Vec3<double> a = capsule.p_LA - Vec3<double>{0.1, 0.1, 0.1},
                     b = capsule.p_LB - Vec3<double>{0.4, 0.1, 0.5};
  CHECK(m.links[capsule.link].name == "arm");
  CHECK(capsule.radius == 0.03);
  CHECK(dot(a, a) < kRoundTripTol * kRoundTripTol);
  CHECK(dot(b, b) < kRoundTripTol * kRoundTripTol);
  const Vec3<double> middle = sphere.p_LA - Vec3<double>{0, 0, 0.01},
                     length = sphere.p_LB - sphere.p_LA;
  CHECK(sphere.radius == 0.05);
  CHECK(dot(middle, middle) < kRoundTripTol * kRoundTripTol);
  CHECK(dot(length, length) == 0.0);
  REQUIRE(m.notes.size() == 1);
  CHECK_THAT(m.notes[0], ContainsSubstring("shapes of 'arm' that the ball hits are left out"));
}

TEST_CASE("cup: JSON holds cup and obstacles bit by bit, info shows them", "[io]") {
  const TemporaryFolder folder;
  Model m = read(folder, with_cup(kCup, "<geom type='sphere' size='.05' contype='1'/>"));
  m.cup->wall = 0.001 + 0.002;
  m.obstacles.push_back({-1, {1.0 / 3.0, 0, 0}, {0, 1.0 / 7.0, 0}, 0.1 + 0.2});
  const std::string text = model_to_json(m);
  const Model back = model_from_json(text, "text");
  CHECK(model_to_json(back) == text);
  REQUIRE(back.cup);
  CHECK(back.cup->wall == m.cup->wall);
  REQUIRE(back.obstacles.size() == 2);
  CHECK(back.obstacles[0].link == 0);
  CHECK(back.obstacles[1].link == -1);
  CHECK(back.obstacles[1].p_LB.y == 1.0 / 7.0);
  CHECK(back.obstacles[1].radius == 0.1 + 0.2);
  CHECK_THAT(
      model_info_text(m),
      ContainsSubstring("at hand, frame cup") &&
          ContainsSubstring("inner radius 0.04 m, wall 0.003 m, floor 0.0145 m, rim 0.095 m") &&
          ContainsSubstring("obstacles of the ball\n  arm: ") &&
          ContainsSubstring("  the ground: (0.3333 0 0) to (0 0.1429 0), radius 0.3 m"));
  CHECK_THAT(model_info_json(m), ContainsSubstring("\"inner_radius\": 0.04"));
  // An MJCF keeps what it has and says what it does not take.
  CHECK(write_model(m, folder.path() / "new.xml") ==
        std::vector<std::string>{"the changed cup or obstacles of the ball"});
  CHECK(read_model(folder.path() / "new.xml").cup->rim == 0.095);
}

TEST_CASE("cup: one that cannot be is refused with what is needed", "[io]") {
  const TemporaryFolder folder;
  struct Case {
    const char *data, *message;
  };
  const Case c = GENERATE(Case{".04 .003 .095", "has 3 numbers; expected 4: inner radius"},
                          Case{"0 .003 .0145 .095", "inner radius 0, wall 0.003"},
                          Case{".04 -1 .0145 .095", "wall -1"},
                          Case{".04 .003 .2 .095", "a floor below the rim"});
  CAPTURE(c.data);
  const std::string custom =
      "<custom><numeric name='cup' data='" + std::string(c.data) + "'/></custom>";
  CHECK_THROWS_WITH(read(folder, with_cup(custom)), ContainsSubstring(c.message));
  std::string bare = with_cup(kCup);
  bare.replace(bare.find("name=\"cup\" pos"), 10, "name=\"mug\"");
  CHECK_THROWS_WITH(read(folder, bare), ContainsSubstring("there is no frame 'cup'") &&
                                            ContainsSubstring("<site name=\"cup\"/>"));
}

TEST_CASE("cup: a wrong JSON is named with key and choices", "[io]") {
  const auto refused = [](const std::string& cup, const std::string& obstacles) {
    const std::string text = R"({"schema": "diffnea/model/1", "links": [)" + std::string(kLink) +
                             R"(], "frames": [{"name": "cup", "link": "hand"}], "cup": )" + cup +
                             R"(, "obstacles": )" + obstacles + "}";
    std::string message = "(read)";
    try {
      model_from_json(text, "m.json");
    } catch (const ModelError& error) {
      message = error.what();
    }
    return message;
  };
  const std::string good = R"({"inner_radius": 0.04, "wall": 0.003, "floor": 0, "rim": 0.1})";
  CHECK(refused(good, "[]") == "(read)");
  CHECK(refused("null", R"([{"link": "hand", "from": [0, 0, 0], "radius": 1}])") == "(read)");
  CHECK_THAT(refused(R"({"inner_radius": 0.04})", "[]"),
             ContainsSubstring("m.json.cup: key 'wall' is missing"));
  CHECK_THAT(refused(R"({"inner_radius": 0, "wall": 1, "floor": 0, "rim": 1})", "[]"),
             ContainsSubstring("expected a radius and a wall above 0"));
  CHECK_THAT(refused(good, R"([{"from": [0, 0, 0], "radius": 0}])"),
             ContainsSubstring("obstacle 0: expected a finite segment and a radius above 0"));
  CHECK_THAT(refused(good, R"([{"link": "hnad", "from": [0, 0, 0], "radius": 1}])"),
             ContainsSubstring("obstacles[0].link: there is no link 'hnad'") &&
                 ContainsSubstring("links: hand"));
  CHECK_THAT(refused(good, R"([{"from": [0, 0, 0], "radius": 1, "colour": 1}])"),
             ContainsSubstring("unknown key 'colour'; keys: link, from, to, radius"));
}

}  // namespace ball_file_test
