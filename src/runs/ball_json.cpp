#include "runs/ball_json.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "runs/json_numbers.hpp"
#include "runs/run_reader.hpp"

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
  std::vector<int> out;
  for (const double x : json_numbers(o.required(key), o.at(key))) {
    if (!(std::abs(x) <= std::numeric_limits<int>::max()))
      throw ModelError(o.at(key) + ": got " + Json(x).dump() + ", which is too large");
    out.push_back(static_cast<int>(x));
  }
  require_length(out.size(), rows, o.at(key));
  return out;
}

}  // namespace

Json ball_summary(const std::optional<BallSeries>& ball) {
  if (!ball) return {};
  Json flagged = Json::array();
  for (const BallFlag& f : ball->flagged)
    flagged.push_back(
        {{"run", f.run}, {"time", number(f.time)}, {"channel", f.channel}, {"reason", f.reason}});
  return {{"held_out", ball->held_out},
          {"has_string", ball->has_string},
          {"length", ball->has_string ? number(ball->length) : Json()},
          {"sigma", number(ball->sigma)},
          {"base_rms", number(ball->base_rms)},
          {"extended_rms", number(ball->extended_rms)},
          {"flagged", flagged}};
}

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

std::optional<BallSeries> read_ball_summary(JsonObject& root) {
  const Json* value = root.optional("ball");
  if (!value) return std::nullopt;
  JsonObject o(*value, root.at("ball"));
  BallSeries out;
  out.held_out = o.boolean_or("held_out", false);
  out.has_string = o.boolean_or("has_string", false);
  out.length = out.has_string ? number_or_nan(o, "length") : 0.0;
  out.sigma = number_or_nan(o, "sigma");
  out.base_rms = number_or_nan(o, "base_rms");
  out.extended_rms = number_or_nan(o, "extended_rms");
  for_each_object(o, "flagged", [&](JsonObject& f) {
    out.flagged.push_back({static_cast<int>(count(f, "run")), number_or_nan(f, "time"),
                           f.string("channel"), f.string("reason")});
  });
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
