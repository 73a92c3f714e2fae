#pragma once
/// An arm whose recording is clean, for tests of the audit to put faults into.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/random.hpp>
#include <diffnea/recording/audit.hpp>

namespace diffnea::test {

inline constexpr double kPi = std::numbers::pi;
inline constexpr int kJoints = 3;
inline constexpr double kPeriod = 8.0;

/// A joint's motion: a Fourier series with known derivatives.
struct Series {
  double center = 0.0, period = kPeriod;
  std::vector<double> a, b;

  /// Derivative of order 0, 1 or 2 at time t.
  double at(double t, int order) const {
    double sum = order == 0 ? center : 0.0;
    for (std::size_t k = 0; k < a.size(); ++k) {
      const double w = 2.0 * kPi * static_cast<double>(k + 1) / period;
      const double phase = w * t + 0.5 * kPi * order;
      sum += std::pow(w, order) * (a[k] * std::sin(phase) + b[k] * std::cos(phase));
    }
    return sum;
  }
};

struct Arm {
  std::vector<Series> motion;
  Recording recording;
};

/// Torque of an arm whose joints are coupled by gravity and inertia, with friction at each.
inline double torque(const Arm& arm, int j, double t) {
  double load = 0.0, acceleration = 0.0, angle = 0.0;
  for (int i = 0; i < kJoints; ++i) {
    angle += arm.motion[i].at(t, 0);
    if (i >= j) load += (5.0 - i) * std::sin(angle);
    acceleration +=
        (i == j ? 0.6 : 0.25 * std::cos(arm.motion[i].at(t, 0))) * arm.motion[i].at(t, 2);
  }
  const double v = arm.motion[j].at(t, 1);
  return load + acceleration + (1.0 + 0.3 * j) * std::tanh(v / 0.01) + 0.4 * v;
}

/// 40 s at 250 Hz; noise of q 2e-5 rad, of q̇ 2 mrad/s, of τ 0.05 N·m.
inline Arm clean_arm(unsigned seed, bool noise = true, double period = kPeriod) {
  Arm arm;
  Rng rng(seed + 7000);
  for (int j = 0; j < kJoints; ++j) {
    Series s;
    s.period = period;
    s.center = rng.uniform(-0.5, 0.5);
    for (int k = 1; k <= 6; ++k) {
      s.a.push_back(0.3 * rng.normal() / k);
      s.b.push_back(0.3 * rng.normal() / k);
    }
    arm.motion.push_back(s);
  }
  Recording& r = arm.recording;
  const long rows = 10'000;
  r.source = "arm.csv";
  r.joint_names = {"shoulder", "elbow", "wrist"};
  r.has_tau.assign(kJoints, true);
  r.info.torque_sampling = TorqueSampling::kInstant;
  r.time.resize(rows);
  r.q.resize(rows, kJoints);
  r.qd = r.qcmd = r.tau = r.q;
  const double scale = noise ? 1.0 : 0.0;
  for (long i = 0; i < rows; ++i) {
    const double t = 0.004 * static_cast<double>(i);
    r.time[i] = t;
    for (int j = 0; j < kJoints; ++j) {
      r.qcmd(i, j) = arm.motion[j].at(t, 0);
      r.q(i, j) = arm.motion[j].at(t, 0) + scale * 2e-5 * rng.normal();
      r.qd(i, j) = arm.motion[j].at(t, 1) + scale * 2e-3 * rng.normal();
      r.tau(i, j) = torque(arm, j, t) + scale * 0.05 * rng.normal();
    }
  }
  return arm;
}

inline std::vector<ChannelFault> found(const Recording& r, const AuditLimits& limits = {}) {
  return audit({r}, limits).faults;
}

inline std::string names(const std::vector<ChannelFault>& faults) {
  std::string out;
  for (const ChannelFault& f : faults) out += f.fault + " " + f.channel + ": " + f.evidence + "\n";
  return out;
}

/// The one fault there is, of the given name and channel.
inline ChannelFault only(const std::vector<ChannelFault>& faults, const std::string& fault,
                         const std::string& channel) {
  INFO(names(faults));
  REQUIRE(faults.size() == 1);
  CHECK(faults[0].fault == fault);
  CHECK(faults[0].channel == channel);
  CHECK(!faults[0].evidence.empty());
  const auto known = audit_fault_names();
  CHECK(std::ranges::any_of(known, [&](const auto& k) { return k.first == faults[0].fault; }));
  return faults[0];
}

/// Of a value with a standard error: 5 of them (12 checks of 5 σ fail by chance once in 10⁵ runs),
/// and a share for what is no noise.
inline void check_near(const ChannelFault& f, double value, double share = 0.0) {
  CAPTURE(f.value, f.std, value);
  CHECK(std::abs(f.value - value) < 5.0 * f.std + share * std::abs(value));
}

}  // namespace diffnea::test
