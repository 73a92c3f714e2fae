/// Informative trajectories, and recordings of simulated robots.

#include <pybind11/stl.h>

#include <diffnea/excite/design.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/mujoco_world.hpp>
#include <diffnea/sim/record.hpp>
#include <diffnea/worlds/world.hpp>

#include "bindings.hpp"
#include "value_type.hpp"

namespace diffnea::python {
namespace {

using namespace pybind11::literals;

struct Simulation {
  Recording recording;
  std::vector<Recording> recordings;
  Model truth;
  long saturated = 0;
  std::string failure;

  template <class List>
  static constexpr void fields(List& list) {
    list.type("Simulation", "A recording of a simulated robot, and the truth behind it.");
    list.field("recording", &Simulation::recording,
               "What the robot's sensors gave; of flights the first.");
    list.field("recordings", &Simulation::recordings,
               "All of them: the flights of a robot that floats, else one.");
    list.field("truth", &Simulation::truth, "The robot as it was: the model that nobody knows.");
    list.field("saturated", &Simulation::saturated, "Rows where a torque met its limit.");
    list.field("failure", &Simulation::failure,
               "Empty, or why the simulation ended early; the recording ends before that.");
  }
};

VecX<double> gains(const char* name, const py::object& x) {
  return x.is_none() ? VecX<double>() : vector_in(std::string("simulate: ") + name, x);
}

Simulation simulate(const Model& model, const Trajectory& trajectory,
                    const std::optional<std::string>& world, std::optional<std::uint64_t> seed,
                    std::optional<double> noise, double rate, const py::object& kp,
                    const py::object& kd, double bandwidth, double damping,
                    bool gravity_compensation, std::optional<double> period, double flight) {
  RecordOptions options;
  options.control_rate = rate;
  options.kp = gains("kp", kp);
  options.kd = gains("kd", kd);
  options.bandwidth = bandwidth;
  options.damping = damping;
  options.gravity_compensation = gravity_compensation;
  options.period = period.value_or(0.0);
  options.seed = seed.value_or(0);
  options.follow = true;
  options.flight = flight;

  const py::gil_scoped_release release;
  Simulation out;
  std::vector<SimulatedRecording> results;
  if (!world) {
    options.scale_noise(noise.value_or(0.0));
    out.truth = model;
    results = {record_model(model, model, trajectory, options)};
  } else {
    const WorldSpec spec = parse_world(*world);
    options.scale_noise(noise.value_or(spec.noise));
    if (model.free_base) {
      WorldFlights flown = record_flights_in_world(spec, model, trajectory, options, options.seed);
      out.truth = std::move(flown.truth);
      results = std::move(flown.flights);
    } else {
      WorldRecording recorded = record_in_world(spec, model, trajectory, options, options.seed);
      out.truth = std::move(recorded.truth);
      results = {std::move(recorded.result)};
    }
  }
  for (SimulatedRecording& result : results) {
    out.saturated += result.saturated;
    out.failure = std::move(result.failure);
    out.recordings.push_back(std::move(result.recording));
  }
  out.recording = out.recordings.front();
  return out;
}

Trajectory excite(const Model& model, double duration, double period, int harmonics, double rate,
                  std::uint64_t seed, double position_share, double velocity_share,
                  double effort_share, double half_range, double velocity, double half_stroke,
                  double slide_velocity) {
  return random_fourier(model, {.duration = duration,
                                .period = period,
                                .harmonics = harmonics,
                                .rate = rate,
                                .seed = seed,
                                .position_share = position_share,
                                .velocity_share = velocity_share,
                                .effort_share = effort_share,
                                .half_range = half_range,
                                .velocity = velocity,
                                .half_stroke = half_stroke,
                                .slide_velocity = slide_velocity});
}

using Limits = std::map<std::string, double>;

Excitation design(const Model& model, double duration, double period, int harmonics, double rate,
                  std::uint64_t seed, int iterations,
                  const std::map<std::string, std::pair<double, double>>& position,
                  const Limits& velocity, const Limits& acceleration, const Limits& torque,
                  const std::vector<double>& noise) {
  DesignOptions options;
  options.motion.duration = duration;
  options.motion.period = period;
  options.motion.harmonics = harmonics;
  options.motion.rate = rate;
  options.motion.seed = seed;
  options.iterations = iterations;
  options.limits = {position, velocity, acceleration, torque};
  options.noise = noise;
  options.progress = [](const FitProgress&) {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() == 0) return true;
    PyErr_Clear();  // the best so far is returned
    return false;
  };
  const py::gil_scoped_release release;
  return design_excitation(model, options);
}

}  // namespace

void bind_sim(py::module_& m) {
  value_type<Simulation>(m);
  m.def("_simulate", &simulate, "model"_a, "trajectory"_a, "world"_a, "seed"_a, "noise"_a, "rate"_a,
        "kp"_a, "kd"_a, "bandwidth"_a, "damping"_a, "gravity_compensation"_a, "period"_a,
        "flight"_a);
  const FourierOptions o;
  m.def("excite", &excite, "model"_a, py::kw_only(), "duration"_a = o.duration,
        "period"_a = o.period, "harmonics"_a = o.harmonics, "rate"_a = o.rate, "seed"_a = o.seed,
        "position_share"_a = o.position_share, "velocity_share"_a = o.velocity_share,
        "effort_share"_a = o.effort_share, "half_range"_a = o.half_range, "velocity"_a = o.velocity,
        "half_stroke"_a = o.half_stroke, "slide_velocity"_a = o.slide_velocity,
        py::call_guard<py::gil_scoped_release>(),
        "Random periodic motion within the model's limits: a finite Fourier series per joint with "
        "a motor. Loops close along it.\n\n"
        "``duration``, ``period`` [s]; ``harmonics``, 3 at least; ``rate`` of the rows [Hz]; "
        "``…_share`` of the limits\n"
        "that is used. Where the model states none: ``half_range`` [rad], ``velocity`` [rad/s], "
        "``half_stroke`` [m],\n"
        "``slide_velocity`` [m/s].");
  value_type<LimitUse>(m);
  using E = Excitation;
  value_type<E>(m);
  const DesignOptions d;
  m.def("design_excitation", &design, "model"_a, py::kw_only(), "duration"_a = d.motion.duration,
        "period"_a = d.motion.period, "harmonics"_a = d.motion.harmonics, "rate"_a = d.motion.rate,
        "seed"_a = d.motion.seed, "iterations"_a = d.iterations,
        "position_limits"_a = std::map<std::string, std::pair<double, double>>{},
        "velocity_limits"_a = Limits{}, "acceleration_limits"_a = Limits{},
        "torque_limits"_a = Limits{}, "noise"_a = std::vector<double>{},
        "D-optimal periodic motion within limits that hold between the rows, too: what `diffnea "
        "excite` writes.\n\n"
        "``duration``, ``period`` [s]; ``harmonics``, 3 at least; ``rate`` of the rows [Hz]; "
        "``iterations`` of the\n"
        "search, 0: the best random motion. ``…_limits`` by joint, ``\"\"`` for all, in place of "
        "the model's. ``noise`` of\n"
        "each joint's torque; ratios alone count. Ctrl-C returns the best so far.\n\n"
        "Of a model whose constraints close loops as many joints with a motor lead as there are "
        "motions; ``…_limits`` by\nname hold for those that follow, too. Raises "
        ":class:`ModelError` if the loops close nowhere within the limits.");
  m.def("_worlds", [] { return parse_json(worlds_json()); });
}

}  // namespace diffnea::python
