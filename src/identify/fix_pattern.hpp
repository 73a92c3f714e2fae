#pragma once
/// Names with *, and values that parameters are held at. Internal to identify/.

#include <optional>
#include <string>
#include <utility>

#include <diffnea/effects/effect.hpp>

namespace diffnea {

/// `pattern` with any number of *.
bool matches(const std::string& pattern, const std::string& name);

/// "elbow.*" or "tip:run=1.payload.mass=2.8": what follows the last = is a value if it is a number.
std::pair<std::string, std::optional<double>> split_value(const std::string& entry);

/// @throws ModelError if a parameter of this sign cannot be held at the value
void require_possible(const std::string& entry, const std::string& name, double value, Sign sign);

}  // namespace diffnea
