/// Bodies in maximal coordinates, fitted to their measured poses by the constrained loss.

#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/constrained_loss.hpp>
#include <diffnea/identify/identify.hpp>

#include "bindings.hpp"
#include "free_world.hpp"
#include "value_type.hpp"

namespace diffnea::python {

template <>
struct detail::TypeName<Body> {
  static std::string text() { return "FreeBody"; }
};
template <>
struct detail::TypeName<NamedConstraint> {
  static std::string text() { return "Constraint"; }
};

namespace {

using namespace pybind11::literals;

struct ConstraintErrorView {
  std::string name;
  double g = 0.0, over_noise = 0.0;

  template <class List>
  static constexpr void fields(List& list) {
    using E = ConstraintErrorView;
    list.type("ConstraintError", "How well the measured motion keeps a constraint after a fit.");
    list.field("name", &E::name, "The constraint.");
    list.field("g", &E::g, "Root mean square of g where it acts, in its unit.");
    list.field("over_noise", &E::over_noise,
               "The same over what the sensor's noise makes of it: about 1 if it is true.");
  }
};

struct ConstrainedFitView {
  std::vector<ParameterEstimate> parameters;
  RowMatX<double> covariance;
  double chi2 = 0.0;
  long samples = 0;
  int iterations = 0;
  bool converged = false;
  std::string termination;
  std::vector<ConstraintErrorView> errors;
  std::vector<Body> bodies;
  std::vector<NamedConstraint> constraints;

