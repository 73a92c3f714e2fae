#include "recording/twos_complement.hpp"

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/recording/audit.hpp>

using Catch::Matchers::ContainsSubstring;
using Catch::Matchers::WithinRel;

namespace diffnea::twos_complement_test {
namespace {

/// Counts of a current that swings, as they are, or as unsigned numbers of so many bits.
VecX<double> counts(double amplitude, double count, int bits) {
  VecX<double> x(2000);
  for (long i = 0; i < x.size(); ++i) {
    double n = std::round(amplitude * std::sin(0.01 * static_cast<double>(i)));
    if (bits > 0 && n < 0.0) n += std::ldexp(1.0, bits);
    x[i] = n * count;
  }
  return x;
}

}  // namespace

TEST_CASE("two's complement: told of any width, in counts or in amperes", "[recording]") {
  const int bits = GENERATE(8, 16, 32);
  const double count = GENERATE(1.0, 0.00269);
  CAPTURE(bits, count);
  const auto found = detail::find_twos_complement(counts(bits == 8 ? 30.0 : 500.0, count, bits));
  REQUIRE(found);
  CHECK(found->bits == bits);
  // Steps of 2^32 counts have 7 digits less than the numbers.
  CHECK_THAT(found->modulus, WithinRel(std::ldexp(count, bits), 1e-6));
  CHECK(found->rows > 900);
}

TEST_CASE("two's complement: signed, small and full channels have none", "[recording]") {
  CHECK_FALSE(detail::find_twos_complement(counts(500.0, 1.0, 0)));
  CHECK_FALSE(detail::find_twos_complement(counts(500.0, 1.0, 0).cwiseAbs()));
  // Through all of an unsigned range, as a phase is.
  VecX<double> phase(2000);
  for (long i = 0; i < 2000; ++i) phase[i] = std::fmod(331.0 * static_cast<double>(i), 65536.0);
  CHECK_FALSE(detail::find_twos_complement(phase));
  // A spike or two, and no quantum.
  VecX<double> spiked = counts(500.0, 1.0, 0).cwiseAbs();
  spiked[7] = 65527.0;
  CHECK_FALSE(detail::find_twos_complement(spiked));
  VecX<double> smooth(2000);
  for (long i = 0; i < 2000; ++i) smooth[i] = std::exp(std::sin(0.01 * static_cast<double>(i)));
  CHECK_FALSE(detail::find_twos_complement(smooth));
}

TEST_CASE("audit: names a torque that wraps, with the unit that reads it", "[audit]") {
  Recording r;
  r.source = "servo.csv";
  r.joint_names = {"servo"};
  r.has_tau = {true};
  r.time = VecX<double>::LinSpaced(2000, 0.0, 19.99);
  r.q = r.time.array().sin();
  r.tau = counts(500.0, 0.00269, 16);
  const AuditReport report = audit({r});
  const auto fault = std::ranges::find(report.faults, "twos_complement", &ChannelFault::fault);
  REQUIRE(fault != report.faults.end());
  CHECK(fault->channel == "tau_servo");
  CHECK_THAT(fault->evidence,
             ContainsSubstring("of 16 bits") && ContainsSubstring("tau_servo [A mod 176.29184]"));
  r.tau = counts(500.0, 0.00269, 0);
  for (const ChannelFault& f : audit({r}).faults) CHECK(f.fault != "twos_complement");
}

}  // namespace diffnea::twos_complement_test
