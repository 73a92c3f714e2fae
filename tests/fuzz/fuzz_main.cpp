/// libFuzzer's entry of one target; DIFFNEA_FUZZ_TARGET is its function in targets.hpp.

#include <cstddef>
#include <cstdint>

#include "fuzz/targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  // libFuzzer's bytes are what a file holds.
  diffnea::fuzz::DIFFNEA_FUZZ_TARGET({reinterpret_cast<const char*>(data), size});
  return 0;
}
