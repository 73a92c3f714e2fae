#include "recording/columns.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <span>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>

#include "core/constants.hpp"

namespace diffnea::detail {
namespace {

struct Unit {
  const char* name;
  double scale;
};
constexpr Unit kTimeUnits[] = {{"s", 1.0}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}};
constexpr Unit kPositionUnits[] = {{"rad", 1.0},     {"deg", kPi / 180}, {"mrad", 1e-3},
                                   {"rev", 2 * kPi}, {"m", 1.0},         {"cm", 1e-2},
                                   {"mm", 1e-3}};
constexpr Unit kVelocityUnits[] = {{"rad/s", 1.0},    {"deg/s", kPi / 180}, {"mrad/s", 1e-3},
                                   {"rpm", kPi / 30}, {"rev/s", 2 * kPi},   {"m/s", 1.0},
                                   {"cm/s", 1e-2},    {"mm/s", 1e-3}};
constexpr Unit kAccelerationUnits[] = {
    {"rad/s^2", 1.0}, {"deg/s^2", kPi / 180}, {"m/s^2", 1.0}, {"mm/s^2", 1e-3}};
constexpr Unit kTorqueUnits[] = {{"N*m", 1.0}, {"Nm", 1.0},    {"mN*m", 1e-3}, {"mNm", 1e-3},
                                 {"N", 1.0},   {"kN", 1000.0}, {"mN", 1e-3}};
constexpr Unit kLengthUnits[] = {{"m", 1.0}, {"cm", 1e-2}, {"mm", 1e-3}};
constexpr Unit kSpinUnits[] = {
    {"rad/s", 1.0}, {"deg/s", kPi / 180}, {"rpm", kPi / 30}, {"rev/s", 2 * kPi}};

std::span<const Unit> units_of(Channel channel) {
  switch (channel) {
    case Channel::kTime:
      return kTimeUnits;
    case Channel::kQ:
    case Channel::kQcmd:
      return kPositionUnits;
    case Channel::kQd:
      return kVelocityUnits;
    case Channel::kQdd:
      return kAccelerationUnits;
    case Channel::kTau:
      return kTorqueUnits;
    case Channel::kBall:
      return kLengthUnits;
    case Channel::kSpin:
      return kSpinUnits;
    case Channel::kRun:
    case Channel::kExtra:
      break;
  }
  return {};
}

std::string_view trim(std::string_view s) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!s.empty() && is_space(s.front())) s.remove_prefix(1);
  while (!s.empty() && is_space(s.back())) s.remove_suffix(1);
  return s;
}

/// "N·m" → "N*m", "rad/s²" → "rad/s^2", "°" → "deg", "µs" → "us".
std::string plain_unit(std::string_view unit) {
  constexpr std::pair<const char*, const char*> kReplace[] = {
      {"\u00b7", "*"}, {"\u22c5", "*"},   {"\u00b2", "^2"}, {"\u00b5", "u"},
      {"\u03bc", "u"}, {"\u00b0", "deg"}, {" ", ""},        {"**", "^"}};
  std::string out(unit);
  for (const auto& [from, to] : kReplace)
    for (std::size_t at; (at = out.find(from)) != std::string::npos;)
      out.replace(at, std::string_view(from).size(), to);
  return out;
}

/// A unit of turning ("deg/s", "N*m"), of sliding ("mm", "N"), or of neither ("A").
enum class Motion { kTurns, kSlides, kEither };

Motion motion_of(Channel channel, const std::string& unit) {
  if (channel == Channel::kTau) {
    if (unit == "A") return Motion::kEither;
    return unit.ends_with('m') ? Motion::kTurns : Motion::kSlides;
  }
  const std::string length = unit.substr(0, unit.find('/'));
  return length == "m" || length == "cm" || length == "mm" ? Motion::kSlides : Motion::kTurns;
}

bool is_of_joint(Channel channel) {
  return channel == Channel::kQ || channel == Channel::kQd || channel == Channel::kQdd ||
         channel == Channel::kQcmd || channel == Channel::kTau;
}

/// Names are compared one by one, and a row takes eight bytes a column however short its cells are.
constexpr std::size_t kMaxColumns = 5000;

/// Cells of a header line, unquoted.
std::vector<std::string> split_header(std::string_view line) {
  std::vector<std::string> out;
  while (true) {
    const std::size_t comma = line.find(',');
    std::string_view cell = trim(line.substr(0, comma));
    if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"')
      cell = trim(cell.substr(1, cell.size() - 2));
    out.emplace_back(cell);
    if (comma == std::string_view::npos) return out;
    line.remove_prefix(comma + 1);
  }
}

