#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>
#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/io/model_info.hpp>
#include <diffnea/model/physical.hpp>

#include "io/effect_json.hpp"
#include "io/json.hpp"
#include "io/model_loops.hpp"
#include "io/model_parts.hpp"
#include "io/model_sanity.hpp"

namespace diffnea {
namespace {

using io::Json;

std::string range(double low, double high, const char* unit) {
  if (!std::isfinite(low) && !std::isfinite(high)) return "";
  return ", " + detail::number_text(low) + " … " + detail::number_text(high) + " " + unit;
}

std::string bound(const char* what, double x, const char* unit) {
  return std::isfinite(x) ? std::string(", ") + what + detail::number_text(x) + " " + unit : "";
}

/// ", = 0.5 knuckle + 0.1" of a joint that follows another.
std::string follow_text(const ModelLink& link) {
  if (!link.follows) return "";
  const Follow& f = *link.follows;
  std::string out = ", = " + (f.ratio == 1.0 ? "" : detail::number_text(f.ratio) + " ") + f.leader;
  if (f.offset != 0.0)
    out += (f.offset < 0.0 ? " - " : " + ") + detail::number_text(std::abs(f.offset));
  return out;
}

std::string servo_text(const ModelLink& link) {
  if (!link.servo) return "";
  const bool turns = link.type == ModelJoint::kRevolute;
  return ", servo " + detail::number_text(link.servo->kp) + (turns ? " N·m/rad" : " N/m") +
         (link.servo->kd > 0.0
              ? " and " + detail::number_text(link.servo->kd) + (turns ? " N·m·s/rad" : " N·s/m")
              : "");
}

std::string joint_text(const ModelLink& link, bool floats) {
  if (floats) return " (floating" + (link.joint.empty() ? "" : ": " + link.joint) + ")";
  if (link.type == ModelJoint::kFixed)
    return link.joint.empty() ? "" : " (fixed: " + link.joint + ")";
  const bool turns = link.type == ModelJoint::kRevolute;
  const JointLimits& l = link.limits;
  return " (" + link.joint + ": " + (turns ? "revolute" : "prismatic") +
         range(l.lower, l.upper, turns ? "rad" : "m") +
         bound("≤ ", l.velocity, turns ? "rad/s" : "m/s") +
         bound("≤ ", l.effort, turns ? "N·m" : "N") + follow_text(link) + servo_text(link) +
         (link.passive && !link.follows ? ", passive" : "") + ")";
}

std::string position_text(const Vec3<double>& p) {
  return "(" + detail::number_text(p.x) + " " + detail::number_text(p.y) + " " +
         detail::number_text(p.z) + ")";
}

std::string inertia_text(const SpatialInertia<double>& b) {
  if (io::is_zero(b)) return "";
  if (!(b.m > 0.0)) return "  " + detail::number_text(b.m) + " kg";
  return "  " + detail::number_text(b.m) + " kg at " + position_text(io::com_inertia(b).com);
}

void append_tree(const Model& model, int parent, const std::string& indent, std::string& out) {
  std::vector<int> children;
  for (std::size_t i = 0; i < model.links.size(); ++i)
    if (model.links[i].parent == parent) children.push_back(static_cast<int>(i));
  for (const int i : children) {
    const bool last = i == children.back();
    out += "  " + indent + (last ? "└─ " : "├─ ") + model.links[i].name +
           joint_text(model.links[i], model.free_base && i == 0) +
           inertia_text(model.links[i].inertia) + "\n";
    append_tree(model, i, indent + (last ? "   " : "│  "), out);
  }
}

double total_mass(const Model& model) {
  double mass = 0.0;
  for (const ModelLink& link : model.links) mass += link.inertia.m;
  return mass;
}

std::string link_name(const Model& model, int link) {
  return link < 0 ? "the ground" : model.links[link].name;
}

std::string headline(const Model& model) {
  const std::string name = model.name.empty() ? "(no name)" : model.name;
  if (model.links.empty()) return name + (model.ball ? ": a ball, no links" : ": no links");
  const std::size_t n = moving_links(model).size();
  const std::string joints = std::to_string(n) + (n == 1 ? " degree" : " degrees") + " of freedom";
  return name + ": " +
         (model.free_base ? "a free base" + (n > 0 ? " and joints of " + joints : "") : joints) +
         ", " + std::to_string(model.links.size()) + " links, " +
         detail::number_text(total_mass(model)) + " kg" + (model.ball ? ", and a ball" : "");
}

std::string ball_text(const Model& model) {
  const BallSpec& ball = *model.ball;
  std::string out = "\nball\n  mass " + detail::number_text(ball.mass) + " kg" +
                    (ball.radius > 0.0 ? ", radius " + detail::number_text(ball.radius) + " m"
                                       : ", radius not known") +
                    "\n";
  if (!ball.string) return out + "  in free flight, without a string\n";
  return out + "  string of " + detail::number_text(ball.string->length) + " m from " +
         link_name(model, ball.string->link) + " at " + position_text(ball.string->p_LS) + "\n";
}

std::string cup_text(const Model& model) {
  const CupSpec& cup = *model.cup;
  const auto frame = std::ranges::find(model.frames, "cup", &ModelFrame::name);
  std::string out = "\ncup\n";
  if (frame != model.frames.end())
    out += "  at " + link_name(model, frame->link) + ", frame cup; heights along its z axis\n";
  return out + "  inner radius " + detail::number_text(cup.inner_radius) + " m, wall " +
         detail::number_text(cup.wall) + " m, floor " + detail::number_text(cup.floor) +
         " m, rim " + detail::number_text(cup.rim) + " m\n";
}

std::string obstacles_text(const Model& model) {
  std::string out = "\nobstacles of the ball\n";
  for (const CapsuleSpec& o : model.obstacles)
    out += "  " + link_name(model, o.link) + ": " + position_text(o.p_LA) + " to " +
           position_text(o.p_LB) + ", radius " + detail::number_text(o.radius) + " m\n";
  return out;
}

constexpr const char* kConstraintKinds[] = {"connect", "weld", "hinge", "rolling"};

/// Length in mm, or in µm and nm as "closed".
std::string gap_text(const io::ConstraintGap& gap) {
  constexpr double kClosed = 1e-6;  // [m, rad]
  if (gap.apart <= kClosed && gap.turned <= kClosed) return "closed";
  std::string out = "apart by " + detail::number_text(1e3 * gap.apart) + " mm";
  if (gap.turned > kClosed) out += ", turned by " + detail::number_text(gap.turned) + " rad";
  return out;
}

std::string constraints_text(const Model& model) {
  const io::LoopReport report = io::report_loops(model);
  std::string out = "\nconstraints, at the reference posture\n";
  for (std::size_t i = 0; i < model.constraints.size(); ++i) {
    const ConstraintSpec& c = model.constraints[i];
    const std::string second =
        link_name(model, c.second.link) + " at " + position_text(c.second.X_LF.p);
    out += "  " + c.name + ": ";
    if (c.kind == ConstraintKind::kRolling)
      out += "a wheel of " + second + ", radius " + detail::number_text(c.radius) +
             " m, rolls on the plane z = 0";
    else
      out += std::string(kConstraintKinds[static_cast<std::size_t>(c.kind)]) + " of " +
             link_name(model, c.first.link) + " at " + position_text(c.first.X_LF.p) + " and " +
             second;
    out += ", " + gap_text(report.gaps[i]) + "\n";
  }
  out += "  they leave " + std::to_string(report.left) + " of " +
         std::to_string(report.coordinates) + (report.coordinates == 1 ? " degree" : " degrees") +
         " of freedom\n";
  if (report.closes && report.farthest > 1e-6)
    out += "  they close where joints move by at most " + detail::number_text(report.farthest) +
           " rad or m\n";
  return out;
}

Json finite_or_null(double x) { return std::isfinite(x) ? Json(x) : Json(); }

Json triple(const Vec3<double>& v) { return Json::array({v.x, v.y, v.z}); }

Json link_or_null(const Model& model, int link) {
  return link < 0 ? Json() : Json(model.links[link].name);
}

Json constraints_json(const Model& model) {
  Json out{{"list", Json::array()}};
  if (model.constraints.empty()) return {};
  const io::LoopReport report = io::report_loops(model);
  for (std::size_t i = 0; i < model.constraints.size(); ++i) {
    const ConstraintSpec& c = model.constraints[i];
    const bool wheel = c.kind == ConstraintKind::kRolling;
    out["list"].push_back({{"name", c.name},
                           {"kind", kConstraintKinds[static_cast<std::size_t>(c.kind)]},
                           {"first", wheel ? Json() : link_or_null(model, c.first.link)},
                           {"second", link_or_null(model, c.second.link)},
                           {"radius", wheel ? Json(c.radius) : Json()},
                           {"apart", report.gaps[i].apart},
                           {"turned", report.gaps[i].turned}});
  }
  out["dofs_left"] = report.left;
  out["closes"] = report.closes;
  out["remains"] = report.remains;
  out["farthest"] = report.farthest;
  return out;
}

Json ball_json(const Model& model) {
  if (!model.ball) return {};
  const BallSpec& ball = *model.ball;
  Json out{{"mass", ball.mass},
           {"radius", ball.radius > 0.0 ? Json(ball.radius) : Json()},
           {"string", Json()}};
  if (ball.string)
    out["string"] = {{"link", link_or_null(model, ball.string->link)},
                     {"attachment", triple(ball.string->p_LS)},
                     {"length", ball.string->length}};
  return out;
}

Json cup_json(const Model& model) {
  if (!model.cup) return {};
  const CupSpec& cup = *model.cup;
  return {{"inner_radius", cup.inner_radius},
          {"wall", cup.wall},
          {"floor", cup.floor},
          {"rim", cup.rim}};
}

}  // namespace

std::vector<ModelIssue> model_issues(const Model& model) {
  std::vector<ModelIssue> issues;
  try {
    issues = check_model(model);
    for (ModelIssue& doubt : io::doubtful_inertias(model)) issues.push_back(std::move(doubt));
    if (!model.constraints.empty())
      if (const io::LoopReport loops = io::report_loops(model); !loops.closes)
        issues.push_back({model.name, "no posture near the reference closes its constraints: " +
                                          detail::number_text(loops.remains) +
                                          " m or rad remain; check their points, or put a `home` "
                                          "near a posture that closes them"});
  } catch (const ModelError& error) {
    issues.push_back({model.name, error.what()});
  }
  for (const EffectSpec& effect : model.effects) {
    try {
      bind(effect, model);
    } catch (const ModelError& error) {
      issues.push_back({effect.where, error.what()});
    }
  }
  return issues;
}

std::string model_info_text(const Model& model) {
  std::string out = headline(model) + "\ngravity " + position_text(model.gravity) + " m/s²\n";
  if (!model.links.empty()) out += "\n  ground\n";
  append_tree(model, -1, "", out);
  if (model.ball) out += ball_text(model);
  if (model.cup) out += cup_text(model);
  if (!model.obstacles.empty()) out += obstacles_text(model);
  if (!model.effects.empty()) out += "\neffects\n";
  for (const EffectSpec& e : model.effects) {
    out += "  " + e.effect + " at " + e.where;
    for (std::size_t k = 0; k < e.parameters.size(); ++k)
      out += (k == 0 ? ": " : ", ") + e.parameters[k].name + " = " +
             detail::number_text(e.parameters[k].value) + " " + e.parameters[k].unit;
    out += "\n";
  }
  if (!model.frames.empty()) out += "\nframes\n";
  for (const ModelFrame& f : model.frames)
    out +=
        "  " + f.name + " on " + link_name(model, f.link) + " at " + position_text(f.X_LF.p) + "\n";
  if (!model.constraints.empty()) out += constraints_text(model);
  if (!model.notes.empty()) out += "\nnotes\n";
  for (const std::string& note : model.notes) out += "  " + note + "\n";
  const std::vector<ModelIssue> issues = model_issues(model);
  out += issues.empty() ? "\nnothing looks wrong\n" : "\nlooks wrong\n";
  for (const ModelIssue& issue : issues) out += "  " + issue.link + ": " + issue.text + "\n";
  return out;
}

std::string model_info_json(const Model& model) {
  static constexpr const char* kTypes[] = {"fixed", "revolute", "prismatic"};
  const TreeMap map = map_to_tree(model);
  const int first = model.free_base ? 1 : 0;  // tree link of the first joint
  const std::vector<TreeJoint> joints = tree_joints(model);
  Json out;
  out["schema"] = "diffnea/info/1";
  out["name"] = model.name;
  out["source"] = model.source;
  out["dofs"] = moving_links(model).size();
  out["joints"] = joint_names(model);
  out["free_base"] = model.free_base ? Json(model.links[0].name) : Json();
  out["mass"] = total_mass(model);
  out["gravity"] = triple(model.gravity);
  out["links"] = Json::array();
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const ModelLink& link = model.links[i];
    Json l;
    l["name"] = link.name;
    l["parent"] = link_or_null(model, link.parent);
    l["joint"] = link.joint.empty() ? Json() : Json(link.joint);
    l["type"] =
        model.free_base && i == 0 ? "floating" : kTypes[static_cast<std::size_t>(link.type)];
    l["dof"] =
        link.type == ModelJoint::kFixed ? Json() : Json(joints[map.dof[i] - first].drive.dof);
    if (link.follows)
      l["follows"] = {{"joint", link.follows->leader},
                      {"ratio", link.follows->ratio},
                      {"offset", link.follows->offset}};
    l["passive"] = link.passive;
    if (link.servo) l["servo"] = {{"kp", link.servo->kp}, {"kd", link.servo->kd}};
    l["limits"] = {{"lower", finite_or_null(link.limits.lower)},
                   {"upper", finite_or_null(link.limits.upper)},
                   {"velocity", finite_or_null(link.limits.velocity)},
                   {"effort", finite_or_null(link.limits.effort)}};
    l["mass"] = link.inertia.m;
    if (link.inertia.m > 0.0) {
      const io::ComInertia c = io::com_inertia(link.inertia);
      l["com"] = triple(c.com);
      l["inertia_about_com"] = Json::array({c.I.xx, c.I.xy, c.I.xz, c.I.yy, c.I.yz, c.I.zz});
      l["triangle_margin"] = triangle_margin(link.inertia);
    }
    out["links"].push_back(l);
  }
  out["frames"] = Json::array();
  for (const ModelFrame& f : model.frames)
    out["frames"].push_back(
        {{"name", f.name}, {"link", link_or_null(model, f.link)}, {"position", triple(f.X_LF.p)}});
  out["constraints"] = constraints_json(model);
  out["ball"] = ball_json(model);
  out["cup"] = cup_json(model);
  out["obstacles"] = Json::array();
  for (const CapsuleSpec& o : model.obstacles)
    out["obstacles"].push_back({{"link", link_or_null(model, o.link)},
                                {"from", triple(o.p_LA)},
                                {"to", triple(o.p_LB)},
                                {"radius", o.radius}});
  out["effects"] = Json::array();
  for (const EffectSpec& e : model.effects) out["effects"].push_back(io::effect_to_json(e));
  out["issues"] = Json::array();
  for (const ModelIssue& issue : model_issues(model))
    out["issues"].push_back({{"link", issue.link}, {"text", issue.text}});
  out["notes"] = model.notes;
  return out.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace diffnea
