#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <diffnea/core/error.hpp>
#include <diffnea/io/model_file.hpp>

#include "io/effect_json.hpp"
#include "io/json.hpp"
#include "io/model_parts.hpp"
#include "io/schema.hpp"

namespace diffnea {
namespace {

using io::Json;
using io::JsonObject;

constexpr const char* kModelSchema = "diffnea/model/1";
constexpr std::array<const char*, 3> kTypes{"fixed", "revolute", "prismatic"};
constexpr const char* kFloating = "floating";  // of a free base

const Json& units() {
  static const Json kUnits{{"length", "m"}, {"mass", "kg"}, {"angle", "rad"},
                           {"time", "s"},   {"force", "N"}, {"torque", "N*m"}};
  return kUnits;
}

Json to_json(const Vec3<double>& v) { return Json::array({v.x, v.y, v.z}); }

Json to_json(const Pose<double>& X) {
  const Eigen::Matrix3d R = to_eigen(X.R);
  Json rows = Json::array();
  for (int i = 0; i < 3; ++i) rows.push_back({R(i, 0), R(i, 1), R(i, 2)});
  return {{"position", to_json(X.p)}, {"rotation", rows}};
}

Json to_json(const SpatialInertia<double>& b) {
  return {{"mass", b.m},
          {"first_moment", to_json(b.h)},
          {"about_origin", Json::array({b.I.xx, b.I.xy, b.I.xz, b.I.yy, b.I.yz, b.I.zz})}};
}

Vec3<double> vector_from(const Json& value, const std::string& where) {
  const std::vector<double> x = io::json_numbers(value, where, 3);
  return {x[0], x[1], x[2]};
}

/// An axis that a person wrote with six digits gets length 1, which a tree wants to 1e-9; one that
/// has it stays bit by bit. `validate` refuses what is further off.
Vec3<double> axis_from(const Json& value, const std::string& where) {
  constexpr double kDigitsTol = 1e-5, kExactTol = 1e-9;
  const Vec3<double> axis = vector_from(value, where);
  const double norm = std::sqrt(dot(axis, axis)), off = std::abs(norm - 1.0);
  return off >= kExactTol && off < kDigitsTol ? axis * (1.0 / norm) : axis;
}

Pose<double> pose_from(const Json& value, const std::string& where) {
  JsonObject o(value, where);
  Pose<double> X = Pose<double>::identity();
  if (const Json* p = o.optional("position")) X.p = vector_from(*p, o.at("position"));
  const Json* rotation = o.optional("rotation");
  const Json* quaternion = o.optional("quaternion");
  const Json* rpy = o.optional("rpy");
  o.finish();
  if ((rotation != nullptr) + (quaternion != nullptr) + (rpy != nullptr) > 1)
    throw ModelError(where + ": give one of rotation, quaternion, rpy");
  if (rotation) {
    io::json_array(*rotation, o.at("rotation"));
    if (rotation->size() != 3)
      throw ModelError(o.at("rotation") + ": expected three rows of three");
    Eigen::Matrix3d R;
    for (int i = 0; i < 3; ++i) {
      const std::vector<double> row = io::json_numbers((*rotation)[i], o.at("rotation"), 3);
      R.row(i) << row[0], row[1], row[2];
    }
    X.R = mat3<double>(R);
  } else if (quaternion) {
    const std::vector<double> w = io::json_numbers(*quaternion, o.at("quaternion"), 4);
    if (!(std::abs(w[0] * w[0] + w[1] * w[1] + w[2] * w[2] + w[3] * w[3] - 1.0) < 1e-5))
      throw ModelError(o.at("quaternion") + ": has not length 1 (order w, x, y, z)");
    X.R = rotation_from_quaternion(w[0], w[1], w[2], w[3]);
  } else if (rpy) {
    X.R = rotation_from_rpy(vector_from(*rpy, o.at("rpy")));
  }
  return X;
}

SpatialInertia<double> inertia_from(const Json& value, const std::string& where) {
  JsonObject o(value, where);
  SpatialInertia<double> b;
  b.m = o.number("mass");
  const Json* h = o.optional("first_moment");
  const Json* I = o.optional("about_origin");
  const Json* com = o.optional("com");
  const Json* I_com = o.optional("about_com");
  o.finish();
  const auto tensor = [&](const Json& v, const char* key) {
    const std::vector<double> x = io::json_numbers(v, o.at(key), 6);
    return Sym3<double>{x[0], x[1], x[2], x[3], x[4], x[5]};
  };
  if ((h || I) && (com || I_com))
    throw ModelError(where +
                     ": give first_moment and about_origin, or com and about_com, not both");
  if (com || I_com) {
    return inertia_from_com(b.m, com ? vector_from(*com, o.at("com")) : Vec3<double>{},
                            I_com ? tensor(*I_com, "about_com") : Sym3<double>{});
  }
  if (h) b.h = vector_from(*h, o.at("first_moment"));
  if (I) b.I = tensor(*I, "about_origin");
  return b;
}

/// @return whether it is that of a free base
bool joint_from(const Json& value, const std::string& where, ModelLink& link) {
  JsonObject o(value, where);
  link.joint = o.string_or("name", "");
  const std::string named = o.string("type");
  const bool floats = named == kFloating;
  const std::string type = floats ? kTypes[0] : named;
  const auto it = std::ranges::find(kTypes, type);
  if (it == kTypes.end())
    throw ModelError(o.at("type") + ": got '" + type +
                     "', expected fixed, revolute, prismatic or floating");
  link.type = static_cast<ModelJoint>(it - kTypes.begin());
  if (const Json* axis = o.optional("axis")) link.axis = axis_from(*axis, o.at("axis"));
  if (const Json* pose = o.optional("pose")) link.X_PJ = pose_from(*pose, o.at("pose"));
  link.passive = o.boolean_or("passive", false);
  if (const Json* servo = o.optional("servo")) {
    JsonObject s(*servo, o.at("servo"));
    link.servo = ServoGains{s.number("kp"), s.number_or("kd", 0.0)};
    s.finish();
    if (!(link.servo->kp > 0.0) || !(link.servo->kd >= 0.0))
      throw ModelError(o.at("servo") + ": expected kp above 0 and kd of 0 or above");
  }
  if (const Json* follows = o.optional("follows")) {
    JsonObject f(*follows, o.at("follows"));
    link.follows = Follow{f.string("joint"), f.number_or("ratio", 1.0), f.number_or("offset", 0.0)};
    f.finish();
    if (link.type == ModelJoint::kFixed)
      throw ModelError(o.at("follows") + ": a fixed joint follows none");
  }
  if (const Json* limits = o.optional("limits")) {
    JsonObject l(*limits, o.at("limits"));
    const JointLimits none;
    link.limits.lower = l.number_or("lower", none.lower);
    link.limits.upper = l.number_or("upper", none.upper);
    link.limits.velocity = l.number_or("velocity", none.velocity);
    link.limits.effort = l.number_or("effort", none.effort);
    l.finish();
  }
  o.finish();
  if (floats && link.parent >= 0)
    throw ModelError(where + ".type: link '" + link.name +
                     "' hangs on another and cannot float; the first link can, and carries all "
                     "others");
  return floats;
}

Json joint_to_json(const ModelLink& link, bool floats) {
  Json joint;
  if (!link.joint.empty()) joint["name"] = link.joint;
  joint["type"] = floats ? kFloating : kTypes[static_cast<std::size_t>(link.type)];
  if (link.type != ModelJoint::kFixed) joint["axis"] = to_json(link.axis);
  joint["pose"] = to_json(link.X_PJ);
  Json limits = Json::object();
  if (std::isfinite(link.limits.lower)) limits["lower"] = link.limits.lower;
  if (std::isfinite(link.limits.upper)) limits["upper"] = link.limits.upper;
  if (std::isfinite(link.limits.velocity)) limits["velocity"] = link.limits.velocity;
  if (std::isfinite(link.limits.effort)) limits["effort"] = link.limits.effort;
  if (!limits.empty()) joint["limits"] = limits;
  if (link.passive) joint["passive"] = true;
  if (link.servo) joint["servo"] = {{"kp", link.servo->kp}, {"kd", link.servo->kd}};
  if (link.follows)
    joint["follows"] = {{"joint", link.follows->leader},
                        {"ratio", link.follows->ratio},
                        {"offset", link.follows->offset}};
  return joint;
}

BumpTable table_from(const Json& value, const std::string& where) {
  JsonObject o(value, where);
  BumpTable t;
  const Json& variables = io::json_array(o.required("variables"), o.at("variables"));
  for (std::size_t i = 0; i < variables.size(); ++i)
    t.variables.push_back(io::json_string(variables[i], o.at("variables")));
  const Json& weights = io::json_array(o.required("weights"), o.at("weights"));
  const long bumps = static_cast<long>(weights.size());
  const long numbers = bumps * static_cast<long>(t.variables.size());
  t.weights = io::json_numbers(weights, o.at("weights"), bumps);
  t.centres = io::json_numbers(o.required("centres"), o.at("centres"), numbers);
  t.widths = io::json_numbers(o.required("widths"), o.at("widths"), numbers);
  t.bound = o.number("bound");
  o.finish();
  return t;
}

EffectSpec effect_from(const Json& value, const std::string& where) {
  JsonObject o(value, where);
  EffectSpec e;
  e.effect = o.string("effect");
  e.where = o.string("where");
  const Json& parameters = io::json_array(o.required("parameters"), o.at("parameters"));
  if (const Json* table = o.optional("table")) e.table = table_from(*table, o.at("table"));
  o.finish();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    JsonObject p(parameters[i], o.at("parameters") + "[" + std::to_string(i) + "]");
    e.parameters.push_back({p.string("name"), p.number("value"), p.string_or("unit", "")});
    p.finish();
  }
  return e;
}

Posterior posterior_from(const Json& value, const std::string& where) {
  JsonObject o(value, where);
  Posterior p;
  const Json& names = io::json_array(o.required("names"), o.at("names"));
  for (std::size_t i = 0; i < names.size(); ++i)
    p.names.push_back(io::json_string(names[i], o.at("names")));
  const long n = static_cast<long>(p.names.size());
  p.mean = io::json_numbers(o.required("mean"), o.at("mean"), n);
  p.information = io::json_numbers(o.required("information"), o.at("information"), n * n);
  if (const Json* recordings = o.optional("recordings"))
    for (const Json& r : io::json_array(*recordings, o.at("recordings")))
      p.recordings.push_back(io::json_string(r, o.at("recordings")));
  o.finish();
  return p;
}

/// Index of any link of the model, −1 (the world) if the name is missing or null.
/// @param links  all of the model's, to name them where it is none of them
int any_link(const std::map<std::string, int>& links, const Json* name, const std::string& where) {
  if (!name) return -1;
  const auto it = links.find(io::json_string(*name, where));
  if (it != links.end()) return it->second;
  std::string names;
  for (const auto& link : links) names += (names.empty() ? "" : ", ") + link.first;
  throw ModelError(where + ": there is no link '" + name->get<std::string>() +
                   "' (null for the world); links: " + (names.empty() ? "none" : names));
}

BallSpec ball_from(const Json& value, const std::string& where,
                   const std::map<std::string, int>& links) {
  JsonObject o(value, where);
  BallSpec ball;
  ball.mass = o.number("mass");
  ball.radius = o.number_or("radius", 0.0);
  if (const Json* string = o.optional("string")) {
    JsonObject s(*string, o.at("string"));
    StringSpec out;
    out.link = any_link(links, s.optional("link"), s.at("link"));
    if (const Json* p = s.optional("attachment")) out.p_LS = vector_from(*p, s.at("attachment"));
    out.length = s.number("length");
    out.length_std = s.number_or("length_std", 0.0);
    s.finish();
    ball.string = out;
  }
  o.finish();
  return ball;
}

CupSpec cup_from(const Json& value, const std::string& where) {
  JsonObject o(value, where);
  const CupSpec cup{o.number("inner_radius"), o.number("wall"), o.number("floor"), o.number("rim")};
  o.finish();
  return cup;
}

/// Without `to` it is a sphere.
CapsuleSpec obstacle_from(const Json& value, const std::string& where,
                          const std::map<std::string, int>& links) {
  JsonObject o(value, where);
  CapsuleSpec out;
  out.link = any_link(links, o.optional("link"), o.at("link"));
  out.p_LA = out.p_LB = vector_from(o.required("from"), o.at("from"));
  if (const Json* to = o.optional("to")) out.p_LB = vector_from(*to, o.at("to"));
  out.radius = o.number("radius");
  o.finish();
  return out;
}

constexpr std::array<const char*, 4> kConstraintKinds{"connect", "weld", "hinge", "rolling"};

ConstraintSpec constraint_from(const Json& value, const std::string& where,
                               const std::map<std::string, int>& links) {
  JsonObject o(value, where);
  ConstraintSpec out;
  out.name = o.string("name");
  const std::string kind = o.string("kind");
  const auto it = std::ranges::find(kConstraintKinds, kind);
  if (it == kConstraintKinds.end())
    throw ModelError(o.at("kind") + ": got '" + kind +
                     "', expected connect, weld, hinge or rolling");
  out.kind = static_cast<ConstraintKind>(it - kConstraintKinds.begin());
  const auto end_from = [&](const Json& end, const std::string& here) {
    JsonObject e(end, here);
    ConstraintEnd at;
    at.link = any_link(links, e.optional("link"), e.at("link"));
    if (const Json* pose = e.optional("pose")) at.X_LF = pose_from(*pose, e.at("pose"));
    e.finish();
    return at;
  };
  if (out.kind == ConstraintKind::kRolling)
    out.radius = o.number("radius");
  else
    out.first = end_from(o.required("first"), o.at("first"));
  out.second = end_from(o.required("second"), o.at("second"));
  o.finish();
  return out;
}

/// Index of the link that `name` names, −1 (the ground) if it is missing or null.
int link_index(const std::map<std::string, int>& index, const Json* name,
               const std::string& where) {
  if (!name) return -1;
  const auto it = index.find(io::json_string(*name, where));
  if (it == index.end())
    throw ModelError(where + ": there is no link '" + name->get<std::string>() +
                     "' before it (leave the key out for the ground)");
  return it->second;
}

}  // namespace

