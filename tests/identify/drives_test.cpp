/// Drives that follow commands by themselves, fitted to logs without a torque.

#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>
#include <catch2/matchers/catch_matchers_string.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>

#include "recording/held_rows.hpp"
#include "support/servo_bench.hpp"

namespace diffnea::drives_test {
namespace {

/// A pendulum on a servo, by its own equation: none of the library's dynamics.
struct Bench {
  double mass = 0.5, length = 0.1, inertia = 0.001;  // about the center of mass
  double stiffness = 12.0, damping = 0.5, delay = 0.02, reach = 0.25, speed = 4.0;
  double armature = 0.02, coulomb = 0.08;
  double load = 0.0;  // share of the torque at the arm that friction takes
  double stop = std::numeric_limits<double>::infinity();  // which the arm does not pass [rad]
  std::function<double(double)> supply;  // over time [s], [V]; nominal: 7.4; empty: not logged
  /// Velocity and torque told beside positions, over time [s]; empty: none.
  std::function<double(double)> velocity, torque;
  double velocity_gain = 0.3;  // of the velocity
  double derivative = 0.0;     // time of what of the damping is within the reach

  Model model() const { return test::servo_bench(mass, length, inertia); }

  /// Velocity a step later, under what the drive gives and what holds the arm still.
  /// @param J  of the arm, without the rotor
  double after(double v, double drive, double weight, double J, double h) const {
    double sign = v > 0.0 ? 1.0 : -1.0;
    if (v == 0.0) {
      if (std::abs(drive - weight) <= coulomb + load * std::abs(weight)) return 0.0;
      sign = drive > weight ? 1.0 : -1.0;
    }
    double rate = 0.0;
    for (const double of_torque : {1.0, -1.0}) {  // sign of J rate + weight
      const double share = 1.0 + load * sign * of_torque;
      rate = (drive - sign * coulomb - share * weight) / (armature + share * J);
      if (of_torque * (J * rate + weight) >= 0.0) break;
    }
    return (v + h * rate) * sign < 0.0 ? 0.0 : v + h * rate;
  }

  /// 100 Hz, commands that are held, encoder of 12 bits, friction that holds: velocity stops where friction can stop it.
  /// @param gain  over the model's
  Recording record(double amplitude, double rate, double gain, double seconds, int run) const {
    return record(
        [&](double t) {
          if (t < 0.5) return 0.0;
          return amplitude * (t < 0.6 * seconds ? std::sin(rate * (t - 0.5) * (t - 0.5))
                                                : (std::fmod(t, 1.6) < 0.8 ? 1.0 : -0.4));
        },
        gain, seconds, run);
  }

