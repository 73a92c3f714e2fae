#include "io/mjcf_cup.hpp"

#include <diffnea/core/error.hpp>

#include "io/mjcf.hpp"
#include "io/mjcf_parts.hpp"

namespace diffnea::io {
namespace {

bool collide(const mjModel& m, int a, int b) {
  return (m.geom_contype[a] & m.geom_conaffinity[b]) != 0 ||
         (m.geom_contype[b] & m.geom_conaffinity[a]) != 0;
}

bool hits(const mjModel& m, int geom, int ball) {
  for (int g = m.body_geomadr[ball]; g < m.body_geomadr[ball] + m.body_geomnum[ball]; ++g)
    if (collide(m, geom, g)) return true;
  return false;
}

}  // namespace

std::optional<CupSpec> find_cup(const mjModel& m, const std::string& where) {
  const int id = mj_name2id(&m, mjOBJ_NUMERIC, "cup");
  if (id < 0) return std::nullopt;
  if (m.numeric_size[id] != 4)
    throw ModelError(where + ": numeric 'cup' has " + std::to_string(m.numeric_size[id]) +
                     " numbers; expected 4: inner radius, thickness of the wall, heights of floor "
                     "and rim above the site 'cup' [m]");
  const mjtNum* x = m.numeric_data + m.numeric_adr[id];
  return CupSpec{x[0], x[1], x[2], x[3]};
}

std::vector<CapsuleSpec> find_obstacles(const mjModel& m, int ball,
                                        const std::vector<BodyAt>& bodies,
                                        const std::vector<bool>& left_out,
                                        std::vector<std::string>& notes) {
  std::vector<CapsuleSpec> out;
  const int site = mj_name2id(&m, mjOBJ_SITE, "cup");
  const int cup = site < 0 ? -1 : m.site_bodyid[site];
  std::string others;
  for (int g = 0; g < m.ngeom; ++g) {
    const int body = m.geom_bodyid[g];
    if (left_out[body] || !hits(m, g, ball)) continue;
    const bool sphere = m.geom_type[g] == mjGEOM_SPHERE;
    if (!sphere && m.geom_type[g] != mjGEOM_CAPSULE) {
      const std::string name = body_name(m, body);
      if (body != cup && others.find("'" + name + "'") == others.npos)
        others += (others.empty() ? "'" : ", '") + name + "'";
      continue;
    }
    const mjtNum* q = m.geom_quat + 4 * g;
    const Vec3<double> half =
        rotation_from_quaternion(q[0], q[1], q[2], q[3]) *
        Vec3<double>{0, 0, sphere ? 0.0 : static_cast<double>(m.geom_size[3 * g + 1])};
    const Vec3<double> middle = vec(m.geom_pos + 3 * g);
    const Pose<double>& X_LB = bodies[body].X_LB;
    // MuJoCo's z axis of a geom runs from the second point of `fromto` to the first.
    out.push_back({bodies[body].link, X_LB.R * (middle + half) + X_LB.p,
                   X_LB.R * (middle - half) + X_LB.p, m.geom_size[3 * g]});
  }
  if (!others.empty())
    notes.push_back("shapes of " + others +
                    " that the ball hits are left out: its obstacles are capsules and spheres");
  return out;
}

}  // namespace diffnea::io
