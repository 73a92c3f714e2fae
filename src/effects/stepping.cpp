#include <algorithm>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/effects/stepping.hpp>

namespace diffnea {
namespace {

[[noreturn]] void lacks(const BoundEffect& e, const char* what) {
  throw Error(e.info().name + " at '" + e.where + "' has no " + what);
}

template <class E>
constexpr bool kIsOfDrivePath =
    requires(const double* p, DrivePath<double>& path) { E::add_to_drive(p, path); };
template <class E>
constexpr bool kIsOfEncoder = requires(const double* p, Encoder& x) { E::add_to_encoder(p, x); };
template <class E>
constexpr bool kIsOfClock = requires(const double* p) { E::clock_shift(p); };
template <class E>
constexpr bool kIsOfLoggedVelocity =
    requires(const VecX<double>& qd, const double* p) { E::logged_velocity(qd, 0.0, p); };

}  // namespace

std::vector<int> joints_read(const BoundEffect& e) {
  std::vector<int> out = visit_formula(e, [&](const auto& formula) {
    if constexpr (requires { formula.joints_read(); }) return formula.joints_read();
    return e.joints;
  });
  for (const int encoder : e.encoders)
    if (std::ranges::find(out, encoder) == out.end()) out.push_back(encoder);
  return out;
}

bool names_joints(const BoundEffect& e) {
  return visit_formula(e, [](const auto& f) { return requires { f.joints_read(); }; });
}

bool has_state(const BoundEffect& e) {
  return visit_formula(e, []<class E>(const E&) { return JointStateEffect<E>; });
}

double advanced_state(const BoundEffect& e, double z, const Move& move) {
  return visit_formula(e, [&]<class E>(const E&) -> double {
    const double* p = e.parameters.data();
    if constexpr (JointStateEffect<E>) return advanced_over<E>(z, move, p);
    lacks(e, "state");
  });
}

double state_torque(const BoundEffect& e, double z, double qd) {
  return visit_formula(e, [&]<class E>(const E&) -> double {
    if constexpr (JointStateEffect<E>) return state_torque<E>(z, qd, e.parameters.data());
    lacks(e, "state");
  });
}

AtRest<double> at_rest(const BoundEffect& e) {
  return visit_formula(e, [&]<class E>(const E&) -> AtRest<double> {
    if constexpr (JointStateEffect<E>) return E::at_rest(e.parameters.data());
    lacks(e, "state");
  });
}

bool hides_motor(const BoundEffect& e) { return e.info().motor != HiddenMotor::kNone; }

bool encoder_at_motor(const BoundEffect& e) {
  return visit_formula(e, [&](const auto& formula) {
    const double* p = e.parameters.data();
    if constexpr (requires { formula.encoder_at_motor(p); }) return formula.encoder_at_motor(p);
    return false;
  });
}

MotorSpring<double> motor_spring(const BoundEffect& e) {
  return visit_formula(e, [&]<class E>(const E&) -> MotorSpring<double> {
    const double* p = e.parameters.data();
    if constexpr (requires { E::motor_spring(p); }) return E::motor_spring(p);
    lacks(e, "hidden motor");
  });
}

double transmitted(const BoundEffect& e, double deflection, double velocity) {
  return visit_formula(e, [&]<class E>(const E&) -> double {
    const double* p = e.parameters.data();
    if constexpr (requires { E::transmitted(deflection, velocity, p); })
      return E::transmitted(deflection, velocity, p);
    lacks(e, "hidden motor");
  });
}

double deflection_at(const BoundEffect& e, double load) {
  return visit_formula(e, [&]<class E>(const E&) -> double {
    const double* p = e.parameters.data();
    if constexpr (requires { E::deflection_at(load, p); }) return E::deflection_at(load, p);
    lacks(e, "hidden motor");
  });
}

JetD deflection_at(const BoundEffect& e, const JetD& load, const JetD* p) {
  return visit_formula(e, [&]<class E>(const E&) -> JetD {
    if constexpr (requires { E::deflection_at(load, p); }) return E::deflection_at(load, p);
    lacks(e, "hidden motor");
  });
}

bool add_to_drive(const BoundEffect& e, DrivePath<double>& path) {
  return visit_formula(e, [&]<class E>(const E&) {
    if constexpr (kIsOfDrivePath<E>) E::add_to_drive(e.parameters.data(), path);
    return kIsOfDrivePath<E>;
  });
}

bool is_of_drive_path(const BoundEffect& e) {
  return visit_formula(e, []<class E>(const E&) { return kIsOfDrivePath<E>; });
}

bool add_to_encoder(const BoundEffect& e, Encoder& encoder) {
  return visit_formula(e, [&]<class E>(const E&) {
    if constexpr (kIsOfEncoder<E>) E::add_to_encoder(e.parameters.data(), encoder);
    return kIsOfEncoder<E>;
  });
}

double clock_shift(const BoundEffect& e) {
  return visit_formula(e, [&]<class E>(const E&) -> double {
    if constexpr (kIsOfClock<E>) return E::clock_shift(e.parameters.data());
    return 0.0;
  });
}

VecX<double> logged_velocity(const BoundEffect& e, const VecX<double>& qd, double dt) {
  return visit_formula(e, [&]<class E>(const E&) -> VecX<double> {
    if constexpr (kIsOfLoggedVelocity<E>) return E::logged_velocity(qd, dt, e.parameters.data());
    return qd;
  });
}

bool is_of_log(const BoundEffect& e) {
  return e.info().port == Port::kBallView || visit_formula(e, []<class E>(const E&) {
           return kIsOfClock<E> || kIsOfLoggedVelocity<E>;
         });
}

bool is_simulated(const BoundEffect& e) {
  return visit_formula(e, [&]<class E>(const E&) {
    return JointStateEffect<E> || E::info().motor != HiddenMotor::kNone || kIsOfDrivePath<E> ||
           kIsOfEncoder<E> || kIsOfClock<E> || kIsOfLoggedVelocity<E>;
  });
}

std::optional<double> view_delay(const BoundEffect& e) {
  return visit_formula(e, [&](const auto& formula) -> std::optional<double> {
    const double* p = e.parameters.data();
    if constexpr (requires { formula.delay(p); }) return formula.delay(p);
    return std::nullopt;
  });
}

void add_to_anchor(const BoundEffect& e, Vec3<double>& p_LS) {
  visit_formula(e, [&](const auto& formula) {
    const double* p = e.parameters.data();
    if constexpr (requires { formula.add_to_anchor(p, p_LS); }) formula.add_to_anchor(p, p_LS);
  });
}

}  // namespace diffnea
