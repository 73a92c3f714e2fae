#include "recording/columns.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <span>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>

#include "core/constants.hpp"
#include "recording/axis_columns.hpp"

namespace diffnea::detail {
namespace {

std::string_view trim(std::string_view s) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!s.empty() && is_space(s.front())) s.remove_prefix(1);
  while (!s.empty() && is_space(s.back())) s.remove_suffix(1);
  return s;
}

bool is_of_joint(Channel channel) {
  return channel == Channel::kQ || channel == Channel::kQd || channel == Channel::kQdd ||
         channel == Channel::kQcmd || channel == Channel::kQdcmd || channel == Channel::kTaucmd ||
         channel == Channel::kTau;
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
constexpr Prefix kJointPrefixes[] = {{"q_", Channel::kQ},         {"qd_", Channel::kQd},
                                     {"qdd_", Channel::kQdd},     {"qcmd_", Channel::kQcmd},
                                     {"qdcmd_", Channel::kQdcmd}, {"taucmd_", Channel::kTaucmd},
                                     {"tau_", Channel::kTau}};

/// The axis that a column is of, if it is one of those. Columns of a base are such where a
/// quaternion is among them: base_x alone may be anything.
void set_axis(const std::string& name, bool floats, Column& column) {
  for (const AxisColumns& of : kAxisColumns)
    for (std::size_t axis = 0; axis < of.axes.size(); ++axis)
      if ((floats || of.where != "base") && name == of.column(axis)) {
        column.channel = of.channel;
        column.index = static_cast<int>(of.first) + static_cast<int>(axis);
      }
}

/// @throws DataError if some axes of a group are there and some are not, or a base has no pose
void require_whole_groups(const Columns& columns, const std::string& where) {
  for (const AxisColumns& of : kAxisColumns) {
    const auto found =
        static_cast<std::size_t>(std::ranges::count(columns.columns, of.channel, &Column::channel));
    const bool needed = of.series == &Recording::base && columns.has(Channel::kBaseQuaternion);
    const bool twin =
        (of.series == &Recording::base_twist &&
         (columns.has(Channel::kBaseTurning) || columns.has(Channel::kBaseVelocity))) ||
        (of.series == &Recording::base_wrench &&
         (columns.has(Channel::kBaseTorque) || columns.has(Channel::kBaseForce)));
    if (found == of.axes.size() || (found == 0 && !needed && !twin)) continue;
    throw DataError(where + ":1: of " + of.columns() + " some are missing; all " +
                    std::to_string(of.axes.size()) + " are needed" +
                    (of.where == "base" ? " of a base that floats (docs/recordings.md)" : ""));
  }
}

/// The joint's name behind a prefix; nothing if the channel is none of a joint.
std::optional<std::string> joint_of(const std::string& name, Channel& channel) {
  for (const Prefix& p : kJointPrefixes)
    if (name.starts_with(p.text) && name.size() > std::string_view(p.text).size()) {
      channel = p.channel;
      return name.substr(std::string_view(p.text).size());
    }
  return std::nullopt;
}

/// Headers as the user calls them: "observation.state.0" becomes "q_gripper [deg]".
/// @throws DataError for a column that is not there
void rename_columns(std::vector<std::string>& cells, const std::string& where,
                    const std::vector<ColumnName>& columns, std::vector<bool>& left_out) {
  const std::vector<std::string> before = cells;
  const auto without_unit = [](const std::string& cell) {
    return std::string(trim(std::string_view(cell).substr(0, cell.rfind('['))));
  };
  for (const ColumnName& c : columns) {
    auto it = std::ranges::find(before, c.from);
    const bool whole = it != before.end();
    if (!whole)
      it = std::ranges::find_if(before, [&](const auto& b) { return without_unit(b) == c.from; });
    if (it == before.end())
      throw DataError(where + ":1: map: there is no column '" + c.from +
                      "'; columns: " + detail::join_or_none(before));
    const std::size_t k = static_cast<std::size_t>(it - before.begin());
    if (c.to.empty()) {
      left_out[k] = true;
      continue;
    }
    const std::size_t unit = whole ? std::string::npos : before[k].rfind('[');
    cells[k] = c.to;
    if (unit != std::string::npos && c.to.find('[') == std::string::npos)
      cells[k] += " " + before[k].substr(unit);
  }
}

/// Worth of one unit of a drive's: the sidecar's torque_constant.
double worth_of(const Column& column, const UnitOfColumn& unit, const std::string& joint,
                const RecordingInfo& info) {
  const auto constant =
      std::ranges::find(info.torque_constant, joint, &std::pair<std::string, double>::first);
  if (constant != info.torque_constant.end()) return constant->second;
  const std::string per = unit.unit == "mA" ? "A" : unit.unit;
  const std::string what = per == "A"   ? "a current [" + unit.unit + "]"
                           : per == "V" ? "a voltage [V]"
                                        : "in per cent";
  throw DataError(
      "'" + column.name + "' is " + what + ", not a torque: give its torque_constant [N*m/" + per +
      "] in the file's .json, or the law as its unit, tau_" + joint +
      " [0.5*N*m] if one is worth 0.5 N*m, or call it by a name that is no torque's, "
      "drive_" +
      joint + " [" + unit.unit +
      "] (--map renames columns); units of torque: " + detail::join(unit_names(Channel::kTau)));
}

/// The joints whose columns stay: all, unless the model's are all there; then these alone.
std::vector<std::string> wanted_joints(const std::vector<std::string>& logged,
                                       const std::vector<JointDescription>& joints) {
  std::vector<std::string> out;
  for (const std::string& name : logged)
    if (std::ranges::find(joints, name, &JointDescription::name) != joints.end())
      out.push_back(name);
  return out.size() == joints.size() && !joints.empty() ? out : logged;
}

/// Sets how a column's cells become SI; a refusal goes to `fail`.
template <class Fail>
void set_unit(Column& c, const std::string& text, Columns& out, const RecordingInfo& info,
              const std::vector<JointDescription>& joints, const Fail& fail) {
  try {
    const UnitOfColumn unit = parse_unit(c.channel, text);
    c.conversion = unit.conversion;
    const std::string joint = is_of_joint(c.channel) ? out.joint_names[c.index] : "";
    if (unit.of_drive) {
      const double worth = worth_of(c, unit, joint, info);
      c.conversion.scale *= worth;
      c.conversion.offset *= worth;
      const std::string per = unit.unit == "mA" ? "A" : unit.unit;
      out.notes.push_back("'" + c.name + "' was converted from " +
                          (per == "A"   ? "current"
                           : per == "V" ? "voltage"
                                        : "per cent") +
                          " with " + std::to_string(worth) + " N*m/" + per);
    }
    const auto known = std::ranges::find(joints, joint, &JointDescription::name);
    if (joint.empty() || known == joints.end() ||
        unit.motion != (known->prismatic ? Motion::kTurns : Motion::kSlides))
      return;
    throw DataError("unit '" + unit.unit + "' cannot be that of '" + joint + "', which " +
                    (known->prismatic ? "slides (prismatic)" : "turns (revolute)") +
                    " in the model; expected " +
                    (c.channel == Channel::kTau || c.channel == Channel::kTaucmd
                         ? (known->prismatic ? "N" : "N*m")
                         : (known->prismatic ? "m" : "rad")) +
                    " or another unit of that kind");
  } catch (const DataError& error) {
    fail(error.what());
  }
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
    case Channel::kQdcmd:
      return 1e6;
    case Channel::kQdd:
      return 1e9;
    case Channel::kTau:
    case Channel::kTaucmd:
      return 1e8;
    case Channel::kBall:
    case Channel::kBasePosition:
    case Channel::kSpin:
    case Channel::kBaseTurning:
    case Channel::kBaseVelocity:
      return 1e5;
    case Channel::kBaseTorque:
    case Channel::kBaseForce:
      return 1e8;
    case Channel::kBaseQuaternion:  // its norm tells
    case Channel::kExtra:
    case Channel::kLeftOut:
      break;
  }
  return std::numeric_limits<double>::infinity();
}

