#include "diffnea/io/sidecar.hpp"

#include <fstream>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>

#include "support/temporary_folder.hpp"

using Catch::Matchers::ContainsSubstring;

namespace diffnea::sidecar_test {

TEST_CASE("sidecar: what is written reads back", "[io]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path data = folder.path() / "arm.csv";
  CHECK_FALSE(read_sidecar(data));
  RecordingInfo info;
  info.torque_side = TorqueSide::kLink;
  info.torque_sampling = TorqueSampling::kHold;
  info.period = 12.5;
  info.passive = {"wrist"};
  info.torque_constant = {{"elbow", 0.119}};
  info.controller = {{"elbow", "kp", 300.0}, {"elbow", "limit", 40.0}};
  write_sidecar(info, data);
  const std::optional<Sidecar> sidecar = read_sidecar(data);
  REQUIRE(sidecar);
  CHECK(sidecar->path == folder.path() / "arm.json");
  CHECK(sidecar->notes.empty());
  CHECK(sidecar->info.torque_side == TorqueSide::kLink);
  CHECK(sidecar->info.torque_sampling == TorqueSampling::kHold);
  CHECK(sidecar->info.period == 12.5);
  CHECK(sidecar->info.passive == info.passive);
  CHECK(sidecar->info.torque_constant == info.torque_constant);
  REQUIRE(sidecar->info.controller.size() == 2);
  CHECK(sidecar->info.controller[1].name == "limit");
  CHECK(sidecar->info.controller[1].value == 40.0);
}

TEST_CASE("sidecar: the side of the torque decides how it is sampled unless said", "[io]") {
  const test::TemporaryFolder folder;
  const auto sampling = [&](const char* text) {
    std::ofstream(folder.path() / "arm.csv.json") << text;
    return read_sidecar(folder.path() / "arm.csv")->info.torque_sampling;
  };
  CHECK(sampling("{}") == TorqueSampling::kHold);
  CHECK(sampling(R"({"torque_side": "link"})") == TorqueSampling::kInstant);
  CHECK(sampling(R"({"torque_sampling": "instant"})") == TorqueSampling::kInstant);
}

TEST_CASE("sidecar: a model of the same name is not taken, an unknown key is noted", "[io]") {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "arm.json") << R"({"schema": "diffnea/model/1"})";
  CHECK_FALSE(read_sidecar(folder.path() / "arm.csv"));
  std::ofstream(folder.path() / "arm.json") << R"({"operator": "me", "period": 2})";
  const std::optional<Sidecar> sidecar = read_sidecar(folder.path() / "arm.csv");
  REQUIRE(sidecar);
  REQUIRE(sidecar->notes.size() == 1);
  CHECK_THAT(sidecar->notes[0], ContainsSubstring("key 'operator'"));
}

TEST_CASE("sidecar: what a recording did not leave is not replaced", "[io]") {
  const test::TemporaryFolder folder;
  const char* text =
      GENERATE(R"({"schema": "diffnea/model/1"})", R"({"operator": "me"})", R"({"period": 2})");
  std::ofstream(folder.path() / "arm.json") << text;
  CHECK_THROWS_AS(write_sidecar({}, folder.path() / "arm.csv"), FileError);
  CHECK(read_text_file(folder.path() / "arm.json") == text);
  CHECK_THROWS_WITH(sidecar_path(folder.path() / "arm.csv"), ContainsSubstring("arm.json"));
}

TEST_CASE("sidecar: it is written where it is read", "[io]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path data = folder.path() / "arm.csv";
  RecordingInfo info;
  info.period = 2.0;
  write_sidecar(info, data);
  std::filesystem::rename(folder.path() / "arm.json", folder.path() / "arm.csv.json");
  info.period = 3.0;
  write_sidecar(info, data);
  CHECK(read_sidecar(data)->info.period == 3.0);
  CHECK_FALSE(std::filesystem::exists(folder.path() / "arm.json"));
  // A recording that is called .json itself is not replaced by what it cannot hold.
  CHECK(sidecar_path(folder.path() / "data.json") == folder.path() / "data.json.json");
}

TEST_CASE("sidecar: in which key two of them differ", "[io]") {
  RecordingInfo a, b;
  CHECK(sidecar_difference(a, b).empty());
  b.payload = HeldBody{};
  b.payload->mass = 2.0;
  CHECK(sidecar_difference(a, b) == "payload");
  a.payload = b.payload;
  CHECK(sidecar_difference(a, b).empty());
  a.torque_side = TorqueSide::kLink;
  CHECK(sidecar_difference(a, b) == "torque_side");
}

TEST_CASE("sidecar: options keep their passive joints beside the file's", "[io]") {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "arm.json") << R"({"period": 2, "passive": ["a"]})";
  ReadOptions options;
  options.info.passive = {"b", "a"};
  const ReadOptions both = with_sidecar(folder.path() / "arm.csv", options);
  CHECK(both.info.passive == std::vector<std::string>{"a", "b"});
  CHECK(both.info.period == 2.0);
  CHECK(with_sidecar(folder.path() / "other.csv", options).info.passive == options.info.passive);
}

TEST_CASE("sidecar: a wrong value is a DataError with file and key", "[io]") {
  const auto [text, message] = GENERATE(table<std::string, std::string>({
      {"{", "arm.json"},
      {"[]", "expected an object"},
      {R"({"torque_side": "joint"})", "torque_side: got 'joint'; choices: motor, link"},
      {R"({"period": -1})", "period: expected a time of 0 s or more"},
      {R"({"period": 4e15})", "at most 1e9 s"},
      {R"({"passive": "wrist"})", "passive"},
      {R"({"torque_constant": 0.1})", "torque_constant: expected an object with a key per joint"},
      {R"({"controller": {"elbow": {"kp": "big"}}})", "controller.elbow.kp"},
      {R"({"torque_sid": "link"})", "got the key 'torque_sid'; did you mean 'torque_side'?"},
  }));
  CAPTURE(text);
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "arm.json") << text;
  CHECK_THROWS_AS(read_sidecar(folder.path() / "arm.csv"), DataError);
  CHECK_THROWS_WITH(read_sidecar(folder.path() / "arm.csv"), ContainsSubstring(message));
}

}  // namespace diffnea::sidecar_test
