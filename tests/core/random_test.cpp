/// The generator against the published one: numbers computed by Vigna's reference sources
/// (xoshiro256starstar.c, its state filled by splitmix64.c).

#include <cmath>
#include <cstdint>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/random.hpp>

namespace random_test {

using namespace diffnea;

TEST_CASE("rng: xoshiro256** filled by splitmix64, the same numbers on every machine", "[core]") {
  const auto check = [](std::uint64_t seed, const std::uint64_t(&expected)[5]) {
    CAPTURE(seed);
    Rng rng(seed);
    for (const std::uint64_t x : expected) CHECK(rng.next() == x);
  };
  check(0, {0x99ec5f36cb75f2b4, 0xbf6e1f784956452a, 0x1a5f849d4933e6e0, 0x6aa594f1262d2d2c,
            0xbba5ad4a1f842e59});
  check(1234567, {0x30a3a1c363600467, 0x19405f0f579929ca, 0x115beaac046ddbd9, 0xeb17caf48f27d7f6,
                  0xa0c94fe1cce9d136});
}

TEST_CASE("rng: the upper 53 bits are the uniform number, two of them a normal one", "[core]") {
  Rng uniform(1234567), normal(1234567);
  CHECK(uniform.uniform() == 0x1.851d0e1b1b0p-3);
  CHECK(Rng(1234567).uniform(-2.0, 6.0) == -2.0 + 8.0 * 0x1.851d0e1b1b0p-3);
  // The logarithm and the cosine are the machine's: its last bit may differ.
  CHECK(std::abs(normal.normal() - 0.5284423983665654) < 1e-15);
}

}  // namespace random_test
