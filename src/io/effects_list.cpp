#include <cmath>

#include <diffnea/core/text.hpp>
#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/io/effects_list.hpp>

#include "io/json.hpp"

namespace diffnea {
namespace {

const char* place_name(Place place) {
  switch (place) {
    case Place::kJoint:
      return "joint";
    case Place::kJointPair:
      return "joint,joint";
    case Place::kTip:
      return "tip";
    case Place::kBase:
      return "base";
    case Place::kAllJoints:
      return "all";
    case Place::kBall:
      return "ball";
    case Place::kString:
      return "string";
    case Place::kCamera:
      return "camera";
  }
  return "";
}

const char* port_name(Port port) {
  switch (port) {
    case Port::kJointTorque:
      return "joint torque";
    case Port::kLinkForce:
      return "force on a link";
    case Port::kModelParameter:
      return "model parameter";
    case Port::kMeasurement:
      return "measurement";
    case Port::kMemory:
      return "torque with memory";
    case Port::kBallForce:
      return "acceleration of the ball";
    case Port::kBallImpact:
      return "bounce of the ball";
    case Port::kBallView:
      return "view of the ball";
    case Port::kStringAnchor:
      return "place of the string";
    case Port::kStringContact:
      return "contact of the string";
  }
  return "";
}

const char* sign_name(Sign sign) {
  return sign == Sign::kFree ? "any" : sign == Sign::kNonNegative ? "not negative" : "positive";
}

}  // namespace

std::string effects_text() {
  std::string out =
      "effects, as in --effects NAME@WHERE (units of a revolute / a prismatic joint)\n";
  for (const EffectInfo& e : catalogue()) {
    out += "\n" + e.name + "   " + e.formula + "\n  " + e.summary + "; at: " + place_name(e.place) +
           "\n";
    for (const ParameterInfo& p : e.parameters) {
      const std::string unit =
          p.unit == p.unit_prismatic ? p.unit : p.unit + " / " + p.unit_prismatic;
      out += "    " + p.name + (p.per_run ? "_<run>" : "") + " [" + (unit == "1" ? "-" : unit) +
             "]" +
             (p.sign == Sign::kNonNegative ? " >= 0"
              : p.sign == Sign::kPositive  ? " > 0"
                                           : "") +
             (p.linear ? "" : ", nonlinear, initially " + detail::number_text(p.initial)) + "\n";
    }
  }
  return out;
}

std::string effects_json() {
  io::Json effects = io::Json::array();
  for (const EffectInfo& e : catalogue()) {
    io::Json parameters = io::Json::array();
    for (const ParameterInfo& p : e.parameters) {
      const double prismatic = std::isnan(p.initial_prismatic) ? p.initial : p.initial_prismatic;
      parameters.push_back({{"name", p.name},
                            {"unit", p.unit},
                            {"unit_prismatic", p.unit_prismatic},
                            {"sign", sign_name(p.sign)},
                            {"linear", p.linear},
                            {"initial", p.initial},
                            {"initial_prismatic", prismatic},
                            {"per_run", p.per_run},
                            {"search", p.search}});
    }
    effects.push_back({{"effect", e.name},
                       {"formula", e.formula},
                       {"summary", e.summary},
                       {"place", place_name(e.place)},
                       {"acts_on", port_name(e.port)},
                       {"motor_side", e.motor_side},
                       {"parameters", parameters}});
  }
  const io::Json out{{"schema", "diffnea/effects/1"}, {"effects", effects}};
  return out.dump(1, ' ', false, io::Json::error_handler_t::replace) + "\n";
}

}  // namespace diffnea