  template <class List>
  static constexpr void fields(List& list) {
    using F = ConstrainedFitView;
    list.type("ConstrainedFit", "Free numbers of bodies and constraints, by the constrained loss.");
    list.field("parameters", &F::parameters,
               "The P free numbers, :class:`ParameterEstimate`, by position or by name.");
    list.field("covariance", &F::covariance,
               "(P, P) of the sensor's noise through smoothing and loss; infinite on the diagonal "
               "of what the motion does not tell.");
    list.field("chi2", &F::chi2, "The cost at the end.");
    list.field("samples", &F::samples, "Smoothed rows that count.");
    list.field("iterations", &F::iterations, "Steps, refused ones included.");
    list.field("converged", &F::converged,
               "The last step gained less than the tolerance, or no step gains.");
    list.field("termination", &F::termination, "Why it ended.");
    list.field("errors", &F::errors, "One :class:`ConstraintError` a constraint.");
    list.in_memory("bodies", &F::bodies, "The bodies with the fitted numbers.");
    list.in_memory("constraints", &F::constraints, "The constraints with the fitted numbers.");
  }
};

/// Measured poses as smooth_bodies takes them.
std::vector<PosedRow> rows_in(const py::object& time, const py::object& pose,
                              const py::object& stretch, long bodies) {
  const std::string where = "fit_constrained: ";
  const VecX<double> t = vector_in(where + "time", time);
  const VecX<double> parts = stretch.is_none() ? VecX<double>::Zero(t.size()).eval()
                                               : vector_in(where + "stretch", stretch, t.size());
  const py::array_t<double> X = number_array(where + "pose", pose);
  if (X.ndim() != 4 || X.shape(0) != t.size() || X.shape(1) != bodies || X.shape(2) != 4 ||
      X.shape(3) != 4)
    throw ShapeError(where + "pose: got shape " + shape_text(X) + ", expected (" +
                     std::to_string(t.size()) + ", " + std::to_string(bodies) +
                     ", 4, 4), one an instant and a body");
  std::vector<PosedRow> rows;
  for (long k = 0; k < t.size(); ++k) {
    PosedRow& row = rows.emplace_back();
    row.time = t[k];
    row.stretch = static_cast<int>(parts[k]);
    for (long b = 0; b < bodies; ++b)
      row.X_WB.push_back(
          pose_in(where + "pose of body " + std::to_string(b) + " at row " + std::to_string(k),
                  X.data() + 16 * (k * bodies + b)));
  }
  return rows;
}

/// Wrenches at each row, (N, 6 n): given as (N, n, 6), or as (n, 6) for all of them.
RowMatX<double> applied_in(const py::object& given, long rows, long bodies) {
  RowMatX<double> out = RowMatX<double>::Zero(rows, 6 * bodies);
  if (given.is_none()) return out;
  const py::array_t<double> f = number_array("fit_constrained: applied", given);
  const bool each = f.ndim() == 3;
  if ((f.ndim() != 2 && !each) || f.shape(f.ndim() - 1) != 6 || f.shape(f.ndim() - 2) != bodies ||
      (each && f.shape(0) != rows))
    throw ShapeError("fit_constrained: applied: got shape " + shape_text(f) + ", expected (" +
                     std::to_string(bodies) + ", 6), or (" + std::to_string(rows) + ", " +
                     std::to_string(bodies) + ", 6)");
  for (long k = 0; k < rows; ++k)
    std::copy_n(f.data() + (each ? k * 6 * bodies : 0), 6 * bodies, out.row(k).data());
  return out;
}

/// Estimates as people read them: covariance by the slopes of FreeWorld::readable.
void read(const FreeWorld& world, const ConstrainedFit& fit, ConstrainedFitView& out) {
  const Eigen::Index P = fit.p.size();
  VecX<double> begin(P);
  for (Eigen::Index k = 0; k < P; ++k) begin[k] = world.parameters()[k].value;
  const VecX<double> value = world.readable(fit.p), prior = world.readable(begin);
  RowMatX<double> slope(P, P);
  for (Eigen::Index first = 0; first < P; first += kJetWidth) {
    VecX<JetD> p(P);
    for (Eigen::Index k = 0; k < P; ++k)
      p[k] = k >= first && k < first + kJetWidth ? JetD(fit.p[k], static_cast<int>(k - first))
                                                 : JetD(fit.p[k]);
    const VecX<JetD> at = world.readable(p);
    for (Eigen::Index i = 0; i < P; ++i)
      for (Eigen::Index k = first; k < std::min(first + kJetWidth, P); ++k)
        slope(i, k) = at[i].v[k - first];
  }
  const auto known = [&](Eigen::Index k) { return std::isfinite(fit.covariance(k, k)); };
  MatX<double> seen = fit.covariance;
  for (Eigen::Index k = 0; k < P; ++k)
    if (!known(k)) seen(k, k) = 0.0;
  out.covariance = slope * seen * slope.transpose();
  for (Eigen::Index i = 0; i < P; ++i)
    for (Eigen::Index k = 0; k < P; ++k)
      if (!known(k) && slope(i, k) != 0.0)
        out.covariance(i, i) = std::numeric_limits<double>::infinity();
  for (Eigen::Index k = 0; k < P; ++k) {
    ParameterEstimate& e = out.parameters.emplace_back();
    e.name = world.parameters()[k].name;
    e.unit = world.parameters()[k].unit;
    e.value = value[k];
    e.prior = prior[k];
    e.identifiable = std::isfinite(out.covariance(k, k));
    e.std =
        e.identifiable ? std::sqrt(out.covariance(k, k)) : std::numeric_limits<double>::quiet_NaN();
  }
}

/// Raises KeyboardInterrupt after Ctrl-C; asked at every sample, it looks now and then.
void heed_interrupts(long& asked) {
  constexpr long kEvery = 1024;  // samples, milliseconds of work
  if (++asked % kEvery != 0) return;
  const py::gil_scoped_acquire gil;
  if (PyErr_CheckSignals() != 0) throw py::error_already_set();
}

ConstrainedFitView fit_of(const std::vector<Body>& bodies,
                          const std::vector<NamedConstraint>& constraints,
                          const std::vector<std::string>& free, const py::object& time,
                          const py::object& pose, const py::object& stretch,
                          const py::object& applied, const py::object& gravity,
                          const py::object& weights, bool robust, int max_iterations,
                          double tolerance) {
  const auto n = static_cast<long>(bodies.size());
  const FreeWorld world(bodies, constraints, free);
  const std::vector<PosedRow> rows = rows_in(time, pose, stretch, n);
  const RowMatX<double> forces = applied_in(applied, static_cast<long>(rows.size()), n);
  const VecX<double> g = vector_in("fit_constrained: gravity", gravity, 3),
                     lambda = vector_in("fit_constrained: weights", weights, 3);
  ConstrainedFitOptions options;
  options.lambda = {lambda[0], lambda[1], lambda[2]};
  options.robust = robust;
  options.max_iterations = max_iterations;
  options.tolerance = tolerance;

  ConstrainedFit fit;
  {
    const py::gil_scoped_release release;
    const BodyMotion motion = smooth_bodies(rows);
    long asked = 0;
    const auto fill = [&]<class T>(const BodySample& sample, const VecX<T>& p,
                                   ConstrainedSystem<T>& system) {
      heed_interrupts(asked);
      system.gravity = {T(g[0]), T(g[1]), T(g[2])};
      const double* f = forces.row(sample.first_row + motion.half_width).data();
      for (Wrench<T>& W : system.applied) {
        W = {{T(f[0]), T(f[1]), T(f[2])}, {T(f[3]), T(f[4]), T(f[5])}};
        f += 6;
      }
      world.fill(p, system);
    };
    fit = fit_constrained(ConstrainedModel(fill), world.parameters(), motion, options);
  }
  ConstrainedFitView out;
  read(world, fit, out);
  out.chi2 = fit.chi2;
  out.samples = fit.samples;
  out.iterations = fit.iterations;
  out.converged = fit.converged;
  out.termination = fit.termination;
  for (const ConstraintError& e : fit.constraints)
    out.errors.push_back({e.name, e.g, e.over_noise});
  out.bodies = world.bodies_at(fit.p);
  out.constraints = world.constraints_at(fit.p);
  return out;
}

}  // namespace

void bind_constrained_fit(py::module_& m) {
  value_type<ConstraintErrorView>(m);
  auto c = value_type<ConstrainedFitView>(m, {.repr = true});
  redefine(c, "parameters", "Parameters", [](const ConstrainedFitView& x) {
    return python_function("diffnea._results", "Parameters")(py::cast(x.parameters));
  });
  c.def("__repr__", [](const py::object& self) {
    return python_function("diffnea._results", "constrained_fit_text")(self).cast<std::string>();
  });
  m.def("fit_constrained", &fit_of, "bodies"_a, "constraints"_a, "free"_a, py::kw_only(), "time"_a,
        "pose"_a, "stretch"_a = py::none(), "applied"_a = py::none(),
        "gravity"_a = py::make_tuple(0.0, 0.0, -9.81), "weights"_a = py::make_tuple(1.0, 1.0, 1.0),
        "robust"_a = true, "max_iterations"_a = 100, "tolerance"_a = 1e-8,
        "Fit free numbers of bodies and constraints to measured poses by the paper's constrained "
        "loss (section IV),\nand return a :class:`ConstrainedFit`.\n\n"
        "``free``: names of numbers, or of what holds them: ``rod.length``, ``rod.p_AP``, "
        "``rod.p_AP[0]``, ``rod``,\n``bodies[0].mass``, ``bodies[0].com``, ``bodies[0].inertia``; "
        "they begin at their values. A mass takes the\ninertia with it, a centre of mass all of "
        "the body; ``inertia`` is about the centre of mass, and stays\npossible. A pose's "
        "(``hinge.X_AJ``) are rx, ry, rz [rad], x, y, z [m] of the motion from where it begins, "
        "in\nits own axes.\n\n"
        "``time``: (N,) [s]; ``pose``: (N, n, 4, 4) of each body in the world [m], as the sensor "
        "saw it; ``stretch``: (N,)\nintegers, another where rows are missing. ``applied``: (N, n, "
        "6) or (n, 6) wrenches in the bodies' frames,\nweight not among them [N·m, N]; "
        "``gravity``: (3,) in the world [m/s²]. ``weights``: of g, ġ and g̈ beside the\n"
        "accelerations. ``robust``: Huber's loss. It ends after ``max_iterations`` steps, or where "
        "one gains a smaller\nshare of the cost than ``tolerance``.\n\n"
        "Raises :class:`DataError` naming a constraint that has no free number and does not hold, "
        ":class:`ModelError` if\nconstraints contradict each other.");
}

}  // namespace diffnea::python
