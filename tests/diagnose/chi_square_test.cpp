#include "diagnose/chi_square.hpp"

#include <cmath>
#include <tuple>

#include <catch2/catch_test_macros.hpp>

namespace diffnea::chi_square_test {
namespace {

TEST_CASE("chi-square: chances of noise are those of tables", "[diagnose]") {
  // Quantiles with five and three digits (Abramowitz, Stegun 1964, table 26.8).
  constexpr double kDigits = 1e-3;
  for (const auto& [freedom, x, chance] : {std::tuple{1, 3.84146, 0.05},
                                           {2, 5.99147, 0.05},
                                           {3, 7.81473, 0.05},
                                           {4, 13.2767, 0.01},
                                           {5, 20.515, 0.001},
                                           {10, 18.3070, 0.05}})
    CHECK(std::abs(chi_square_tail(x, freedom) - chance) < kDigits * chance);
  for (const int freedom : {1, 2, 7}) CHECK(chi_square_tail(0.0, freedom) == 1.0);
}

}  // namespace
}  // namespace diffnea::chi_square_test
