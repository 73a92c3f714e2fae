#include "io/mjcf_loops.hpp"

#include <cstddef>
#include <optional>

#include <Eigen/Geometry>

#include "io/mjcf_parts.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

/// Words of a <numeric> that stands for a site; the site's name ends it.
std::string site_note(const std::string& end, const std::string& constraint) {
  return end + " of " + constraint + ": ";
}

/// Site that `remember_site` wrote down; −1: none.
int remembered_site(const mjModel& m, const char* end, const std::string& constraint) {
  const std::string note = site_note(end, constraint);
  for (int i = 0; i < m.nnumeric; ++i) {
    const std::string name = object_name(m, mjOBJ_NUMERIC, i, "");
    if (name.starts_with(note)) return mj_name2id(&m, mjOBJ_SITE, name.substr(note.size()).c_str());
  }
  return -1;
}

Pose<double> pose_of(const mjtNum* p, const mjtNum* quat) {
  return {rotation_from_quaternion(quat[0], quat[1], quat[2], quat[3]), vec(p)};
}

bool is_active(const mjModel& m, int e) {
#if mjVERSION_HEADER >= 300
  return m.eq_active0[e] != 0;
#else
  return m.eq_active[e] != 0;
#endif
}

void set_frame(XmlElement& site, const std::string& name, const Pose<double>& X) {
  const Eigen::Quaterniond q(to_eigen(X.R));
  site.SetAttribute("name", name.c_str());
  site.SetAttribute("pos", exact(X.p).c_str());
  site.SetAttribute("quat", (exact(q.w()) + " " + exact(vec3<double>(q.vec()))).c_str());
}

}  // namespace

std::string constraint_name(const mjModel& m, int e) {
  const std::string name = object_name(m, mjOBJ_EQUALITY, e, "");
  if (!name.empty()) return name;
  std::string made = (m.eq_type[e] == mjEQ_WELD ? "weld" : "connect") + std::to_string(e + 1);
  while (mj_name2id(&m, mjOBJ_EQUALITY, made.c_str()) >= 0) made += "_";
  return made;
}

std::vector<ConstraintSpec> loop_constraints(const mjModel& m, const std::vector<bool>& left_out,
                                             const PlaceOfBody& place) {
  std::vector<ConstraintSpec> out;
  for (int e = 0; e < m.neq; ++e) {
    if (!is_active(m, e) || (m.eq_type[e] != mjEQ_CONNECT && m.eq_type[e] != mjEQ_WELD)) continue;
    const int a = m.eq_obj1id[e], b = m.eq_obj2id[e];
    if ((a >= 0 && left_out[a]) || (b >= 0 && left_out[b])) continue;
    const mjtNum* data = m.eq_data + static_cast<std::ptrdiff_t>(mjNEQDATA) * e;
    const bool weld = m.eq_type[e] == mjEQ_WELD;
    ConstraintSpec spec;
    spec.name = constraint_name(m, e);
    spec.kind = weld ? ConstraintKind::kWeld : ConstraintKind::kConnect;
    // In the bodies. Connect: a point of each. Weld: x₁ + R₁ relpos = x₂ + R₂ anchor, R₁ relquat =
    // R₂; the anchor leads.
    Pose<double> X_AJ = weld ? pose_of(data + 3, data + 6) : shift(vec(data));
    Pose<double> X_BK = weld ? shift(vec(data)) : shift(vec(data + 3));
    int body_a = a, body_b = b;
    const auto at_site = [&](const char* end, int& body, Pose<double>& X) {
      const int site = remembered_site(m, end, spec.name);
      if (site < 0) return;
      body = m.site_bodyid[site];
      X = pose_of(m.site_pos + 3 * site, m.site_quat + 4 * site);
    };
    at_site("site1", body_a, X_AJ);
    at_site("site2", body_b, X_BK);
    const auto end_at = [&](int body, const Pose<double>& X) -> ConstraintEnd {
      const auto [link, X_LB] = place(body);
      return {link, X_LB * X};
    };
    spec.first = end_at(body_a, X_AJ);
    spec.second = end_at(body_b, X_BK);
    out.push_back(std::move(spec));
  }
  return out;
}

