#include "io/mjcf_limits.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <utility>

#include <diffnea/core/error.hpp>

#include "core/c_numbers.hpp"

namespace diffnea::io {
namespace {

constexpr double kMaxBodies = 1000.0;
constexpr double kMaxUserData = 1000.0;  ///< numbers of a sensor of the user's

/// Attributes of <size>, and the largest they may be. MuJoCo allocates what they say: njmax² of
/// eight bytes, nuser_… for every element; where it cannot, it ends the process.
constexpr std::pair<const char*, double> kMaxSizes[] = {
    {"njmax", 5000},       {"nconmax", 5000},    {"nstack", 5e7},        {"nuserdata", 1e6},
    {"nkey", 1000},        {"nuser_body", 1000}, {"nuser_jnt", 1000},    {"nuser_geom", 1000},
    {"nuser_site", 1000},  {"nuser_cam", 1000},  {"nuser_tendon", 1000}, {"nuser_actuator", 1000},
    {"nuser_sensor", 1000}};

/// Of an element and all below it, generated ones counted.
double bodies_of(XmlElement& e) {
  std::istringstream counts(attribute(e, "count"));
  double product = 1.0;
  for (double n; counts >> n;) product *= std::max(n, 1.0);
  double below = 0.0;
  for_each_child(e, nullptr, [&](XmlElement& c) { below += bodies_of(c); });
  if (is(e, "composite")) return below + product;
  if (is(e, "replicate")) return below * product;
  return below + (is(e, "body") ? 1.0 : 0.0);
}

void limit_elements(XmlElement& root, const std::string& where) {
  long elements = 0;
  walk(root, [&](XmlElement&) { ++elements; });
  if (elements > kMaxMjcfElements)
    throw ModelError(where + ": has " + std::to_string(elements) + " elements; the limit is " +
                     std::to_string(kMaxMjcfElements));
  const double bodies = bodies_of(root);
  if (bodies <= kMaxBodies) return;
  std::ostringstream text;
  text << where << ": has " << bodies << " bodies, generated ones counted; the limit is "
       << kMaxBodies;
  throw ModelError(text.str());
}

void limit_sizes(XmlElement& root, const std::string& where) {
  const detail::CNumbers point;
  const auto limit = [&](XmlElement& e, const char* name, double most) {
    if (!(std::strtod(attribute(e, name).c_str(), nullptr) <= most))
      throw ModelError(where + ": <" + e.Name() + "> has " + name + " = '" + attribute(e, name) +
                       "'; the limit is " + std::to_string(static_cast<long>(most)));
  };
  for_each_child(root, "size", [&](XmlElement& size) {
    for (const auto& [name, most] : kMaxSizes) limit(size, name, most);
  });
  for_each_child(root, "sensor", [&](XmlElement& sensor) {
    for_each_child(sensor, "user", [&](XmlElement& user) { limit(user, "dim", kMaxUserData); });
  });
}

/// MuJoCo takes NaN for "not given" and goes on.
void refuse_nan(XmlElement& root, const std::string& where) {
  const detail::CNumbers point;
  walk(root, [&](XmlElement& e) {
    for (const tinyxml2::XMLAttribute* a = e.FirstAttribute(); a; a = a->Next()) {
      if (std::strcmp(a->Name(), "name") == 0) continue;
      std::istringstream words(a->Value());
      for (std::string word; words >> word;) {
        char* end = nullptr;
        if (std::isnan(std::strtod(word.c_str(), &end)) && *end == '\0')
          throw ModelError(where + ": <" + e.Name() + "> has " + a->Name() + " = '" + a->Value() +
                           "', expected finite numbers (NaN)");
      }
    }
  });
}

}  // namespace

void check_mjcf(XmlElement& root, const std::string& where) {
  limit_elements(root, where);
  limit_sizes(root, where);
  refuse_nan(root, where);
}

}  // namespace diffnea::io
