#include "diffnea/version.hpp"

#include <catch2/catch_test_macros.hpp>

namespace version_test {

TEST_CASE("version: the linked library is the one these headers belong to", "[core]") {
  CHECK(diffnea::version() == diffnea::kVersion);
}

}  // namespace version_test
