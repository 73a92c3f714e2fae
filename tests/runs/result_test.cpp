#include <fstream>
#include <limits>
#include <unistd.h>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/identify_text.hpp>
#include <diffnea/runs/diagnosis.hpp>
#include <diffnea/runs/result.hpp>
#include <diffnea/runs/result_folder.hpp>

#include "support/ended_process.hpp"
#include "support/temporary_folder.hpp"

namespace diffnea::result_test {
namespace {

using Catch::Matchers::ContainsSubstring;
namespace fs = std::filesystem;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// A result with every kind of entry; names that a page must not take for markup.
FitRun some_run() {
  FitRun run;
  IdentifyResult& fit = run.fit;
  fit.model.name = "<b>robot</b>";
  fit.parameters = {
      {"arm.mass", "kg", 1.25, 0.03, 1.0, true, false, false},
      {"arm.hx", "kg*m", 0.5, kNaN, 0.5, false, false, false},
      {"elbow.armature.armature", "kg*m^2", 0.0, 0.01, 0.1, true, false, true},
      {"<i>.viscous_friction.viscous", "N*m*s/rad", 0.25, 0.0, 0.25, false, true, false}};
  fit.base_parameters = {{"arm.mass + 0.5 arm.hx", 1.5, 0.02, {0, 1}, {1.0, 0.5}}};
  fit.errors = {{"elbow", "N*m", 2.0, 0.1, 0.5, 0.2, 1.0, 0.25, 0.3},
                {"<i>", "N", kNaN, kNaN, kNaN, kNaN, kNaN, kNaN, kNaN}};
  fit.boundary = {"arm"};
  fit.consistency_cost = 0.75;
  fit.physically_consistent = true;
  fit.plan.filter_hz = 12.5;
  fit.plan.decimator.rate_hz = 500;
  fit.plan.decimator.factor = 10;
  fit.data_report.quarantined = 1;
  fit.data_report.quarantined_rows = {{17, "q_elbow is 1e30"}};
  fit.data_report.extra_channels = {"</script><script>alert(1)</script>"};
  fit.notes = {"a \"note\" & more"};
  fit.summary = {true, false, "converged", 7, 1, 1000, 2000, 0.5, 0.25};
  fit.train_series = {
      {"elbow", "N*m", {0, 0.1, 0.2}, {1, 2, 3}, {1.1, 2.1, 2.9}, {0, 1, 2}, {-0.5, 0.1, 0.6}},
      {"<i>", "N", {}, {}, {}, {}, {}}};
  fit.torque_constants = {{"elbow", "N*m/A", 2.0, 1.75, 0.125}};
  run.reproduce = {"1.2.3", {"diffnea", "identify", "a model.urdf"}, {{"model", "a.urdf", 12, ""}}};
  return run;
}

/// A ball that is seen at three instants of two windows.
BallSeries some_ball(bool has_string) {
  BallSeries b;
  b.held_out = true;
  b.has_string = has_string;
  b.run = {0, 0, 1};
  b.window = {0, 0, 1};
  b.time = {0.5, 0.625, 0.0};
  b.measured = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
  b.base = {{1.5, 2, 3}, {kNaN, kNaN, kNaN}, {7, 8, 9.25}};
  b.extended = {{1, 2, 3.125}, {4, 5, 6}, {7, 8, 9}};
  b.anchor.assign(3,
                  has_string ? BallSeries::Point{0.25, 0, 1} : BallSeries::Point{kNaN, kNaN, kNaN});
  b.taut = {has_string, false, has_string};
  b.length = has_string ? 1.0 / 3.0 : 0.0;
  b.sigma = 1.0 / 7.0;
  b.base_rms = 0.5;
  b.extended_rms = kNaN;
  b.flagged = {{1, 0.75, "ball", "no \"window\" is <long> enough"}};
  return b;
}

bool same(double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); }

/// What result.json holds of a fit.
void check_same(const IdentifyResult& got, const IdentifyResult& expected) {
  REQUIRE(got.parameters.size() == expected.parameters.size());
  for (std::size_t k = 0; k < got.parameters.size(); ++k) {
    const ParameterEstimate &a = got.parameters[k], &b = expected.parameters[k];
    CAPTURE(b.name);
    CHECK(a.name == b.name);
    CHECK(a.unit == b.unit);
    CHECK(a.value == b.value);
    CHECK(same(a.std, b.std));
    CHECK(a.prior == b.prior);
    CHECK(a.identifiable == b.identifiable);
    CHECK(a.fixed == b.fixed);
    CHECK(a.at_bound == b.at_bound);
  }
  REQUIRE(got.errors.size() == expected.errors.size());
  for (std::size_t k = 0; k < got.errors.size(); ++k) {
    const JointError &a = got.errors[k], &b = expected.errors[k];
    CAPTURE(b.joint);
    CHECK(a.joint == b.joint);
    CHECK(a.unit == b.unit);
    for (double JointError::* const rms :
         {&JointError::torque_rms, &JointError::train, &JointError::nominal_train,
          &JointError::test, &JointError::nominal_test, &JointError::test_all,
          &JointError::test_raw})
      CHECK(same(a.*rms, b.*rms));
  }
  REQUIRE(got.base_parameters.size() == 1);
  CHECK(got.base_parameters[0].expression == expected.base_parameters[0].expression);
  CHECK(got.base_parameters[0].value == expected.base_parameters[0].value);
  CHECK(got.base_parameters[0].std == expected.base_parameters[0].std);
  REQUIRE(got.torque_constants.size() == 1);
  CHECK(got.torque_constants[0].joint == expected.torque_constants[0].joint);
  CHECK(got.torque_constants[0].value == expected.torque_constants[0].value);
  CHECK(got.boundary == expected.boundary);
  CHECK(got.consistency_cost == expected.consistency_cost);
  CHECK(got.physically_consistent == expected.physically_consistent);
  CHECK(got.plan.filter_hz == expected.plan.filter_hz);
  CHECK(got.plan.decimator.rate_hz / got.plan.decimator.factor ==
        expected.plan.decimator.rate_hz / expected.plan.decimator.factor);
  CHECK(got.data_report.quarantined == expected.data_report.quarantined);
  CHECK(got.data_report.extra_channels == expected.data_report.extra_channels);
  CHECK(got.notes == expected.notes);
  CHECK(got.summary.converged == expected.summary.converged);
  CHECK(got.summary.interrupted == expected.summary.interrupted);
  CHECK(got.summary.termination == expected.summary.termination);
  CHECK(got.summary.iterations == expected.summary.iterations);
  CHECK(got.summary.passes == expected.summary.passes);
  CHECK(got.summary.rows == expected.summary.rows);
  CHECK(got.summary.fitted_rows == expected.summary.fitted_rows);
  CHECK(got.summary.seconds == expected.summary.seconds);
  CHECK(got.summary.seconds_fitting == expected.summary.seconds_fitting);
}

bool same(const std::vector<BallSeries::Point>& a, const std::vector<BallSeries::Point>& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t k = 0; k < a.size(); ++k)
    for (std::size_t i = 0; i < 3; ++i)
      if (!(a[k][i] == b[k][i] || (std::isnan(a[k][i]) && std::isnan(b[k][i])))) return false;
  return true;
}

