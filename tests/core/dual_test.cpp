/// Dual numbers against derivatives by hand.

#include <cmath>

#include <catch2/catch_test_macros.hpp>
#include <catch2/matchers/catch_matchers_floating_point.hpp>

#include <diffnea/core/dual.hpp>

namespace dual_test {

using namespace diffnea;
using Catch::Matchers::WithinRel;

TEST_CASE("dual numbers: first and second derivatives of every function", "[constraints]") {
  using Along = Dual<double, 1>;
  using Twice = Dual<Along, 1>;
  const double x = 0.7;
  const Twice t(Along(x, 0), 0);
  const auto check = [](const Twice& f, double value, double first, double second) {
    CHECK_THAT(f.a.a, WithinRel(value, 1e-14));
    CHECK_THAT(f.v[0].a, WithinRel(first, 1e-13));
    CHECK_THAT(f.a.v[0], WithinRel(first, 1e-13));
    CHECK_THAT(f.v[0].v[0], WithinRel(second, 1e-13));
  };
  check(sin(t), std::sin(x), std::cos(x), -std::sin(x));
  check(cos(t), std::cos(x), -std::sin(x), -std::cos(x));
  check(exp(t), std::exp(x), std::exp(x), std::exp(x));
  check(log(t), std::log(x), 1 / x, -1 / (x * x));
  check(sqrt(t), std::sqrt(x), 0.5 / std::sqrt(x), -0.25 / (x * std::sqrt(x)));
  check(atan2(t, Twice(2.0)), std::atan2(x, 2.0), 2 / (4 + x * x),
        -4 * x / ((4 + x * x) * (4 + x * x)));
  check(atan2(Twice(2.0), t), std::atan2(2.0, x), -2 / (4 + x * x),
        4 * x / ((4 + x * x) * (4 + x * x)));
  check(1.0 / t, 1 / x, -1 / (x * x), 2 / (x * x * x));
  check(t * t - 3.0 * t, x * x - 3 * x, 2 * x - 3, 2.0);
}

}  // namespace dual_test
