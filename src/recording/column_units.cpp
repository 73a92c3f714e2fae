#include "recording/column_units.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

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
/// Units that drives report instead: a torque by the sidecar's torque_constant, per A, V or %.
constexpr Unit kDriveUnits[] = {{"A", 1.0}, {"mA", 1e-3}, {"V", 1.0}, {"%", 1.0}};
constexpr Unit kLengthUnits[] = {{"m", 1.0}, {"cm", 1e-2}, {"mm", 1e-3}};
constexpr Unit kSpinUnits[] = {
    {"rad/s", 1.0}, {"deg/s", kPi / 180}, {"rpm", kPi / 30}, {"rev/s", 2 * kPi}};
constexpr Unit kSpeedUnits[] = {{"m/s", 1.0}, {"cm/s", 1e-2}, {"mm/s", 1e-3}};
constexpr Unit kMomentUnits[] = {{"N*m", 1.0}, {"Nm", 1.0}, {"mN*m", 1e-3}, {"mNm", 1e-3}};
constexpr Unit kForceUnits[] = {{"N", 1.0}, {"kN", 1000.0}, {"mN", 1e-3}};
constexpr Unit kNoUnits[] = {{"1", 1.0}};

std::span<const Unit> units_of(Channel channel) {
  switch (channel) {
    case Channel::kTime:
      return kTimeUnits;
    case Channel::kQ:
    case Channel::kQcmd:
      return kPositionUnits;
    case Channel::kQd:
    case Channel::kQdcmd:
      return kVelocityUnits;
    case Channel::kQdd:
      return kAccelerationUnits;
    case Channel::kTau:
    case Channel::kTaucmd:
      return kTorqueUnits;
    case Channel::kBall:
    case Channel::kBasePosition:
      return kLengthUnits;
    case Channel::kSpin:
    case Channel::kBaseTurning:
      return kSpinUnits;
    case Channel::kBaseQuaternion:
      return kNoUnits;
    case Channel::kBaseVelocity:
      return kSpeedUnits;
    case Channel::kBaseTorque:
      return kMomentUnits;
    case Channel::kBaseForce:
      return kForceUnits;
    case Channel::kRun:
    case Channel::kExtra:
    case Channel::kLeftOut:
      break;
  }
  return {};
}

Motion motion_of(Channel channel, const std::string& unit) {
  if (channel == Channel::kTau || channel == Channel::kTaucmd)
    return unit.ends_with('m') ? Motion::kTurns : Motion::kSlides;
  const std::string length = unit.substr(0, unit.find('/'));
  return length == "m" || length == "cm" || length == "mm" ? Motion::kSlides : Motion::kTurns;
}

/// A finite number that is all of the text.
std::optional<double> number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double x = 0.0;
  const auto [last, error] = std::from_chars(text.data(), text.data() + text.size(), x);
  if (error != std::errc() || last != text.data() + text.size() || !std::isfinite(x))
    return std::nullopt;
  return x;
}

}  // namespace

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

std::vector<std::string> unit_names(Channel channel) {
  std::vector<std::string> out;
  for (const Unit& u : units_of(channel)) out.emplace_back(u.name);
  if (channel == Channel::kTau)
    for (const Unit& u : kDriveUnits) out.emplace_back(u.name);
  return out;
}

UnitOfColumn parse_unit(Channel channel, const std::string& text) {
  const auto fail = [&](const std::string& why) -> void {
    throw DataError("unit '" + text + "' " + why + "; units: " + join_or_none(unit_names(channel)) +
                    ", or a law of raw numbers, FACTOR*UNIT, FACTOR*UNIT+OFFSET, … mod MODULUS");
  };
  UnitOfColumn out;
  std::string rest = text;
  double factor = 1.0, offset = 0.0;
  if (const std::size_t at = rest.rfind("mod"); at != std::string::npos && at > 0) {
    const std::optional<double> modulus = number(std::string_view(rest).substr(at + 3));
    if (!modulus || !(*modulus > 0.0)) fail("ends in no modulus above 0");
    out.conversion.modulus = *modulus;
    rest.resize(at);
  }
  if (const std::size_t at = rest.find('*');
      at != std::string::npos && rest.find_first_of("0123456789") < at) {
    const std::optional<double> read = number(std::string_view(rest).substr(0, at));
    if (!read || *read == 0.0) fail("begins with no factor");
    factor = *read;
    rest.erase(0, at + 1);
  }
  if (const std::size_t at = rest.find_first_of("+-"); at != std::string::npos) {
    const std::optional<double> read = number(std::string_view(rest).substr(at));
    if (!read) fail("ends in no offset");
    offset = *read;
    rest.resize(at);
  }
  const auto find = [&](std::span<const Unit> units) -> const Unit* {
    const auto it = std::ranges::find_if(units, [&](const Unit& u) { return u.name == rest; });
    return it == units.end() ? nullptr : &*it;
  };
  const Unit* unit = find(units_of(channel));
  if (unit != nullptr) {
    out.motion = motion_of(channel, rest);
  } else if (channel == Channel::kTau && (unit = find(kDriveUnits)) != nullptr) {
    out.of_drive = true;
  } else {
    fail(std::string("is not known for a ") + channel_name(channel));
  }
  out.unit = rest;
  out.conversion.scale = factor * unit->scale;
  out.conversion.offset = offset * unit->scale;
  return out;
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
    case Channel::kQdcmd:
      return "desired velocity";
    case Channel::kTaucmd:
      return "torque command";
    case Channel::kTau:
      return "torque";
    case Channel::kBall:
      return "ball position";
    case Channel::kSpin:
      return "spin";
    case Channel::kBasePosition:
      return "base position";
    case Channel::kBaseQuaternion:
      return "base quaternion";
    case Channel::kBaseTurning:
      return "base angular velocity";
    case Channel::kBaseVelocity:
      return "base velocity";
    case Channel::kBaseTorque:
      return "torque on the base";
    case Channel::kBaseForce:
      return "force on the base";
    case Channel::kExtra:
      return "extra channel";
    case Channel::kLeftOut:
      return "column that is left out";
  }
  return "";
}

}  // namespace diffnea::detail
