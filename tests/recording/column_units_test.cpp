#include "recording/column_units.hpp"

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>

#include "support/csv_file.hpp"

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinAbs;

namespace diffnea::column_units_test {
namespace {

constexpr double kPi = 3.14159265358979323846;
/// One rounding of numbers of order 1.
constexpr double kRounding = 1e-12;

double cell(const std::string& header, double value, const ReadOptions& options = {}) {
  const std::string number = std::to_string(value);
  const auto runs =
      test::read("time,q_a," + header + "\n0,0," + number + "\n1,1," + number + "\n", options);
  return header.starts_with("tau") ? runs[0].tau(0, 0) : runs[0].qcmd(0, 0);
}

ReadOptions with_constant(double worth) {
  ReadOptions options;
  options.info.torque_constant = {{"a", worth}};
  return options;
}

}  // namespace

TEST_CASE("units: raw counts by a stated law", "[recording]") {
  CHECK_THAT(cell("qcmd_a [0.087890625*deg-180]", 3072.0), WithinAbs(0.5 * kPi, kRounding));
  CHECK_THAT(cell("qcmd_a [1e-3*rad+0.5]", 250.0), WithinAbs(0.75, kRounding));
  CHECK_THAT(cell("tau_a [0.02*N·m]", -50.0), WithinAbs(-1.0, kRounding));
}

TEST_CASE("units: counts of a signed number that were read as unsigned", "[recording]") {
  CHECK_THAT(cell("tau_a [0.00269*N*m mod 65536]", 65527.0), WithinAbs(-9 * 0.00269, kRounding));
  CHECK_THAT(cell("tau_a [0.00269*N*m mod 65536]", 9.0), WithinAbs(9 * 0.00269, kRounding));
  CHECK_THAT(cell("tau_a [N*m mod 176.29184]", 176.26763), WithinAbs(-9 * 0.00269, 1e-9));
}

TEST_CASE("units: amperes, milliamperes, volts and per cent by what one is worth", "[recording]") {
  CHECK_THAT(cell("tau_a [A]", 2.0, with_constant(1.8)), WithinAbs(3.6, kRounding));
  CHECK_THAT(cell("tau_a [mA]", 2000.0, with_constant(1.8)), WithinAbs(3.6, kRounding));
  CHECK_THAT(cell("tau_a [V]", 3.0, with_constant(0.5)), WithinAbs(1.5, kRounding));
  CHECK_THAT(cell("tau_a [%]", 50.0, with_constant(0.04)), WithinAbs(2.0, kRounding));
  CHECK_THAT(cell("tau_a [0.00269*A mod 65536]", 65527.0, with_constant(2.0)),
             WithinAbs(-9 * 0.00269 * 2.0, kRounding));
  for (const char* unit : {"A", "mA", "V", "%"})
    CHECK_THROWS_WITH(cell("tau_a [" + std::string(unit) + "]", 1.0),
                      ContainsSubstring("not a torque: give its torque_constant [N*m/") &&
                          ContainsSubstring("drive_a [" + std::string(unit) + "] (--map"));
}

TEST_CASE("units: what is no law is refused with the units there are", "[recording]") {
  for (const char* unit : {"x*deg", "0*deg", "2*", "deg+", "deg mod 0", "deg mod", "furlong"})
    CHECK_THROWS_WITH(
        cell("qcmd_a [" + std::string(unit) + "]", 1.0),
        ContainsSubstring("arm.csv:1:3: unit '") && ContainsSubstring("units: rad, deg"));
}

TEST_CASE("map: columns by other names keep or change their units", "[recording]") {
  ReadOptions options;
  options.columns = {{"t", "time [ms]"}, {"grip.pos", "q_grip"}, {"load", ""}, {"u", "qcmd_grip"}};
  ReadReport report;
  const auto runs =
      test::read("t,grip.pos [deg],load,u [mrad]\n0,90,x,500\n1000,180,y,600\n", options, &report);
  REQUIRE(runs[0].joint_names == std::vector<std::string>{"grip"});
  CHECK(runs[0].time[1] == 1.0);
  CHECK_THAT(runs[0].q(1, 0), WithinAbs(kPi, kRounding));
  CHECK_THAT(runs[0].qcmd(0, 0), WithinAbs(0.5, kRounding));
  CHECK(runs[0].extra.empty());
  CHECK(report.notes.empty());
}

TEST_CASE("map: a column that is not there, and one that comes twice, are refused", "[recording]") {
  ReadOptions options;
  options.columns = {{"elbow", "q_elbow"}};
  CHECK_THROWS_WITH(test::read("time,q_a\n0,1\n1,2\n", options),
                    ContainsSubstring("map: there is no column 'elbow'; columns: time, q_a"));
  options.columns = {{"b", "q_a"}};
  CHECK_THROWS_WITH(test::read("time,q_a,b\n0,1,2\n1,2,2\n", options),
                    ContainsSubstring("column 'q_a' comes twice"));
  options.columns = {{"q_a", "qcmd_a"}, {"qcmd_a", "q_a"}};
  CHECK(test::read("time,q_a,qcmd_a\n0,1,2\n1,2,2\n", options)[0].q(0, 0) == 2.0);
}

}  // namespace diffnea::column_units_test