long Columns::find(Channel channel) const {
  const auto it = std::ranges::find(columns, channel, &Column::channel);
  return it == columns.end() ? -1 : it - columns.begin();
}

Columns parse_header(std::string_view line, const std::string& where, const ReadOptions& options) {
  const RecordingInfo& info = options.info;
  const std::vector<JointDescription>& joints = options.joints;
  if (line.starts_with("\xef\xbb\xbf")) line.remove_prefix(3);
  std::vector<std::string> cells = split_header(line);
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

  std::vector<bool> left_out(cells.size(), false);
  rename_columns(cells, where, options.columns, left_out);

  Columns out;
  std::vector<std::string> names, units, logged;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    std::string name = cells[k], unit;
    if (name.empty()) fail(k, "the column has no name");
    if (const std::size_t bracket = name.rfind('['); bracket != std::string::npos) {
      if (name.back() != ']') fail(k, "'" + name + "' opens a unit that it does not close");
      unit = plain_unit(std::string_view(name).substr(bracket + 1, name.size() - bracket - 2));
      name = std::string(trim(std::string_view(name).substr(0, bracket)));
    }
    if (const auto it = std::ranges::find(names, name); it != names.end() && !left_out[k])
      fail(k, "column '" + name + "' comes twice, first as column " +
                  std::to_string(it - names.begin() + 1));
    names.push_back(name);
    units.push_back(unit);
    if (left_out[k]) names.back() = "";  // nobody's
    if (names.back().starts_with("q_") && name.size() > 2) logged.push_back(name.substr(2));
  }
  if (std::ranges::find(names, "time") == names.end())
    throw DataError(where + ":1: there is no column `time` [s]; columns: " +
                    detail::join_or_none(cells) + "; --map \"COLUMN=time [s]\" names it");
  out.joint_names = wanted_joints(logged, joints);
  std::vector<std::string> strangers;
  for (const std::string& joint : logged)
    if (std::ranges::find(out.joint_names, joint) == out.joint_names.end())
      strangers.push_back(joint);
  if (!strangers.empty())
    out.notes.push_back("columns of joints that the model does not have are left out: " +
                        detail::join(strangers));

  out.has_tau.assign(out.joint_names.size(), false);
  const bool floats = std::ranges::any_of(names, [](const std::string& name) {
    return name.size() == 7 && name.starts_with("base_q");
  });
  for (std::size_t k = 0; k < names.size(); ++k) {
    Column c{.channel = Channel::kExtra, .index = 0, .conversion = {}, .name = cells[k]};
    Channel channel = Channel::kExtra;
    if (left_out[k]) {
      c.channel = Channel::kLeftOut;
    } else if (names[k] == "time") {
      c.channel = Channel::kTime;
    } else if (names[k] == "run") {
      c.channel = Channel::kRun;
    } else if (const std::optional<std::string> joint = joint_of(names[k], channel);
               joint && std::ranges::find(strangers, *joint) != strangers.end()) {
      c.channel = Channel::kLeftOut;
    } else if (joint) {
      const auto it = std::ranges::find(out.joint_names, *joint);
      if (it == out.joint_names.end())
        fail(k, "'" + names[k] + "' has no 'q_" + *joint +
                    "' (a joint's position is always needed); joints: " +
                    detail::join_or_none(out.joint_names));
      c.channel = channel;
      c.index = static_cast<int>(it - out.joint_names.begin());
      if (channel == Channel::kTau) out.has_tau[c.index] = true;
    } else {
      set_axis(names[k], floats, c);
    }
    if (c.channel == Channel::kExtra) {
      c.index = static_cast<int>(out.extra_names.size());
      out.extra_names.push_back(cells[k]);
    } else if (!units[k].empty() && c.channel != Channel::kLeftOut) {
      set_unit(c, units[k], out, info, joints, [&](const std::string& what) { fail(k, what); });
    }
    out.columns.push_back(c);
  }
  require_whole_groups(out, where);
  if (out.joint_names.empty() && !out.has(Channel::kBall) && !floats)
    throw DataError(
        where +
        ":1: there is neither a joint (q_<joint>), a ball (ball_x, ball_y, ball_z) nor a base that "
        "floats (base_x … base_qw)" +
        "; columns: " + detail::join_or_none(names) + "; --map \"COLUMN=q_JOINT [deg]\" names one" +
        (options.notes.empty() ? "" : ". " + detail::join(options.notes, ". ")));
  for (const std::string& joint : info.passive)
    if (std::ranges::find(logged, joint) == logged.end())
      throw DataError(where + ": the passive joint '" + joint +
                      "' has no column; joints: " + detail::join_or_none(out.joint_names));
  for (const std::string& joint : out.joint_names)
    out.passive.push_back(std::ranges::find(info.passive, joint) != info.passive.end());
  return out;
}

}  // namespace diffnea::detail
