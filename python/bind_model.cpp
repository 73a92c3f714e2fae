/// Robot descriptions and the catalogue of effects.

#include <cmath>
#include <filesystem>
#include <iterator>

#include <pybind11/stl/filesystem.h>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/bound_effect.hpp>
#include <diffnea/io/effects_list.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/io/model_info.hpp>
#include <diffnea/model/graft.hpp>
#include <diffnea/model/model.hpp>
#include <diffnea/worlds/world.hpp>

#include "bindings.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;
namespace fs = std::filesystem;

/// A link as Python sees it: names instead of indices.
struct LinkView {
  std::string name, parent, joint, type;
  bool passive = false;
  double mass = 0.0;
  VecX<double> com, inertia;
  double lower = 0.0, upper = 0.0, velocity = 0.0, effort = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Link", "A link and the joint that carries it.");
    list.field("name", &LinkView::name, "The link's name.");
    list.field("parent", &LinkView::parent, "Name of the parent link; empty: the ground.");
    list.field("joint", &LinkView::joint, "Name of the joint to the parent.");
    list.field("type", &LinkView::type,
               "``revolute``, ``prismatic`` or ``fixed``; ``floating`` of a free base.");
    list.field("passive", &LinkView::passive, "The joint's torque is known to be zero.");
    list.field("mass", &LinkView::mass, "Of the link.", {.unit = "kg"});
    list.field("com", &LinkView::com, "(3,) centre of mass in the link's frame.", {.unit = "m"});
    list.field("inertia", &LinkView::inertia,
               "(6,) Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre of mass.", {.unit = "kg·m²"});
    list.field("lower", &LinkView::lower, "Smallest position [rad] or [m]; −inf: no limit.");
    list.field("upper", &LinkView::upper, "Largest position [rad] or [m]; inf: no limit.");
    list.field("velocity", &LinkView::velocity, "Largest speed [rad/s] or [m/s]; inf: no limit.");
    list.field("effort", &LinkView::effort,
               "Largest torque [N·m], of a slide force [N]; inf without a limit.");
  }
};

/// Inertia about the centre of mass: I_c = I_o − m (|c|² 1 − c cᵀ).
LinkView view(const Model& model, const ModelLink& link) {
  static constexpr const char* kTypes[] = {"fixed", "revolute", "prismatic"};
  const bool floats = model.free_base && &link == &model.links[0];
  LinkView out;
  out.name = link.name;
  out.parent = link.parent < 0 ? "" : model.links[static_cast<std::size_t>(link.parent)].name;
  out.joint = link.joint;
  out.type = floats ? "floating" : kTypes[static_cast<std::size_t>(link.type)];
  out.passive = link.passive;
  const SpatialInertia<double>& b = link.inertia;
  out.mass = b.m;
  const Eigen::Vector3d h = to_eigen(b.h);
  const Eigen::Vector3d c = b.m > 0.0 ? Eigen::Vector3d(h / b.m) : Eigen::Vector3d::Zero();
  const Eigen::Matrix3d shift = c.dot(h) * Eigen::Matrix3d::Identity() - c * h.transpose();
  const Eigen::Matrix3d I = to_eigen(full(b.I)) - shift;
  out.com = c;
  out.inertia = VecX<double>(6);
  out.inertia << I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2);
  out.lower = link.limits.lower;
  out.upper = link.limits.upper;
  out.velocity = link.limits.velocity;
  out.effort = link.limits.effort;
  return out;
}

std::vector<LinkView> links(const Model& model) {
  std::vector<LinkView> out;
  for (const ModelLink& link : model.links) out.push_back(view(model, link));
  return out;
}

std::string model_repr(const Model& model) {
  const auto list = [](const std::vector<std::string>& names) {
    std::string text;
    for (std::size_t k = 0; k < names.size() && k < 8; ++k) text += (k == 0 ? "" : ", ") + names[k];
    return text + (names.size() > 8 ? ", …" : "");
  };
  double mass = 0.0;
  for (const ModelLink& link : model.links) mass += link.inertia.m;
  std::map<std::string, int> effects;
  for (const EffectSpec& e : model.effects) ++effects[e.effect];
  std::vector<std::string> counted;
  for (const auto& [name, count] : effects) counted.push_back(name + " ×" + std::to_string(count));
  const std::vector<std::string> joints = joint_names(model);
  const py::str gravity =
      py::repr(py::make_tuple(model.gravity.x, model.gravity.y, model.gravity.z));
  return "Model(" + std::string(py::repr(py::str(model.name))) + ": " +
         (model.free_base ? "free base, " : "") + std::to_string(joints.size()) + " joints [" +
         list(joints) + "], " + std::to_string(model.links.size()) + " links, " +
         std::string(py::str("{:.4g}").format(mass)) + " kg, effects [" + list(counted) +
         "], gravity " + std::string(gravity) + ")";
}

