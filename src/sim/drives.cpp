#include "sim/drives.hpp"

#include <cmath>
#include <limits>

namespace diffnea::sim {
namespace {

/// Adds parameter 0 of every effect of type E to its joints' entries.
template <class E>
void collect(const std::vector<BoundEffect>& effects, VecX<double>& values) {
  for (const BoundEffect& e : effects)
    if (std::holds_alternative<E>(e.type))
      for (const int j : e.joints) values[j] += e.parameters[0];
}

}  // namespace

Drives::Drives(const std::vector<BoundEffect>& effects, int num_dofs)
    : limit_(VecX<double>::Constant(num_dofs, std::numeric_limits<double>::infinity())),
      delay_(VecX<double>::Zero(num_dofs)),
      lag_(delay_) {
  for (const BoundEffect& e : effects)
    if (std::holds_alternative<Saturation>(e.type))
      for (const int j : e.joints) limit_[j] = std::min(limit_[j], e.parameters[0]);
  collect<ActuatorDelay>(effects, delay_);
  collect<ActuatorLag>(effects, lag_);
}

void Drives::reset() {
  commands_.clear();
  state_.resize(0);
}

void Drives::command(double time, const VecX<double>& torque) {
  commands_.push_back({time, torque.cwiseMin(limit_).cwiseMax(-limit_)});
  if (state_.size() == 0) state_ = commands_.back().torque;
  const double oldest = time - delay_.maxCoeff();
  while (commands_.size() > 1 && commands_[1].time <= oldest) commands_.pop_front();
}

void Drives::begin_step(double time, double h) {
  h_ = h;
  input_ = commands_.front().torque;
  for (long j = 0; j < input_.size(); ++j)
    for (const Command& c : commands_)
      if (c.time <= time + 0.5 * h - delay_[j]) input_[j] = c.torque[j];
}

VecX<double> Drives::applied(double share) const {
  VecX<double> out = input_;
  for (long j = 0; j < out.size(); ++j)
    if (lag_[j] > 0.0) out[j] += (state_[j] - input_[j]) * std::exp(-share * h_ / lag_[j]);
  return out;
}

Encoders::Encoders(const std::vector<BoundEffect>& effects, int num_dofs)
    : gain_(VecX<double>::Zero(num_dofs)), offset_(VecX<double>::Zero(num_dofs)) {
  collect<EncoderScale>(effects, gain_);
  collect<EncoderOffset>(effects, offset_);
  gain_.array() += 1.0;
}

}  // namespace diffnea::sim
