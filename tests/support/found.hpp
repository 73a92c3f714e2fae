#pragma once
/// One of the parameters that a fit found.

#include <algorithm>
#include <string>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/identify/identify.hpp>

namespace diffnea::test {

inline const ParameterEstimate& find(const IdentifyResult& result, const std::string& name) {
  const auto it = std::ranges::find(result.parameters, name, &ParameterEstimate::name);
  CAPTURE(name);
  REQUIRE(it != result.parameters.end());
  return *it;
}

}  // namespace diffnea::test