void remember_site(XmlElement& constraint, const char* end, const std::string& site) {
  XmlElement& root = *constraint.GetDocument()->RootElement();
  if (attribute(constraint, "name").empty()) {
    // One that no other constraint has.
    std::string name = std::string(constraint.Name()) + " at " + site;
    for_each_child(root, "equality", [&](XmlElement& section) {
      for_each_child(section, nullptr, [&](XmlElement& other) {
        if (attribute(other, "name") == name) name += "_";
      });
    });
    constraint.SetAttribute("name", name.c_str());
  }
  XmlElement& numeric = *child(root, "custom").InsertNewChildElement("numeric");
  numeric.SetAttribute("name", (site_note(end, attribute(constraint, "name")) + site).c_str());
  numeric.SetAttribute("data", "0");
}

bool write_constraint(XmlElement& root, const ConstraintSpec& c,
                      const std::vector<XmlElement*>& bodies, bool q0_apart) {
  const auto body_of = [&](const ConstraintEnd& end) -> XmlElement& {
    if (end.link >= 0) return *bodies[static_cast<std::size_t>(end.link)];
    return child(root, "worldbody");
  };
  const auto name_of = [&](XmlElement& body) {
    return is(body, "body") ? attribute(body, "name") : std::string("world");
  };
  const auto add = [&](const char* tag, const std::string& name) -> XmlElement& {
    XmlElement& e = *child(root, "equality").InsertNewChildElement(tag);
    e.SetAttribute("name", name.c_str());
    return e;
  };
  XmlElement &a = body_of(c.first), &b = body_of(c.second);
  const auto connect = [&](const std::string& name, const Vec3<double>& p_A,
                           const Vec3<double>& p_B) {
    XmlElement& e = add("connect", name);
    if (!q0_apart) {
      e.SetAttribute("body1", name_of(a).c_str());
      e.SetAttribute("body2", name_of(b).c_str());
      e.SetAttribute("anchor", exact(p_A).c_str());
      return;
    }
    for (const auto& [end, body, p] :
         {std::tuple{"site1", &a, p_A}, std::tuple{"site2", &b, p_B}}) {
      const std::string site = name + (end[4] == '1' ? "_first" : "_second");
      set_frame(*body->InsertNewChildElement("site"), site, shift(p));
      e.SetAttribute(end, site.c_str());
    }
  };
  switch (c.kind) {
    case ConstraintKind::kConnect:
      connect(c.name, c.first.X_LF.p, c.second.X_LF.p);
      return true;
    case ConstraintKind::kHinge: {  // two points of the axis
      const Vec3<double> z{0, 0, 1};
      connect(c.name, c.first.X_LF.p, c.second.X_LF.p);
      connect(c.name + "_axis", c.first.X_LF.R * z + c.first.X_LF.p,
              c.second.X_LF.R * z + c.second.X_LF.p);
      return true;
    }
    case ConstraintKind::kWeld: {
      XmlElement& e = add("weld", c.name);
      e.SetAttribute("body1", name_of(a).c_str());
      e.SetAttribute("body2", name_of(b).c_str());
      // R₁ relquat = R₂ and x₁ + R₁ relpos = x₂ + R₂ anchor, with the anchor at body 2's origin.
      const Pose<double> X_AB = c.first.X_LF * inverse(c.second.X_LF);
      const Eigen::Quaterniond q(to_eigen(X_AB.R));
      e.SetAttribute("anchor", "0 0 0");
      e.SetAttribute(
          "relpose",
          (exact(X_AB.p) + " " + exact(q.w()) + " " + exact(vec3<double>(q.vec()))).c_str());
      return true;
    }
    case ConstraintKind::kRolling:
      return false;
  }
  return false;
}

}  // namespace diffnea::io
