/// Pages of robots with many joints: below 5 MB, and drawn from the rows that matter.

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/report/diagnose_page.hpp>
#include <diffnea/report/identify_page.hpp>

#include "support/page.hpp"

namespace diffnea::page_size_test {
namespace {

constexpr int kJoints = 40;
constexpr std::size_t kMost = 5'000'000;

/// Numbers of six digits.
std::vector<double> column(std::size_t rows, double phase) {
  std::vector<double> out;
  for (std::size_t k = 0; k < rows; ++k)
    out.push_back(12.3456 * std::sin(phase + 0.0123457 * static_cast<double>(k)));
  return out;
}

std::vector<double> times(std::size_t rows) {
  std::vector<double> out;
  for (std::size_t k = 0; k < rows; ++k) out.push_back(0.0123 * static_cast<double>(k));
  return out;
}

}  // namespace

TEST_CASE("report: pages of many joints stay below 5 MB", "[report]") {
  FitRun fit;
  DiagnoseRun diagnosis;
  Finding& f = diagnosis.finding;
  f.simulated.horizons.emplace_back().horizon = 0.1;
  for (int j = 0; j < kJoints; ++j) {
    const std::string joint = "joint" + std::to_string(j);
    const TorqueSeries series{joint,           "N*m",           times(4000),    column(4000, j),
                              column(4000, 1), column(4000, 2), column(4000, 3)};
    fit.fit.train_series.push_back(series);
    fit.fit.test_series.push_back(series);
    f.series.push_back({joint, "N*m", times(4000), column(4000, j), column(4000, 1),
                        column(4000, 2), column(4000, 3), column(4000, 4), column(4000, 5)});
    f.simulated.joints.push_back({.joint = joint,
                                  .unit = "rad",
                                  .time = times(3000),
                                  .measured = column(3000, j),
                                  .base = column(3000, 1),
                                  .extended = column(3000, 2)});
  }
  CHECK(identify_page(fit).size() < kMost);
  const std::string page = diagnose_page(diagnosis);
  CHECK(page.size() < kMost);
  test::check_page(page);
}

TEST_CASE("report: a thinned motion keeps the ends of its windows", "[report]") {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  DiagnoseRun run;
  for (int j = 0; j < 20; ++j) {
    SimulatedSeries s{.joint = "joint",
                      .unit = "rad",
                      .time = times(3000),
                      .measured = column(3000, j),
                      .base = column(3000, 1),
                      .extended = column(3000, 2)};
    for (std::size_t k = 500; k < 3000; k += 500) s.base[k] = s.extended[k] = kNaN;
    run.finding.simulated.joints.push_back(s);
  }
  const std::string page = diagnose_page(run);
  // Five ends of windows in both columns of 20 joints; their times and those of the next rows.
  CHECK(test::count(page, "null") >= 20 * 2 * 5);
  CHECK(test::count(page, ",6.15,6.1623,") == 20);  // rows 500 and 501; every second one is kept
  CHECK(test::count(page, ",6.1746,6.1869,") == 0);
}

}  // namespace diffnea::page_size_test