/// Chains are resolved: every follower follows a degree of freedom.
py::dict followers(const Model& model) {
  const std::vector<std::string> joints = joint_names(model);
  py::dict out;
  for (const TreeJoint& j : tree_joints(model))
    if (j.follows)
      out[py::str(j.name)] = py::dict("joint"_a = joints[static_cast<std::size_t>(j.drive.dof)],
                                      "ratio"_a = j.drive.ratio, "offset"_a = j.drive.offset);
  return out;
}

Model from_dict(const py::object& dict) {
  const std::string text = py::cast<std::string>(python_function("json", "dumps")(dict));
  return model_from_json(text, "Model.from_dict");
}

Model with_effects(Model model, std::vector<EffectSpec> effects) {
  for (EffectSpec& spec : effects) spec = to_spec(bind(spec, model));
  model.effects = std::move(effects);
  return model;
}

EffectSpec make_effect(std::string effect, std::string where,
                       const std::map<std::string, double>& parameters) {
  EffectSpec out{std::move(effect), std::move(where), {}};
  const EffectInfo& about = find_effect(out.effect);  // unknown names: better known now
  for (const auto& [name, value] : parameters) {
    // The catalogue's order; what it does not know (offset_3 of run 3) comes last and is checked
    // when bound.
    out.parameters.push_back({name, value, ""});
  }
  const auto rank = [&](const EffectParameter& p) {
    std::size_t k = 0;
    while (k < about.parameters.size() && about.parameters[k].name != p.name) ++k;
    return k;
  };
  std::ranges::stable_sort(out.parameters, {}, rank);
  return out;
}

std::string effect_repr(const EffectSpec& e) {
  std::string text = "Effect('" + e.effect + "', '" + e.where + "'";
  for (const EffectParameter& p : e.parameters)
    text += ", " + p.name + "=" + std::string(py::repr(py::float_(p.value))) +
            (p.unit.empty() || p.unit == "1" ? "" : " " + p.unit);
  return text + ")";
}

py::dict effect_parameters(const EffectSpec& e) {
  py::dict out;
  for (const EffectParameter& p : e.parameters) out[py::str(p.name)] = p.value;
  return out;
}

py::object effect_table(const EffectSpec& e) {
  if (!e.table) return py::none();
  return py::dict("variables"_a = e.table->variables, "centres"_a = e.table->centres,
                  "widths"_a = e.table->widths, "weights"_a = e.table->weights,
                  "bound"_a = e.table->bound);
}

std::optional<BumpTable> table_from(const py::object& table) {
  if (table.is_none()) return std::nullopt;
  const auto numbers = [&](const char* key) { return py::cast<std::vector<double>>(table[key]); };
  return BumpTable{py::cast<std::vector<std::string>>(table["variables"]), numbers("centres"),
                   numbers("widths"), numbers("weights"), py::cast<double>(table["bound"])};
}

py::object effect_catalogue() { return parse_json(effects_json())["effects"]; }

}  // namespace