void check_same(const std::optional<BallSeries>& got, const BallSeries& expected) {
  REQUIRE(got);
  CHECK(got->held_out == expected.held_out);
  CHECK(got->has_string == expected.has_string);
  CHECK(got->run == expected.run);
  CHECK(got->window == expected.window);
  CHECK(got->time == expected.time);
  CHECK(same(got->measured, expected.measured));
  CHECK(same(got->base, expected.base));
  CHECK(same(got->extended, expected.extended));
  CHECK(same(got->anchor, expected.anchor));
  CHECK(got->taut == expected.taut);
  CHECK(got->length == expected.length);
  CHECK(got->sigma == expected.sigma);
  CHECK(got->base_rms == expected.base_rms);
  CHECK(std::isnan(got->extended_rms));
  REQUIRE(got->flagged.size() == 1);
  CHECK(got->flagged[0].run == 1);
  CHECK(got->flagged[0].time == 0.75);
  CHECK(got->flagged[0].channel == "ball");
  CHECK(got->flagged[0].reason == expected.flagged[0].reason);
}

fs::path write_run(const FitRun& run, const fs::path& folder) {
  write_file_atomically(folder / "result.json", identify_result_json(run));
  write_file_atomically(folder / "series.json", series_json(run.fit));
  return folder;
}

}  // namespace

