#include "diagnose/term.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/effects/stepping.hpp>

namespace diffnea {

VecX<double> Term::values() const {
  VecX<double> out(std::ssize(linear));
  for (std::size_t k = 0; k < linear.size(); ++k) out[k] = effect.parameters[linear[k]];
  return out;
}

VecX<double> Term::torque() const {
  VecX<double> out = columns * values();
  if (has_offset()) out += offset;
  return out;
}

Beside Term::torque_beside() const {
  VecX<double> weights = VecX<double>::Ones(beside.cols());
  weights.head(width()) = values();
  return combined(beside, weights);
}

double Term::visible_share() const {
  const Beside torque = torque_beside();
  const double whole = torque.whitened.squaredNorm();
  return whole > 0.0 ? std::sqrt(std::max(product(torque, torque)(0, 0), 0.0) / whole) : 0.0;
}

VecX<double> torque_of(const std::vector<Term>& terms, long rows) {
  VecX<double> out = VecX<double>::Zero(rows);
  for (const Term& t : terms) out += t.torque();
  return out;
}

Term term_at(const Candidate& c, int index, const std::vector<double>& point) {
  Term term;
  term.candidate = index;
  term.effect = c.effect;
  term.linear = c.linear;
  term.shapes = c.shapes;
  // A spring that is not there has a rest anywhere: its column shows at a stiffness of 1 alone.
  const bool has_rest = term.linear.size() > 1 && std::ranges::any_of(term.linear, [&](int k) {
                          return scale_of(term, k) == Scale::kPlain &&
                                 term.effect.parameter_info[k].sign == Sign::kFree;
                        });
  for (const int k : term.linear)
    term.effect.parameters[k] = has_rest && scale_of(term, k) == Scale::kLinear ? 1.0 : 0.0;
  c.set(point, term.effect);
  if (c.swings > 0.0 && encoder_at_motor(term.effect))
    term.effect.parameters[term.effect.index_of("damping")] =
        2.0 * kSwing * std::sqrt(motor_spring(term.effect).stiffness * c.swings);
  return term;
}

void set_torque(const Evidence& evidence, const Candidate& candidate, Term& term) {
  if (!candidate.nonlinear) {
    term.columns = evidence.columns(term.effect, term.linear);
    return;
  }
  VecX<double> torque;
  term.columns = evidence.columns(term.effect, term.linear, &torque);
  term.offset = torque - term.columns * term.values();
}

std::vector<bool> signs(const BoundEffect& effect, const std::vector<int>& linear) {
  std::vector<bool> out;
  for (const int k : linear) out.push_back(effect.parameter_info[k].sign != Sign::kFree);
  return out;
}

Scale scale_of(const Term& term, int parameter) {
  return scale(term.effect.parameter_info[parameter]);
}

bool is_like_friction(const TriedEffect& effect) {
  const EffectInfo& info = effect.info();
  return info.port == Port::kJointTorque || info.has(Trait::kFriction);
}

bool acts_at_its_joints(const TriedEffect& effect) {
  const Port port = effect.info().port;
  return port == Port::kJointTorque || (port == Port::kMemory && !encoder_at_motor(effect));
}

bool is_of_runs(const TriedEffect& effect) {
  return std::ranges::any_of(effect.info().parameters, &ParameterInfo::per_run);
}

bool is_dry(const TriedEffect& effect) {
  if (!effect.own && hides_motor(effect)) return motor_spring(effect).friction_share < 1.0;
  return effect.index_of("smoothing") >= 0;
}

}  // namespace diffnea
