#include "io/mjcf_constraints.hpp"

#include <cstddef>

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

/// Couples the two joints of a constraint, q₁ − q₁₀ = c₀ + c₁ (q₂ − q₂₀).
/// @return why it cannot; empty: it did
std::string couple(const mjModel& m, int e, std::vector<JointCoupling>& joints) {
  const mjtNum* c = m.eq_data + static_cast<std::ptrdiff_t>(mjNEQDATA) * e;
  const auto rest = [&](int j) { return m.qpos0[m.jnt_qposadr[j]]; };
  const auto free = [&](int j) { return !joints[j].follows && !joints[j].locked_at; };
  const auto follow = [&](int j, int leader, double ratio, double offset) {
    joints[j].follows = Follow{joint_name(m, leader), ratio, offset};
  };
  const int a = m.eq_obj1id[e], b = m.eq_obj2id[e];
  if (b < 0) {
    if (!free(a)) return "its joint is held by another constraint as well";
    joints[a].locked_at = rest(a) + c[0];
    return "";
  }
  if (c[2] != 0 || c[3] != 0 || c[4] != 0)
    return "it is a polynomial of degree " +
           std::to_string(c[4] != 0   ? 4
                          : c[3] != 0 ? 3
                                      : 2) +
           ", and only a straight line, of degree 1, is supported";
  const double offset = rest(a) + c[0] - c[1] * rest(b);
  if (free(a))
    follow(a, b, c[1], offset);
  else if (free(b) && c[1] != 0)
    follow(b, a, 1.0 / c[1], -offset / c[1]);
  else
    return "both joints are held by other constraints as well";
  return "";
}

}  // namespace

std::vector<JointCoupling> joint_couplings(const mjModel& m, const std::vector<bool>& left_out,
                                           const Mjcf& mjcf, std::vector<std::string>& notes) {
  std::vector<JointCoupling> out(static_cast<std::size_t>(m.njnt));
  for (int e = 0; e < m.neq; ++e) {
#if mjVERSION_HEADER >= 300
    if (!m.eq_active0[e]) continue;
#else
    if (!m.eq_active[e]) continue;
#endif
    const int type = m.eq_type[e], a = m.eq_obj1id[e], b = m.eq_obj2id[e];
    if (type == mjEQ_CONNECT || type == mjEQ_WELD) {
      if (!mjcf.reading.open_loops) continue;  // see mjcf_loops.hpp
      if ((a >= 0 && left_out[a]) || (b >= 0 && left_out[b])) continue;
    }
    const std::string place = place_of_constraint(mjcf, e),
                      name = object_name(m, mjOBJ_EQUALITY, e, ""),
                      what = "equality constraint " + (name.empty() ? "" : "'" + name + "' ") +
                             (place.empty() ? "" : "(" + place + ") ") + constraint_text(m, e);
    if (mjcf.reading.open_loops) {
      notes.push_back(what + ": left out, as asked; its forces are missing from the model");
      continue;
    }
    std::string reason = "joints, points and welds are supported, and these are not";
    if (type == mjEQ_JOINT) {
      reason = couple(m, e, out);
      if (reason.empty()) continue;
    }
    throw ModelError(mjcf.where + ": " + what + ": " + reason +
                     "; make one of the joints fixed, or read the tree without its constraints "
                     "(--open-loops, open_loops=True), whose forces then are missing");
  }
  return out;
}

}  // namespace diffnea::io
