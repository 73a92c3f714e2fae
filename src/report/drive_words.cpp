#include "report/drive_words.hpp"

#include <algorithm>
#include <cmath>

#include "report/diagnose_words.hpp"
#include "report/format.hpp"

namespace diffnea::report {
namespace {

constexpr std::size_t kInSentence = 4;  ///< kinds of numbers
constexpr std::size_t kNamed = 3;       ///< joints of a kind
constexpr std::size_t kInTable = 16;    ///< numbers

/// Joint and kind of a number: "elbow" and "dead band" of "elbow.position_servo.dead_band";
/// "rotor".
std::pair<std::string, std::string> parts(const std::string& name) {
  const std::size_t last = name.rfind('.'), first = name.rfind('.', last - 1);
  const std::string effect = name.substr(first + 1, last - first - 1);
  return {name.substr(0, first),
          plain(effect == "position_servo" ? name.substr(last + 1) : effect)};
}

std::string listed(const std::vector<std::string>& items) {
  std::string out;
  for (std::size_t i = 0; i < items.size(); ++i)
    out += (i == 0 ? "" : i + 1 == items.size() ? " and " : ", ") + items[i];
  return out;
}

}  // namespace

std::string drives_sentence(const Finding& f) {
  std::vector<std::pair<std::string, std::vector<std::string>>> kinds;  // and their joints
  for (const RefutedNumber& n : f.drives) {
    const auto [joint, kind] = parts(n.name);
    auto of = std::ranges::find(kinds, kind, [](const auto& k) { return k.first; });
    if (of == kinds.end()) of = kinds.insert(kinds.end(), {kind, {}});
    of->second.push_back(joint);
  }
  if (kinds.empty()) return "";
  std::vector<std::string> words;
  for (const auto& [kind, joints] : kinds)
    if (words.size() < kInSentence)
      words.push_back(
          kind + " at " +
          (joints.size() > kNamed ? std::to_string(joints.size()) + " joints" : listed(joints)));
    else {
      words.push_back("more");
      break;
    }
  return "The drives differ from the description: " + listed(words) + ".";
}

std::vector<std::vector<std::string>> drive_rows(const Finding& f) {
  std::vector<std::vector<std::string>> rows;
  for (const RefutedNumber& n : f.drives) {
    if (rows.size() == kInTable) {
      rows.push_back({"and " + std::to_string(f.drives.size() - kInTable) + " more", "", "", "",
                      "in result.json"});
      break;
    }
    const auto [joint, kind] = parts(n.name);
    rows.push_back({joint, kind, std::isnan(n.described) ? "none" : number(n.described),
                    value_and_std(n.value, n.std), unit(n.unit)});
  }
  return rows;
}

}  // namespace diffnea::report
