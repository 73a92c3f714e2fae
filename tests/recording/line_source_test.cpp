#include "recording/line_source.hpp"

#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/error.hpp>

using namespace diffnea;

#ifdef __linux__
TEST_CASE("lines: a file that cannot be read to its end is no shorter file", "[recording]") {
  // The first page of a process is never mapped: it opens, and its first read fails.
  detail::LineSource lines("/proc/self/mem", "recording");
  std::string_view line;
  CHECK_THROWS_AS(lines.next(line), FileError);
}
#endif