void bind_model(py::module_& m) {
  py::class_<EffectSpec> effect(m, "Effect",
                                "An effect on a model, as plain data: what, where, how much.");
  effect
      .def(py::init(&make_effect), "effect"_a, "where"_a, "parameters"_a = py::dict(),
           "``effect``: a name of ``diffnea.effects()``; ``where``: a joint's name, two of them "
           "separated by a\n"
           "comma, or base, tip, all; ``parameters``: values in SI units by name, the others take "
           "their defaults.")
      .def_readonly("effect", &EffectSpec::effect,
                    "Name in the catalogue, e.g. ``coulomb_friction``.")
      .def_readonly("where", &EffectSpec::where, "A joint's name, or base, tip, all.")
      .def_property_readonly("parameters", &effect_parameters, "Values by name [SI units].")
      .def_property_readonly(
          "units",
          [](const EffectSpec& e) {
            py::dict out;
            for (const EffectParameter& p : e.parameters) out[py::str(p.name)] = p.unit;
            return out;
          },
          "Units by parameter name; empty where the effect has not been bound to a model.")
      .def_property_readonly(
          "table", &effect_table,
          "What ``diagnose`` has learned, of the effect ``residual``: variables, centres and "
          "widths "
          "of its\nbumps (a row of variables each), weights and bound; None of any other.")
      .def("__repr__", &effect_repr)
      .def("__eq__",
           [](const EffectSpec& a, const py::object& other) {
             if (!py::isinstance<EffectSpec>(other)) return false;
             const EffectSpec b = py::cast<EffectSpec>(other);
             return a.effect == b.effect && a.where == b.where &&
                    effect_parameters(a).equal(effect_parameters(b)) &&
                    effect_table(a).equal(effect_table(b));
           })
      .def(py::pickle(
          [](const EffectSpec& e) {
            py::list parameters;
            for (const EffectParameter& p : e.parameters)
              parameters.append(py::make_tuple(p.name, p.value, p.unit));
            return py::make_tuple(e.effect, e.where, parameters, effect_table(e));
          },
          [](const py::tuple& state) {
            EffectSpec e{py::cast<std::string>(state[0]), py::cast<std::string>(state[1]), {}};
            for (const auto& [name, value, unit] :
                 py::cast<std::vector<std::tuple<std::string, double, std::string>>>(state[2]))
              e.parameters.push_back({name, value, unit});
            e.table = table_from(state[3]);
            return e;
          }));
  effect.attr("__module__") = "diffnea";

  value_type<LinkView>(m);

  value_type<ModelIssue>(m);

  py::class_<Model> model(
      m, "Model", "A robot: a tree of links, and the effects that act on it. Never changes.");
  model.def_readonly("name", &Model::name, "The robot's name.")
      .def_readonly("source", &Model::source, "File that it was read from.")
      .def_readonly("notes", &Model::notes,
                    "What that file says and this model leaves out, one sentence each.")
      .def_property_readonly(
          "num_joints", [](const Model& x) { return moving_links(x).size(); },
          "Number n of degrees of freedom: moving joints that follow no other.")
      .def_property_readonly(
          "free_base",
          [](const Model& x) -> py::object {
            return x.free_base ? py::object(py::str(x.links[0].name)) : py::none();
          },
          "Name of the link that the robot floats on; None where the base is fixed.")
      .def_property_readonly(
          "constraints",
          [](const Model& x) {
            std::vector<std::string> names;
            for (const ConstraintSpec& c : x.constraints) names.push_back(c.name);
            return names;
          },
          "Names of the constraints that close loops of the tree; `to_dict` has them whole.")
      .def_property_readonly(
          "num_positions",
          [](const Model& x) {
            return moving_links(x).size() + (x.free_base ? kBasePositions : 0);
          },
          "Length of ``q``: n; with a free base 7 + n, its pose ``[x y z qx qy qz qw]`` first.")
      .def_property_readonly(
          "num_velocities",
          [](const Model& x) {
            return moving_links(x).size() + (x.free_base ? kBaseVelocities : 0);
          },
          "Length of ``qd``, ``qdd`` and ``tau``: n; with a free base 6 + n, its twist ``[ω; v]``, "
          "in its own\nframe, first.")
      .def_property_readonly("joint_names", &joint_names,
                             "Names of those joints; arrays (…, n) have this order.")
      .def_property_readonly("followers", &followers,
                             "Joints that follow others (mimic joints, joint equalities), by name: "
                             "``{\"joint\": ..., \"ratio\": ..., \"offset\": ...}`` with\n"
                             "q = ratio q_joint + offset.")
      .def_property_readonly("links", &links, "All links, parents before children.")
      .def_property_readonly(
          "frame_names",
          [](const Model& x) {
            std::vector<std::string> out;
            for (const ModelFrame& f : x.frames) out.push_back(f.name);
            for (const ModelLink& l : x.links) out.push_back(l.name);
            return out;
          },
          "Frames that the kinematics know: those of the file, then the links'.")
      .def_readonly("effects", &Model::effects,
                    "Effects on the model, as a list of :class:`Effect`.")
      .def_property_readonly(
          "gravity", [](const Model& x) { return array_out(VecX<double>(to_eigen(x.gravity))); },
          "(3,) acceleration of gravity in the world [m/s²].")
      .def_property_readonly(
          "inertial_parameters",
          [](const Model& x) { return array_out(inertial_parameters(make_tree(x))); },
          "(10 links,) per moving link, with all that is fixed to it: m, hx, hy, hz, Ixx, Ixy, "
          "Ixz, "
          "Iyy, Iyz, Izz;\n"
          "h first moment [kg·m], I about the link's origin [kg·m²]. What :func:`regressor` "
          "multiplies.")
      .def(
          "with_inertial_parameters",
          [](Model x, const py::object& pi) {
            set_inertial_parameters(x, vector_in("with_inertial_parameters: pi", pi));
            return x;
          },
          "pi"_a,
          "A copy with other inertias, (10 links,) in the order of ``inertial_parameters``.")
      .def("with_effects", &with_effects, "effects"_a,
           "A copy with these effects in place of its own; names, places and signs are checked.")
      .def(
          "with_part",
          [](Model whole, const Model& part) {
            graft(whole, part);
            return whole;
          },
          "part"_a,
          "A copy with what ``part`` has of the links and joints that move there, by name: a model "
          "that a fit left whose other joints were locked. What moves here beside them keeps its "
          "inertia.")
      .def("issues", &model_issues, "What looks wrong, as a list of :class:`Issue`.")
      .def("info", &model_info_text, "The tree with masses, limits, effects and issues, as text.")
      .def(
          "to_dict", [](const Model& x) { return parse_json(model_to_json(x)); },
          "The model as dict, schema ``diffnea/model/1``.")
      .def_static("from_dict", &from_dict, "data"_a, "The inverse of :meth:`to_dict`.")
      .def(
          "save",
          [](const Model& x, const std::filesystem::path& path, const std::string& mujoco) {
            return write_model(x, path, {}, {mujoco});
          },
          "path"_a, "mujoco"_a = ModelWriting{}.mujoco, py::call_guard<py::gil_scoped_release>(),
          "Write ``.json`` (all of it), ``.urdf`` or ``.xml``: the document that the model was "
          "read "
          "from with its values put\n"
          "in place, or, where it came in another form, a new one without looks. Return what the "
          "format cannot hold, one phrase each. ``mujoco`` is the oldest MuJoCo that has to load "
          "an "
          "MJCF: 3.5 has delays of drives.\n"
          "Raise ``ModelError`` for an extension that names no format, and for no version.")
      .def("__repr__", &model_repr)
      .def("__eq__",
           [](const Model& a, const py::object& other) {
             return py::isinstance<Model>(other) &&
                    model_to_json(a) == model_to_json(py::cast<const Model&>(other));
           })
      .def("__copy__", [](const Model& x) { return Model(x); })
      .def(
          "__deepcopy__", [](const Model& x, const py::dict&) { return Model(x); }, "memo"_a)
      .def(py::pickle([](const Model& x) { return py::make_tuple(model_to_json(x), x.source); },
                      [](const py::tuple& state) {
                        Model x = model_from_json(py::cast<std::string>(state[0]), "pickle");
                        x.source = py::cast<std::string>(state[1]);
                        return x;
                      }));
  model.attr("__module__") = "diffnea";

  m.def(
      "_read_model",
      [](const std::filesystem::path& path, bool fix_base, bool free_base, bool open_loops,
         bool allow_outside) {
        return read_model_or_run(path, {.fix_base = fix_base,
                                        .free_base = free_base,
                                        .open_loops = open_loops,
                                        .allow_outside = allow_outside});
      },
      "path"_a, "fix_base"_a = false, "free_base"_a = false, "open_loops"_a = false,
      "allow_outside"_a = false, py::call_guard<py::gil_scoped_release>());
  m.def("_find_model_file", &find_model_file, "name"_a, "extensions"_a);
  m.def("effects", &effect_catalogue,
        "The effects there are: a list of dicts, those of ``diffnea effects --json``: effect, "
        "formula,\nsummary, place, acts_on, motor_side and parameters.");
}

}  // namespace diffnea::python
