#include "diffnea/version.hpp"

#include <catch2/catch_test_macros.hpp>

TEST_CASE("version: the linked library is the one these headers belong to", "[core]") {
  CHECK(diffnea::version() == diffnea::kVersion);
}
