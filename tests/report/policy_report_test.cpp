/// Runs of learning and transfer: files both ways, pages, the terminal's text.

#include <algorithm>
#include <cmath>
#include <limits>
#include <regex>
#include <support/temporary_folder.hpp>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_exception.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/report/learn_page.hpp>
#include <diffnea/report/learn_text.hpp>
#include <diffnea/report/run_folder.hpp>
#include <diffnea/report/transfer_page.hpp>
#include <diffnea/report/transfer_text.hpp>
#include <diffnea/runs/policy_file.hpp>
#include <diffnea/worlds/world.hpp>

#include "support/page.hpp"

namespace diffnea::policy_report_test {
namespace {

using test::check_page;
using test::count;

using Catch::Approx;
using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::MessageMatches;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

const LearnRun& learned() {
  static const LearnRun run = [] {
    const Model model = read_model(std::string(DIFFNEA_SOURCE_DIR) + "/models/wam4_ball.xml");
    LearnOptions options;
    options.ereps.samples = 24;
    options.ereps.iterations = 4;
    LearnRun out{.task = ball_in_cup(model, model, options)};
    for (const std::uint64_t seed : {3u, 7u}) {
      out.policies.push_back(learn(out.task, seed));
      out.imagined.push_back(rollouts(out.task, 1).trace(out.policies.back().policy.mean));
    }
    out.policies[1].solved = true;  // whatever four iterations have brought
    out.policies[0].solved = false;
    out.seconds = 1.5;
    out.reproduce = {"0.0", {"diffnea", "learn", "ball-in-cup", "a<b.xml"}, {}};
    return out;
  }();
  return run;
}

/// The first policy misses, the second catches; of its repetitions one is lost to the solver.
TransferRun transferred() {
  const LearnRun& from = learned();
  TransferRun out{.task = from.task,
                  .policies = from.policies,
                  .imagined = from.imagined,
                  .world = "mujoco:x<y"};
  Execution missed, caught;
  missed.reward = 0.5;
  missed.reward_wide = 0.25;
  missed.trace = from.imagined[0];
  caught.reward = 3.5;
  caught.reward_wide = 2.25;
  caught.trace = from.imagined[1];
  missed.verdict = {Outcome::kMissed, "never above the rim: 12 mm short"};
  caught.verdict = {Outcome::kInCup, "in the cup since 1.29 s"};
  out.executions = {missed, caught};
  out.best = 1;
  Execution failed = caught;
  failed.failure = "diverged";
  failed.reward = failed.reward_wide = -kInfinity;
  out.repetitions = {caught, caught, failed};
  out.reproduce = from.reproduce;
  return out;
}

std::string files(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  std::string out;
  for (const std::string& name : names) out += name + " ";
  return out;
}

}  // namespace

TEST_CASE("share: Wilson's interval", "[policy]") {
  // Wilson 1927 as Newcombe 1998 tabulates it: 81 of 263, 15 of 148, 0 of 20, 1 of 29.
  CHECK(share_of(81, 263).low == Approx(0.2553).margin(5e-5));
  CHECK(share_of(81, 263).high == Approx(0.3662).margin(5e-5));
  CHECK(share_of(15, 148).low == Approx(0.0624).margin(5e-5));
  CHECK(share_of(15, 148).high == Approx(0.1605).margin(5e-5));
  CHECK(share_of(0, 20).low == 0.0);
  CHECK(share_of(0, 20).high == Approx(0.1611).margin(5e-5));
  CHECK(share_of(1, 29).low == Approx(0.0061).margin(5e-5));
  CHECK(share_of(1, 29).high == Approx(0.1718).margin(5e-5));
  CHECK(share_of(0, 0).low == 0.0);
  CHECK(share_of(0, 0).high == 1.0);
}

TEST_CASE("path error: up to the row in which the model catches the ball", "[policy]") {
  // The ball's paths lie 3 mm, 4 mm and 0 apart in the first half, ten times that in the second.
  constexpr double kRounding = 1e-12;
  constexpr long kRows = 101;
  RolloutTrace imagined;
  imagined.channels = {"ball_x", "ball_y", "ball_z", "phase"};
  imagined.time = VecX<double>::LinSpaced(kRows, 0.0, 1.0);
  imagined.values.resize(kRows, 4);
  imagined.values.col(0) = 2.0 * imagined.time;
  imagined.values.col(1).setConstant(-0.5);
  imagined.values.col(2) = 1.0 - imagined.time.array().square();
  imagined.values.col(3).setZero();
  RolloutTrace obtained = imagined;
  for (long k = 0; k < kRows; ++k)
    obtained.values.row(k).head(2) += (k < 50 ? 1.0 : 10.0) * Eigen::RowVector2d(3e-3, 4e-3);

  const double never = path_error(imagined, obtained).rms;
  CHECK(never == Approx(std::sqrt((50 * 25e-6 + 51 * 25e-4) / 101)).epsilon(1e-9));
  CHECK(std::isnan(path_error(imagined, obtained).at_capture));

  imagined.values.col(3).tail(51).setConstant(double(BallPhase::kCaptured));
  const PathError caught = path_error(imagined, obtained);
  CHECK(std::abs(caught.at_capture - 5e-3) < kRounding);
  CHECK(std::abs(caught.rms - 5e-3) < kRounding);

  RolloutTrace brief = obtained;  // ends before the capture
  brief.time.conservativeResize(20);
  brief.values.conservativeResize(20, 4);
  CHECK(std::abs(path_error(imagined, brief).rms - 5e-3) < kRounding);
  CHECK(std::isnan(path_error(imagined, brief).at_capture));
  CHECK(std::isnan(path_error({}, obtained).rms));
  CHECK(std::isnan(path_error(imagined, {}).rms));
}

TEST_CASE("side view: the plane in which the ball moves", "[policy]") {
  RolloutTrace trace;
  trace.channels = {"ball_x", "ball_y", "ball_z"};
  trace.time = VecX<double>::LinSpaced(11, 0.0, 1.0);
  for (const double degrees : {0.0, 30.0, 90.0, 150.0}) {
    CAPTURE(degrees);
    const double angle = degrees * M_PI / 180.0;
    trace.values.resize(11, 3);
    trace.values.col(0) = std::cos(angle) * trace.time;
    trace.values.col(1) = std::sin(angle) * trace.time;
    trace.values.col(2).setConstant(2.0);
    const SideView view = side_view({trace});
    CHECK(std::abs(view.x * std::cos(angle) + view.y * std::sin(angle)) == Approx(1.0));
  }
}

TEST_CASE("stick figure: the arm ends in the cup, the string has its length", "[policy]") {
  const LearnRun& run = learned();
  const RolloutTrace& trace = run.imagined[0];
  const StickFigure f = stick_figure(run.task.model, trace, side_view({trace}));
  REQUIRE(f.across.rows() == trace.time.size());
  const RowMatX<double> cup = points_of(trace, "cup");
  const long last = f.arm_points() - 1, knot = last + 1, ball = f.across.cols() - 1;
  // The simulator's cup and ours come from the same kinematics.
  CHECK((f.up.col(last) - cup.col(2)).cwiseAbs().maxCoeff() < 1e-9);
  // It hangs straight down at the start; the simulator lets it settle for half a second.
  CHECK(f.up(0, knot) - f.up(0, ball) == Approx(run.task.options.reward.string).margin(1e-3));
}

TEST_CASE("learn run: the folder gives back what was written", "[policy]") {
  const test::TemporaryFolder folder;
  {
    ResultFolder run(folder.path());
    publish_learn_run(learned(), run);
  }
  CHECK(files(folder.path()) ==
        "controller.json model.json policy_3.json policy_7.json report.html result.json "
        "series.json ");
  const LearnRun same = read_learn_run(folder.path());
  CHECK(fingerprint(same.task) == fingerprint(learned().task));
  CHECK(learn_result_json(same) == learn_result_json(learned()));
  REQUIRE(same.figures.size() == 2);
  CHECK(same.figures[0].time.size() == same.imagined[0].time.size());
  CHECK(same.imagined[0].time.size() < learned().imagined[0].time.size());
  CHECK(learn_text(same) == learn_text(learned()));

  SECTION("policies of an earlier run go") {
    LearnRun fewer = learned();
    fewer.policies.resize(1);
    fewer.imagined.resize(1);
    ResultFolder run(folder.path());
    publish_learn_run(fewer, run);
    CHECK_FALSE(std::filesystem::exists(folder.path() / "policy_7.json"));
  }
  SECTION("what does not fit is named") {
    write_file_atomically(folder.path() / "policy_7.json", policy_json(learned().policies[0]));
    CHECK_THROWS_MATCHES(read_learn_run(folder.path()), ModelError,
                         MessageMatches(ContainsSubstring("policy_7.json.seed: got 3")));
  }
  SECTION("without series there is a page") {
    std::filesystem::remove(folder.path() / "series.json");
    const std::string page = learn_page(read_learn_run(folder.path()));
    check_page(page);
    CHECK_THAT(page, ContainsSubstring("holds no series.json"));
  }
}

TEST_CASE("run folder: what no run left there stays", "[policy]") {
  const test::TemporaryFolder folder;
  const std::string mine[] = {"policy_1.json", "recording_1.csv", "recording_1.json"};
  for (const std::string& name : mine) write_file_atomically(folder.path() / name, "mine");
  const auto all_there = [&] {
    return std::ranges::all_of(
        mine, [&](const auto& name) { return std::filesystem::exists(folder.path() / name); });
  };
  SECTION("beside what is learned") {
    ResultFolder out(folder.path());
    publish_learn_run(learned(), out);
    CHECK(all_there());
  }
  SECTION("but recordings of an earlier transfer go") {
    const auto transfer = [&](bool records) {
      ResultFolder out(folder.path());
      if (records) write_file_atomically(out.staging() / "recording_7.csv", "its own");
      publish_transfer_run(transferred(), out);
    };
    transfer(true);
    CHECK(all_there());
    CHECK(std::filesystem::exists(folder.path() / "recording_7.csv"));
    transfer(false);
    CHECK_FALSE(std::filesystem::exists(folder.path() / "recording_7.csv"));
    write_file_atomically(folder.path() / "recording_of_mine.csv", "mine");
    transfer(false);
    CHECK(std::filesystem::exists(folder.path() / "recording_of_mine.csv"));
  }
}

TEST_CASE("learn page: numbers, curves of all seeds, the best one's movement", "[policy]") {
  const test::TemporaryFolder folder;
  ResultFolder run(folder.path());
  publish_learn_run(learned(), run);
  const std::string page = read_text_file(folder.path() / "report.html");
  check_page(page);
  CHECK_THAT(page, ContainsSubstring("1 of 2 policies catch the ball in the model"));
  CHECK_THAT(page, ContainsSubstring("7 <b>best</b>"));
  CHECK_THAT(page, ContainsSubstring("a&lt;b.xml"));
  CHECK(count(page, "data-draw='curve'") == 6);
  CHECK(count(page, "data-best='1'") == 6);
  for (const char* kind : {"strip", "player"})
    CHECK_THAT(page, ContainsSubstring(std::string("data-draw='") + kind +
                                       "' data-movement='imagined' data-index='1'"));
  // Numbers of both seeds, the movement of one.
  CHECK(count(page, "\"reward_mean\":[") == 2);
  CHECK_THAT(page, ContainsSubstring("\"imagined\":[null,{\"time\""));
}

TEST_CASE("transfer run: the folder gives back what was written", "[policy]") {
  const test::TemporaryFolder folder;
  const TransferRun run = transferred();
  {
    ResultFolder out(folder.path());
    publish_transfer_run(run, out);
  }
  const TransferRun same = read_transfer_run(folder.path());
  CHECK(transfer_result_json(same) == transfer_result_json(run));
  CHECK(transfer_text(same) == transfer_text(run));
  CHECK(same.best == 1);
  CHECK(same.repetitions[2].failure == "diverged");

  const std::string page = read_text_file(folder.path() / "report.html");
  check_page(page);
  CHECK_THAT(page, ContainsSubstring("1 of 2 policies (50 %, 95 % interval 9–91 %) catch"));
  CHECK_THAT(page, ContainsSubstring("2 of 3 repetitions with noise"));
  CHECK_THAT(page, ContainsSubstring("mujoco:x&lt;y"));
  CHECK_THAT(page, ContainsSubstring("Best success: seed 7, in the cup since 1.29 s"));
  CHECK_THAT(page, ContainsSubstring("Worst failure: seed 3, never above the rim: 12 mm short"));
  CHECK_THAT(page, ContainsSubstring("data-draw='player' data-movement='obtained' data-index='1'"));
  CHECK(count(page, "data-draw='player'") == 1);
  for (const char* kind : {"strip", "distance"})
    for (const char* index : {"0", "1"})
      CHECK(std::regex_search(page, std::regex(std::string("data-draw='") + kind +
                                               "'[^>]*data-index='" + index + "'")));
  CHECK(count(page, "data-ghost=''") == 3);
  CHECK(count(page, "data-draw='scatter'") == 1);
}

TEST_CASE("transfer run: file, text and page say by what the world differs", "[policy]") {
  const test::TemporaryFolder folder;
  TransferRun run = transferred();
  CHECK(world_sentence(run).empty());  // a file of an earlier version
  const auto page = [&] {
    ResultFolder out(folder.path());
    publish_transfer_run(run, out);
    return read_text_file(folder.path() / "report.html");
  };
  CHECK(page().find("The world differs") == std::string::npos);
  CHECK_FALSE(read_transfer_run(folder.path()).differences);
  run.differences.emplace();
  CHECK(world_sentence(run) == "The world is as its description says.");
  run.differences = {"masses -8…+20 %", "a rope of 1.2 g in place of a massless string"};
  const std::string sentence =
      "The world differs from its description: masses -8…+20 %; a rope of 1.2 g in place of a "
      "massless "
      "string.";
  CHECK_THAT(page(), ContainsSubstring(sentence));
  const TransferRun same = read_transfer_run(folder.path());
  CHECK(same.differences == run.differences);
  CHECK_THAT(transfer_text(same), ContainsSubstring(sentence));
}

TEST_CASE("transfer run: an interrupted one, and executions without rows", "[policy]") {
  const test::TemporaryFolder folder;
  TransferRun run = transferred();
  run.executions.resize(1);
  run.executions[0].failure = "joint2 breaks its limit";
  run.executions[0].trace.time.resize(0);
  run.executions[0].trace.values.resize(0, run.executions[0].trace.values.cols());
  run.repetitions.clear();
  run.best = -1;
  run.interrupted = true;
  ResultFolder out(folder.path());
  publish_transfer_run(run, out);
  const std::string page = read_text_file(folder.path() / "report.html");
  check_page(page);
  CHECK_THAT(page, ContainsSubstring("Interrupted: 1 of 2 policies were executed"));
  CHECK(count(page, "data-draw='strip'") == 0);
}

TEST_CASE("transfer: a policy whose motion breaks a limit fails alone", "[policy]") {
  const LearnRun& run = learned();
  const auto world =
      make_simulator(parse_world("mujoco:wam4_ball,perturb=none"), run.task.controller, {}, 0);
  MotionLimits limits = motion_limits(run.task.controller);
  limits.velocity.setConstant(1e-3);
  const Execution e = execute(run.policies[0], *world, limits, *run.task.model.cup, 5);
  CHECK_THAT(e.failure, ContainsSubstring("breaks a limit") && ContainsSubstring("joint"));
  CHECK(e.seed == 5);
  CHECK(e.reward < -1.0);
  CHECK_FALSE(e.success());
  CHECK(e.trace.time.size() == 0);
}

TEST_CASE("transfer run: more movements than our reader takes are stored at a lower rate",
          "[policy]") {
  const test::TemporaryFolder folder;
  TransferRun run = transferred();
  Execution& again = run.repetitions.front();
  constexpr long kRows = 40'000;  // at 100 Hz, 16 columns: nine are beyond 5 million values
  again.trace.time.setLinSpaced(kRows, 0.0, 0.01 * (kRows - 1));
  again.trace.values.setOnes(kRows, again.trace.values.cols());
  again.trace.q_desired.resize(0, 0);
  run.repetitions.assign(9, again);
  {
    ResultFolder out(folder.path());
    publish_transfer_run(run, out);
  }
  const TransferRun same = read_transfer_run(folder.path());
  REQUIRE(same.repetitions.size() == 9);
  const VecX<double>& time = same.repetitions[8].trace.time;
  CHECK(time.size() == kRows / 2 + 1);
  CHECK(time[time.size() - 1] == Approx(0.01 * (kRows - 1)));
  CHECK_THAT(read_text_file(folder.path() / "report.html"), ContainsSubstring("9 repetitions"));
}

}  // namespace diffnea::policy_report_test
