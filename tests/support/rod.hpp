#pragma once
/// A rod with a drive, and recordings of it by closed forms, with a torque that a test adds.

#include <cmath>

#include <diffnea/core/random.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/recording/recording.hpp>

namespace diffnea::test {

constexpr double kRodFriction = 0.5;  ///< dry [N·m]

/// A rod with a rotor, viscous and dry friction.
inline Model rod() {
  return model_from_json(R"({"schema": "diffnea/model/1", "name": "rod", "gravity": [0, 0, -9.81],
    "links": [{"name": "rod", "joint": {"name": "rod", "type": "revolute", "axis": [0, 1, 0]},
               "inertia": {"mass": 2, "com": [0, 0, -0.3],
                           "about_com": [0.02, 0, 0, 0.02, 0, 0.002]}}],
    "effects": [
      {"effect": "armature", "where": "rod", "parameters": [{"name": "armature", "value": 0.01}]},
      {"effect": "viscous_friction", "where": "rod",
       "parameters": [{"name": "viscous", "value": 0.1}]},
      {"effect": "coulomb_friction", "where": "rod",
       "parameters": [{"name": "coulomb", "value": 0.5}]}]})",
                         "rod");
}

/// 20 s of five sines, at 250 Hz, as a sensor of torque sees them.
/// @param dry  torque [N·m] of dry friction, and of all that the model lacks, by q, q̇, q̈
template <class Torque>
Recording rod_recording(unsigned seed, const Torque& dry) {
  constexpr double kStep = 0.004, kTorqueNoise = 0.03, kEncoder = 1e-5;
  Rng rng(seed);
  Recording r;
  r.source = "rod";
  r.joint_names = {"rod"};
  r.has_tau = {true};
  r.info.torque_sampling = TorqueSampling::kInstant;
  const long rows = 5000;
  r.time = VecX<double>::LinSpaced(rows, 0.0, kStep * static_cast<double>(rows - 1));
  r.q = r.tau = RowMatX<double>::Zero(rows, 1);
  VecX<double> q = VecX<double>::Zero(rows), qd = q, qdd = q;
  for (int k = 1; k <= 5; ++k) {
    const double w = 2.0 * M_PI * rng.uniform(0.2, 1.5), phase = rng.uniform(0.0, 2.0 * M_PI);
    const double a = 2.4 / (static_cast<double>(k) * w);
    const Eigen::ArrayXd angle = w * r.time.array() + phase;
    q.array() += a * angle.sin();
    qd.array() += a * w * angle.cos();
    qdd.array() -= a * w * w * angle.sin();
  }
  for (long i = 0; i < rows; ++i) {
    r.q(i, 0) = q[i] + kEncoder * rng.normal();
    r.tau(i, 0) = 0.21 * qdd[i] + 2.0 * 9.81 * 0.3 * std::sin(q[i]) + 0.1 * qd[i] +
                  dry(q[i], qd[i], qdd[i]) + kTorqueNoise * rng.normal();
  }
  return r;
}

}  // namespace diffnea::test
