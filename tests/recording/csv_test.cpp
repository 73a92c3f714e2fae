#include "diffnea/recording/csv.hpp"

#include <cmath>
#include <fstream>
#include <numbers>
#include <sstream>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>

#include "support/csv_file.hpp"

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::EndsWith;
using Catch::Matchers::WithinRel;

namespace diffnea::csv_test {
using namespace test;
namespace {

/// A unit's factor rounds once.
constexpr double kRounding = 1e-15;

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

TEST_CASE("csv: a base that floats has a pose, a twist and a wrench; base_x alone is no base",
          "[recording]") {
  const Recording r =
      read("time,base_x [mm],base_y,base_z,base_qx,base_qy,base_qz,base_qw,base_vx,base_vy,base_vz,"
           "base_wx [deg/s],base_wy,base_wz,base_tx,base_ty,base_tz,base_fx,base_fy,base_fz\n"
           "0,1000,2,3,0,0,0.6,0.8,4,5,6,180,8,9,10,11,12,13,14,15\n")
          .front();
  CHECK(r.num_joints() == 0);
  CHECK(r.base == RowMatX<double>{{1, 2, 3, 0, 0, 0.6, 0.8}});
  CHECK(r.base_twist.rightCols(5) == RowMatX<double>{{8, 9, 4, 5, 6}});
  CHECK(std::abs(r.base_twist(0, 0) - std::numbers::pi) < 1e-15);
  CHECK(r.base_wrench == RowMatX<double>{{10, 11, 12, 13, 14, 15}});
  const Recording fixed = read("time,q_a,base_x\n0,1,2\n").front();
  CHECK(fixed.base.size() == 0);
  REQUIRE(fixed.extra.size() == 1);
  CHECK(fixed.extra[0].name == "base_x");
}

TEST_CASE("csv: what the format does not allow is refused, with file, line and column",
          "[recording]") {
  const auto [text, message] = GENERATE(table<std::string, std::string>({
      {"", "arm.csv: the file is empty"},
      {"time,q_a\n", "arm.csv: there is a header and no row"},
      {"t,q_a\n0,1\n", "arm.csv:1: there is no column `time` [s]; columns: t, q_a"},
      {"time,x\n0,1\n", "neither a joint (q_<joint>), a ball"},
      {"time;q_a\n0;1\n", "header without commas"},
      {"0.0,1.5\n0.1,1.6\n", "got numbers in the first row, expected a header"},
      {"time,q_a,q_a\n0,1,1\n", "arm.csv:1:3: column 'q_a' comes twice, first as column 2"},
      {"time,q_a [deg],q_a\n0,1,1\n", "arm.csv:1:3: column 'q_a' comes twice"},
      {"time,q_a,\n0,1,1\n", "arm.csv:1:3: the column has no name"},
      {"time,q_a,tau_b\n0,1,1\n", "arm.csv:1:3: 'tau_b' has no 'q_b'"},
      {"time,q_a,qd_b\n0,1,1\n", "arm.csv:1:3: 'qd_b' has no 'q_b'"},
      {"time,ball_x,ball_z\n0,1,1\n", "of ball_x, ball_y, ball_z some are missing"},
      {"time,base_x,base_y,base_z,base_qx,base_qy,base_qz\n0,0,0,0,0,0,1\n",
       "of base_qx, base_qy, base_qz, base_qw some are missing"},
      {"time,base_qx,base_qy,base_qz,base_qw\n0,0,0,0,1\n", "of base_x, base_y, base_z some"},
      {"time,base_x,base_y,base_z,base_qx,base_qy,base_qz,base_qw,base_fx\n0,0,0,0,0,0,0,1,2\n",
       "of base_tx, base_ty, base_tz some are missing"},
      {"time,base_x [deg],base_y,base_z,base_qx,base_qy,base_qz,base_qw\n0,0,0,0,0,0,0,1\n",
       "unit 'deg' is not known for a base position; units: m, cm, mm"},
      {"time,q_a [grad]\n0,1\n", "unit 'grad' is not known for a position; units: rad, deg"},
      {"time [min],q_a\n0,1\n", "unit 'min' is not known for a time; units: s, ms"},
      {"time,q_a,tau_a [A]\n0,1,1\n",
       "arm.csv:1:3: 'tau_a [A]' is a current [A], not a torque: give its torque_constant [N*m/A]"},
      {"time,q_a,tau_a [W]\n0,1,1\n", "unit 'W' is not known for a torque; units: N*m"},
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

TEST_CASE("csv: columns of joints that the model does not have are left out, with a note",
          "[recording]") {
  ReadOptions options;
  options.joints = {{.name = "a"}};
  ReadReport report;
  // The wheel's torque, zero throughout, would be refused, and its word, too.
  const std::string text = "time,q_wheel,q_a,tau_wheel,tau_a\n0,off,1,0,3\n1,1,2,0,4\n";
  const Recording r = read(text, options, &report)[0];
  CHECK(r.joint_names == std::vector<std::string>{"a"});
  CHECK(r.tau(1, 0) == 4.0);
  CHECK(report.notes.at(0) == "columns of joints that the model does not have are left out: wheel");
  options.joints = {{.name = "a"}, {.name = "b"}};  // which of them is meant, is not known
  CHECK_THROWS_AS(read(text, options), DataError);
}

TEST_CASE("csv: an extra channel that holds words is kept as gaps, with a note", "[recording]") {
  ReadReport report;
  const Recording r = read("time,q_a,state\n0,1,idle\n1,1,2\n", {}, &report)[0];
  CHECK(std::isnan(r.extra[0].values[0]));
  CHECK(r.extra[0].values[1] == 2.0);
  CHECK_THAT(report.notes.back(), ContainsSubstring("'state' holds 1 cells that are no numbers"));
}

}  // namespace diffnea::csv_test
