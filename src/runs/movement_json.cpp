#include "runs/movement_json.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runs/json_numbers.hpp"
#include "runs/run_reader.hpp"

namespace diffnea::io {
namespace {

std::vector<double> list(const VecX<double>& x) { return {x.begin(), x.end()}; }

bool is_stored(const std::string& channel) {
  return channel.starts_with("q_") || channel == "phase" ||
         ((channel.starts_with("ball_") || channel.starts_with("cup_") ||
           channel.starts_with("axis_")) &&
          !channel.substr(channel.find('_')).starts_with("_v"));
}

VecX<double> read_column(JsonObject& o, const char* key, long rows) {
  const std::vector<double> x = column(o, key);
  if (static_cast<long>(x.size()) != rows)
    throw ModelError(o.at(key) + ": has " + std::to_string(x.size()) + " values, time " +
                     std::to_string(rows));
  return Eigen::Map<const VecX<double>>(x.data(), rows);
}

RowMatX<double> table(const std::vector<VecX<double>>& columns, long rows) {
  RowMatX<double> out(rows, static_cast<long>(columns.size()));
  if (rows == 0) return out;
  for (std::size_t i = 0; i < columns.size(); ++i) out.col(static_cast<long>(i)) = columns[i];
  return out;
}

StickFigure read_figure(const Json& value, const std::string& where, const VecX<double>& time) {
  JsonObject o(value, where);
  StickFigure out;
  out.time = time;
  for (const auto& item : value.items()) out.names.push_back(item.key());
  const long points = static_cast<long>(out.names.size());
  if (points < 8) throw ModelError(where + ": too few points, expected arm_0, arm_1 … ball");
  // All of them before there is a table: names without numbers would ask for memory.
  std::vector<VecX<double>> across, up;
  for (const std::string& name : out.names) {
    JsonObject point(o.required(name.c_str()), o.at(name.c_str()));
    across.push_back(read_column(point, "across", time.size()));
    up.push_back(read_column(point, "up", time.size()));
  }
  out.across = table(across, time.size());
  out.up = table(up, time.size());
  return out;
}

}  // namespace

RolloutTrace thinned(const RolloutTrace& trace, double rate) {
  const long rows = trace.time.size();
  if (rate > 0.0 && rows < 3) return trace;
  std::vector<long> kept;
  if (rate > 0.0) {
    const double period = (trace.time[rows - 1] - trace.time[0]) / static_cast<double>(rows - 1);
    const long stride = std::max(1L, std::lround(1.0 / (rate * period)));
    if (stride == 1) return trace;
    for (long k = 0; k < rows; k += stride) kept.push_back(k);
    if (kept.back() != rows - 1) kept.push_back(rows - 1);
  }
  RolloutTrace out = trace;
  out.time = trace.time(kept);
  out.values = trace.values(kept, Eigen::all);
  if (trace.q_desired.rows() == rows) out.q_desired = trace.q_desired(kept, Eigen::all);
  return out;
}

Json movement(const RolloutTrace& trace, const StickFigure* figure) {
  Json channels = Json::object();
  for (std::size_t c = 0; c < trace.channels.size(); ++c)
    if (is_stored(trace.channels[c]))
      channels[trace.channels[c]] = trace.time.size() == 0
                                        ? Json::array()
                                        : rounded(list(trace.values.col(static_cast<long>(c))));
  Json points;
  if (figure) {
    points = Json::object();
    for (std::size_t i = 0; i < figure->names.size(); ++i) {
      const long column = static_cast<long>(i);
      points[figure->names[i]] = {{"across", rounded(list(figure->across.col(column)))},
                                  {"up", rounded(list(figure->up.col(column)))}};
    }
  }
  return {
      {"time", rounded(list(trace.time))}, {"channels", channels},   {"figure", points},
      {"reward", number(trace.reward)},    {"solved", trace.solved}, {"failure", trace.failure}};
}

RolloutTrace read_movement(JsonObject& o, StickFigure* figure) {
  RolloutTrace out;
  const std::vector<double> time = column(o, "time");
  const long rows = static_cast<long>(time.size());
  out.time = Eigen::Map<const VecX<double>>(time.data(), rows);
  const Json& channels = o.required("channels");
  JsonObject columns(channels, o.at("channels"));
  std::vector<VecX<double>> values;
  for (const auto& item : channels.items()) {
    values.push_back(read_column(columns, item.key().c_str(), rows));
    out.channels.push_back(item.key());
  }
  out.values = table(values, rows);
  out.reward = o.number_or("reward", -std::numeric_limits<double>::infinity());
  out.solved = o.boolean_or("solved", false);
  out.failure = o.string_or("failure", "");
  if (figure) {
    const Json* points = o.optional("figure");
    *figure = points ? read_figure(*points, o.at("figure"), out.time) : StickFigure{};
  }
  return out;
}

}  // namespace diffnea::io
