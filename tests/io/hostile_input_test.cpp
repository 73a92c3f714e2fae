/// Files that were made to harm are refused before they cost time or memory. What they cost a
/// program that does not refuse them is told by tests/python/hostile_input_test.py, which limits
/// it.

#include <array>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <functional>
#include <string>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/generators/catch_generators_range.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/trajectory_file.hpp>
#include <diffnea/policy/promp.hpp>
#include <diffnea/recording/csv.hpp>
#include <diffnea/recording/preprocess.hpp>
#include <diffnea/runs/result.hpp>

#include "support/temporary_folder.hpp"

namespace diffnea::hostile_input_test {
namespace {

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::MessageMatches;

std::string times(int count, const std::string& text) {
  std::string out;
  for (int i = 0; i < count; ++i) out += text;
  return out;
}

/// `count` texts, each of its number.
std::string each(int count, const std::function<std::string(int)>& text) {
  std::string out;
  for (int i = 0; i < count; ++i) out += text(i);
  return out;
}

class Folder {
 public:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    const std::filesystem::path path = folder_.path() / name;
    std::ofstream(path, std::ios::binary) << text;
    return path;
  }
  const std::filesystem::path& path() const { return folder_.path(); }

 private:
  test::TemporaryFolder folder_;
};

struct Case {
  const char* name;
  std::string text, message;
};

TEST_CASE("hostile: descriptions of a size that no robot has are refused", "[io]") {
  const auto body = [](const std::string& inside) {
    return "<mujoco><worldbody><body><joint/><geom size='1'/>" + inside +
           "</body></worldbody></mujoco>";
  };
  const auto size = [](const std::string& what) {
    return "<mujoco><size " + what + "/><worldbody><body><joint/><geom size='1'/></body>" +
           "</worldbody></mujoco>";
  };
  const std::string begin = R"({"schema": "diffnea/model/1", "links": [)";
  const Case c = GENERATE_REF(
      Case{"lists in lists", times(100'000, "["), "is no robot description"},
      Case{"objects in objects", times(100'000, R"({"a":)"), "nested too deeply; the limit is 64"},
      Case{"keys", "{" + each(1001, [](int i) { return "\"" + std::to_string(i) + "\":0,"; }) + "}",
           "too many keys; the limit is 1000"},
      Case{"values", R"({"a":[)" + times(5'000'001, "0,") + "0]}", "too many values"},
      Case{"links",
           begin +
               each(2001,
                    [](int i) {
                      return std::string(i > 0 ? "," : "") + R"({"name": ")" + std::to_string(i) +
                             "\"}";
                    }) +
               "]}",
           "has 2001 links; the limit is 2000"},
      Case{"effects",
           begin + R"(], "effects": [)" +
               times(10'000, R"({"effect": "a", "where": "b", "parameters": []},)") +
               R"({"effect": "a", "where": "b", "parameters": []}]})",
           "has 10001 effects; the limit is 10000"},
      Case{"links of a URDF",
           "<robot name='r'>" +
               each(2001, [](int i) { return "<link name='" + std::to_string(i) + "'/>"; }) +
               "</robot>",
           "has 2001 links; the limit is 2000"},
      Case{"elements", "<robot>" + times(200'001, "<a/>") + "</robot>",
           "too many elements; the limit is 200000"},
      Case{"attributes",
           "<robot " + each(1001, [](int i) { return "a" + std::to_string(i) + "='' "; }) + "/>",
           "too many attributes; the limit is 1000"},
      Case{"elements in elements", "<robot>" + times(10'000, "<a>"), "XML_ELEMENT_DEPTH_EXCEEDED"},
      Case{"text that is not UTF-8", "<robot name='\xff'/>", "is not UTF-8"},
      Case{"text cut in a character", "<robot name='\xe2\x82'/>", "is not UTF-8"},
      Case{"a character 0", std::string("<robot name='\0'/>", 17), "is not UTF-8"},
      Case{"bodies", body(times(1000, "<body><geom size='1'/></body>")),
           "has 1001 bodies, generated ones counted; the limit is 1000"},
      Case{"bodies of bodies",
           body("<replicate count='100'><replicate count='100'><body/></replicate></replicate>"),
           "has 10001 bodies"},
      Case{"sites", body(times(5000, "<site/>")), "elements; the limit is 5000"},
      Case{"user numbers", size("nuser_body='1000000000'"), "nuser_body = '1000000000'"},
      Case{"keys of a posture", size("nkey='1e9'"), "nkey = '1e9'; the limit is 1000"},
      Case{"constraints", size("njmax='100000'"), "njmax = '100000'"},
      Case{"sensors",
           "<mujoco><worldbody><body name='b'><joint/><geom size='1'/></body></worldbody><sensor>"
           "<user objtype='body' objname='b' dim='2000000000' needstage='vel' datatype='real'/>"
           "</sensor></mujoco>",
           "<user> has dim = '2000000000'; the limit is 1000"});
  CAPTURE(c.name);
  const Folder folder;
  CHECK_THROWS_MATCHES(read_model(folder.write("model.xml", c.text)), ModelError,
                       MessageMatches(ContainsSubstring(c.message)));
}

TEST_CASE("hostile: entities are not put in, and comments may be in any encoding", "[io]") {
  const Folder folder;
  const std::string laughs =
      "<!DOCTYPE r [<!ENTITY a 'ha'><!ENTITY b '&a;&a;'><!ENTITY f SYSTEM '/etc/passwd'>]>\n";
  const Model model = read_model(folder.write(
      "a.urdf", "<?xml version='1.0'?><!-- \xb0 -->" +
                    std::string("<robot name='r'><link name='&lt;a&#x41;'><!-- \xff --></link>") +
                    "</robot>"));
  CHECK(model.links.at(0).name == "<aA");
  // As the parser has it: text, or no XML. Never what the entity stands for.
  try {
    const Model read =
        read_model(folder.write("b.urdf", laughs + "<robot name='&b;'><link name='&f;'/></robot>"));
    CHECK(read.name.find("ha") == std::string::npos);
    CHECK(read.links.at(0).name.find("root") == std::string::npos);
  } catch (const ModelError& error) {
    CHECK_THAT(error.what(), ContainsSubstring("is not XML"));
  }
}

TEST_CASE("hostile: the length of an actuator is not simulated", "[io]") {
  const Folder folder;  // 1e309 steps
  const Model model = read_model(folder.write(
      "a.xml",
      "<mujoco><compiler><lengthrange mode='all' inttotal='1e300' inteval='1e299' "
      "timestep='1e-9'/></compiler><worldbody><body><joint name='j'/><geom size='1'/></body>"
      "</worldbody><actuator><general joint='j'/></actuator></mujoco>"));
  CHECK(model.links.size() == 1);
}

TEST_CASE("hostile: links of an MJCF's folder may not lead out of it", "[io]") {
  const Folder folder, outside;
  const std::string part =
      "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody>"
      "</mujoco>";
  std::filesystem::create_symlink(outside.write("part.xml", part), folder.path() / "link.xml");
  std::filesystem::create_directory_symlink(outside.path(), folder.path() / "folder");
  folder.write("inside.xml", part);
  std::filesystem::create_symlink("inside.xml", folder.path() / "also.xml");
  const auto including = [&](const std::string& file) {
    return read_model(folder.write("model.xml", "<mujoco><include file='" + file + "'/></mujoco>"));
  };
  for (const char* file : {"link.xml", "folder/part.xml", "./folder/../link.xml"})
    CHECK_THROWS_MATCHES(including(file), ModelError,
                         MessageMatches(ContainsSubstring("outside the model's folder")));
  CHECK(including("also.xml").links.size() == 1);
}

/// A model of one body that is the mesh.
Model of_mesh(const Folder& folder, const std::string& mesh) {
  return read_model(folder.write(
      "model.xml", "<mujoco><asset><mesh name='m' " + mesh +
                       "/></asset><worldbody><body><joint/><geom type='mesh' mesh='m'/></body>"
                       "</worldbody></mujoco>"));
}

void check_refused_mesh(const Folder& folder, const std::string& mesh, const std::string& message) {
  CHECK_THROWS_MATCHES(of_mesh(folder, mesh), ModelError,
                       MessageMatches(ContainsSubstring(message)));
}

TEST_CASE("hostile: meshes whose faces name what there is not are refused", "[io]") {
  // MuJoCo's compiler would read where they point, and end the process at a file without content.
  const std::string vertices = "v 1 0 0\nv 0 1 0\nv 0 0 1\nv 0 0 0\n";
  const std::string faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\n";
  const auto msh = [](int vertex_count, int last) {
    const std::array<std::int32_t, 4> head = {vertex_count, 0, 0, 4};
    const std::array<float, 12> points = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
    const std::array<std::int32_t, 12> corners = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, last};
    std::string bytes(sizeof head + sizeof points + sizeof corners, '\0');
    std::memcpy(bytes.data(), head.data(), sizeof head);
    std::memcpy(bytes.data() + sizeof head, points.data(), sizeof points);
    std::memcpy(bytes.data() + sizeof head + sizeof points, corners.data(), sizeof corners);
    return bytes;
  };
  const Case c = GENERATE_REF(
      Case{"obj", vertices + faces + "f 2 3 4\n", ""},
      Case{"obj", vertices + faces + "f -3 -2\t-1\r\n", ""},
      // Corners without the normals and texture coordinates that the file has: it takes
      // AddressSanitizer to see MuJoCo read what lies before them.
      Case{"obj", vertices + "vn 0 0 1\nvt 0 0\n" + faces + "f 2//1 3/1/-1 4/1\n", ""},
      Case{"obj", "vn 0 0 1\nvt 0 0\n" + vertices + faces + "f 2 3 4\n", ""},
      Case{"obj", vertices, ""},  // their hull
      Case{"OBJ", vertices + faces + "f 2 3 5\n", "m.OBJ): line 8: a face names vertex '5' of 4"},
      Case{"obj", vertices + faces + "f 2 3 2147483648\n", "vertex '2147483648' of 4"},
      Case{"obj", vertices + faces + "f -4 -3 -5\n", "vertex '-5' of 4"},
      Case{"obj", "f -1 -2 -3\n" + vertices + faces, "line 1: a face names vertex '-1' of 4"},
      Case{"obj", vertices + faces + "f 2 3 0\n", "vertex '0' of 4"},
      Case{"obj", vertices + faces + "f 2 3 4x\n", "vertex '4x' of 4"},
      Case{"obj", vertices + faces + "f 2 3 4/1\n", "texture coordinate '1' of 0"},
      Case{"obj", vertices + faces + "f 2 3 4/\n", "texture coordinate '' of 0"},
      Case{"obj", vertices + faces + "f 2 3 4//7\n", "normal '7' of 0"},
      Case{"obj", vertices + "vt 0 0\nvn 0 0 1\nf 2 3 4/1/1/1\n", "more than three indices"},
      Case{"obj", vertices + faces + std::string("f 2 3 4\0", 8), "NUL"},
      Case{"obj", "v 1 0 0\n", "has 1 vertices, expected at least 4"},
      Case{"obj", "", "m.obj): is an empty file"}, Case{"stl", "", "m.stl): is an empty file"},
      Case{"msh", msh(4, 3), ""}, Case{"msh", msh(4, 4), "m.msh): a face names vertex '4' of 4"},
      Case{"msh", msh(4, -1), "vertex '-1' of 4"},
      Case{"msh", msh(5, 3), "MuJoCo cannot compile it"},  // of another size than it says
      Case{"msh", msh(-4, 3), "MuJoCo cannot compile it"},
      Case{"msh", "short", "MuJoCo cannot compile it"}, Case{"obj", "f 1 2 9", "has 0 vertices"});
  CAPTURE(c.name, c.text);
  const Folder folder;
  folder.write(std::string("m.") + c.name, c.text);
  const std::string file = std::string("file='m.") + c.name + "'";
  if (c.message.empty()) {
    CHECK(of_mesh(folder, file).links.size() == 1);
  } else {
    check_refused_mesh(folder, file, c.message);
  }
}

TEST_CASE("hostile: faces of a mesh that an MJCF states itself name what there is", "[io]") {
  const Folder folder;
  const std::string stated = "vertex='1 0 0 0 1 0 0 0 1 0 0 0' face='0 2 1 ";
  const std::string whole = stated + "0 1 3 0 3 2 1 2 3'";
  CHECK(of_mesh(folder, whole).links.size() == 1);
  check_refused_mesh(folder, stated + "0 1 3 0 3 2 1 2 4'",
                     "mesh 'm': a face names vertex '4' of 4");
  check_refused_mesh(folder, stated + "0 1 3 0 3 2 1 2 -9'", "vertex '-9' of 4");
  check_refused_mesh(folder, stated + "0 1 3 0 3 2 1 2 99999999999999999999'", "of 4");
  check_refused_mesh(folder, "vertex='1 0 0 x 1 0 0 0 1 0 0 0'",
                     "vertex holds 'x', expected numbers");
  check_refused_mesh(folder, "vertex='1 0 0'", "has 1 vertices");
  folder.write("m.obj", "v 1 0 0");
  check_refused_mesh(folder, whole + " file='m.obj'", "names a file and states vertices or faces");
}

TEST_CASE("hostile: recordings and trajectories of hostile size are refused", "[recording]") {
  const Folder folder;
  const std::string line = times(1'100'000, "0");
  const std::string columns =
      "time" + each(5000, [](int i) { return ",q" + std::to_string(i); }) + "\n0\n";
  const Case c = GENERATE_REF(
      Case{"a header", line, ":1: the line is longer than 1 MiB"},
      Case{"a row", "time,q_a,qcmd_a\n0,0,0\n" + line, ":3: the line is longer than 1 MiB"},
      Case{"columns", columns, "5001 columns; the limit is 5000"});
  CAPTURE(c.name);
  const std::filesystem::path path = folder.write("data.csv", c.text);
  CHECK_THROWS_MATCHES(read_recordings(path), DataError,
                       MessageMatches(ContainsSubstring(c.message)));
  CHECK_THROWS_MATCHES(read_trajectory(path), DataError,
                       MessageMatches(ContainsSubstring(c.message)));
}

TEST_CASE("hostile: a grid needs rows, and a rate that there is", "[recording]") {
  const auto recording = [](long rows, const std::function<double(long)>& time) {
    Recording r;
    r.source = "r";
    r.joint_names = {"a"};
    r.time.resize(rows);
    for (long i = 0; i < rows; ++i) r.time[i] = time(i);
    r.q = RowMatX<double>::Random(rows, 1);
    r.tau = RowMatX<double>::Random(rows, 1);
    r.has_tau = {true};
    return r;
  };
  // Three rows 2 µs apart, then a pause of 19 ms: ten thousand grid points a pause.
  const Recording dense = recording(3000, [](long i) {
    return 19e-3 * static_cast<double>(i / 3) + 2e-6 * static_cast<double>(i % 3);
  });
  CHECK_THROWS_MATCHES(plan_preprocess({dense}), DataError,
                       MessageMatches(ContainsSubstring("rows are too few")));
  const Recording tiny = recording(100, [](long i) { return 1e-300 * static_cast<double>(i); });
  CHECK_THROWS_MATCHES(plan_preprocess({tiny}), DataError,
                       MessageMatches(ContainsSubstring("is the unit of `time` right?")));
}

TEST_CASE("hostile: numbers of a result that no integer holds are refused", "[io]") {
  const Folder folder;
  folder.write("result.json",
               R"({"schema": "diffnea/identify/1", "rmse": {"units": {}}, "preprocessing": {
                   "rows": 1e300}, "summary": {}})");
  CHECK_THROWS_MATCHES(read_fit_run(folder.path()), ModelError,
                       MessageMatches(ContainsSubstring("preprocessing.rows: got 1e+300")));
}

TEST_CASE("hostile: primitives of a size that no search has are refused", "[policy]") {
  PrompSpec spec{.joints = {"a"}};
  spec.bases = 2'000'000'000;
  CHECK_THROWS_MATCHES(Promp(spec), Error, MessageMatches(ContainsSubstring("at most 1000")));
  spec.bases = 10;
  spec.held_first = spec.held_last = 2'000'000'000;  // their sum is no int
  CHECK_THROWS_MATCHES(Promp(spec), Error, MessageMatches(ContainsSubstring("weights are held")));
}

}  // namespace
}  // namespace diffnea::hostile_input_test