Json io::effect_to_json(const EffectSpec& e) {
  Json parameters = Json::array();
  for (const EffectParameter& p : e.parameters)
    parameters.push_back({{"name", p.name}, {"value", p.value}, {"unit", p.unit}});
  Json out{{"effect", e.effect}, {"where", e.where}, {"parameters", parameters}};
  if (e.table)
    out["table"] = {{"variables", e.table->variables},
                    {"centres", e.table->centres},
                    {"widths", e.table->widths},
                    {"weights", e.table->weights},
                    {"bound", e.table->bound}};
  return out;
}

std::string model_to_json(const Model& model) {
  io::validate(model, "model_to_json");
  const auto name_of = [&](int link) { return link < 0 ? Json() : Json(model.links[link].name); };
  Json out;
  out["schema"] = kModelSchema;
  out["name"] = model.name;
  out["units"] = units();
  out["gravity"] = to_json(model.gravity);
  out["links"] = Json::array();
  for (const ModelLink& link : model.links) {
    Json l;
    l["name"] = link.name;
    l["parent"] = name_of(link.parent);
    l["joint"] = joint_to_json(link, model.free_base && link.parent < 0);
    if (!io::is_zero(link.inertia)) l["inertia"] = to_json(link.inertia);
    out["links"].push_back(l);
  }
  out["frames"] = Json::array();
  for (const ModelFrame& f : model.frames)
    out["frames"].push_back(
        {{"name", f.name}, {"link", name_of(f.link)}, {"pose", to_json(f.X_LF)}});
  for (const ConstraintSpec& c : model.constraints) {
    const auto end = [&](const ConstraintEnd& e) {
      return Json{{"link", name_of(e.link)}, {"pose", to_json(e.X_LF)}};
    };
    Json constraint{{"name", c.name},
                    {"kind", kConstraintKinds[static_cast<std::size_t>(c.kind)]},
                    {"second", end(c.second)}};
    if (c.kind == ConstraintKind::kRolling)
      constraint["radius"] = c.radius;
    else
      constraint["first"] = end(c.first);
    out["constraints"].push_back(constraint);
  }
  out["effects"] = Json::array();
  for (const EffectSpec& e : model.effects) out["effects"].push_back(io::effect_to_json(e));
  if (model.ball) {
    out["ball"]["mass"] = model.ball->mass;
    if (model.ball->radius > 0.0) out["ball"]["radius"] = model.ball->radius;
    if (const std::optional<StringSpec>& s = model.ball->string)
      out["ball"]["string"] = {
          {"link", name_of(s->link)}, {"attachment", to_json(s->p_LS)}, {"length", s->length}};
    if (model.ball->string && model.ball->string->length_std > 0.0)
      out["ball"]["string"]["length_std"] = model.ball->string->length_std;
  }
  if (const std::optional<CupSpec>& cup = model.cup)
    out["cup"] = {{"inner_radius", cup->inner_radius},
                  {"wall", cup->wall},
                  {"floor", cup->floor},
                  {"rim", cup->rim}};
  for (const CapsuleSpec& o : model.obstacles)
    out["obstacles"].push_back({{"link", name_of(o.link)},
                                {"from", to_json(o.p_LA)},
                                {"to", to_json(o.p_LB)},
                                {"radius", o.radius}});
  if (!model.home.empty()) out["home"] = model.home;
  if (model.posterior) {
    const Posterior& p = *model.posterior;
    require_size("model_to_json: posterior.mean", static_cast<long>(p.mean.size()),
                 static_cast<long>(p.names.size()), "name");
    require_size("model_to_json: posterior.information", static_cast<long>(p.information.size()),
                 static_cast<long>(p.names.size() * p.names.size()), "pair of names");
    for (const std::vector<double>* v : {&p.mean, &p.information})
      for (const double x : *v)
        if (!std::isfinite(x)) throw ModelError("model_to_json: the posterior is not finite");
    out["posterior"] = {{"names", p.names}, {"mean", p.mean}, {"information", p.information}};
    if (!p.recordings.empty()) out["posterior"]["recordings"] = p.recordings;
  }
  if (!model.notes.empty()) out["notes"] = model.notes;
  return out.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Model model_from_json(std::string_view text, const std::string& where) {
  const Json json = io::parse_json(text, where);
  JsonObject o(json, where);
  Model model;
  model.source = where;
  io::require_schema(o, where, kModelSchema);
  model.name = o.string_or("name", "");
  if (const Json* u = o.optional("units"); u && *u != units())
    throw ModelError(o.at("units") + ": expected " + units().dump());
  if (const Json* g = o.optional("gravity")) model.gravity = vector_from(*g, o.at("gravity"));

  std::map<std::string, int> index;
  const Json& links = io::json_array(o.required("links"), o.at("links"));
  for (std::size_t i = 0; i < links.size(); ++i) {
    const std::string here = o.at("links") + "[" + std::to_string(i) + "]";
    JsonObject l(links[i], here);
    ModelLink link;
    link.name = l.string("name");
    link.parent = link_index(index, l.optional("parent"), l.at("parent"));
    if (const Json* joint = l.optional("joint"))
      model.free_base |= joint_from(*joint, l.at("joint"), link);
    if (const Json* inertia = l.optional("inertia"))
      link.inertia = inertia_from(*inertia, l.at("inertia"));
    l.finish();
    index[link.name] = static_cast<int>(i);
    model.links.push_back(link);
  }
  if (const Json* frames = o.optional("frames")) {
    io::json_array(*frames, o.at("frames"));
    for (std::size_t i = 0; i < frames->size(); ++i) {
      JsonObject f((*frames)[i], o.at("frames") + "[" + std::to_string(i) + "]");
      ModelFrame frame;
      frame.name = f.string("name");
      frame.link = link_index(index, f.optional("link"), f.at("link"));
      if (const Json* pose = f.optional("pose")) frame.X_LF = pose_from(*pose, f.at("pose"));
      f.finish();
      model.frames.push_back(frame);
    }
  }
  if (const Json* constraints = o.optional("constraints")) {
    io::json_array(*constraints, o.at("constraints"));
    for (std::size_t i = 0; i < constraints->size(); ++i)
      model.constraints.push_back(constraint_from(
          (*constraints)[i], o.at("constraints") + "[" + std::to_string(i) + "]", index));
  }
  if (const Json* effects = o.optional("effects")) {
    io::json_array(*effects, o.at("effects"));
    for (std::size_t i = 0; i < effects->size(); ++i)
      model.effects.push_back(
          effect_from((*effects)[i], o.at("effects") + "[" + std::to_string(i) + "]"));
  }
  if (const Json* ball = o.optional("ball")) model.ball = ball_from(*ball, o.at("ball"), index);
  if (const Json* cup = o.optional("cup")) model.cup = cup_from(*cup, o.at("cup"));
  if (const Json* obstacles = o.optional("obstacles")) {
    io::json_array(*obstacles, o.at("obstacles"));
    for (std::size_t i = 0; i < obstacles->size(); ++i)
      model.obstacles.push_back(
          obstacle_from((*obstacles)[i], o.at("obstacles") + "[" + std::to_string(i) + "]", index));
  }
  if (const Json* home = o.optional("home"))
    model.home =
        io::json_numbers(*home, o.at("home"), static_cast<int>(moving_links(model).size()));
  if (const Json* posterior = o.optional("posterior"))
    model.posterior = posterior_from(*posterior, o.at("posterior"));
  if (const Json* notes = o.optional("notes")) {
    io::json_array(*notes, o.at("notes"));
    for (const Json& note : *notes) model.notes.push_back(io::json_string(note, o.at("notes")));
  }
  o.finish();
  io::validate(model, where);
  return model;
}

}  // namespace diffnea
