#include <diffnea/worlds/world.hpp>

#include "fuzz/targets.hpp"

namespace diffnea::fuzz {

void world(std::string_view input) {
  result_or_error([&] { parse_world(std::string(input)); });
}

}  // namespace diffnea::fuzz