TEST_CASE("result: what is written comes back", "[io]") {
  const test::TemporaryFolder folder;
  const FitRun run = some_run();
  const FitRun back = read_fit_run(write_run(run, folder.path()));
  check_same(back.fit, run.fit);
  CHECK(back.reproduce.command == run.reproduce.command);
  // The rest of what the schema holds is compared by writing it again.
  CHECK(identify_result_json(back) == identify_result_json(run));
  CHECK(series_json(back.fit) == series_json(run.fit));
  CHECK(identify_page(back) == identify_page(run));
}

TEST_CASE("result: a ball's summary and path come back, of a fit and of a diagnosis", "[io]") {
  const test::TemporaryFolder folder;
  const BallSeries ball = some_ball(GENERATE(true, false));
  FitRun run = some_run();
  run.fit.ball = ball;
  const FitRun back = read_fit_run(write_run(run, folder.path()));
  check_same(back.fit.ball, ball);
  CHECK(identify_result_json(back) == identify_result_json(run));
  CHECK(series_json(back.fit) == series_json(run.fit));

  DiagnoseRun diagnosis;
  diagnosis.finding.ball = ball;
  write_file_atomically(folder.path() / "result.json", diagnose_result_json(diagnosis));
  write_file_atomically(folder.path() / "series.json", diagnose_series_json(diagnosis.finding));
  check_same(read_diagnose_run(folder.path()).finding.ball, ball);
  // Without the series, what result.json says is there.
  fs::remove(folder.path() / "series.json");
  const std::optional<BallSeries> summary = read_diagnose_run(folder.path()).finding.ball;
  REQUIRE(summary);
  CHECK(summary->rows() == 0);
  CHECK(summary->sigma == ball.sigma);
}

TEST_CASE("result: a long path is thinned, all of its columns alike", "[io]") {
  const test::TemporaryFolder folder;
  FitRun run = some_run();
  BallSeries ball = some_ball(true);
  constexpr int kRows = 9001;
  ball.run.assign(kRows, 0);
  ball.window.assign(kRows, 2);
  ball.taut.assign(kRows, true);
  ball.time.clear();
  for (int k = 0; k < kRows; ++k) ball.time.push_back(0.25 * k);
  for (auto* path : {&ball.measured, &ball.base, &ball.extended, &ball.anchor}) {
    path->clear();
    for (int k = 0; k < kRows; ++k) path->push_back({0.25 * k, 1, 2});
  }
  run.fit.ball = ball;
  const FitRun back = read_fit_run(write_run(run, folder.path()));
  REQUIRE(back.fit.ball);
  CHECK(back.fit.ball->rows() == 3001);
  CHECK(back.fit.ball->time.back() == ball.time.back());
  CHECK(back.fit.ball->anchor[100][0] == back.fit.ball->time[100]);
  CHECK(back.fit.ball->taut.size() == 3001);
}

TEST_CASE("result: a ball's path of unequal columns is refused", "[io]") {
  const test::TemporaryFolder folder;
  FitRun run = some_run();
  run.fit.ball = some_ball(true);
  write_run(run, folder.path());
  std::string text = series_json(run.fit);
  text.replace(text.find("\"time\":[0.5,0.625,0.0]"), 22, "\"time\":[0.5,0.625]");
  write_file_atomically(folder.path() / "series.json", text);
  CHECK_THROWS_WITH(read_fit_run(folder.path()),
                    ContainsSubstring("series.json.ball.run: has 3 values, time 2"));
  run.fit.ball->anchor.pop_back();
  CHECK_THROWS_WITH(series_json(run.fit), ContainsSubstring("ball.anchor: has 2 values, time 3"));
}

