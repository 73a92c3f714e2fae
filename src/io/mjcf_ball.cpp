#include "io/mjcf_ball.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <diffnea/core/error.hpp>

#include "io/mjcf.hpp"
#include "io/mjcf_parts.hpp"
#include "io/model_parts.hpp"

namespace diffnea::io {
namespace {

constexpr const char* kExpected =
    "; expected <spatial name='string' limited='true' range='0 LENGTH'> with two sites: one on the "
    "arm (or the world), one on the free body 'ball'";

std::string site_name(const mjModel& m, int site) {
  const char* name = mj_id2name(&m, mjOBJ_SITE, site);
  return name ? name : "site" + std::to_string(site);
}

/// Radius of the largest sphere that the body is drawn with; 0 if there is none.
double radius_of(const mjModel& m, int body) {
  double radius = 0.0;
  for (int g = m.body_geomadr[body]; g < m.body_geomadr[body] + m.body_geomnum[body]; ++g)
    if (m.geom_type[g] == mjGEOM_SPHERE)
      radius = std::max(radius, static_cast<double>(m.geom_size[3 * g]));
  return radius;
}

/// Fills in the string. @throws ModelError
void find_string(const mjModel& m, int tendon, const std::string& where, MjcfBall& ball,
                 std::vector<std::string>& notes) {
  const std::string here = where + ": tendon 'string' ";
  const int first = m.tendon_adr[tendon], num = m.tendon_num[tendon];
  for (int w = first; w < first + num; ++w)
    if (num != 2 || m.wrap_type[w] != mjWRAP_SITE)
      throw ModelError(here + "runs over " + std::to_string(num) +
                       (m.wrap_type[w] == mjWRAP_JOINT ? " joints" : " sites and objects") +
                       kExpected);
  const int sites[] = {m.wrap_objid[first], m.wrap_objid[first + 1]};
  const bool on_ball[] = {m.site_bodyid[sites[0]] == ball.body,
                          m.site_bodyid[sites[1]] == ball.body};
  if (on_ball[0] == on_ball[1])
    throw ModelError(here + "runs from site '" + site_name(m, sites[0]) + "' to site '" +
                     site_name(m, sites[1]) + "', of which " +
                     (on_ball[0] ? "both are" : "none is") + " on the ball" + kExpected);
  if (!m.tendon_limited[tendon]) throw ModelError(here + "has no limit" + kExpected);
  if (m.tendon_range[2 * tendon] > 0.0)
    notes.emplace_back("the lower limit of tendon 'string' is left out: a string may go slack");
  ball.tendon = tendon;
  ball.anchor = on_ball[0] ? sites[1] : sites[0];
  const Vec3<double> end =
      vec(m.site_pos + 3 * (on_ball[0] ? sites[0] : sites[1])) - vec(m.body_ipos + 3 * ball.body);
  ball.offset = std::sqrt(dot(end, end));
  if (ball.offset > 0.0)
    notes.push_back("the string ends " + exact(ball.offset) +
                    " m beside the ball's centre, to which its length is counted");
}

/// The site's element, if its `pos` is its position in its body.
XmlElement* find_site(XmlElement& element, const std::string& name) {
  for (XmlElement* e = element.FirstChildElement(); e; e = e->NextSiblingElement()) {
    if (std::strcmp(e->Name(), "site") == 0 && attribute(*e, "name") == name) {
      const bool in_body =
          std::strcmp(element.Name(), "body") == 0 || std::strcmp(element.Name(), "worldbody") == 0;
      return in_body && !e->Attribute("fromto") ? e : nullptr;
    }
    if (XmlElement* found = find_site(*e, name)) return found;
  }
  return nullptr;
}

XmlElement* find_spatial_string(XmlElement& root) {
  XmlElement* out = nullptr;
  for_each_child(root, "tendon", [&](XmlElement& tendon) {
    for_each_child(tendon, "spatial", [&](XmlElement& e) {
      if (attribute(e, "name") == "string") out = &e;
    });
  });
  return out;
}

}  // namespace

bool is_free(const mjModel& m, int body) {
  return m.body_jntnum[body] == 1 && m.jnt_type[m.body_jntadr[body]] == mjJNT_FREE;
}

std::vector<bool> left_out_bodies(const mjModel& m, const Mjcf& mjcf) {
  std::vector<bool> out(static_cast<std::size_t>(m.nbody));
  const auto is_ball = [&](int b) { return is_free(m, b) && body_name(m, b) == "ball"; };
  int base = -1;                                               // body on which the robot floats
  std::vector<bool> moves(static_cast<std::size_t>(m.nbody));  // it, or something on it
  for (int b = m.nbody - 1; b > 0; --b) {
    if (m.body_jntnum[b] > 0) moves[b] = true;
    if (moves[b]) moves[m.body_parentid[b]] = true;
  }
  for (int b = 1; b < m.nbody; ++b) {
    if (!is_free(m, b) || is_ball(b)) continue;
    if (base >= 0) {
      const std::string first = body_name(m, base), second = body_name(m, b);
      throw ModelError(
          mjcf.where + ": bodies '" + first + "'" + mjcf.line_of("body", first) + " and '" +
          second + "'" + mjcf.line_of("body", second) +
          " are free: a robot floats on one base; --fix-base (fix_base=True) reads them as fixed "
          "where the file has them, as if hung there (a free body named 'ball' is a ball beside "
          "the robot)");
    }
    base = b;
  }
  for (int b = 1; b < m.nbody; ++b) {
    const int parent = m.body_parentid[b];
    if (base >= 0 && parent == 0 && b != base && moves[b] && !is_ball(b)) {
      const std::string floats = body_name(m, base), beside = body_name(m, b);
      throw ModelError(mjcf.where + ": body '" + floats + "'" + mjcf.line_of("body", floats) +
                       " is free, and '" + beside + "'" + mjcf.line_of("body", beside) +
                       " moves beside it: a robot that floats hangs on one base; --fix-base "
                       "(fix_base=True) reads what is free as fixed where the file has it");
    }
    const bool stands = base >= 0 && parent == 0 && !moves[b];
    out[b] = (parent > 0 && out[parent]) || is_ball(b) || stands;
  }
  return out;
}

std::optional<MjcfBall> find_ball(const mjModel& m, const std::string& where,
                                  std::vector<std::string>& notes) {
  const int body = mj_name2id(&m, mjOBJ_BODY, "ball");
  const int tendon = mj_name2id(&m, mjOBJ_TENDON, "string");
  if (body < 0 || !is_free(m, body)) {
    if (body > 0)
      notes.emplace_back(
          "body 'ball' has no <freejoint/>, so it is taken for a link of the robot and not for a "
          "ball");
    if (tendon >= 0)
      notes.emplace_back("tendon 'string' is left out: no free body 'ball' hangs on it");
    return std::nullopt;
  }
  MjcfBall ball{.body = body};
  const int dof = m.jnt_dofadr[m.body_jntadr[body]];
  if (std::any_of(m.dof_damping + dof, m.dof_damping + dof + 6, [](double d) { return d != 0.0; }))
    notes.emplace_back("damping of the ball's free joint is left out");
  for (int b = body + 1; b < m.nbody; ++b)
    if (m.body_parentid[b] == body)
      notes.push_back("body '" + body_name(m, b) + "', which hangs on the ball, is left out");
  if (tendon >= 0) {
    find_string(m, tendon, where, ball, notes);
    return ball;
  }
  for (int t = 0; t < m.ntendon; ++t)
    for (int w = m.tendon_adr[t]; w < m.tendon_adr[t] + m.tendon_num[t]; ++w)
      if (m.wrap_type[w] == mjWRAP_SITE && m.site_bodyid[m.wrap_objid[w]] == body) {
        const char* name = mj_id2name(&m, mjOBJ_TENDON, t);
        notes.push_back("tendon '" + std::string(name ? name : "") +
                        "' at the ball is left out: a string is a tendon named 'string'");
        break;
      }
  return ball;
}

BallSpec ball_spec(const mjModel& m, const MjcfBall& parts, int link, const Pose<double>& X_LB) {
  BallSpec out;
  out.mass = m.body_mass[parts.body];
  out.radius = radius_of(m, parts.body);
  if (parts.tendon >= 0)
    out.string = StringSpec{link, X_LB.R * vec(m.site_pos + 3 * parts.anchor) + X_LB.p,
                            m.tendon_range[2 * parts.tendon + 1] + parts.offset};
  return out;
}

BallSpec write_string(XmlElement& root, const mjModel& m, const MjcfBall& parts,
                      const BallSpec& now, const BallSpec& then, std::vector<std::string>& notes) {
  BallSpec out = then;
  if (now.string.has_value() != then.string.has_value()) {
    notes.emplace_back(now.string ? "the string of the ball" : "that the ball has no string");
    return out;
  }
  if (!now.string) return out;
  if (now.string->length != then.string->length) {
    XmlElement* tendon = find_spatial_string(root);
    const double upper = now.string->length - parts.offset;
    if (tendon && upper > 0.0) {
      tendon->SetAttribute("limited", "true");
      tendon->SetAttribute("range",
                           (exact(m.tendon_range[2 * parts.tendon]) + " " + exact(upper)).c_str());
      out.string->length = now.string->length;
    } else {
      notes.emplace_back("the changed length of the string");
    }
  }
  const Vec3<double> moved = now.string->p_LS - then.string->p_LS;
  if (now.string->link == then.string->link && dot(moved, moved) == 0.0) return out;
  // The cup is where it was, whatever is tied to its site.
  const std::string name = site_name(m, parts.anchor);
  XmlElement* site = name == "cup" ? nullptr : find_site(root, name);
  if (site && now.string->link == then.string->link) {  // axes of link and body are parallel
    site->SetAttribute("pos", exact(vec(m.site_pos + 3 * parts.anchor) + moved).c_str());
    out.string->p_LS = now.string->p_LS;
  } else {
    notes.emplace_back("the changed attachment of the string");
  }
  return out;
}

}  // namespace diffnea::io
