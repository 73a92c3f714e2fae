#include <algorithm>
#include <cmath>
#include <memory>

#include "mechanisms.hpp"

namespace hidden {
namespace {

/// A smooth sign whose width the integrator can follow: its slope is a damping, strength / width,
/// on the joint's inertia.
struct Sign {
  double width, inertia;
  double operator()(double strength, double qd) const {
    return std::tanh(qd / std::max(width, std::abs(strength) / (1500.0 * inertia)));
  }
};

Sign draw_sign(const Draw& draw, int j) {
  return {draw.rng.log_uniform(0.003, 0.015) * (draw.link(j).slide ? 0.1 : 1.0),
          draw.scales.inertia[j]};
}

/// Opposes the motor with f(s, state) at one joint.
template <class F>
void oppose(Mechanism& h, int j, F f) {
  h.force = [j, f](double s, const State& x, double* qfrc) { qfrc[x.dof[j]] -= f(s, x); };
}

Mechanism at_joint(const std::string& effect, int j, const Draw& draw, double unit) {
  Mechanism h;
  h.effect = effect;
  h.where = draw.joint(j);
  h.joints = {j};
  h.start = 0.02 * draw.torque(j) / unit;
  return h;
}

Mechanism coulomb(int j, const Draw& draw) {
  Mechanism h = at_joint("coulomb_friction", j, draw, 1.0);
  h.parameters = [](double s) { return Json{{"coulomb", s}}; };
  if (draw.rng.chance(0.5)) {
    const Sign sign = draw_sign(draw, j);
    oppose(h, j, [j, sign](double s, const State& x) { return s * sign(s, x.qd[j]); });
  } else {
    // MuJoCo's own, as hard as its solver allows.
    h.configure = [j](double s, mjModel& m, const State& x) {
      const int i = x.dof[j];
      m.dof_frictionloss[i] = s;
      m.dof_solref[mjNREF * i] = 2.0 * m.opt.timestep;
      m.dof_solimp[mjNIMP * i] = m.dof_solimp[mjNIMP * i + 1] = 0.99;
    };
  }
  return h;
}

Mechanism viscous(int j, const Draw& draw) {
  Mechanism h = at_joint("viscous_friction", j, draw, draw.speed(j));
  h.configure = [j](double s, mjModel& m, const State& x) { m.dof_damping[x.dof[j]] = s; };
  h.parameters = [](double s) { return Json{{"viscous", s}}; };
  return h;
}

Mechanism quadratic(int j, const Draw& draw) {
  Mechanism h = at_joint("quadratic_friction", j, draw, draw.speed(j) * draw.speed(j));
  oppose(h, j, [j](double s, const State& x) { return s * x.qd[j] * std::abs(x.qd[j]); });
  h.parameters = [](double s) { return Json{{"quadratic", s}}; };
  return h;
}

Mechanism stribeck(int j, const Draw& draw) {
  Mechanism h = at_joint("stribeck_friction", j, draw, 1.0);
  const double v_s = draw.rng.log_uniform(0.08, 0.35) * draw.speed(j);
  const Sign sign = draw_sign(draw, j);
  oppose(h, j, [=](double s, const State& x) {
    const double r = x.qd[j] / v_s;
    return s * sign(s, x.qd[j]) * std::exp(-r * r);
  });
  h.parameters = [=](double s) { return Json{{"stiction_excess", s}, {"stribeck_velocity", v_s}}; };
  return h;
}

/// Of what the other direction has.
double draw_ratio(Rng& rng) { return rng.uniform(0.3, 0.75); }

Mechanism asymmetric_coulomb(int j, const Draw& draw) {
  Mechanism h = at_joint("asymmetric_coulomb", j, draw, 1.0);
  const double ratio = draw_ratio(draw.rng);
  const bool forward = draw.rng.chance(0.5);
  const double plus = forward ? 1.0 : ratio, minus = forward ? ratio : 1.0;
  const Sign sign = draw_sign(draw, j);
  oppose(h, j, [=](double s, const State& x) {
    return s * (x.qd[j] > 0.0 ? plus : minus) * sign(s, x.qd[j]);
  });
  h.parameters = [=](double s) {
    return Json{{"coulomb_positive", s * plus}, {"coulomb_negative", s * minus}};
  };
  return h;
}

Mechanism asymmetric_viscous(int j, const Draw& draw) {
  Mechanism h = at_joint("asymmetric_viscous", j, draw, draw.speed(j));
  const double ratio = draw_ratio(draw.rng);
  const bool forward = draw.rng.chance(0.5);
  const double plus = forward ? 1.0 : ratio, minus = forward ? ratio : 1.0;
  oppose(h, j,
         [=](double s, const State& x) { return s * (x.qd[j] > 0.0 ? plus : minus) * x.qd[j]; });
  h.parameters = [=](double s) {
    return Json{{"viscous_positive", s * plus}, {"viscous_negative", s * minus}};
  };
  return h;
}

Mechanism sublinear(int j, const Draw& draw) {
  Mechanism h = at_joint("sublinear_friction", j, draw, std::sqrt(draw.speed(j)));
  const Sign sign = draw_sign(draw, j);
  oppose(h, j, [=](double s, const State& x) {
    return s * sign(s, x.qd[j]) * std::sqrt(std::abs(x.qd[j]));
  });
  h.parameters = [](double s) { return Json{{"sublinear", s}}; };
  return h;
}

/// A share μ of the torque that reaches the link is lost in the gear: motor torque u = τ + μ|τ| s.
Mechanism load(int j, const Draw& draw) {
  Mechanism h = at_joint("load_friction", j, draw, draw.torque(j));
  h.limit = 0.5;
  const Sign sign = draw_sign(draw, j);
  const double torque = draw.torque(j);
  oppose(h, j, [=](double s, const State& x) {
    const double u = x.applied[j], turn = sign(s * torque, x.qd[j]);
    return u - u / (1.0 + s * turn * (u > 0.0 ? 1.0 : -1.0));
  });
  h.parameters = [](double s) { return Json{{"mu", s}}; };
  return h;
}

/// ż = q̇ − |q̇| z/x_s, torque F z/x_s. Under constant q̇ the exact solution over a step.
Mechanism dahl(int j, const Draw& draw) {
  Mechanism h = at_joint("presliding_dahl", j, draw, 1.0);
  const double x_s = draw.rng.log_uniform(0.02, 0.2) * draw.scales.position[j];
  const auto z = std::make_shared<double>(0.0);
  h.reset = [z] { *z = 0.0; };
  oppose(h, j, [z, x_s](double s, const State&) { return s * *z / x_s; });
  h.advance = [=](double, const State& x, double dt) {
    const double v = x.qd[j], end = v > 0.0 ? x_s : -x_s;
    *z = end + (*z - end) * std::exp(-std::abs(v) * dt / x_s);
  };
  h.parameters = [=](double s) { return Json{{"coulomb", s}, {"presliding", x_s}}; };
  return h;
}

/// ż = q̇ − σ₀|q̇| z/g(q̇), torque σ₀z + σ₁ż, g = F_c + (F_s − F_c) e^{−(q̇/v_s)²}; all forces in
/// proportion to the strength F_c.
Mechanism lugre(int j, const Draw& draw) {
  Mechanism h = at_joint("presliding_lugre", j, draw, 1.0);
  const double excess = draw.rng.uniform(1.1, 1.6);
  const double v_s = draw.rng.log_uniform(0.05, 0.2) * draw.speed(j);
  const double bend = draw.rng.log_uniform(0.01, 0.1) * draw.scales.position[j];   // F_c/σ₀
  const double time_constant = draw.rng.uniform(0.0, 0.3) * bend / draw.speed(j);  // σ₁/σ₀
  const auto z = std::make_shared<double>(0.0);
  const auto rate = std::make_shared<double>(0.0);
  const auto g = [=](double v) { return 1.0 + (excess - 1.0) * std::exp(-v * v / (v_s * v_s)); };
  h.reset = [=] { *z = *rate = 0.0; };
  oppose(h, j, [=](double s, const State&) { return s / bend * (*z + time_constant * *rate); });
  h.advance = [=](double, const State& x, double dt) {
    const double v = x.qd[j], end = (v > 0.0 ? bend : -bend) * g(v), before = *z;
    *z = end + (before - end) * std::exp(-std::abs(v) * dt / std::abs(end));
    *rate = (*z - before) / dt;
  };
  h.parameters = [=](double s) {
    return Json{{"sigma0", s / bend},
                {"sigma1", s / bend * time_constant},
                {"coulomb", s},
                {"stiction", s * excess},
                {"stribeck_velocity", v_s}};
  };
  return h;
}

Mechanism warm_up(int j, const Draw& draw) {
  Mechanism h = at_joint("warm_up", j, draw, 0.5 * draw.speed(j));
  const double time_constant = draw.rng.log_uniform(5.0, 40.0);
  oppose(h, j, [=](double s, const State& x) {
    return s * std::exp(-std::max(x.time, 0.0) / time_constant) * x.qd[j];
  });
  h.parameters = [=](double s) { return Json{{"viscous", s}, {"time_constant", time_constant}}; };
  return h;
}

struct Entry {
  const char* name;
  Mechanism (*make)(int, const Draw&);
};
constexpr Entry kEntries[] = {{"coulomb_friction", coulomb},
                              {"viscous_friction", viscous},
                              {"quadratic_friction", quadratic},
                              {"stribeck_friction", stribeck},
                              {"asymmetric_coulomb", asymmetric_coulomb},
                              {"asymmetric_viscous", asymmetric_viscous},
                              {"sublinear_friction", sublinear},
                              {"load_friction", load},
                              {"presliding_dahl", dahl},
                              {"presliding_lugre", lugre},
                              {"warm_up", warm_up}};

const Entry* find(const std::string& effect) {
  const auto* it = std::ranges::find_if(kEntries, [&](const Entry& e) { return e.name == effect; });
  return it == std::end(kEntries) ? nullptr : it;
}

}  // namespace

bool is_friction(const std::string& effect) { return find(effect) != nullptr; }
Mechanism friction(const std::string& effect, int joint, const Draw& draw) {
  return find(effect)->make(joint, draw);
}

}  // namespace hidden