TEST_CASE("result: a number that does not exist is null", "[io]") {
  const std::string text = identify_result_json(some_run());
  CHECK_THAT(text, ContainsSubstring("\"std\": null"));
  CHECK_THAT(text, !ContainsSubstring("nan") && !ContainsSubstring("NaN"));
}

TEST_CASE("result: a broken file is refused with its path and key", "[io]") {
  const test::TemporaryFolder folder;
  const auto read = [&](const std::string& text) {
    write_file_atomically(folder.path() / "result.json", text);
    return read_fit_run(folder.path());
  };
  CHECK_THROWS_AS(read_fit_run(folder.path() / "nothing"), FileError);
  CHECK_THROWS_AS(read("{"), ModelError);
  CHECK_THROWS_WITH(read(R"({"schema": "diffnea/learn/1"})"),
                    ContainsSubstring("result.json") && ContainsSubstring("diffnea/learn/1"));
  CHECK_THROWS_WITH(read(R"({"schema": "diffnea/identify/1"})"), ContainsSubstring("rmse"));
}

TEST_CASE("report: text from outside is never markup", "[report]") {
  const std::string page = identify_page(some_run());
  const auto holds = [&](const char* text) { return page.find(text) != std::string::npos; };
  CHECK_FALSE(holds("<b>robot"));
  CHECK_FALSE(holds("<script>alert"));
  CHECK_FALSE(holds("<i>"));
  CHECK(holds("&lt;b&gt;robot&lt;/b&gt;"));
  CHECK(holds("a &quot;note&quot; &amp; more"));
  CHECK(holds("&#39;a model.urdf&#39;"));  // as a shell takes it
}

TEST_CASE("report: the page names nothing from elsewhere and forbids it", "[report]") {
  const std::string page = identify_page(some_run());
  const std::string markup = page.substr(0, page.find("id='data'"));
  for (const char* text : {"src=", "href=", "url(", "@import", "://"})
    CHECK(markup.find(text) == std::string::npos);
  CHECK(markup.find("default-src 'none'") != std::string::npos);
}

TEST_CASE("result: torque constants and velocities come back from the files", "[io][report]") {
  const test::TemporaryFolder folder;
  const FitRun back = read_fit_run(write_run(some_run(), folder.path()));
  REQUIRE(back.fit.torque_constants.size() == 1);
  CHECK(back.fit.torque_constants[0].value == 1.75);
  CHECK(back.fit.torque_constants[0].std == 0.125);
  CHECK(back.fit.train_series[0].velocity == std::vector<double>{-0.5, 0.1, 0.6});
  CHECK(back.fit.train_series[1].velocity.empty());
  const std::string page = identify_page(back);
  CHECK(page.find("Torque constants") != std::string::npos);
  CHECK(page.find("error over velocity") != std::string::npos);
}

TEST_CASE("report: many long series keep the page below 5 MB", "[report]") {
  FitRun run = some_run();
  TorqueSeries s{"joint", "N*m", {}, {}, {}, {}, {}};
  for (int k = 0; k < 4000; ++k) {
    s.time.push_back(0.0123457 * k);
    for (auto* y : {&s.measured, &s.fitted, &s.nominal}) y->push_back(-1.23457e-3 * (k % 97));
    s.velocity.push_back(0.01 * (k % 89));
  }
  run.fit.train_series.assign(40, s);
  run.fit.test_series.assign(40, s);
  CHECK(identify_page(run).size() < 5'000'000);
}

TEST_CASE("report: numbers of any size can be drawn", "[report]") {
  for (const double size : {0.0, 1e-300, 1e20, 1e300}) {
    FitRun run = some_run();
    TorqueSeries& s = run.fit.train_series[0];
    s.measured = s.fitted = s.nominal = {size, size * (1 + 1e-15), kNaN};
    CHECK(identify_page(run).size() > 1000);  // and ends
  }
}

