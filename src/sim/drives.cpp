#include "sim/drives.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace diffnea::sim {

Drives::Drives(const std::vector<BoundEffect>& effects, int num_dofs)
    : limit_(num_dofs), delay_(num_dofs), lag_(num_dofs) {
  std::vector<DrivePath<double>> paths(
      static_cast<std::size_t>(num_dofs),
      {.limit = std::numeric_limits<double>::infinity(), .delay = 0.0, .lag = 0.0});
  for (const BoundEffect& e : effects)
    for (const int j : e.joints) add_to_drive(e, paths[static_cast<std::size_t>(j)]);
  for (int j = 0; j < num_dofs; ++j) {
    const DrivePath<double>& path = paths[static_cast<std::size_t>(j)];
    limit_[j] = path.limit;
    delay_[j] = path.delay;
    lag_[j] = path.lag;
  }
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
  for (long j = 0; j < input_.size(); ++j) {
    const double end = time + h - delay_[j];
    for (std::size_t k = 1; k < commands_.size(); ++k) {  // each takes over what is left of the step
      const double left = std::clamp((end - commands_[k].time) / h, 0.0, 1.0);
      input_[j] += left * (commands_[k].torque[j] - commands_[k - 1].torque[j]);
    }
  }
}

VecX<double> Drives::applied(double share) const {
  VecX<double> out = input_;
  for (long j = 0; j < out.size(); ++j)
    if (lag_[j] > 0.0)
      out[j] += (state_[j] - input_[j]) *
                (lag_[j] < h_ ? -std::expm1(-h_ / lag_[j]) * lag_[j] / h_
                              : std::exp(-share * h_ / lag_[j]));
  return out;
}

void Drives::end_step() {
  VecX<double> out = input_;
  for (long j = 0; j < out.size(); ++j)
    if (lag_[j] > 0.0) out[j] += (state_[j] - input_[j]) * std::exp(-h_ / lag_[j]);
  state_ = out;
}

Encoders::Encoders(const std::vector<BoundEffect>& effects, int num_dofs)
    : gain_(num_dofs), offset_(num_dofs) {
  std::vector<Encoder> encoders(static_cast<std::size_t>(num_dofs));
  for (const BoundEffect& e : effects)
    for (const int j : e.joints) add_to_encoder(e, encoders[static_cast<std::size_t>(j)]);
  for (int j = 0; j < num_dofs; ++j) {
    gain_[j] = encoders[static_cast<std::size_t>(j)].scale + 1.0;
    offset_[j] = encoders[static_cast<std::size_t>(j)].offset;
  }
}

}  // namespace diffnea::sim
