#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/identify/joint_choice.hpp>
#include <diffnea/model/lock.hpp>

#include "core/edit_distance.hpp"
#include "core/statistics.hpp"
#include "identify/loop_positions.hpp"

namespace diffnea {
namespace {

using Names = std::vector<std::string>;

/// Rows of a file that tell where a joint was held.
constexpr long kLookedAt = 16384;

bool has(const Names& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

Names without(const Names& names, const Names& others) {
  Names out;
  for (const std::string& name : names)
    if (!has(others, name)) out.push_back(name);
  return out;
}

/// A number that is all of the text.
std::optional<double> to_number(const std::string& text) {
  double x = 0.0;
  const auto [last, error] = std::from_chars(text.data(), text.data() + text.size(), x);
  if (error != std::errc() || last != text.data() + text.size()) return std::nullopt;
  return x;
}

/// The positions that the choice states; NaN: a lock without one.
std::map<std::string, double> stated_positions(const JointChoice& choice) {
  std::map<std::string, double> out;
  for (const std::string& lock : choice.lock) {
    const std::size_t equal = lock.find('=');
    const std::string joint = lock.substr(0, equal);
    double value = std::numeric_limits<double>::quiet_NaN();
    if (equal != std::string::npos) {
      const std::optional<double> read = to_number(lock.substr(equal + 1));
      if (!read || !std::isfinite(*read))
        throw ModelError("lock: got '" + lock +
                         "', expected JOINT or JOINT=VALUE with a number in rad or m");
      value = *read;
    }
    if (!out.emplace(joint, value).second) throw ModelError("lock: " + joint + " is named twice");
  }
  return out;
}

void require_joints(const Model& model, const Names& names, const char* option) {
  const Names moving = joint_names(model);
  for (const std::string& name : names)
    if (!has(moving, name))
      throw ModelError(std::string(option) + ": the model has no moving joint '" + name +
                       "'; joints: " + detail::join_or_none(moving));
}

/// "; is q_elbw that of elbow?": names that differ by a letter or two, or by their case.
std::string likely_pairs(const Names& strangers, const Names& missing) {
  const auto plain = [](std::string name) {
    std::erase_if(name, [](char c) { return c == '_' || c == '-' || c == '.'; });
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
    return name;
  };
  Names pairs;
  for (const std::string& m : missing)
    for (const std::string& s : strangers)
      if (edit_distance(plain(m), plain(s)) <= 2) pairs.push_back("q_" + s + "=q_" + m);
  return pairs.empty() ? "" : "; are they the same, --map \"" + detail::join(pairs, ",") + "\"?";
}

/// @throws DataError if names may be spelt in two ways, or nothing would hold what is not logged
void require_clear(const Model& model, const Names& logged, const Names& missing,
                   const Names& strangers) {
  if (missing.empty()) return;
  const Names moving = joint_names(model);
  const bool none_is_shared = missing.size() == moving.size();
  const std::string differ =
      "the joints are not the model's; only in the recording: " + detail::join_or_none(strangers) +
      "; only in the model: " + detail::join(missing) + likely_pairs(strangers, missing);
  if (none_is_shared) throw DataError(differ + "; --map \"q_NAME=q_JOINT\" names columns");
  if (!strangers.empty())
    throw DataError(differ + "; --joints " + detail::join(without(moving, missing), ",") +
                    " leaves these out and locks those, --lock JOINT=VALUE says where");
  for (const int i : moving_links(model)) {
    const ModelLink& link = model.links[static_cast<std::size_t>(i)];
    if (link.passive && has(missing, link.joint))
      throw DataError(
          "the passive joint '" + link.joint +
          "' is not logged, and nothing holds it; recording: " + detail::join_or_none(logged) +
          "; --lock " + link.joint + "=VALUE if it was held");
  }
}

std::optional<LoggedPosition> position_of(const Recording& r, const std::string& joint) {
  const auto it = std::ranges::find(r.joint_names, joint);
  if (it == r.joint_names.end()) return std::nullopt;
  std::vector<double> values;
  for (const double q : r.q.col(it - r.joint_names.begin()))
    if (std::isfinite(q)) values.push_back(q);
  if (values.empty()) return std::nullopt;
  const auto [low, high] = std::ranges::minmax(values);
  return LoggedPosition{median(std::move(values)), low, high};
}

/// "a, b at 0 rad; c at 0.2 m"
std::string listed(const std::vector<std::pair<std::string, std::string>>& at) {
  std::vector<std::pair<std::string, Names>> groups;
  for (const auto& [joint, where] : at) {
    const auto it = std::ranges::find(groups, where, &std::pair<std::string, Names>::first);
    if (it == groups.end())
      groups.push_back({where, {joint}});
    else
      it->second.push_back(joint);
  }
  Names out;
  for (const auto& [where, joints] : groups) out.push_back(detail::join(joints) + " at " + where);
  return detail::join(out, "; ");
}

/// A recording's joints.
struct Log {
  std::string source;  ///< file and run, for messages
  Names joints;
};

/// Joints of the model that a recording has, but for those that the choice locks.
Names free_joints(const Model& model, const Log& log, const JointChoice& choice) {
  Names out;
  for (const std::string& joint : joint_names(model)) {
    const bool is_locked = std::ranges::any_of(choice.lock, [&](const std::string& lock) {
      return lock.substr(0, lock.find('=')) == joint;
    });
    if (!is_locked && (choice.joints.empty() || has(choice.joints, joint)) &&
        has(log.joints, joint))
      out.push_back(joint);
  }
  return out;
}

/// One model serves all recordings: what moves in one of them, moves in all.
/// @throws DataError naming the first recording that differs
void require_alike(const Model& model, const std::vector<Log>& logs, const JointChoice& choice) {
  const Names there = free_joints(model, logs.front(), choice);
  for (const Log& log : logs) {
    const Names here = free_joints(model, log, choice), lacks = without(there, here),
                adds = without(here, there);
    if (lacks.empty() && adds.empty()) continue;
    throw DataError(log.source + ": its joints are not those of " + logs.front().source +
                    "; only here: " + detail::join_or_none(without(log.joints, there)) +
                    "; only there: " + detail::join_or_none(lacks) +
                    likely_pairs(without(log.joints, there), lacks) +
                    "; --lock JOINT=VALUE holds a joint in all of them");
  }
}

/// All recordings alike, the first tells.
ServedModel serve_logs(
    const Model& model, const std::vector<Log>& logs, const JointChoice& choice,
    const std::function<std::optional<LoggedPosition>(const std::string&)>& position) {
  require_alike(model, logs, choice);
  try {
    return serve_joints(model, logs.front().joints, choice, position);
  } catch (const DataError& error) {
    throw DataError(logs.front().source + ": " + error.what());
  }
}

}  // namespace

ServedModel serve_joints(
    const Model& model, const Names& logged, const JointChoice& choice,
    const std::function<std::optional<LoggedPosition>(const std::string&)>& position) {
  const std::map<std::string, double> stated = stated_positions(choice);
  Names locked;
  for (const auto& [joint, value] : stated) locked.push_back(joint);
  require_joints(model, locked, "lock");
  require_joints(model, choice.joints, "joints");
  const Names moving = joint_names(model);
  if (!choice.joints.empty()) {
    for (const std::string& joint : without(moving, choice.joints))
      if (!has(locked, joint)) locked.push_back(joint);
    if (const Names lost = without(choice.joints, logged); !lost.empty() && !logged.empty())
      throw DataError("joints: " + detail::join(lost) +
                      " is asked for and not logged; recording: " + detail::join_or_none(logged));
  }
  Names of_model;  // a fixed joint's column is no stranger's: it may have been locked before
  for (const ModelLink& link : model.links)
    if (!link.joint.empty()) of_model.push_back(link.joint);
  const Names missing =
      logged.empty() ? Names{}
                     : without(without(without(moving, logged), locked), joints_of_loops(model));
  const Names strangers = without(logged, of_model);
  require_clear(model, logged, missing, strangers);

  ServedModel out{.model = model, .note = ""};
  std::vector<std::pair<std::string, std::string>> at;
  Names gone;
  for (const std::string& joint : moving) {  // in the model's order
    if (!has(locked, joint) && !has(missing, joint)) continue;
    const auto said = stated.find(joint);
    double value = said == stated.end() ? std::numeric_limits<double>::quiet_NaN() : said->second;
    std::string why;
    const bool is_logged = has(logged, joint);
    if (const std::optional<LoggedPosition> was =
            is_logged && position ? position(joint) : std::nullopt) {
      if (std::isnan(value)) value = was->median;
      why = " (logged from " + detail::number_text(was->lowest, 3) + " to " +
            detail::number_text(was->highest, 3) + ")";
    }
    if (std::isnan(value)) value = resting_position(out.model, joint);
    const auto link =
        std::ranges::find_if(out.model.links, [&](const ModelLink& l) { return l.joint == joint; });
    const char* unit = link->type == ModelJoint::kPrismatic ? " m" : " rad";
    at.emplace_back(joint, detail::number_text(value) + unit + why);
    for (const std::string& effect : lock_joint(out.model, joint, value))
      if (const std::string name = effect.substr(0, effect.find(" at ")); !has(gone, name))
        gone.push_back(name);
  }
  if (!at.empty()) out.note = "locked: " + listed(at);
  if (!missing.empty())
    out.note += ", since the recordings do not have " +
                std::string(missing.size() == 1 ? "it" : "them") + " (--lock JOINT=VALUE)";
  if (!gone.empty()) out.note += "; gone with their motion: " + detail::join(gone);
  if (const Names left_out =
          without(without(logged, joint_names(out.model)), follower_names(out.model));
      !left_out.empty())
    out.note += (out.note.empty() ? "" : "; ") + std::string("columns left out: those of ") +
                detail::join(left_out);
  return out;
}

ServedModel serve_joints(const Model& model, const std::vector<std::filesystem::path>& files,
                         const std::vector<ReadOptions>& options, const JointChoice& choice) {
  if (files.empty()) return {.model = model, .note = ""};
  const auto options_of = [&](std::size_t file) {
    ReadOptions out = options.empty() ? ReadOptions{} : options[options.size() == 1 ? 0 : file];
    out.joints.clear();  // all that are logged
    return out;
  };
  std::vector<Log> logs;
  for (std::size_t f = 0; f < files.size(); ++f) {
    const ReadOptions read = options_of(f);
    logs.push_back({read.name.empty() ? files[f].string() : read.name,
                    RecordingReader(files[f], read).joint_names()});
  }
  std::optional<Recording> first;
  return serve_logs(model, logs, choice, [&](const std::string& joint) {
    if (!first) {
      RecordingReader reader(files.front(), options_of(0));
      reader.next(first.emplace(), kLookedAt);
    }
    return position_of(*first, joint);
  });
}

ServedModel serve_joints(const Model& model, const std::vector<Recording>& recordings,
                         const JointChoice& choice) {
  if (recordings.empty()) return {.model = model, .note = ""};
  std::vector<Log> logs;
  for (const Recording& r : recordings) logs.push_back({r.source, r.joint_names});
  return serve_logs(model, logs, choice, [&](const std::string& joint) {
    return position_of(recordings.front(), joint);
  });
}

}  // namespace diffnea
