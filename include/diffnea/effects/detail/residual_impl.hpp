#pragma once

#include <algorithm>
#include <cmath>

#include <diffnea/core/compiled.hpp>
#include <diffnea/effects/residual.hpp>

namespace diffnea {
namespace detail {

inline Residual::Axis residual_axis(const std::string& channel,
                                    const std::vector<std::string>& joints,
                                    const std::string& here) {
  for (const bool velocity : {false, true}) {
    const std::string prefix = velocity ? "qd_" : "q_";
    if (!channel.starts_with(prefix)) continue;
    const auto at = std::ranges::find(joints, channel.substr(prefix.size()));
    if (at != joints.end()) return {velocity, static_cast<int>(at - joints.begin())};
  }
  std::string names;
  for (const std::string& j : joints) names += (names.empty() ? "" : ", ") + j;
  throw ModelError(here + ": table: got the variable '" + channel +
                   "', expected q_<joint> or qd_<joint>; joints: " + names);
}

}  // namespace detail

DIFFNEA_INLINE Residual Residual::from(const BumpTable& table,
                                       const std::vector<std::string>& joints,
                                       const std::string& here) {
  Residual out;
  out.table = table;
  for (const std::string& v : table.variables)
    out.axes.push_back(detail::residual_axis(v, joints, here));
  if (out.axes.empty() || out.axes.size() > 2)
    throw ModelError(here + ": table: got " + std::to_string(out.axes.size()) +
                     " variables, expected one or two");
  const std::size_t numbers = table.weights.size() * out.axes.size();
  for (const auto& [name, of] :
       {std::pair<const char*, const std::vector<double>&>{"centres", table.centres},
        {"widths", table.widths}})
    if (of.size() != numbers)
      throw ModelError(here + ": table: got " + std::to_string(of.size()) + " " + name +
                       ", expected " + std::to_string(numbers) +
                       ": one for each weight and variable");
  const auto finite = [](double x) { return std::isfinite(x); };
  if (!std::ranges::all_of(table.centres, finite) || !std::ranges::all_of(table.weights, finite))
    throw ModelError(here + ": table: centres and weights must be finite numbers");
  if (!std::ranges::all_of(table.widths, [](double h) { return std::isfinite(h) && h > 0.0; }))
    throw ModelError(here + ": table: widths must be above 0");
  if (!(table.bound >= 0.0) || !std::isfinite(table.bound))
    throw ModelError(here + ": table: bound = " + std::to_string(table.bound) +
                     ", expected a finite number, 0 or above");
  return out;
}

DIFFNEA_INLINE void Residual::complete(const BoundSetting& setting) {
  if (!setting.spec.table)
    throw ModelError(setting.here +
                     ": it has no table; `diffnea diagnose` learns one where a torque has "
                     "no name, it cannot be asked for");
  if (setting.joints.size() != 1)
    throw ModelError(setting.here + ": its table is of one joint; expected that joint's name");
  *this = from(*setting.spec.table, joint_names(setting.model), setting.here);
}

}  // namespace diffnea
