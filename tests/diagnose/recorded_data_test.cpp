/// Measured recordings that are not part of the project: every file reads, and preprocessing makes
/// sense of it.

#include <algorithm>
#include <filesystem>
#include <support/data_folder.hpp>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/recording/csv.hpp>
#include <diffnea/recording/preprocess.hpp>

namespace diffnea::recorded_data_test {
namespace {

using test::data_folder;

ReadOptions options_for(const std::filesystem::path& file) {
  ReadOptions options;
  // A pendulum that swings freely: its torque column is zero by construction.
  if (file.stem() == "free_swing") options.info.passive = {"pendulum"};
  return options;
}

}  // namespace

TEST_CASE("recorded data: every recording reads", "[data]") {
  int files = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data_folder())) {
    if (entry.path().extension() != ".csv") continue;
    CAPTURE(entry.path());
    // Tables of flights and of runs, without time: no recordings.
    if (entry.path().stem() == "spin" || entry.path().stem() == "index") {
      CHECK_THROWS_AS(read_recordings(entry.path()), DataError);
      continue;
    }
    ReadReport report;
    const std::vector<Recording> runs =
        read_recordings(entry.path(), options_for(entry.path()), &report);
    CHECK(!runs.empty());
    CHECK(report.quarantined <= 4);
    long rows = 0;
    for (const Recording& r : runs) {
      rows += r.rows();
      for (long i = 1; i < r.rows(); ++i) REQUIRE(r.time[i] > r.time[i - 1]);
    }
    CHECK(rows == report.rows - report.quarantined);
    ++files;
  }
  CHECK(files > 0);
}

TEST_CASE("recorded data: rows of garbage at the start of a file are left out", "[data]") {
  const std::filesystem::path file =
      data_folder() / "ur10e" / "id_50s_15harm_loaded_mass_unstated.csv";
  ReadReport report;
  CHECK(read_recordings(file, {}, &report).at(0).rows() == 6097);
  REQUIRE(report.quarantined == 3);
  CHECK(report.quarantined_rows[0].line == 3);
  CHECK(report.quarantined_rows[2].line == 5);
}

TEST_CASE("recorded data: flights have a ball and no joints", "[data]") {
  const std::vector<Recording> flights =
      read_recordings(data_folder() / "table_tennis" / "flights.csv");
  CHECK(flights.size() == 232);
  CHECK(flights[0].num_joints() == 0);
  CHECK(flights[0].ball.cols() == 3);
}

TEST_CASE("recorded data: cut-offs are those that people chose by hand", "[data]") {
  const std::filesystem::path folder = data_folder();
  const auto cutoff = [&](const std::filesystem::path& file) {
    return plan_preprocess(read_recordings(folder / file)).filter_hz;
  };
  // EMPS: 100 Hz in its reference; Panda: 10 Hz; UR10e: 3 to 10 Hz in the literature.
  const double emps = cutoff("emps/train.csv"), panda = cutoff("panda/exciting.csv"),
               ur10e = cutoff("ur10e/id_50s_12harm.csv");
  CHECK(emps > 60.0);
  CHECK(emps < 200.0);
  CHECK(panda > 3.0);
  CHECK(panda < 12.0);
  CHECK(ur10e > 3.0);
  CHECK(ur10e < 12.0);
}

TEST_CASE("recorded data: read and preprocessed in blocks, it is the whole", "[data]") {
  for (const char* name :
       {"panda/exciting.csv", "double_pendulum/record_02.csv", "ur10e/val_ptp_10_points.csv"}) {
    CAPTURE(name);
    const std::filesystem::path file = data_folder() / name;
    const std::vector<Recording> runs = read_recordings(file);
    const PreprocessPlan plan = plan_preprocess(runs);
    const Preprocessed whole = preprocess(runs[0], plan);
    CHECK(whole.qdd.allFinite());
    RecordingReader reader(file);
    Preprocessor stream(plan, 1000);
    long at = 0;
    double error = 0.0;
    const auto compare = [&](const Preprocessed& part) {
      REQUIRE(at + part.rows() <= whole.rows());
      if (part.rows() > 0)
        error = std::max(error,
                         (part.qdd - whole.qdd.middleRows(at, part.rows())).cwiseAbs().maxCoeff());
      at += part.rows();
    };
    for (Recording block; reader.next(block, 700);) compare(stream.push(block));
    compare(stream.finish());
    CHECK(at == whole.rows());
    CHECK(error < 1e-9 * whole.qdd.cwiseAbs().maxCoeff());
  }
}

}  // namespace diffnea::recorded_data_test
