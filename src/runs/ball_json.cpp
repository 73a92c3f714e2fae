#include "runs/ball_json.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "runs/fields_json.hpp"

namespace diffnea::io {
namespace {

constexpr std::size_t kMostRows = 4000;  ///< of the path that is stored
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<const char*, 3> kAxes{"x", "y", "z"};

using Points = std::vector<BallSeries::Point>;

constexpr std::array<std::pair<const char*, Points BallSeries::*>, 4> kPaths{
    {{"measured", &BallSeries::measured},
     {"base", &BallSeries::base},
     {"extended", &BallSeries::extended},
     {"anchor", &BallSeries::anchor}}};

void require_length(std::size_t got, std::size_t expected, const std::string& where) {
  if (got != expected)
    throw ModelError(where + ": has " + std::to_string(got) + " values, time " +
                     std::to_string(expected));
}

/// Every n-th value.
template <class T>
std::vector<T> thinned(const std::vector<T>& values, std::size_t stride) {
  std::vector<T> out;
  for (std::size_t k = 0; k < values.size(); k += stride) out.push_back(values[k]);
  return out;
}

Json path(const Points& points) {
  Json out = Json::object();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> column;
    for (const BallSeries::Point& p : points) column.push_back(p[axis]);
    out[kAxes[axis]] = rounded(column);
  }
  return out;
}

Points read_path(const Json& value, const std::string& where, std::size_t rows) {
  JsonObject o(value, where);
  Points out(rows);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<double> values = column(o, kAxes[axis]);
    require_length(values.size(), rows, o.at(kAxes[axis]));
    for (std::size_t k = 0; k < rows; ++k) out[k][axis] = values[k];
  }
  return out;
}

std::vector<int> read_integers(JsonObject& o, const char* key, std::size_t rows) {
  std::vector<int> out = integers(o, key);
  require_length(out.size(), rows, o.at(key));
  return out;
}

}  // namespace

Json ball_columns(const std::optional<BallSeries>& ball) {
  if (!ball) return {};
  const std::size_t rows = ball->time.size(), stride = (rows + kMostRows - 1) / kMostRows;
  if (rows == 0) return {};
  require_length(ball->run.size(), rows, "ball.run");
  require_length(ball->window.size(), rows, "ball.window");
  Json out{{"run", thinned(ball->run, stride)},
           {"window", thinned(ball->window, stride)},
           {"time", rounded(thinned(ball->time, stride))}};
  for (const auto& [key, member] : kPaths) {
    if (member == &BallSeries::anchor && !ball->has_string) {
      out[key] = Json();
      continue;
    }
    require_length(((*ball).*member).size(), rows, std::string("ball.") + key);
    out[key] = path(thinned((*ball).*member, stride));
  }
  out["taut"] = Json();
  if (ball->has_string) {
    require_length(ball->taut.size(), rows, "ball.taut");
    out["taut"] = thinned(ball->taut, stride);
  }
  return out;
}

void read_ball_columns(JsonObject& root, std::optional<BallSeries>& ball) {
  const Json* value = root.optional("ball");
  if (!value) return;
  if (!ball) throw ModelError(root.at("ball") + ": holds a path, but result.json has no ball");
  JsonObject o(*value, root.at("ball"));
  ball->time = column(o, "time");
  const std::size_t rows = ball->time.size();
  ball->run = read_integers(o, "run", rows);
  ball->window = read_integers(o, "window", rows);
  for (const auto& [key, member] : kPaths) {
    const Json* points = o.optional(key);
    (*ball).*member =
        points ? read_path(*points, o.at(key), rows) : Points(rows, {kNaN, kNaN, kNaN});
  }
  ball->taut.assign(rows, false);
  if (const Json* taut = o.optional("taut")) {
    require_length(json_array(*taut, o.at("taut")).size(), rows, o.at("taut"));
    for (std::size_t k = 0; k < rows; ++k) {
      if (!(*taut)[k].is_boolean()) throw ModelError(o.at("taut") + ": expected true or false");
      ball->taut[k] = (*taut)[k].get<bool>();
    }
  }
}

}  // namespace diffnea::io
