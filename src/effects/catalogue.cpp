#include <algorithm>
#include <array>
#include <charconv>
#include <numeric>
#include <string_view>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/catalogue.hpp>

#include "core/edit_distance.hpp"

namespace diffnea {
namespace {

/// Degree of freedom of a base that floats, which no joint moves.
constexpr int kNoDof = -1;

/// "did you mean x? choices: a, b, c"
std::string choices(const std::string& name, const std::vector<std::string>& names) {
  std::string list, nearest;
  std::size_t least = name.size() / 2 + 1;  // further off than half of its letters is no likeness
  for (const std::string& n : names) {
    list += (list.empty() ? "" : ", ") + n;
    if (const std::size_t d = edit_distance(name, n); d < least) {
      least = d;
      nearest = n;
    }
  }
  return (nearest.empty() ? "" : "did you mean '" + nearest + "'? ") +
         "choices: " + (list.empty() ? "none" : list);
}

template <std::size_t... I>
std::vector<std::shared_ptr<const AnyEffect>> all_of(std::index_sequence<I...>) {
  return {std::make_shared<const AnyEffect>(std::variant_alternative_t<I, EffectVariant>{})...};
}
/// One of each, as the catalogue has them.
const std::vector<std::shared_ptr<const AnyEffect>>& all_effects() {
  static const auto kAll = all_of(std::make_index_sequence<std::variant_size_v<EffectVariant>>{});
  return kAll;
}

const EffectInfo& info_of(const EffectVariant& effect) {
  return std::visit([]<class E>(const E&) -> const EffectInfo& { return E::info(); }, effect);
}

const std::shared_ptr<const AnyEffect>& formula_of(const std::string& name) {
  std::vector<std::string> names;
  for (const auto& effect : all_effects()) {
    if (info_of(*effect).name == name) return effect;
    names.push_back(info_of(*effect).name);
  }
  throw ModelError("effect '" + name + "': there is no such effect; " + choices(name, names));
}

/// Completes a formula with what it has of the model and the spec beside its parameters.
/// @throws ModelError
std::shared_ptr<const AnyEffect> completed(const std::shared_ptr<const AnyEffect>& effect,
                                           const BoundSetting& setting) {
  auto out = std::make_shared<AnyEffect>(*effect);
  const bool complete = std::visit(
      [&](auto& formula) {
        if constexpr (requires { formula.complete(setting); }) {
          formula.complete(setting);
          return true;
        }
        return false;
      },
      static_cast<EffectVariant&>(*out));
  if (complete) return out;
  return effect;
}

std::string names_of_places(Place place) {
  switch (place) {
    case Place::kJoint:
      return "a joint's name or `all`";
    case Place::kJointPair:
      return "two joints, \"first,second\"";
    case Place::kTip:
      return "`tip`, the joint that moves the link, or `base` of a robot that floats";
    case Place::kBase:
      return "`base`";
    case Place::kAllJoints:
      return "`all`";
    case Place::kBall:
      return "`ball`";
    case Place::kString:
      return "`string`";
    case Place::kCamera:
      return "`camera`";
  }
  return "";
}

/// A joint by name: a degree of freedom, or one that follows another.
TreeJoint find_joint_or_throw(const std::string& here, const std::string& name,
                              const std::vector<TreeJoint>& joints) {
  const auto it = std::ranges::find(joints, name, &TreeJoint::name);
  if (it != joints.end()) return *it;
  std::vector<std::string> names;
  for (const TreeJoint& j : joints) names.push_back(j.name);
  throw ModelError(here + ": there is no moving joint '" + name + "'; " + choices(name, names));
}

std::string trimmed(const std::string& s) {
  const std::size_t first = s.find_first_not_of(' '), last = s.find_last_not_of(' ');
  return first == std::string::npos ? "" : s.substr(first, last - first + 1);
}

/// Joints that `where` names; empty for what acts on a ball.
std::vector<TreeJoint> resolve_where(const std::string& here, const EffectInfo& info,
                                     const std::string& where, const Model& model,
                                     const std::vector<TreeJoint>& joints) {
  const std::string expected = "; expected " + names_of_places(info.place);
  if (acts_on_ball(info)) {
    const std::vector<std::string> there = places(info, model);
    if (there.empty())
      throw ModelError(here + ": the model has no " +
                       (info.has(Trait::kNeedsCup)     ? "cup on the link of a string"
                        : info.place == Place::kString ? "string"
                                                       : "ball") +
                       " to act on");
    if (where != there.front()) throw ModelError(here + ": got '" + where + "'" + expected);
    return {};
  }
  if (where == "base" && info.has(Trait::kInertia) && model.free_base)
    return {{.name = where, .link = 0, .drive = {.dof = kNoDof}}};
  if (joints.empty()) throw ModelError(here + ": the model has no moving joint to act on");
  if (where.empty()) throw ModelError(here + ": it is not said where it acts" + expected);

  const bool acts_on_all = info.place == Place::kJoint || info.place == Place::kAllJoints;
  const bool is_joint = std::ranges::find(joints, where, &TreeJoint::name) != joints.end();
  std::vector<TreeJoint> all = joints;
  std::erase_if(all, [](const TreeJoint& j) { return j.follows; });
  if (where == "all" && acts_on_all && is_joint)
    throw ModelError(here +
                     ": a joint of the model is named 'all', which here means every joint; " +
                     "give that joint another name");
  if (where == "all" && acts_on_all) return all;
  if (where == "tip" && info.place == Place::kTip) return {joints.back()};
  if (where == "base" && info.place == Place::kBase) return all;
  const std::size_t comma = where.find(',');
  if (info.place == Place::kJointPair) {
    if (comma == std::string::npos || where.find(',', comma + 1) != std::string::npos)
      throw ModelError(here + ": got '" + where + "'" + expected);
    const TreeJoint first = find_joint_or_throw(here, trimmed(where.substr(0, comma)), joints);
    const TreeJoint second = find_joint_or_throw(here, trimmed(where.substr(comma + 1)), joints);
    if (first.link == second.link)
      throw ModelError(here + ": both joints of the pair are the same" + expected);
    return {first, second};
  }
  const bool names_place = !is_joint && (where == "all" || where == "tip" || where == "base");
  if (names_place || info.place == Place::kBase || info.place == Place::kAllJoints)
    throw ModelError(here + ": got '" + where + "'" + expected);
  return {find_joint_or_throw(here, where, joints)};
}

/// Fills joints, links and, at joints that follow others, how they do.
/// @throws ModelError for an effect that such a joint cannot have
void place_at(const std::vector<TreeJoint>& joints, const std::string& here, BoundEffect& out) {
  const EffectInfo& info = out.info();
  for (const TreeJoint& j : joints) {
    if (j.drive.dof != kNoDof) out.joints.push_back(j.drive.dof);
    out.links.push_back(j.link);
    if (!j.follows || info.place == Place::kTip) continue;
    const bool one_instant = info.port == Port::kJointTorque && info.place == Place::kJoint;
    if (!one_instant || info.has(Trait::kGain) || info.has(Trait::kFollowsLoad) ||
        (info.has(Trait::kReadsAcceleration) && !info.has(Trait::kRotor)))
      throw ModelError(here + ": joint '" + j.name +
                       "' follows another; only friction, springs and rotors can act at such a "
                       "joint, bind it to the joint that is followed");
    out.follows.push_back(j.drive);
  }
}

/// Run of a per-run parameter's name: "offset_3" gives 3.
bool parse_run(const std::string& name, const std::string& stem, int& run) {
  if (name.rfind(stem + "_", 0) != 0) return false;
  const char* end = name.data() + name.size();
  const auto [last, error] = std::from_chars(name.data() + stem.size() + 1, end, run);
  return error == std::errc() && last == end;
}

[[noreturn]] void refuse_runs(const std::string& where) {
  throw ModelError(
      "effects: got '" + where +
      "'; after a colon come the recordings an effect acts in, run=K or run=K+L, numbered "
      "from 0 as they are given, e.g. payload@tip:run=1");
}

/// As few digits as say which number it is.
std::string text(double x) {
  char out[32];
  return {out, std::to_chars(out, out + sizeof out, x).ptr};
}

void check_value(const std::string& here, const ParameterInfo& info, double value) {
  const bool ok = std::isfinite(value) && (info.sign != Sign::kNonNegative || value >= 0.0) &&
                  (info.sign != Sign::kPositive || value > 0.0) && value <= info.most;
  if (ok) return;
  const std::string unit = info.unit == "1" ? "" : " " + info.unit;
  throw ModelError(here + ": " + info.name + " = " + text(value) + unit + ", expected a " +
                   (info.sign == Sign::kFree          ? "finite number"
                    : info.sign == Sign::kNonNegative ? "number that is 0 or above"
                                                      : "number above 0") +
                   (std::isfinite(info.most) ? ", at most " + text(info.most) + unit : ""));
}

/// Joints and their parents, of one type: a shaft's torque is [N·m] at both or [N] at both.
std::vector<std::string> joint_pairs(const Model& model) {
  const std::vector<TreeJoint> joints = tree_joints(model);
  const Tree<double> tree = make_tree(model);
  std::vector<std::string> out;
  for (const TreeJoint& joint : joints) {
    const Link<double>& link = tree.links[static_cast<std::size_t>(joint.link)];
    const int carrier = link.parent - tree.first_joint();  // joint of the parent
    if (carrier < 0 || link.type != tree.links[static_cast<std::size_t>(link.parent)].type)
      continue;
    const TreeJoint& before = joints[static_cast<std::size_t>(carrier)];
    if (!before.follows && !joint.follows) out.push_back(before.name + "," + joint.name);
  }
  return out;
}

}  // namespace

RunPlace split_where(const std::string& where) {
  const std::size_t colon = where.rfind(':');  // joints may have one in their names
  if (colon == std::string::npos) return {where, {}};
  RunPlace out{where.substr(0, colon), {}};
  std::string rest = where.substr(colon + 1);
  if (!rest.starts_with("run=")) {
    constexpr std::array<std::string_view, 6> kNoJoints{"tip",  "base",   "all",
                                                        "ball", "string", "camera"};
    if (std::ranges::find(kNoJoints, out.place) != kNoJoints.end()) refuse_runs(where);
    return {where, {}};
  }
  rest = rest.substr(4) + "+";
  for (std::size_t at = 0; at < rest.size();) {
    const std::size_t plus = rest.find('+', at);
    int run = -1;
    const auto [last, error] = std::from_chars(rest.data() + at, rest.data() + plus, run);
    if (error != std::errc() || last != rest.data() + plus || run < 0) refuse_runs(where);
    out.runs.push_back(run);
    at = plus + 1;
  }
  std::ranges::sort(out.runs);
  out.runs.erase(std::ranges::unique(out.runs).begin(), out.runs.end());
  return out;
}

std::string join_where(const RunPlace& where) {
  std::string out = where.place;
  for (std::size_t k = 0; k < where.runs.size(); ++k)
    out += (k == 0 ? ":run=" : "+") + std::to_string(where.runs[k]);
  return out;
}

bool BoundEffect::acts_in(int run) const {
  return runs.empty() || std::ranges::find(runs, run) != runs.end();
}

std::shared_ptr<const AnyEffect> any_effect() { return all_effects().front(); }

const EffectInfo& BoundEffect::info() const { return info_of(*type); }

bool acts_on_ball(const EffectInfo& info) {
  return info.place == Place::kBall || info.place == Place::kString || info.place == Place::kCamera;
}

const std::vector<EffectInfo>& catalogue() {
  static const std::vector<EffectInfo> kCatalogue = [] {
    std::vector<EffectInfo> out;
    for (const auto& effect : all_effects()) out.push_back(info_of(*effect));
    return out;
  }();
  return kCatalogue;
}

const EffectInfo& find_effect(const std::string& name) { return info_of(*formula_of(name)); }

const EffectInfo* known_effect(const std::string& name) {
  const auto at = std::ranges::find(catalogue(), name, &EffectInfo::name);
  return at == catalogue().end() ? nullptr : &*at;
}

const std::string& effect_of(NativeField field) {
  for (const EffectInfo& info : catalogue())
    for (const ParameterInfo& p : info.parameters)
      if (p.native == field) return info.name;
  throw Error("effect_of: no effect of the catalogue has a parameter of that native field");
}

std::vector<int> BoundEffect::linear_parameters() const {
  std::vector<int> out;
  for (std::size_t i = 0; i < parameter_info.size(); ++i)
    if (parameter_info[i].linear) out.push_back(static_cast<int>(i));
  return out;
}

std::vector<int> BoundEffect::shape_parameters() const {
  std::vector<int> out;
  for (std::size_t i = 0; i < parameter_info.size(); ++i)
    if (!parameter_info[i].linear) out.push_back(static_cast<int>(i));
  return out;
}

std::vector<int> BoundEffect::amplitude_parameters() const {
  std::vector<int> out = linear_parameters();
  if (!out.empty()) return out;
  for (const int k : shape_parameters())
    if (scale(parameter_info[k]) == Scale::kPlain) out.push_back(k);
  if (info().has(Trait::kNoAmplitude)) out.clear();
  return out;
}

std::vector<std::string> places(const EffectInfo& info, const Model& model) {
  switch (info.place) {
    case Place::kJoint:
      return joint_names(model);
    case Place::kJointPair:
      return joint_pairs(model);
    case Place::kTip:
      return {"tip"};
    case Place::kBase:
      return {"base"};
    case Place::kAllJoints:
      return {"all"};
    case Place::kBall:
      return model.ball ? std::vector<std::string>{"ball"} : std::vector<std::string>{};
    case Place::kString:
      if (!model.ball || !model.ball->string) return {};
      if (info.has(Trait::kNeedsCup) && !cup_at_string(model)) return {};
      return {"string"};
    case Place::kCamera:
      return model.ball ? std::vector<std::string>{"camera"} : std::vector<std::string>{};
  }
  return {};
}

BoundEffect bind(const EffectSpec& spec, const Model& model, const std::vector<int>& runs) {
  BoundEffect out;
  out.type = formula_of(spec.effect);
  out.where = spec.where;
  const EffectInfo& info = out.info();
  const std::string here = model.name + ": " + spec.effect + " at '" + spec.where + "'";
  const std::vector<int> moving = tree_links(model);
  out.num_joints = static_cast<int>(moving_links(model).size());
  const RunPlace place = split_where(spec.where);
  out.runs = place.runs;
  place_at(resolve_where(here, info, place.place, model, tree_joints(model)), here, out);
  if (!out.runs.empty() && info.has(Trait::kOfRobot))
    throw ModelError(here +
                     ": it belongs to the robot and acts in every recording; leave out ':run='");

  // Units: those of the joints' type, which must be one where the unit depends on it.
  int num_prismatic = 0;
  for (const int link : out.links)
    num_prismatic += model.links[moving[link]].type == ModelJoint::kPrismatic ? 1 : 0;
  const bool prismatic = num_prismatic > 0;
  const bool mixed = prismatic && num_prismatic < static_cast<int>(out.joints.size());

  // One entry per parameter; a per-run parameter gets one for every run that is known.
  std::vector<int> all_runs = runs;
  for (const EffectParameter& p : spec.parameters)
    for (const ParameterInfo& i : info.parameters)
      if (int run = 0; i.per_run && parse_run(p.name, i.name, run)) all_runs.push_back(run);
  std::ranges::sort(all_runs);
  all_runs.erase(std::ranges::unique(all_runs).begin(), all_runs.end());
  out.type = completed(out.type, {spec, model, out.joints, out.links, all_runs, here});
  const bool has_table =
      visit_formula(out, [](const auto& formula) { return requires { formula.table; }; });
  if (spec.table && !has_table)
    throw ModelError(here + ": it has a table of bumps, which is of the effect residual alone");

  for (ParameterInfo p : info.parameters) {
    if (mixed && p.unit != p.unit_prismatic)
      throw ModelError(here + ": " + p.name + " would be in " + p.unit + " at one joint and in " +
                       p.unit_prismatic + " at another; bind it to each joint by name");
    if (prismatic) {
      p.unit = p.unit_prismatic;
      if (!std::isnan(p.initial_prismatic)) p.initial = p.initial_prismatic;
      if (!p.search_prismatic.empty()) p.search = p.search_prismatic;
    }
    p.unit_prismatic = p.unit;
    p.initial_prismatic = p.initial;
    p.search_prismatic = p.search;
    if (!p.per_run) {
      out.parameter_info.push_back(p);
      continue;
    }
    for (const int run : all_runs) {
      out.parameter_info.push_back(p);
      out.parameter_info.back().name += "_" + std::to_string(run);
    }
  }

  for (const ParameterInfo& p : out.parameter_info) out.parameters.push_back(p.initial);
  std::vector<bool> given(out.parameters.size(), false);
  for (const EffectParameter& p : spec.parameters) {
    const auto it = std::ranges::find(out.parameter_info, p.name, &ParameterInfo::name);
    if (it == out.parameter_info.end()) {
      std::vector<std::string> names;
      for (const ParameterInfo& i : info.parameters)
        names.push_back(i.per_run ? i.name + "_<run>" : i.name);
      throw ModelError(here + ": it has no parameter '" + p.name + "'; " + choices(p.name, names));
    }
    const std::size_t k = it - out.parameter_info.begin();
    if (given[k]) throw ModelError(here + ": parameter '" + p.name + "' is given twice");
    if (!p.unit.empty() && p.unit != it->unit)
      throw ModelError(here + ": " + p.name + " is given in " + p.unit + ", expected " + it->unit);
    check_value(here, *it, p.value);
    given[k] = true;
    out.parameters[k] = p.value;
  }
  return out;
}

EffectSpec to_spec(const BoundEffect& effect) {
  EffectSpec spec{effect.info().name, effect.where, {}};
  for (std::size_t i = 0; i < effect.parameters.size(); ++i)
    spec.parameters.push_back(
        {effect.parameter_info[i].name, effect.parameters[i], effect.parameter_info[i].unit});
  visit_formula(effect, [&](const auto& formula) {
    if constexpr (requires { spec.table = formula.table; }) spec.table = formula.table;
  });
  return spec;
}

void lead_command(const BoundEffect& effect, CommandPath& path) {
  visit_formula(effect, [&](const auto& formula) {
    if constexpr (requires { formula.lead(0, effect.parameters.data(), path); })
      for (const int j : effect.joints) formula.lead(j, effect.parameters.data(), path);
  });
}

double drive_slope(const BoundEffect& effect, const CommandPath& path) {
  double out = 0.0;
  visit_formula(effect, [&](const auto& formula) {
    if constexpr (requires { formula.slope(0, effect.parameters.data(), path); })
      out = formula.slope(effect.joints.front(), effect.parameters.data(), path);
  });
  return out;
}

void linear_columns(const BoundEffect& effect, const JointSample<double>& x, double* columns) {
  const EffectInfo& info = effect.info();
  if (info.port != Port::kJointTorque)
    throw ModelError(info.name + " at '" + effect.where +
                     "': it is no joint torque at one instant; series_columns has its columns (a "
                     "payload's are those of the torque regressor)");
  // The torque is homogeneous in the linear parameters: one of them 1, the others 0.
  std::vector<double> p = effect.parameters;
  const std::vector<int> linear = effect.linear_parameters();
  for (const int k : linear) p[k] = 0.0;
  std::fill_n(columns, linear.size() * effect.num_joints, 0.0);
  for (const int k : linear) {
    p[k] = 1.0;
    add_torque(effect, x, p.data(), columns);
    p[k] = 0.0;
    columns += effect.num_joints;
  }
}

template void add_torque<double>(const BoundEffect&, const JointSample<double>&, const double*,
                                 double*);
template void add_torque<JetD>(const BoundEffect&, const JointSample<JetD>&, const JetD*, JetD*);
template void add_torque<double>(const BoundEffect&, const Tree<double>&,
                                 const JointSample<double>&, const double*, double*);
template void add_torque<JetD>(const BoundEffect&, const Tree<double>&, const JointSample<JetD>&,
                               const JetD*, JetD*);
template void add_to_tree<double>(const BoundEffect&, const double*, Tree<double>&);
template void add_to_tree<JetD>(const BoundEffect&, const JetD*, Tree<JetD>&);

}  // namespace diffnea