struct Prefix {
  const char* text;
  Channel channel;
};
constexpr Prefix kJointPrefixes[] = {{"q_", Channel::kQ},
                                     {"qd_", Channel::kQd},
                                     {"qdd_", Channel::kQdd},
                                     {"qcmd_", Channel::kQcmd},
                                     {"tau_", Channel::kTau}};
constexpr Prefix kAxisPrefixes[] = {{"ball_", Channel::kBall}, {"spin_", Channel::kSpin}};

/// The joint's name behind a prefix; nothing if the channel is none of a joint.
std::optional<std::string> joint_of(const std::string& name, Channel& channel) {
  for (const Prefix& p : kJointPrefixes)
    if (name.starts_with(p.text) && name.size() > std::string_view(p.text).size()) {
      channel = p.channel;
      return name.substr(std::string_view(p.text).size());
    }
  return std::nullopt;
}

}  // namespace

void require_plain_name(const std::string& what, const std::string& name, bool of_joint) {
  const bool trimmed = !name.empty() && name.front() != ' ' && name.front() != '\t' &&
                       name.back() != ' ' && name.back() != '\t';
  if (!trimmed || name.find_first_of(of_joint ? ",\"\r\n[]" : ",\"\r\n") != name.npos)
    throw DataError(what + ": a column cannot be named '" + name +
                    "', expected a name without commas, quotes, line ends and spaces about it; of "
                    "a joint without brackets");
}

const char* channel_name(Channel channel) {
  switch (channel) {
    case Channel::kTime:
      return "time";
    case Channel::kRun:
      return "run";
    case Channel::kQ:
      return "position";
    case Channel::kQd:
      return "velocity";
    case Channel::kQdd:
      return "acceleration";
    case Channel::kQcmd:
      return "desired position";
    case Channel::kTau:
      return "torque";
    case Channel::kBall:
      return "ball position";
    case Channel::kSpin:
      return "spin";
    case Channel::kExtra:
      return "extra channel";
  }
  return "";
}

double largest_credible(Channel channel) {
  switch (channel) {
    case Channel::kTime:
      return 1e10;  // seconds since 1970 are 2e9
    case Channel::kRun:
      return 1e9;
    case Channel::kQ:
    case Channel::kQcmd:
      return 1e6;  // a wheel that was never reset
    case Channel::kQd:
      return 1e6;
    case Channel::kQdd:
      return 1e9;
    case Channel::kTau:
      return 1e8;
    case Channel::kBall:
      return 1e5;
    case Channel::kSpin:
      return 1e5;
    case Channel::kExtra:
      break;
  }
  return std::numeric_limits<double>::infinity();
}

long Columns::find(Channel channel) const {
  const auto it = std::ranges::find(columns, channel, &Column::channel);
  return it == columns.end() ? -1 : it - columns.begin();
}

