#include "recording/unwrapper.hpp"

#include <algorithm>
#include <cmath>

#include <diffnea/core/text.hpp>

#include "core/constants.hpp"

namespace diffnea::detail {
namespace {

/// Beyond a turn, and what an encoder's zero may add to it, a position was never wrapped [rad].
constexpr double kWithin = 2.0 * kPi * 1.001;

}  // namespace

Unwrapper::Unwrapper(const std::vector<JointDescription>& joints,
                     const std::vector<Recording>& sample)
    : joints_(joints), q_(joints.size()), qcmd_(joints.size()), wraps_(joints.size(), 0) {
  for (std::size_t j = 0; j < joints.size(); ++j)
    wraps_at_a_turn_.push_back(
        joints[j].continuous && std::ranges::none_of(sample, [&](const Recording& r) {
          return (r.q.col(static_cast<long>(j)).array().abs() > kWithin).any();
        }));
}

void Unwrapper::unwrap(RowMatX<double>& values, std::vector<Column>& columns,
                       std::vector<long>* wraps) {
  for (std::size_t j = 0; j < joints_.size() && static_cast<long>(j) < values.cols(); ++j) {
    if (!wraps_at_a_turn_[j]) continue;
    Column& c = columns[j];
    for (long i = 0; i < values.rows(); ++i) {
      double& x = values(i, static_cast<long>(j));
      if (!std::isfinite(x)) continue;
      const double now = x, step = now - c.last;
      if (c.any && std::abs(step) > kPi && std::abs(now) < kWithin) {
        c.turns -= std::copysign(2.0 * kPi, step);
        if (wraps != nullptr) ++(*wraps)[j];
      }
      c.last = now;
      c.any = true;
      x = now + c.turns;
    }
  }
}

void Unwrapper::apply(Recording& block) {
  if (block.run != run_ || block.source != source_) {
    q_.assign(joints_.size(), {});
    qcmd_.assign(joints_.size(), {});
    run_ = block.run;
    source_ = block.source;
  }
  unwrap(block.q, q_, &wraps_);
  unwrap(block.qcmd, qcmd_, nullptr);
}

std::string Unwrapper::note() const {
  std::vector<std::string> of;
  for (std::size_t j = 0; j < joints_.size(); ++j)
    if (wraps_[j] > 0)
      of.push_back("q_" + joints_[j].name + " (" + std::to_string(wraps_[j]) +
                   (wraps_[j] == 1 ? " time)" : " times)"));
  return of.empty() ? ""
                    : "encoders of continuous joints that begin again at a whole turn were "
                      "unwrapped: " +
                          join(of);
}

}  // namespace diffnea::detail
