/// Recordings written and read again, whole and in blocks.

#include <cmath>
#include <limits>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/recording/csv.hpp>

#include "support/csv_file.hpp"

namespace diffnea::csv_blocks_test {
using namespace test;
namespace {

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

}  // namespace diffnea::csv_blocks_test
