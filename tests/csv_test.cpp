#include "diffnea/recording/csv.hpp"

#include <cmath>
#include <fstream>
#include <limits>
#include <numbers>
#include <sstream>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>

#include "support/temporary_folder.hpp"

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::EndsWith;
using Catch::Matchers::WithinRel;

namespace diffnea {
namespace {

/// A unit's factor rounds once.
constexpr double kRounding = 1e-15;

/// A file in a folder of its own.
struct CsvFile {
  test::TemporaryFolder folder;
  std::filesystem::path path = folder.path() / "arm.csv";

  explicit CsvFile(const std::string& text) { std::ofstream(path, std::ios::binary) << text; }
};

std::vector<Recording> read(const std::string& text, const ReadOptions& options = {},
                            ReadReport* report = nullptr) {
  return read_recordings(CsvFile(text).path, options, report);
}

/// `rows` good rows of one joint, from row `first`.
std::string good_rows(int rows, int first = 0) {
  std::string out;
  for (int i = first; i < first + rows; ++i)
    out += std::to_string(0.01 * i) + "," + std::to_string(0.1 * i) + ",1.5\n";
  return out;
}

bool same(const RowMatX<double>& a, const RowMatX<double>& b) {
  if (a.rows() != b.rows() || a.cols() != b.cols()) return false;
  for (long i = 0; i < a.size(); ++i)
    if (!(a.data()[i] == b.data()[i] || (std::isnan(a.data()[i]) && std::isnan(b.data()[i]))))
      return false;
  return true;
}

Recording random_recording(unsigned seed, long rows) {
  Rng rng(seed);
  Recording r;
  r.run = static_cast<int>(seed);
  r.joint_names = {"a", "b", "c"};
  r.has_tau = {true, false, true};
  r.time.resize(rows);
  for (long i = 0; i < rows; ++i) r.time[i] = 0.001 * static_cast<double>(i) + 1e-5 * rng.uniform();
  const auto fill = [&](RowMatX<double>& m, long columns) {
    m.resize(rows, columns);
    for (long i = 0; i < m.size(); ++i) m.data()[i] = rng.normal() * std::exp(3.0 * rng.normal());
  };
  for (RowMatX<double>* m : {&r.q, &r.qd, &r.qdd, &r.qcmd, &r.tau}) fill(*m, 3);
  fill(r.ball, 3);
  fill(r.spin, 3);
  r.q(3, 1) = r.ball(0, 2) = std::numeric_limits<double>::quiet_NaN();
  r.tau.col(1).setConstant(std::numeric_limits<double>::quiet_NaN());
  r.extra.push_back({"temperature [degC]", r.q.col(0)});
  return r;
}

}  // namespace

TEST_CASE("csv: all columns of the format arrive in SI units, in the joints' order",
          "[recording]") {
  ReadReport report;
  const std::vector<Recording> runs = read(
      "time [ms],q_elbow [deg],tau_elbow,q_slide [mm],qd_slide [mm/s],qdd_elbow [rad/s²],"
      "qcmd_elbow,tau_slide [kN],ball_x,ball_y,ball_z [cm],spin_x [rpm],spin_y,spin_z,volts [V]\n"
      "10,180,2.5,1500,20,7,0.5,0.3,1,2,300,60,4,5,24\n"
      "20,90,2.5,1500,20,7,0.5,0.3,1,2,300,60,4,5,25\n",
      {}, &report);
  REQUIRE(runs.size() == 1);
  const Recording& r = runs[0];
  CHECK(r.joint_names == std::vector<std::string>{"elbow", "slide"});
  CHECK(r.has_tau == std::vector<bool>{true, true});
  CHECK_THAT(r.time[1], WithinRel(0.02, kRounding));
  CHECK_THAT(r.q(0, 0), WithinRel(std::numbers::pi, kRounding));
  CHECK_THAT(r.q(0, 1), WithinRel(1.5, kRounding));
  CHECK_THAT(r.qd(0, 1), WithinRel(0.02, kRounding));
  CHECK(std::isnan(r.qd(0, 0)));
  CHECK(r.qdd(0, 0) == 7.0);
  CHECK(r.qcmd(0, 0) == 0.5);
  CHECK(r.tau(0, 0) == 2.5);
  CHECK_THAT(r.tau(0, 1), WithinRel(300.0, kRounding));
  CHECK_THAT(r.ball(0, 2), WithinRel(3.0, kRounding));
  CHECK_THAT(r.spin(0, 0), WithinRel(2.0 * std::numbers::pi, kRounding));
  REQUIRE(r.extra.size() == 1);
  CHECK(r.extra[0].name == "volts [V]");
  CHECK(r.extra[0].values[1] == 25.0);
  CHECK(report.extra_channels == std::vector<std::string>{"volts [V]"});
  CHECK(report.rows == 2);
  bool missing = false;
  for (const std::string& note : report.notes)
    missing = missing || note == "no velocity is measured at: elbow";
  CHECK(missing);
}

TEST_CASE("csv: byte order mark, CRLF, quotes, spaces, blank lines and signs do no harm",
          "[recording]") {
  const std::vector<Recording> runs =
      read("\xef\xbb\xbf\"time\" , q_a ,\"tau_a\"\r\n\r\n 0 , +1.5e0 ,\"2\"\r\n0.1,-.5,NaN\r\n");
  REQUIRE(runs.size() == 1);
  REQUIRE(runs[0].rows() == 2);
  CHECK(runs[0].q(0, 0) == 1.5);
  CHECK(runs[0].tau(0, 0) == 2.0);
  CHECK(runs[0].q(1, 0) == -0.5);
  CHECK(std::isnan(runs[0].tau(1, 0)));
}

TEST_CASE("csv: an empty cell is a gap, in any column", "[recording]") {
  const std::vector<Recording> runs =
      read("time,q_a,ball_x,ball_y,ball_z\n0,1,,,\n0.1,,2,3,4\n0.2,1,nan,NA,5\n");
  REQUIRE(runs[0].rows() == 3);
  CHECK(std::isnan(runs[0].ball(0, 2)));
  CHECK(std::isnan(runs[0].q(1, 0)));
  CHECK(runs[0].ball(1, 2) == 4.0);
  CHECK(std::isnan(runs[0].ball(2, 0)));
  CHECK(std::isnan(runs[0].ball(2, 1)));
  CHECK(runs[0].spin.size() == 0);
}

TEST_CASE("csv: a ball alone is a recording, gaps and all", "[recording]") {
  ReadReport report;
  const std::vector<Recording> runs = read(
      "run,time,ball_x,ball_y,ball_z,spin_x,spin_y,spin_z\n"
      "0,0,1,2,3,,,\n0,0.1,,,,,,\n0,0.2,4,5,6,7,8,9\n1,0,1,1,1,0,0,0\n",
      {}, &report);
  REQUIRE(runs.size() == 2);
  CHECK(runs[0].num_joints() == 0);
  CHECK(runs[0].q.rows() == 3);
  CHECK(runs[0].q.cols() == 0);
  CHECK(runs[0].has_tau.empty());
  CHECK(runs[0].ball(0, 1) == 2.0);
  CHECK(std::isnan(runs[0].ball(1, 0)));
  CHECK(runs[0].ball(2, 2) == 6.0);
  CHECK(std::isnan(runs[0].spin(0, 0)));
  CHECK(runs[0].spin(2, 1) == 8.0);
  CHECK(report.notes.empty());

  const test::TemporaryFolder folder;
  write_recordings(runs, folder.path() / "ball.csv");
  std::ostringstream text;
  text << std::ifstream(folder.path() / "ball.csv").rdbuf();
  CHECK_THAT(text.str(),
             ContainsSubstring("run,time,ball_x,ball_y,ball_z,spin_x,spin_y,spin_z\n") &&
                 ContainsSubstring("\n0,0.1,,,,,,\n"));
  const std::vector<Recording> back = read_recordings(folder.path() / "ball.csv");
  REQUIRE(back.size() == 2);
  CHECK(same(back[0].ball, runs[0].ball));
  CHECK(same(back[0].spin, runs[0].spin));
  CHECK(same(back[0].q, runs[0].q));
}

TEST_CASE("csv: blocks of a ball alone join", "[recording]") {
  std::string text = "time,ball_x,ball_y,ball_z\n";
  for (int i = 0; i < 70'000; ++i)  // more than a block
    text += std::to_string(0.01 * i) + (i % 3 == 0 ? ",,,\n" : ",1,2," + std::to_string(i) + "\n");
  const std::vector<Recording> runs = read(text);
  REQUIRE(runs.size() == 1);
  CHECK(runs[0].rows() == 70'000);
  CHECK(runs[0].q.rows() == 70'000);
  CHECK(runs[0].ball(69'998, 2) == 69'998.0);
  CHECK(std::isnan(runs[0].ball(69'999, 0)));
}

TEST_CASE("csv: a ball that is never seen is refused where there is nothing else", "[recording]") {
  CHECK_THROWS_WITH(read("time,ball_x,ball_y,ball_z\n0,,,\n0.1,,,\n"),
                    ContainsSubstring("the ball is seen in no row"));
  ReadReport report;
  read("time,q_a,ball_x,ball_y,ball_z\n0,1,,,\n0.1,2,,,\n", {}, &report);
  REQUIRE(report.notes.size() == 1);
  CHECK_THAT(report.notes[0], ContainsSubstring("the ball is seen in no row"));
}

TEST_CASE("csv: runs are kept apart, and time may begin anew in each", "[recording]") {
  const std::vector<Recording> runs =
      read("run,time,q_a\n3,0,1\n3,0.1,2\n1,0,3\n1,0.1,4\n1,0.2,5\n2,9,6\n");
  REQUIRE(runs.size() == 3);
  CHECK(runs[0].run == 3);
  CHECK(runs[0].rows() == 2);
  CHECK(runs[1].rows() == 3);
  CHECK(runs[1].q(0, 0) == 3.0);
  CHECK(runs[2].rows() == 1);
  CHECK_THAT(runs[2].source, EndsWith("arm.csv run 2"));
  CHECK_THROWS_WITH(read("run,time,q_a\n3,0,1\n1,0,2\n3,1,3\n"),
                    ContainsSubstring("arm.csv:4: run 3 begins a second time"));
}

TEST_CASE("csv: rows that cannot be true are left out, each with its reason", "[recording]") {
  const std::string bad =
      "3.00,inf,1\n"           // line 302
      "3.01,-1e400,1\n"        // 303
      "2.681562e+154,0.1,1\n"  // 304
      "2.99,0.1,1\n"           // 305: repeats row 301
      "1.00,0.1,1\n"           // 306: backward
      ",0.1,1\n";              // 307
  ReadReport report;
  ReadOptions options;
  options.max_quarantined_share = 0.02;
  const std::vector<Recording> runs =
      read("time,q_a,tau_a\n" + good_rows(300) + bad + good_rows(100, 302), options, &report);
  CHECK(runs[0].rows() == 400);
  CHECK(report.rows == 406);
  REQUIRE(report.quarantined == 6);
  const char* reasons[] = {"'q_a' is inf, infinite",
                           "'q_a' is -inf, infinite",
                           "'time' is 2.68156e+154, absurdly large",
                           "time repeats (2.99)",
                           "time runs backward, from 2.99 to 1",
                           "the time is missing"};
  for (int i = 0; i < 6; ++i) {
    CHECK(report.quarantined_rows[i].line == 302 + i);
    CHECK(report.quarantined_rows[i].reason == reasons[i]);
  }
  // A clock that jumps ahead and back: the jump is wrong, not what follows it.
  const std::vector<Recording> jumped =
      read("time,q_a,tau_a\n" + good_rows(150) + "500,0.1,1\n" + good_rows(150, 150), {}, &report);
  CHECK(jumped[0].rows() == 300);
  REQUIRE(report.quarantined == 1);
  CHECK(report.quarantined_rows[0].line == 152);
  CHECK(report.quarantined_rows[0].reason == "time jumps ahead to 500 and back");
  // A pause is none of this.
  CHECK(read("time,q_a,tau_a\n" + good_rows(150) + good_rows(150, 5000), {}, &report)[0].rows() ==
        300);
  CHECK(report.quarantined == 0);
}

TEST_CASE("csv: a file with more than 1 % of impossible rows is refused", "[recording]") {
  const auto file = [](int good, int bad) {
    std::string text = "time,q_a,tau_a\n" + good_rows(good);
    for (int i = 0; i < bad; ++i) text += "0,0,0\n";
    return text;
  };
  CHECK(read(file(99, 1))[0].rows() == 99);
  CHECK_THROWS_WITH(
      read(file(98, 2)),
      ContainsSubstring("2 of 100 rows cannot be true, expected at most 1 %: line 100: time "
                        "runs backward") &&
          ContainsSubstring("need a column `run`"));
}

namespace {

/// 400 rows whose torque swings between ±2; the rows from `first` to before `end` have `absurd`.
std::string with_torques(const std::string& absurd, int first, int end) {
  std::string out = "time,q_a,tau_a\n";
  for (int i = 0; i < 400; ++i)
    out += std::to_string(0.01 * i) + ",0.1," +
           (i >= first && i < end ? absurd : std::to_string(2.0 * std::sin(0.1 * i))) + "\n";
  return out;
}

/// Lines that are left out of a file.
std::vector<long> left_out(const std::string& text, const ReadOptions& options = {}) {
  ReadReport report;
  read(text, options, &report);
  std::vector<long> lines;
  for (const QuarantinedRow& row : report.quarantined_rows) lines.push_back(row.line);
  return lines;
}

}  // namespace

TEST_CASE("csv: a short burst of absurd torque is left out, wherever it stands", "[recording]") {
  using Lines = std::vector<long>;
  CHECK(left_out(with_torques("-1e6", 200, 202)) == Lines{202, 203});
  CHECK(left_out(with_torques("1e6", 0, 2)) == Lines{2, 3});
  CHECK(left_out(with_torques("1e6", 398, 400)) == Lines{400, 401});
  CHECK(left_out(with_torques("nan", 398, 400)).empty());
  ReadReport report;
  const Recording r = read(with_torques("1e6", 200, 202), {}, &report).at(0);
  CHECK(r.rows() == 398);
  CHECK(r.tau.cwiseAbs().maxCoeff() <= 2.0);
  CHECK_THAT(report.quarantined_rows.at(0).reason,
             ContainsSubstring("'tau_a' is 1e+06, more than 1000 times"));
}

TEST_CASE("csv: a torque that is large for long is the torque", "[recording]") {
  // 21 rows of 400: more than a burst, and more than 2 %, so that it is usual.
  CHECK(left_out(with_torques("1e6", 200, 221)).empty());
  // 25 of 2000: 98 % stay below 2, and yet no burst.
  std::string text = with_torques("1e6", 200, 225);
  for (int i = 400; i < 2000; ++i) text += std::to_string(0.01 * i) + ",0.1,1.5\n";
  ReadReport report;
  const Recording r = read(text, {}, &report).at(0);
  CHECK(report.quarantined == 0);
  CHECK(r.rows() == 2000);
  CHECK(r.tau(210, 0) == 1e6);
  CHECK(r.tau(199, 0) != 1e6);
  CHECK(r.tau(225, 0) != 1e6);
}

TEST_CASE("csv: the joint's effort limit tells an absurd torque earlier", "[recording]") {
  ReadOptions options;
  options.joints = {{.name = "a", .effort = 5.0}};
  const std::string text = with_torques("600", 200, 201);  // 300 times what is usual
  CHECK(left_out(text).empty());
  CHECK(left_out(text, options) == std::vector<long>{202});
  // A limit that all rows exceed is wrong itself; one of 0 was never given.
  for (const double effort : {1e-3, 0.0}) {
    options.joints = {{.name = "a", .effort = effort}};
    CHECK(left_out(with_torques("2", 0, 0), options).empty());
  }
}

TEST_CASE("csv: absurd torques do not depend on the blocks that are asked for", "[recording]") {
  const CsvFile file(with_torques("1e6", 100, 103));
  for (const long block_rows : {1L, 7L, 101L, 1000L}) {
    RecordingReader reader(file.path);
    long rows = 0;
    for (Recording block; reader.next(block, block_rows);) {
      CHECK(block.tau.cwiseAbs().maxCoeff() <= 2.0);
      rows += block.rows();
    }
    CHECK(rows == 397);
    CHECK(reader.report().quarantined == 3);
  }
}

TEST_CASE("csv: an angle cannot be that of a slide, nor a length that of a hinge", "[recording]") {
  ReadOptions options;
  options.joints = {{.name = "a", .prismatic = true}, {.name = "b"}};
  const auto header = [&](const std::string& a, const std::string& b) {
    return read("time," + a + "," + b + "\n0,0,0\n1,0,0\n", options).size();
  };
  CHECK(header("q_a [mm]", "q_b [deg]") == 1);
  CHECK(header("q_a", "q_b") == 1);
  CHECK_THROWS_WITH(header("q_a [deg]", "q_b"),
                    ContainsSubstring(":1:2: unit 'deg' cannot be that of 'a', which slides"));
  CHECK_THROWS_WITH(header("q_a", "q_b [mm]"), ContainsSubstring("expected rad"));
  CHECK_THROWS_WITH(read("time,q_a,tau_a [N*m],q_b\n0,0,1,0\n", options),
                    ContainsSubstring("expected N or"));
}

TEST_CASE("csv: gaps and a file that breaks off are noted", "[recording]") {
  std::string text = with_torques("", 10, 13);
  ReadReport report;
  read(text, {}, &report);
  REQUIRE(report.notes.size() == 1);
  CHECK_THAT(report.notes[0], ContainsSubstring("'tau_a' in 3 of 400 rows"));
  text = with_torques("", 0, 0) + "4.0,0.";
  read(text, {}, &report);
  CHECK_THAT(report.notes.back(),
             ContainsSubstring("breaks off in the middle of its last row, line 402"));
}

TEST_CASE("csv: a file that breaks off loses its last row, not itself", "[recording]") {
  ReadReport report;
  CHECK(read("time,q_a,tau_a\n" + good_rows(200) + "2.00,1.0", {}, &report)[0].rows() == 200);
  REQUIRE(report.quarantined == 1);
  CHECK_THAT(report.quarantined_rows[0].reason, ContainsSubstring("ends in the middle"));
  CHECK(read("time,q_a,tau_a\n" + good_rows(200) + "2.00,1.0,-")[0].rows() == 200);
}

TEST_CASE("csv: what the format does not allow is refused, with file, line and column",
          "[recording]") {
  const auto [text, message] = GENERATE(table<std::string, std::string>({
      {"", "arm.csv: the file is empty"},
      {"time,q_a\n", "arm.csv: there is a header and no row"},
      {"t,q_a\n0,1\n", "arm.csv:1: there is no column `time` [s]; columns: t, q_a"},
      {"time,x\n0,1\n", "neither a joint (q_<joint>) nor a ball"},
      {"time;q_a\n0;1\n", "header without commas"},
      {"0.0,1.5\n0.1,1.6\n", "got numbers in the first row, expected a header"},
      {"time,q_a,q_a\n0,1,1\n", "arm.csv:1:3: column 'q_a' comes twice, first as column 2"},
      {"time,q_a [deg],q_a\n0,1,1\n", "arm.csv:1:3: column 'q_a' comes twice"},
      {"time,q_a,\n0,1,1\n", "arm.csv:1:3: the column has no name"},
      {"time,q_a,tau_b\n0,1,1\n", "arm.csv:1:3: 'tau_b' has no 'q_b'"},
      {"time,q_a,qd_b\n0,1,1\n", "arm.csv:1:3: 'qd_b' has no 'q_b'"},
      {"time,ball_x,ball_z\n0,1,1\n", "of ball_x, ball_y, ball_z some are missing"},
      {"time,q_a [grad]\n0,1\n", "unit 'grad' is not known for a position; units: rad, deg"},
      {"time [min],q_a\n0,1\n", "unit 'min' is not known for a time; units: s, ms"},
      {"time,q_a,tau_a [A]\n0,1,1\n",
       "arm.csv:1:3: 'tau_a' is a current [A]: give its torque_constant"},
      {"time,q_a,tau_a [V]\n0,1,1\n", "unit 'V' is not known for a torque; units: N*m"},
      {"time,q_a [deg\n0,1\n", "opens a unit that it does not close"},
      {"time,q_a\n0,1\n0.1,1.2.3\n", "arm.csv:3:2: '1.2.3' in column 'q_a' is no number"},
      {"time,q_a\n0,1\n0.1,off\n", "arm.csv:3:2: 'off' in column 'q_a' is no number"},
      {"time,q_a\n0,1\n0.1\n", "arm.csv:3:2: the row has 1 cells, the header 2"},
      {"time,q_a\n0,1\n0.1,2,3\n", "arm.csv:3:3: the row has 3 cells, the header 2"},
      {"time,q_a\n0,1,\n", "arm.csv:2:3: the row has 3 cells, the header 2"},
      {"time,q_a,tau_a\n0,1,0\n1,1,-0\n", "'tau_a' is 0 in every row; declare the joint passive"},
      {"time,q_a,tau_a\n0,1,\n1,1,\n", "'tau_a' has no value"},
  }));
  CAPTURE(text);
  CHECK_THROWS_AS(read(text), DataError);
  CHECK_THROWS_WITH(read(text), ContainsSubstring(message));
}

TEST_CASE("csv: a file that is not there is a FileError", "[recording]") {
  const test::TemporaryFolder folder;
  CHECK_THROWS_AS(read_recordings(folder.path() / "none.csv"), FileError);
  CHECK_THROWS_AS(read_recordings(folder.path()), FileError);
}

TEST_CASE("csv: another format is refused with the command that converts it", "[recording]") {
  const test::TemporaryFolder folder;
  for (const char* name : {"a.mcap", "a.db3", "a.bag", "a.mat", "a.parquet", "a.npz"}) {
    const std::filesystem::path path = folder.path() / name;
    std::ofstream(path) << "not read";
    CHECK_THROWS_WITH(read_recordings(path), EndsWith("python -m diffnea.convert " + path.string() +
                                                      " -o " + folder.path().string() + "/a.csv"));
  }
  std::filesystem::create_directory(folder.path() / "bag");
  std::ofstream(folder.path() / "bag" / "metadata.yaml") << "";
  CHECK_THROWS_WITH(read_recordings(folder.path() / "bag"), EndsWith("bag.csv"));
}

TEST_CASE("csv: a robot description is refused with where it is given", "[recording]") {
  const test::TemporaryFolder folder;
  for (const char* name : {"arm.urdf", "arm.xml", "arm.mjcf", "arm.json"}) {
    const std::filesystem::path path = folder.path() / name;
    CHECK_THROWS_WITH(read_recordings(path), !ContainsSubstring("description"));  // none is there
    std::ofstream(path) << "not read";
    CHECK_THROWS_WITH(read_recordings(path), ContainsSubstring(name) &&
                                                 ContainsSubstring("is no recording") &&
                                                 ContainsSubstring("--model"));
  }
}

TEST_CASE("csv: a declared passive joint has torque zero, a joint without torque is prescribed",
          "[recording]") {
  ReadOptions options;
  options.info.passive = {"b"};
  ReadReport report;
  const Recording r =
      read("time,q_a,q_b,q_c,tau_b,tau_c\n0,1,2,3,0,5\n1,1,2,3,0,5\n", options, &report)[0];
  CHECK(r.has_tau == std::vector<bool>{false, false, true});
  CHECK(std::isnan(r.tau(0, 0)));
  CHECK(r.tau(1, 1) == 0.0);
  CHECK(r.tau(1, 2) == 5.0);
  options.info.passive = {"z"};
  CHECK_THROWS_WITH(read("time,q_a\n0,1\n", options),
                    ContainsSubstring("passive joint 'z' has no column; joints: a"));
}

TEST_CASE("csv: a current is read with its torque constant", "[recording]") {
  ReadOptions options;
  options.info.torque_constant = {{"a", 0.5}};
  CHECK(read("time,q_a,tau_a [A]\n0,1,3\n", options)[0].tau(0, 0) == 1.5);
}

TEST_CASE("csv: an extra channel that holds words is kept as gaps, with a note", "[recording]") {
  ReadReport report;
  const Recording r = read("time,q_a,state\n0,1,idle\n1,1,2\n", {}, &report)[0];
  CHECK(std::isnan(r.extra[0].values[0]));
  CHECK(r.extra[0].values[1] == 2.0);
  CHECK_THAT(report.notes.back(), ContainsSubstring("'state' holds 1 cells that are no numbers"));
}

TEST_CASE("csv: what is written reads back bit by bit", "[recording]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "out.csv";
  const std::vector<Recording> written = {random_recording(1, 50), random_recording(2, 70)};
  write_recordings(written, path);
  const std::vector<Recording> again = read_recordings(path);
  REQUIRE(again.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(again[i].run == written[i].run);
    CHECK(again[i].joint_names == written[i].joint_names);
    CHECK(again[i].has_tau == written[i].has_tau);
    CHECK(again[i].time == written[i].time);
    for (auto member : {&Recording::q, &Recording::qd, &Recording::qdd, &Recording::qcmd,
                        &Recording::tau, &Recording::ball, &Recording::spin})
      CHECK(same(again[i].*member, written[i].*member));
    CHECK(again[i].extra[0].name == "temperature [degC]");
    CHECK(again[i].extra[0].values == written[i].extra[0].values);
  }
  write_recording(written[0], path);
  CHECK(read_recordings(path).size() == 1);
  Recording other = written[1];
  other.qd.resize(0, 0);
  CHECK_THROWS_AS(write_recordings({written[0], other}, path), DataError);
  CHECK_THROWS_AS(write_recording(other, folder.path() / "no" / "such.csv"), FileError);
}

TEST_CASE("csv: several files become one list of runs", "[recording]") {
  const CsvFile a("run,time,q_a\n0,0,1\n4,0,1\n"), b("time,q_a,x\n0,2,1\n");
  ReadReport report;
  const std::vector<Recording> all = read_recordings({a.path, b.path}, {}, &report);
  REQUIRE(all.size() == 3);
  CHECK(all[2].run == 2);
  CHECK(all[2].q(0, 0) == 2.0);
  CHECK(report.rows == 3);
  CHECK(report.extra_channels == std::vector<std::string>{"x"});
}

TEST_CASE("csv: blocks of any size hold the rows of the whole", "[recording]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "out.csv";
  write_recordings({random_recording(1, 50), random_recording(2, 70)}, path);
  const std::vector<Recording> whole = read_recordings(path);
  const long max_rows = GENERATE(1L, 7L, 49L, 50L, 51L, 1000L);
  CAPTURE(max_rows);
  RecordingReader reader(path);
  long at = 0;
  int previous = 1;
  for (Recording block; reader.next(block, max_rows);) {
    REQUIRE(block.rows() >= 1);
    REQUIRE(block.rows() <= max_rows);
    if (block.run != previous) at = 0;
    previous = block.run;
    const Recording& r = whole[block.run == 1 ? 0 : 1];
    CHECK(block.time == r.time.segment(at, block.rows()));
    CHECK(same(block.q, r.q.middleRows(at, block.rows())));
    CHECK(same(block.tau, r.tau.middleRows(at, block.rows())));
    at += block.rows();
  }
  CHECK(at == 70);
  CHECK(reader.report().rows == 120);
  Recording block;
  CHECK_FALSE(reader.next(block, max_rows));
}

TEST_CASE("csv: long lines are whole wherever the read buffer ends", "[recording]") {
  // Rows of 0.8 MB, under the limit of 1 MiB: the buffer of 2 MiB ends within one of them.
  constexpr std::size_t kChannels = 4000;
  const std::string digits = "0." + std::string(200, '5');
  std::string text = "time,q_a";
  for (std::size_t i = 0; i < kChannels; ++i) text += ",channel_" + std::to_string(i);
  text += "\n";
  for (int row = 0; row < 5; ++row) {
    text += std::to_string(row) + "," + std::to_string(row + 1);
    for (std::size_t i = 1; i < kChannels; ++i) text += "," + digits;
    text += "," + std::to_string(10 * row) + "\n";
  }
  const Recording r = read(text)[0];
  REQUIRE(r.extra.size() == kChannels);
  REQUIRE(r.rows() == 5);
  CHECK(r.extra[0].values[3] == 5.0 / 9.0);
  CHECK(r.extra[kChannels - 1].values[4] == 40.0);
}

}  // namespace diffnea
