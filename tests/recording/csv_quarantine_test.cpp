/// Rows of a recording that cannot be true: which are left out, and when the file is refused.

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/recording/audit.hpp>
#include <diffnea/recording/csv.hpp>

#include "support/csv_file.hpp"

using Catch::Matchers::ContainsSubstring;

namespace diffnea::csv_quarantine_test {
using namespace test;

namespace {

/// Lines that are left out of a file.
std::vector<long> left_out(const std::string& text, const ReadOptions& options = {}) {
  ReadReport report;
  read(text, options, &report);
  std::vector<long> lines;
  for (const QuarantinedRow& row : report.quarantined_rows) lines.push_back(row.line);
  return lines;
}

}  // namespace

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

TEST_CASE("csv: a clock that is set back and goes on is refused where it was set", "[recording]") {
  const std::string header = "time,q_a,tau_a\n";
  const auto set_back = [&](int rows) { return header + good_rows(300) + good_rows(300, 300 - rows); };
  for (const int rows : {2, 100, 300}) {
    CAPTURE(rows);
    CHECK_THROWS_WITH(read(set_back(rows)),
                      ContainsSubstring("arm.csv:302: the clock is set back, from 2.99 to ") &&
                          ContainsSubstring("in a column `run`"));
  }
  ReadOptions all;
  all.max_quarantined_share = 1.0;  // an audit has its own word for it
  ReadReport report;
  CHECK(read(set_back(100), all, &report)[0].rows() == 500);
  CHECK(report.quarantined == 100);
  AuditReport audited;
  add_reading(report, audited);
  REQUIRE(audited.faults.size() == 1);
  CHECK(audited.faults[0].severity == FaultSeverity::kFault);
  // Rows that come in another order are late, one by one.
  CHECK(read(header + good_rows(300) + good_rows(1, 302) + good_rows(2, 300) + good_rows(100, 303),
             {}, &report)[0]
            .rows() == 401);
  CHECK(report.quarantined == 2);
}

TEST_CASE("csv: stamps that are coarser than the rows are told from a clock that runs backward",
          "[recording]") {
  std::string text = "time,q_a,tau_a\n";
  for (int i = 0; i < 400; ++i) text += std::to_string(0.01 * (i / 2)) + ",0.1,1.5\n";
  CHECK_THROWS_WITH(read(text), ContainsSubstring("200 of 400 rows cannot be true") &&
                                    ContainsSubstring("line 3: time repeats (0)") &&
                                    ContainsSubstring("write `time` with more digits") &&
                                    !ContainsSubstring("`run`"));
}

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

}  // namespace diffnea::csv_quarantine_test
