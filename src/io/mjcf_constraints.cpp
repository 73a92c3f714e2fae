#include "io/mjcf_constraints.hpp"

#include <diffnea/core/error.hpp>

#include "io/mjcf_parts.hpp"

namespace diffnea::io {
namespace {

/// Constraint `number` of those in the document, in MuJoCo's order.
std::string place_of_constraint(const Mjcf& mjcf, int number) {
  std::string out;
  for_each_child(*mjcf.document->RootElement(), "equality", [&](XmlElement& section) {
    for_each_child(section, nullptr, [&](XmlElement& e) {
      if (number-- == 0) out = mjcf.line(e);
    });
  });
  return out;
}

/// Phrase for an equality constraint, with the names of its objects.
std::string constraint_text(const mjModel& m, int e) {
  const int a = m.eq_obj1id[e], b = m.eq_obj2id[e];
  const auto pair = [&](mjtObj type, const char* otherwise) {
    return "'" + std::string(object_name(m, type, a, "without a name")) + "'" +
           (b < 0 ? std::string(otherwise)
                  : " and '" + std::string(object_name(m, type, b, "without a name")) + "'");
  };
  switch (m.eq_type[e]) {
    case mjEQ_CONNECT:
      return "holds bodies " + pair(mjOBJ_BODY, " and the world") + " together at a point";
    case mjEQ_WELD:
      return "welds bodies " + pair(mjOBJ_BODY, " and the world");
    case mjEQ_JOINT:
      return b < 0 ? "locks joint " + pair(mjOBJ_JOINT, "")
                   : "couples joints " + pair(mjOBJ_JOINT, "");
    case mjEQ_TENDON:
      return "couples tendons " + pair(mjOBJ_TENDON, "");
    default:
      return "couples shapes " + pair(mjOBJ_GEOM, "");
  }
}

}  // namespace

void look_for_closed_loops(const mjModel& m, const std::vector<bool>& left_out, const Mjcf& mjcf,
                           std::vector<std::string>& notes) {
  for (int e = 0; e < m.neq; ++e) {
#if mjVERSION_HEADER >= 300
    if (!m.eq_active0[e]) continue;
#else
    if (!m.eq_active[e]) continue;
#endif
    const int type = m.eq_type[e], a = m.eq_obj1id[e], b = m.eq_obj2id[e];
    if ((type == mjEQ_CONNECT || type == mjEQ_WELD) &&
        ((a >= 0 && left_out[a]) || (b >= 0 && left_out[b])))
      continue;
    const std::string place = place_of_constraint(mjcf, e),
                      name = object_name(m, mjOBJ_EQUALITY, e, ""),
                      what = "equality constraint " + (name.empty() ? "" : "'" + name + "' ") +
                             (place.empty() ? "" : "(" + place + ") ") + constraint_text(m, e);
    if (mjcf.reading.open_loops) {
      notes.push_back(what + ": left out, as asked; its forces are missing from the model");
      continue;
    }
    throw ModelError(mjcf.where + ": " + what +
                     "; a robot must be a tree of independent joints: make one of the joints "
                     "fixed, or read the tree without its constraints (--open-loops, "
                     "open_loops=True), whose forces then are missing");
  }
}

}  // namespace diffnea::io
