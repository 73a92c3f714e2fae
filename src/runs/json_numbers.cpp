#include "runs/json_numbers.hpp"

#include <cmath>
#include <cstdlib>

#include "core/c_numbers.hpp"

namespace diffnea::io {

Json number(double x) { return std::isfinite(x) ? Json(x) : Json(); }

Json rounded(const std::vector<double>& values) {
  const detail::CNumbers point;
  Json out = Json::array();
  for (const double x : values) {
    char text[32];
    detail::print(text, sizeof text, "%.6g", x);
    out.push_back(number(std::strtod(text, nullptr)));
  }
  return out;
}

std::string text(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace diffnea::io