  /// @param told   command over time [s], [rad]
  /// @param begin  position at rest [rad]
  Recording record(const std::function<double(double)>& told, double gain, double seconds, int run,
                   double begin = 0.0) const {
    constexpr int kFine = 100;  // steps a row
    const double row = 0.01, h = row / kFine;
    const long rows = std::lround(seconds / row);
    Recording r = test::blank_servo_log(rows);
    r.source = "bench, run " + std::to_string(run);
    r.run = run;
    r.info.controller = {{"servo", "gain", gain}};
    if (supply) r.extra.push_back({"voltage [mV]", VecX<double>(rows)});
    if (velocity) r.qdcmd.resize(rows, 1);
    if (torque) r.taucmd.resize(rows, 1);
    const double step = 2.0 * M_PI / 4096.0, J = inertia + mass * length * length;
    double q = begin, v = 0.0, setpoint = told(0.0);
    const std::size_t late_by = static_cast<std::size_t>(std::lround(delay / h));
    std::vector<double> past(late_by, setpoint), fed_past(late_by, 0.0);
    std::size_t oldest = 0;
    for (long k = 0; k < rows; ++k) {
      const double t = row * static_cast<double>(k), c = told(t);
      r.time[k] = t;
      r.q(k, 0) = step * std::round(q / step);
      r.qcmd(k, 0) = c;
      if (supply) r.extra[0].values[k] = 1e3 * supply(t);
      if (velocity) r.qdcmd(k, 0) = velocity(t);
      if (torque) r.taucmd(k, 0) = torque(t);
      const double fed =
          (velocity ? velocity_gain * velocity(t) : 0.0) + (torque ? torque(t) : 0.0);
      for (int i = 0; i < kFine; ++i) {
        setpoint += std::clamp(c - setpoint, -speed * h, speed * h);
        const double late = past[oldest];
        past[oldest] = setpoint;
        const double late_fed = std::exchange(fed_past[oldest], fed);
        oldest = (oldest + 1) % past.size();
        const double strength = supply ? supply(t + i * h) / 7.4 : 1.0;
        const double asked = std::clamp(gain * (late - q) - derivative * v, -reach, reach);
        const double drive =
            strength * stiffness * asked - (damping - stiffness * derivative) * v + late_fed;
        v = after(v, drive, mass * 9.81 * length * std::sin(q), J, h);
        q += h * v;
        if (q > stop) q = stop, v = 0.0;
      }
    }
    return r;
  }
};

bool says(const IdentifyResult& result, const std::string& words) {
  return std::ranges::any_of(
      result.notes, [&](const std::string& note) { return note.find(words) != std::string::npos; });
}

double find_parameter(const EffectSpec& effect, const char* name) {
  return std::ranges::find(effect.parameters, name, &EffectParameter::name)->value;
}

double value(const IdentifyResult& result, const std::string& end) {
  return test::estimate(result, end).value;
}

}  // namespace

TEST_CASE("identify: a servo's law from commands and positions alone, runs of two gains and loads",
          "[identify]") {
  const double load = GENERATE(0.0, 0.3);
  Bench bench;
  bench.load = load;
  Bench loaded = bench;
  loaded.mass += 0.2;  // at the arm's center of mass
  Recording second = loaded.record(0.7, 3.0, 2.0, 6.0, 1);
  second.info.payload = HeldBody{"weight", "servo", 0.2, std::array{0.0, 0.0, -bench.length},
                                 std::array{0.0, 0.0, 0.0, 0.0, 0.0, 0.0}};
  IdentifyOptions options;
  if (load > 0.0)
    options.choice.effects = {"position_servo", "armature", "coulomb_friction", "load_friction"};
  const IdentifyResult result =
      identify(bench.model(),
               {bench.record(1.0, 1.5, 1.0, 6.0, 0), second},
               {bench.record(0.9, 2.2, 1.5, 6.0, 0)}, options);
  std::vector<std::pair<const char*, double>> truth{
      {"position_servo.stiffness", bench.stiffness}, {"position_servo.delay", bench.delay},
      {"position_servo.reach", bench.reach},         {"position_servo.speed", bench.speed},
      {"position_servo.damping", bench.damping},
      {"armature.armature", bench.armature},
      {"coulomb_friction.coulomb", bench.coulomb}};
  if (load > 0.0) truth.emplace_back("load_friction.mu", load);
  for (const auto& [name, is] : truth) {
    CAPTURE(load, name, is, value(result, name));
    // Dry friction is smoothed over 0.01 rad/s, and holds two steps of the encoder.
    const double share = std::string(name).starts_with("coulomb") ? 0.1 : 0.05;
    CHECK(std::abs(value(result, name) - is) < share * is);
  }
  REQUIRE(result.errors.size() == 1);
  CHECK(result.errors[0].test < 1.5e-3);  // an encoder's step
  CHECK(result.errors[0].nominal_test > 0.1);
  CHECK(result.notes.front().find("no torque was recorded at servo") != std::string::npos);
}

TEST_CASE("identify: rows in which a stop holds the joint do not count", "[identify]") {
  Bench bench;
  bench.reach = bench.speed = 1e3;
  const auto told = [](double t) { return 1.3 * std::sin(1.2 * t) + 0.1 * std::sin(5.0 * t); };
  const std::vector<Recording> test{bench.record(told, 1.0, 8.0, 0)};
  bench.stop = 0.7;
  const Recording train = bench.record(told, 1.0, 12.0, 0);
  const IdentifyResult result = identify(bench.model(), {train}, test);
  CHECK(says(result, "servo is held near 0.69"));
  CHECK_FALSE(says(result, "held out, do not count"));
  for (const auto& [name, is] : {std::pair{"position_servo.stiffness", bench.stiffness},
                                 {"position_servo.damping", bench.damping},
                                 {"position_servo.delay", bench.delay},
                                 {"armature.armature", bench.armature}}) {
    CAPTURE(name, is, value(result, name));
    CHECK(std::abs(value(result, name) - is) < 0.05 * is);
  }
  CHECK(result.errors[0].test < 1.5e-3);  // an encoder's step
  // Every row is one whose command the arm could have followed, or is left out.
  double seconds = 0.0;
  for (const detail::HeldRows& held : detail::find_held({train}, 0)) {
    CHECK(std::abs(held.at - bench.stop) < 1.5e-3);
    CHECK(train.qcmd.col(0).segment(held.first, held.rows).maxCoeff() > bench.stop);
    seconds += 0.01 * static_cast<double>(held.rows);
  }
  const double beyond = 0.01 * static_cast<double>((train.qcmd.array() > bench.stop).count());
  CHECK(std::abs(seconds - beyond) < 0.3 * beyond);
  Recording off = train;  // a drive that is off holds nothing back
  off.extra = {{"torque_enable", VecX<double>::Zero(off.rows())}};
  CHECK(detail::find_held({off}, 0).empty());
}

TEST_CASE("identify: neither friction nor a weak drive is a stop", "[identify]") {
  Bench bench;
  const auto told = [](double t) { return 2.0 * std::sin(0.8 * t) + 0.4 * std::sin(3.0 * t); };
  SECTION("a drive that cannot lift its load") {
    bench.mass = 1.0;  // 0.98 N·m at the most, of which the drive has 0.6
    bench.reach = 0.05;
  }
  SECTION("friction that holds a soft drive") { bench.coulomb = 0.5, bench.stiffness = 3.0; }
  SECTION("friction of the load") { bench.load = 0.6, bench.mass = 1.0, bench.stiffness = 4.0; }
  SECTION("a slow drive") { bench.speed = 0.5; }
  CHECK(detail::find_held({bench.record(told, 1.0, 30.0, 0)}, 0).empty());
}

TEST_CASE("identify: a drive that is told velocities and torques beside positions", "[identify]") {
  Bench bench;
  bench.reach = bench.speed = 1e3;
  bench.velocity = [](double t) { return 2.0 * std::cos(2.0 * t); };
  bench.torque = [](double t) { return 0.4 * (std::fmod(t, 1.3) < 0.6 ? 1.0 : -0.7); };
  const auto told = [](double t) { return std::sin(2.0 * t); };
  const std::vector<Recording> train{bench.record(told, 1.0, 8.0, 0)};
  Bench other = bench;
  other.torque = [](double t) { return 0.3 * (std::fmod(t, 0.9) < 0.3 ? -1.0 : 1.0); };
  const std::vector<Recording> test{other.record(told, 1.0, 8.0, 0)};
  const IdentifyResult result = identify(bench.model(), train, test);
  for (const auto& [name, is] : {std::pair{"position_servo.stiffness", bench.stiffness},
                                 {"position_servo.damping", bench.damping},
                                 {"position_servo.delay", bench.delay},
                                 {"feed_forward.damping", bench.velocity_gain},
                                 {"feed_forward.share", 1.0},
                                 {"armature.armature", bench.armature}}) {
    const ParameterEstimate& e = test::estimate(result, name);
    CAPTURE(name, is, e.value, e.std);
    CHECK(std::abs(e.value - is) < 0.05 * is);
  }
  CHECK(result.errors[0].test < 1.5e-3);  // an encoder's step
  // One that does not know of the torque is told what it leaves out.
  IdentifyOptions options;
  options.choice.effects = {"position_servo", "armature", "coulomb_friction"};
  const IdentifyResult without = identify(bench.model(), train, test, options);
  CHECK(without.errors[0].test > 10.0 * result.errors[0].test);
  CHECK(says(without, "add feed_forward to --effects"));
  // Where none was logged, nothing of it is in the model.
  Bench plain = bench;
  plain.velocity = plain.torque = {};
  const IdentifyResult of_plain =
      identify(plain.model(), {plain.record(1.0, 1.5, 1.0, 6.0, 0)}, {});
  CHECK(std::ranges::none_of(of_plain.model.effects,
                             [](const EffectSpec& e) { return e.effect == "feed_forward"; }));
}

TEST_CASE("identify: a drive that follows the supply that was logged", "[identify]") {
  Bench bench;
  bench.reach = bench.speed = 1e3;
  bench.supply = [](double t) { return 7.4 * (1.0 - 0.02 * t + 0.1 * std::sin(2.0 * t)); };
  const Model model = bench.model();
  const Recording train = bench.record(0.8, 1.5, 1.0, 12.0, 0);
  IdentifyOptions options;
  options.choice.effects = {"position_servo", "armature", "coulomb_friction", "supply_sag"};
  const auto fitted = [&](const Recording& data) { return identify(model, {data}, {}, options); };
  const IdentifyResult result = fitted(train);
  const ParameterEstimate share = test::estimate(result, "supply_sag.share");
  CHECK(share.std < 0.1);
  CHECK(std::abs(share.value - 1.0) < 3.0 * share.std + 0.02);  // 2 %: smoothed friction creeps
  // The median of the run, whose middle is at 6 s.
  CHECK(std::abs(value(result, "supply_sag.nominal") - bench.supply(6.0)) < 0.5);
  Recording unlogged = train;
  unlogged.extra.clear();
  CHECK_THROWS_WITH(fitted(unlogged), Catch::Matchers::ContainsSubstring("voltage_servo [V]"));
  Recording dead = train;  // the column is there
  dead.extra[0].values.setZero();
  CHECK_THROWS_WITH(fitted(dead), Catch::Matchers::ContainsSubstring("no row has one"));
}

TEST_CASE("identify: a rotor that rules what the joint feels", "[identify]") {
  Bench bench;  // A wrist: next to nothing hangs on its gear.
  bench.mass = 0.01;
  bench.length = 0.02;
  bench.inertia = 2e-6;
  bench.reach = 100.0;
  bench.speed = 1e4;
  bench.damping = 1.5;
  bench.coulomb = 0.01;  // friction that sticks holds an encoder step
  const IdentifyResult result = identify(bench.model(), {bench.record(0.6, 1.5, 1.0, 6.0, 0)},
                                         {bench.record(0.45, 2.2, 1.0, 6.0, 0)}, {});
  CHECK(result.errors[0].test < 1.5e-3);  // an encoder's step
  // The links' weight moves it by 0.1 mrad and hardly tells the scale, the motion what is over
  // what.
  const double rotor = value(result, "armature.armature");
  CAPTURE(rotor);
  CHECK(rotor > 1000.0 * bench.inertia);
  CHECK(std::abs(value(result, "position_servo.stiffness") / rotor -
                 bench.stiffness / bench.armature) < 0.02 * bench.stiffness / bench.armature);
  CHECK(std::abs(value(result, "position_servo.damping") / rotor - bench.damping / bench.armature) <
        0.02 * bench.damping / bench.armature);
}

TEST_CASE("identify: friction and gains that the description has are where a drive's fit begins",
          "[identify]") {
  const Bench bench;
  Model model = bench.model();
  model.links[1].servo = ServoGains{30.0, 0.0};
  model.effects = {{"viscous_friction", "servo", {{"viscous", 0.9, "N*m*s/rad"}}}};
  const IdentifyResult result = identify(model, {bench.record(1.0, 1.5, 1.0, 6.0, 0)},
                                         {bench.record(0.9, 2.2, 1.0, 6.0, 0)}, {});
  const auto prior = [&](const char* end) {
    for (const ParameterEstimate& p : result.parameters)
      if (p.name.ends_with(end)) return p.prior;
    return -1.0;
  };
  CHECK(prior("position_servo.stiffness") == 30.0);
  CHECK(prior("position_servo.damping") == 0.9);
  CHECK(prior("viscous_friction.viscous") == -1.0);  // one with the drive's
  CHECK(std::abs(value(result, "position_servo.stiffness") - bench.stiffness) <
        0.05 * bench.stiffness);
  CHECK(std::abs(value(result, "position_servo.damping") - bench.damping) < 0.05 * bench.damping);
  CHECK(result.errors[0].test < 1.5e-3);
}

TEST_CASE("identify: a largest torque of the description stays, unless runs refute it",
          "[identify]") {
  Bench bench;
  bench.reach = 100.0;
  bench.speed = 1e4;
  Model model = bench.model();
  model.links[1].servo = ServoGains{30.0, 0.0};
  const auto fitted = [&](double torque) {
    model.links[1].limits.effort = torque;
    return identify(model, {bench.record(0.6, 1.5, 1.0, 6.0, 0)},
                    {bench.record(0.5, 2.2, 1.0, 6.0, 0)}, {});
  };
  const auto largest = [](const IdentifyResult& of) {
    for (const EffectSpec& e : of.model.effects)
      if (e.effect == "position_servo")
        return find_parameter(e, "stiffness") * find_parameter(e, "reach");
    return 0.0;
  };
  const IdentifyResult unreached = fitted(40.0);
  CHECK(std::abs(largest(unreached) - 40.0) < 1e-9);
  CHECK(test::estimate(unreached, "reach").fixed);
  CHECK(says(unreached, "the largest torque of the description stays where no run tells of it"));
  const IdentifyResult beyond = fitted(2.0);
  CHECK(value(beyond, "reach") == 1000.0);
  CHECK(says(beyond, "is left out where runs are simulated better without it"));
}

TEST_CASE("identify: where links tell no scale, the description's gain sets it", "[identify]") {
  Bench bench;  // a wrist that nothing hangs on, its axis upright
  bench.mass = 0.01;
  bench.length = 0.0;
  bench.inertia = 2e-6;
  bench.reach = 100.0;
  bench.speed = 1e4;
  bench.damping = 1.5;
  bench.coulomb = 0.01;
  Model model = bench.model();
  model.links[1].servo = ServoGains{30.0, 1.0};
  const IdentifyResult result = identify(model, {bench.record(0.6, 1.5, 1.0, 6.0, 0)}, {}, {});
  const double stiffness = value(result, "position_servo.stiffness");
  CAPTURE(stiffness);
  CHECK(stiffness > 10.0);
  CHECK(stiffness < 90.0);
  CHECK(std::abs(value(result, "position_servo.damping") / stiffness -
                 bench.damping / bench.stiffness) < 0.03 * bench.damping / bench.stiffness);
  CHECK_FALSE(test::estimate(result, "stiffness").identifiable);
  CHECK(says(result, "the links do not tell how large the gain"));
}

TEST_CASE("identify: what positions cannot tell of a drive is refused, with what to do",
          "[identify]") {
  using Catch::Matchers::ContainsSubstring;
  const Bench bench;
  Recording unknown = bench.record(1.0, 1.5, 1.0, 3.0, 0);
  unknown.info.payload = HeldBody{"", "servo", {}, {}, {}};
  CHECK_THROWS_WITH(identify(bench.model(), {unknown}, {}, {}),
                    ContainsSubstring("payload.mass") && ContainsSubstring("only their ratio"));
  Recording off = bench.record(1.0, 1.5, 1.0, 3.0, 0);
  off.extra.push_back({"torque_enable", VecX<double>::Zero(off.rows())});
  CHECK_THROWS_WITH(identify(bench.model(), {off}, {}, {}),
                    ContainsSubstring("off in every row") && ContainsSubstring("--passive servo"));
}

TEST_CASE("identify: a drive without gain is refused, with what to do", "[identify]") {
  const Bench bench;
  CHECK_THROWS_WITH(identify(bench.model(), {bench.record(1.0, 1.5, 0.0, 1.0, 0)}, {}, {}),
                    Catch::Matchers::ContainsSubstring("controller.servo.gain") &&
                        Catch::Matchers::ContainsSubstring("torque_enable"));
}

TEST_CASE("identify: a drive that saturates in most rows is named, its largest torque told",
          "[identify]") {
  Bench bench;
  bench.reach = 0.07;
  bench.speed = 1e4;
  const auto told = [](double t) { return 1.2 * std::sin(2.2 * t) + std::sin(3.7 * t); };
  const IdentifyResult result = identify(bench.model(), {bench.record(told, 1.0, 20.0, 0)}, {}, {});
  CHECK(says(result, "gives all that it can in "));
  const double largest = bench.stiffness * bench.reach,
               found = value(result, "position_servo.stiffness") *
                       value(result, "position_servo.reach");
  CAPTURE(found, largest);
  CHECK(std::abs(found - largest) < 0.05 * largest);
  for (const auto& [name, is] : {std::pair{"position_servo.damping", bench.damping},
                                 {"armature.armature", bench.armature}}) {
    CAPTURE(name, is, value(result, name));
    CHECK(std::abs(value(result, name) - is) < 0.05 * is);
  }
}

TEST_CASE("identify: damping within a drive's largest torque, and beyond it", "[identify]") {
  Bench bench;
  bench.speed = 1e4;
  bench.reach = 0.15;
  bench.derivative = GENERATE(0.0, 0.03);
  const IdentifyResult result =
      identify(bench.model(), {bench.record(0.8, 3.0, 1.0, 12.0, 0)}, {}, {});
  for (const auto& [name, is] : {std::pair{"position_servo.stiffness", bench.stiffness},
                                 {"position_servo.reach", bench.reach},
                                 {"position_servo.damping", bench.damping}}) {
    CAPTURE(bench.derivative, name, is, value(result, name));
    CHECK(std::abs(value(result, name) - is) < 0.03 * is);
  }
  CHECK(std::abs(value(result, "derivative_time") - bench.derivative) < 0.1 * 0.03);
}

TEST_CASE("identify: the gain of a drive that saturates in nine rows of ten", "[identify]") {
  Bench bench;
  bench.mass = 0.377;
  bench.length = 0.097;
  bench.stiffness = 21.6;
  bench.delay = 0.003;
  bench.armature = 0.023;
  bench.coulomb = 0.064;
  bench.reach = 0.047;
  bench.speed = 1e4;
  const auto wave = [](double t) {
    return 0.528 * std::sin(3.555 * t + 4.696) + 0.666 * std::sin(5.505 * t + 3.952) +
           0.607 * std::sin(2.442 * t + 3.681) + 0.685 * std::sin(3.464 * t + 1.804);
  };
  const auto told = [&](double t) { return (wave(t) - wave(0.0)) * std::min(1.0, 2.0 * t); };
  const IdentifyResult result = identify(bench.model(), {bench.record(told, 1.0, 20.0, 0)}, {}, {});
  for (const auto& [name, is] : {std::pair{"position_servo.stiffness", bench.stiffness},
                                 {"position_servo.reach", bench.reach},
                                 {"position_servo.damping", bench.damping},
                                 {"armature.armature", bench.armature}}) {
    CAPTURE(name, is, value(result, name));
    CHECK(std::abs(value(result, name) - is) < 0.05 * is);
  }
  CHECK(says(result, "gives all that it can in "));
  CHECK_FALSE(says(result, "not told apart"));
}

TEST_CASE("identify: a drive that saturates in every row is said to, or to reach no command",
          "[identify]") {
  Bench bench;
  bench.mass = 0.85;
  bench.length = 0.15;
  bench.reach = 0.1;
  bench.speed = 1e4;
  // Steps of 1.5 rad from side to side, each before the joint is there.
  Rng rng(5);
  std::vector<double> turns{0.0};
  while (turns.back() < 20.0) turns.push_back(turns.back() + rng.uniform(0.15, 0.5));
  const auto told = [&](double t) {
    return (std::ranges::upper_bound(turns, t) - turns.begin()) % 2 == 1 ? 1.5 : -1.5;
  };
  const IdentifyResult result = identify(bench.model(), {bench.record(told, 1.0, 20.0, 0)}, {}, {});
  CHECK((says(result, "gives all that it can in 100 % of the rows") ||
         says(result, "servo never gets near its commands")));
}

TEST_CASE("identify: a command that never changes holds the delay, and is named", "[identify]") {
  const Bench bench;
  const auto told = [](double) { return 0.3; };
  const IdentifyResult result =
      identify(bench.model(), {bench.record(told, 1.0, 4.0, 0, 1.2)}, {}, {});
  CHECK(says(result, "qcmd_servo never changes"));
  CHECK(test::estimate(result, "position_servo.delay").fixed);
}

TEST_CASE("identify: a joint that nothing drives has no gain, whatever was commanded",
          "[identify]") {
  Bench bench;
  bench.stiffness = 0.0;
  const auto told = [](double t) { return 0.5 * std::sin(2.0 * t) + 0.3 * std::sin(5.0 * t); };
  const IdentifyResult result =
      identify(bench.model(), {bench.record(told, 1.0, 6.0, 0, 1.0)}, {}, {});
  CHECK(says(result, "servo moves as if nothing drove it"));
  CHECK_FALSE(test::estimate(result, "position_servo.stiffness").identifiable);
}

TEST_CASE("identify: rows further apart than a drive's answer are named", "[identify]") {
  const Bench bench;
  const auto told = [](double t) { return 0.5 * std::sin(2.0 * t) + 0.3 * std::sin(5.0 * t); };
  Recording all = bench.record(told, 1.0, 20.0, 0), some = all;
  constexpr long kEvery = 20;
  const long rows = all.rows() / kEvery;
  some.time.resize(rows);
  some.q.resize(rows, 1);
  some.qcmd.resize(rows, 1);
  some.tau = RowMatX<double>::Constant(rows, 1, std::nan(""));
  for (long k = 0; k < rows; ++k) {
    some.time[k] = all.time[kEvery * k];
    some.q.row(k) = all.q.row(kEvery * k);
    some.qcmd.row(k) = all.qcmd.row(kEvery * k);
  }
  CHECK(says(identify(bench.model(), {some}, {}, {}), "rows are 200 ms apart"));
  CHECK_FALSE(says(identify(bench.model(), {all}, {}, {}), "Log faster"));
}

}  // namespace diffnea::drives_test