Columns parse_header(std::string_view line, const std::string& where, const RecordingInfo& info,
                     const std::vector<JointDescription>& joints) {
  if (line.starts_with("\xef\xbb\xbf")) line.remove_prefix(3);
  const std::vector<std::string> cells = split_header(line);
  const auto fail = [&](std::size_t column, const std::string& what) -> void {
    throw DataError(where + ":1:" + std::to_string(column + 1) + ": " + what);
  };
  if (cells.size() > kMaxColumns)
    fail(kMaxColumns, "the header has " + std::to_string(cells.size()) + " columns; the limit is " +
                          std::to_string(kMaxColumns));
  if (cells.size() == 1 && (line.find(';') != line.npos || line.find('\t') != line.npos))
    fail(0, "got a header without commas, expected comma-separated columns (time, q_<joint>, …)");
  if (std::ranges::all_of(cells, [](const std::string& c) {
        return !c.empty() && c.find_first_not_of("0123456789+-.eE") == std::string::npos;
      }))
    fail(0, "got numbers in the first row, expected a header (time, q_<joint>, tau_<joint>, …)");

  Columns out;
  std::vector<std::string> names, units;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    std::string name = cells[k], unit;
    if (name.empty()) fail(k, "the column has no name");
    if (const std::size_t bracket = name.rfind('['); bracket != std::string::npos) {
      if (name.back() != ']') fail(k, "'" + name + "' opens a unit that it does not close");
      unit = plain_unit(std::string_view(name).substr(bracket + 1, name.size() - bracket - 2));
      name = std::string(trim(std::string_view(name).substr(0, bracket)));
    }
    if (const auto it = std::ranges::find(names, name); it != names.end())
      fail(k, "column '" + name + "' comes twice, first as column " +
                  std::to_string(it - names.begin() + 1));
    names.push_back(name);
    units.push_back(unit);
    if (name.starts_with("q_") && name.size() > 2) out.joint_names.push_back(name.substr(2));
  }
  if (std::ranges::find(names, "time") == names.end())
    throw DataError(where +
                    ":1: there is no column `time` [s]; columns: " + detail::join_or_none(names));

  out.has_tau.assign(out.joint_names.size(), false);
  std::array<std::array<bool, 3>, 2> axes{};
  for (std::size_t k = 0; k < names.size(); ++k) {
    Column c{.channel = Channel::kExtra, .index = 0, .scale = 1.0, .name = cells[k]};
    Channel channel = Channel::kExtra;
    if (names[k] == "time") {
      c.channel = Channel::kTime;
    } else if (names[k] == "run") {
      c.channel = Channel::kRun;
    } else if (const std::optional<std::string> joint = joint_of(names[k], channel)) {
      const auto it = std::ranges::find(out.joint_names, *joint);
      if (it == out.joint_names.end())
        fail(k, "'" + names[k] + "' has no 'q_" + *joint +
                    "' (a joint's position is always needed); joints: " +
                    detail::join_or_none(out.joint_names));
      c.channel = channel;
      c.index = static_cast<int>(it - out.joint_names.begin());
      if (channel == Channel::kTau) out.has_tau[c.index] = true;
    } else {
      for (const Prefix& p : kAxisPrefixes)
        for (int axis = 0; axis < 3; ++axis)
          if (names[k] == p.text + std::string(1, static_cast<char>('x' + axis))) {
            c.channel = p.channel;
            c.index = axis;
            axes[p.channel == Channel::kBall ? 0 : 1][axis] = true;
          }
    }
    if (c.channel == Channel::kExtra) {
      c.index = static_cast<int>(out.extra_names.size());
      out.extra_names.push_back(cells[k]);
    } else if (!units[k].empty()) {
      const std::span<const Unit> known = units_of(c.channel);
      const auto it =
          std::ranges::find_if(known, [&](const Unit& u) { return u.name == units[k]; });
      if (it != known.end()) {
        c.scale = it->scale;
        const auto joint =
            is_of_joint(c.channel)
                ? std::ranges::find(joints, out.joint_names[c.index], &JointDescription::name)
                : joints.end();
        if (joint != joints.end()) {
          const Motion motion = motion_of(c.channel, units[k]);
          if (motion == (joint->prismatic ? Motion::kTurns : Motion::kSlides))
            fail(k, "unit '" + units[k] + "' cannot be that of '" + joint->name + "', which " +
                        (joint->prismatic ? "slides (prismatic)" : "turns (revolute)") +
                        " in the model; expected " +
                        (c.channel == Channel::kTau ? (joint->prismatic ? "N" : "N*m")
                                                    : (joint->prismatic ? "m" : "rad")) +
                        " or another unit of that kind");
        }
      } else {
        const std::string joint = c.channel == Channel::kTau ? out.joint_names[c.index] : "";
        const auto constant =
            std::ranges::find(info.torque_constant, joint, &std::pair<std::string, double>::first);
        std::vector<std::string> choices;
        for (const Unit& u : known) choices.emplace_back(u.name);
        if (units[k] != "A" || joint.empty())
          fail(k, "unit '" + units[k] + "' is not known for a " + channel_name(c.channel) +
                      "; units: " + detail::join_or_none(choices));
        if (constant == info.torque_constant.end())
          fail(k, "'" + names[k] +
                      "' is a current [A]: give its torque_constant [N*m/A] in the file's "
                      ".json, or convert it; units: " +
                      detail::join_or_none(choices));
        c.scale = constant->second;
        out.notes.push_back("'" + names[k] + "' was converted from current with " +
                            std::to_string(c.scale) + " N*m/A");
      }
    }
    out.columns.push_back(c);
  }
  for (const Prefix& p : kAxisPrefixes) {
    const std::array<bool, 3>& got = axes[p.channel == Channel::kBall ? 0 : 1];
    const bool any = got[0] || got[1] || got[2], all = got[0] && got[1] && got[2];
    if (any && !all)
      throw DataError(where + ":1: of " + p.text + "x, " + p.text + "y, " + p.text +
                      "z some are missing; all three are needed");
  }
  if (out.joint_names.empty() && !out.has(Channel::kBall))
    throw DataError(where +
                    ":1: there is neither a joint (q_<joint>) nor a ball (ball_x, ball_y, ball_z)" +
                    "; columns: " + detail::join_or_none(names));
  for (const std::string& joint : info.passive)
    if (std::ranges::find(out.joint_names, joint) == out.joint_names.end())
      throw DataError(where + ": the passive joint '" + joint +
                      "' has no column; joints: " + detail::join_or_none(out.joint_names));
  for (const std::string& joint : out.joint_names)
    out.passive.push_back(std::ranges::find(info.passive, joint) != info.passive.end());
  return out;
}

}  // namespace diffnea::detail