TEST_CASE("report: the terminal's text names error and uncertainty", "[report]") {
  const std::string text = identify_text(some_run());
  CHECK_THAT(text, ContainsSubstring("1.250 ± 0.030"));
  CHECK_THAT(text, ContainsSubstring("from 50.0 % to 10.0 % of the torque"));
  CHECK_THAT(text, ContainsSubstring("at its bound"));
}

TEST_CASE("report: the headline says falls, rises, stays, and what cannot be computed",
          "[report]") {
  FitRun run = some_run();
  const auto headline = [&](double before, double after) {
    run.fit.errors = {{"slide", "m", kNaN, after, before, kNaN, kNaN, kNaN, kNaN}};
    return identify_headline(run);
  };
  CHECK_THAT(headline(0.5, 0.25), ContainsSubstring("falls from 0.5 to 0.25 m (slide)"));
  CHECK_THAT(headline(0.25, 0.5), ContainsSubstring("rises from 0.25 to 0.5"));
  CHECK_THAT(headline(0.25, 0.2501), ContainsSubstring("stays at 0.25 m"));
  CHECK_THAT(headline(kNaN, 0.25),
             ContainsSubstring("is 0.25 m (slide) (that of the model before cannot"));
}

TEST_CASE("report: the headline of many joints says between which errors they are", "[report]") {
  FitRun run = some_run();
  run.fit.errors.clear();
  const auto add = [&](const std::string& joint, double before, double after) {
    run.fit.errors.push_back({joint, "rad", kNaN, after, before, kNaN, kNaN, kNaN, kNaN});
  };
  for (const double k : {1.0, 2.0, 4.0, 3.0}) add("j" + std::to_string(k), 0.1 * k, 0.01 * k);
  CHECK_THAT(identify_headline(run),
             ContainsSubstring("falls from 0.1–0.4 to 0.01–0.04 rad (all 4 joints)."));
  add("wrist", 0.1, 0.2);
  CHECK_THAT(identify_headline(run),
             ContainsSubstring("to 0.01–0.04 rad (4 joints), rises from 0.1 to 0.2 rad (wrist)."));
}

TEST_CASE("report: one length of windows is no curve", "[report]") {
  FitRun run = some_run();
  const auto has = [&] {
    return identify_page(run).find("Error over horizon") != std::string::npos;
  };
  HorizonError e;
  e.joint = "slide";
  e.horizon = 1.0;
  run.fit.horizons = {e};
  CHECK_FALSE(has());
  run.fit.horizons[0].apart = run.fit.horizons[0].test_apart = 1;
  CHECK(has());
  run.fit.horizons = {e, e};
  run.fit.horizons[1].horizon = 2.0;
  CHECK(has());
}

TEST_CASE("report: a warning stands on top of the page, once", "[report]") {
  FitRun run = some_run();
  run.fit.notes = {std::string(kWarning) + "the elbow is in degrees", "nothing much"};
  const std::string page = identify_page(run);
  const std::size_t at = page.find("the elbow is in degrees");
  REQUIRE(at != page.npos);
  CHECK(at < page.find("Error of the"));
  CHECK(page.find("the elbow is in degrees", at + 1) == page.npos);
  CHECK(page.find("nothing much") > page.find("Data and notes"));
}

TEST_CASE("report: recorded rows and fitted samples are told apart, as are missing charts",
          "[report]") {
  FitRun run = some_run();
  for (const std::string& text : {identify_text(run), identify_page(run)})
    CHECK_THAT(text,
               ContainsSubstring("1001 recorded rows (1 quarantined), 2000 torque samples fitted"));
  CHECK_THAT(identify_page(run), !ContainsSubstring("holds no series.json"));
  run.fit.train_series.clear();
  CHECK_THAT(identify_page(run), ContainsSubstring("holds no series.json"));
}

