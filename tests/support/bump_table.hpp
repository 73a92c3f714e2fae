#pragma once
/// A table for the effect `residual`, its numbers unlike one another.

#include <string>

#include <diffnea/model/model.hpp>

namespace diffnea::test {

/// Three bumps over the position of `first` and the velocity of `second`; its bound cuts nothing.
inline BumpTable bump_table(const std::string& first, const std::string& second) {
  return {{"q_" + first, "qd_" + second},
          {0.1, -0.2, 0.6, 0.3, -0.5, 0.05},
          {0.9, 0.7, 1.1, 0.8, 0.6, 1.3},
          {0.8, -1.3, 0.5},
          10.0};
}

}  // namespace diffnea::test
