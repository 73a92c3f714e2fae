/// The formula of an effect of one's own, before it goes into the catalogue: its torque, and that
/// its derivatives are those of the formula.
///
///     own_effect

#include <cmath>
#include <cstdio>

#include "end_stop.hpp"

int main() {
  using diffnea::JetD;
  const diffnea::EndStop formula;
  const int joint = 0;
  double worst = 0.0;
  for (const double q : {-2.0, -1.3, -0.4, 0.0, 0.7, 1.9}) {
    const double p[] = {5.0, 1.2};  // stiffness [N·m/rad], begin [rad]
    double tau = 0.0;
    formula.add_torque(diffnea::JointSample<double>{.q = &q}, &joint, p, &tau);

    JetD angle(q), parameters[] = {JetD(p[0]), JetD(p[1])}, out(0.0);
    angle.v[0] = parameters[0].v[1] = parameters[1].v[2] = 1.0;
    formula.add_torque(diffnea::JointSample<JetD>{.q = &angle}, &joint, parameters, &out);

    const bool beyond = std::abs(q) > p[1];
    const double side = q > 0.0 ? 1.0 : -1.0;
    const double expected[] = {beyond ? p[0] : 0.0, beyond ? q - side * p[1] : 0.0,
                               beyond ? -side * p[0] : 0.0};
    for (int k = 0; k < 3; ++k) worst = std::fmax(worst, std::abs(out.v[k] - expected[k]));
    worst = std::fmax(worst, std::abs(out.a - tau));
    std::printf("q = %5.2f rad: %6.2f N·m\n", q, tau);
  }
  std::printf("derivatives are wrong by %.1e at most\n", worst);
  return worst < 1e-12 ? 0 : 3;
}