TEST_CASE("result: inputs carry their SHA-256", "[io]") {
  const test::TemporaryFolder folder;
  const auto digest = [&](const std::string& content) {
    write_file_atomically(folder.path() / "input", content);
    const RunInput input = describe_input("data", folder.path() / "input");
    CHECK(input.bytes == content.size());
    return input.sha256;
  };
  // NIST's examples for FIPS 180-4: one block, two blocks, the empty text, a long one.
  CHECK(digest("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(digest("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq") ==
        "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  CHECK(digest("") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  CHECK(digest(std::string(1'000'000, 'a')) ==
        "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
  CHECK_THROWS_AS(describe_input("data", folder.path() / "nothing"), FileError);
}

TEST_CASE("result: of a folder the names and contents of its files count", "[io]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path bag = folder.path() / "bag";
  std::filesystem::create_directories(bag / "data");
  write_file_atomically(bag / "metadata.yaml", "abc");
  write_file_atomically(bag / "data" / "log.mcap", "12345");
  const RunInput before = describe_input("data", bag);
  CHECK(before.bytes == 8);
  CHECK(before.sha256.size() == 64);
  CHECK(describe_input("data", bag).sha256 == before.sha256);
  std::filesystem::rename(bag / "data" / "log.mcap", bag / "data" / "other.mcap");
  CHECK(describe_input("data", bag).sha256 != before.sha256);
}

TEST_CASE("result folder: files appear together, and leftovers of an earlier run go", "[io]") {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "a" / "run";
  const std::vector<std::string> names{"result.json", "model.json", "model.urdf"};
  {
    ResultFolder run(path);
    write_file_atomically(run.staging() / "result.json", "1");
    write_file_atomically(run.staging() / "model.urdf", "1");
    CHECK_FALSE(fs::exists(path / "result.json"));
    run.publish(names);
  }
  write_file_atomically(path / "mine.txt", "kept");
  {
    ResultFolder run(path);
    write_file_atomically(run.staging() / "result.json", "2");
    write_file_atomically(run.staging() / "model.json", "2");
    run.publish(names);
    CHECK(run.files() == std::vector<std::string>{"result.json", "model.json"});
  }
  CHECK(read_text_file(path / "result.json") == "2");
  CHECK(fs::exists(path / "model.json"));
  CHECK_FALSE(fs::exists(path / "model.urdf"));
  CHECK(fs::exists(path / "mine.txt"));
  CHECK(std::distance(fs::directory_iterator(path), fs::directory_iterator()) == 3);
}

TEST_CASE("result folder: nothing remains of a run that failed", "[io]") {
  const test::TemporaryFolder folder;
  {
    ResultFolder run(folder.path() / "a" / "run/");
    write_file_atomically(run.staging() / "result.json", "1");
  }
  CHECK_FALSE(fs::exists(folder.path() / "a"));
}

TEST_CASE("result folder: what a killed program left behind goes, what a running one uses stays",
          "[io]") {
  const test::TemporaryFolder folder;
  const fs::path dead = folder.path() / (".partial-" + std::to_string(test::ended_process())),
                 alive = folder.path() / (".partial-" + std::to_string(::getppid())),
                 own = folder.path() / (".partial-" + std::to_string(::getpid())),
                 other = folder.path() / ".partial-of-mine";
  for (const fs::path& path : {dead, alive, own, other}) {
    fs::create_directory(path);
    write_file_atomically(path / "model.xml", "old");
  }
  ResultFolder run(folder.path());
  CHECK_FALSE(fs::exists(dead));
  CHECK(fs::exists(alive / "model.xml"));
  CHECK(fs::exists(other / "model.xml"));
  CHECK(run.staging() == own);
  CHECK(fs::is_empty(own));  // or the old file would be published with the new ones
}

TEST_CASE("result folder: one that cannot be written is refused at once", "[io]") {
  const test::TemporaryFolder folder;
  write_file_atomically(folder.path() / "file", "");
  CHECK_THROWS_WITH(ResultFolder(folder.path() / "file" / "run"),
                    ContainsSubstring("file/run") && ContainsSubstring("another folder"));
}

}  // namespace diffnea::result_test
