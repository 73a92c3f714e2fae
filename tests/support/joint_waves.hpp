#pragma once
/// Stretches of motion in closed form, for effects that remember or look ahead.

#include <cmath>
#include <functional>

#include <diffnea/effects/series.hpp>
#include <diffnea/io/model_file.hpp>

namespace diffnea::test {

constexpr double kDt = 1e-3;  ///< [s]
constexpr long kRows = 2001;  ///< 2 s
using Function = std::function<double(double)>;

inline VecX<double> sampled(const Function& f, double dt = kDt, long rows = kRows) {
  VecX<double> out(rows);
  for (long k = 0; k < rows; ++k) out[k] = f(static_cast<double>(k) * dt);
  return out;
}

inline Model wam() { return read_model(DIFFNEA_SOURCE_DIR "/models/wam4.xml"); }

/// Joint j: 0.6 sin(ω_j t + j) rad, with derivatives, at t + shift.
inline JointSeries waves(double shift = 0.0) {
  JointSeries x;
  x.dt = kDt;
  x.q.resize(kRows, 4);
  x.qd = x.qdd = x.q;
  for (int j = 0; j < 4; ++j) {
    const double w = 5.0 + 2.0 * j;
    const auto angle = [=](double t) { return w * (t + shift) + j; };
    x.q.col(j) = sampled([&](double t) { return 0.6 * std::sin(angle(t)); });
    x.qd.col(j) = sampled([&](double t) { return 0.6 * w * std::cos(angle(t)); });
    x.qdd.col(j) = sampled([&](double t) { return -0.6 * w * w * std::sin(angle(t)); });
  }
  return x;
}

/// One sliding joint without load: what effects on a single torque or motion need.
inline Model rail() {
  Model m;
  m.name = "rail";
  ModelLink link;
  link.name = "cart";
  link.joint = "slide";
  link.type = ModelJoint::kPrismatic;
  link.inertia.m = 2.0;
  m.links.push_back(link);
  return m;
}

inline JointSeries rail_series(const Function& q, const Function& qd, const Function& qdd) {
  JointSeries x;
  x.dt = kDt;
  x.q = sampled(q);
  x.qd = sampled(qd);
  x.qdd = sampled(qdd);
  return x;
}
inline JointSeries rail_at_rest() {
  const Function zero = [](double) { return 0.0; };
  return rail_series(zero, zero, zero);
}

inline RowMatX<double> torque_on_rail(const EffectSpec& spec, const JointSeries& x) {
  const Model model = rail();
  const BoundEffect e = bind(spec, model);
  return series_torque(e, make_tree(model), x, e.parameters.data());
}

}  // namespace diffnea::test
