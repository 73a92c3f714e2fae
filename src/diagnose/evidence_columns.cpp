/// What effects add in an evidence's rows: their columns and torques, filtered like the measured
/// torque.

#include <algorithm>
#include <complex>
#include <numeric>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/stepping.hpp>

#include "diagnose/evidence.hpp"

namespace diffnea {

MatX<double> Evidence::rows_of(
    long k, const std::function<RowMatX<double>(const JointSeries&)>& columns) const {
  std::vector<RowMatX<double>> stretches;
  for (const JointSeries& s : series_) stretches.push_back(columns(s));
  return rows_of(k, stretches);
}

void Evidence::evaluate(const TriedEffect& effect) {
  const TriedEffect::Own& own = *effect.own;
  const long width = static_cast<long>(own.parameters.size());
  std::vector<RowMatX<double>> stretches;
  for (const JointSeries& s : series_) {
    stretches.push_back(own.columns(s));
    const RowMatX<double>& c = stretches.back();
    const std::string what = "diagnose: candidate '" + own.name + "': ";
    if (c.rows() != s.rows() || c.cols() != width)
      throw DataError(what + "its columns have shape (" + std::to_string(c.rows()) + ", " +
                      std::to_string(c.cols()) + "), expected (" + std::to_string(s.rows()) + ", " +
                      std::to_string(width) +
                      "): a row for each instant, a column for each parameter");
    for (long k = 0; k < width; ++k)
      if (!c.col(k).allFinite())
        throw DataError(what + "the column of '" +
                        own.parameters[static_cast<std::size_t>(k)].name +
                        "' holds NaN or infinity; expected finite torques at every instant");
  }
  const auto at = std::ranges::find(joints_, effect.joints[0]);
  if (at != joints_.end())
    own_[{own.name, own.where}] = rows_of(at - joints_.begin(), stretches);
}

MatX<double> Evidence::columns(const TriedEffect& effect, const std::vector<int>& which,
                               VecX<double>* torque) const {
  const long m = times(), width = static_cast<long>(which.size());
  MatX<double> out = MatX<double>::Zero(rows(), width);
  if (torque) *torque = VecX<double>::Zero(rows());
  if (effect.own) {
    if (torque) *torque = torque_of(effect);
    const auto at = std::ranges::find(joints_, effect.joints[0]);
    if (at != joints_.end())
      out.middleRows((at - joints_.begin()) * m, m) =
          own_.at({effect.own->name, effect.where})(Eigen::all, which);
    return out;
  }
  if (which.empty() && !torque) return out;
  // Joint torques of one joint reach that joint alone: the others' columns need no filter.
  std::vector<long> reached;  // index into joints_
  const Port port = effect.info().port;
  const bool local =
      port == Port::kJointTorque || (port == Port::kMemory && !encoder_at_motor(effect));
  for (std::size_t k = 0; k < joints_.size(); ++k)
    if (!local || std::ranges::find(effect.joints, joints_[k]) != effect.joints.end())
      reached.push_back(static_cast<long>(k));
  if (reached.empty()) return out;
  const long all = width + (torque ? 1 : 0);
  std::vector<std::vector<RowMatX<double>>> stretches(reached.size());
  for (const JointSeries& s : series_) {
    RowMatX<double> at;
    std::vector<RowMatX<double>> c = series_columns(effect, reference(s), s,
                                                    effect.parameters.data(), which,
                                                    torque ? &at : nullptr);
    if (torque) c.push_back(std::move(at));
    for (std::size_t r = 0; r < reached.size(); ++r) {
      RowMatX<double>& block = stretches[r].emplace_back(s.q.rows(), all);
      for (long w = 0; w < all; ++w)
        block.col(w) = c[static_cast<std::size_t>(w)].col(
            joints_[static_cast<std::size_t>(reached[r])]);
    }
  }
  for (std::size_t r = 0; r < reached.size(); ++r) {
    const MatX<double> of = rows_of(reached[r], stretches[r]);
    out.middleRows(reached[r] * m, m) = of.leftCols(width);
    if (torque) torque->segment(reached[r] * m, m) = of.col(width);
  }
  return out;
}

void Evidence::ripples(int joint, double first, double step, int count,
                       const std::function<void(int, MatX<double>)>& visit) const {
  using Phasors = Eigen::ArrayXcd;
  const auto turns = [&](const JointSeries& s, double n) {
    const Eigen::ArrayXd angle = n * s.q.col(joint).array();
    Phasors out(angle.size());
    out.real() = angle.cos();
    out.imag() = angle.sin();
    return out;
  };
  const long of = std::ranges::find(joints_, joint) - joints_.begin();
  std::vector<Phasors> at, by;
  for (const JointSeries& s : series_) {
    at.push_back(turns(s, first));
    by.push_back(turns(s, step));
  }
  for (int k = 0; k < count; ++k) {
    std::vector<RowMatX<double>> stretches;
    for (std::size_t i = 0; i < at.size(); ++i) {
      stretches.emplace_back(at[i].size(), 2);
      stretches.back() << at[i].imag(), at[i].real();
      at[i] *= by[i];
    }
    visit(k, rows_of(of, stretches));
  }
}

MatX<double> Evidence::curvature(long k) const {
  const int j = joints_[static_cast<std::size_t>(k)];
  return rows_of(k, [j](const JointSeries& s) {
    RowMatX<double> out(s.rows(), 2);
    out.col(0) = derivative(derivative(s.total.col(j), s.dt), s.dt);
    out.col(1) = derivative(out.col(0), s.dt);
    return out;
  });
}

bool Evidence::has_friction(int joint) const {
  return std::ranges::any_of(references_.begin()->second.effects, [&](const BoundEffect& e) {
    return e.info().motor_side && !e.info().has(Trait::kAtMotor) &&
           std::ranges::find(e.joints, joint) != e.joints.end();
  });
}

VecX<double> Evidence::torque_of(const TriedEffect& effect) const {
  if (effect.own) {
    std::vector<int> all(effect.parameters.size());
    std::iota(all.begin(), all.end(), 0);
    return columns(effect, all) *
           Eigen::Map<const VecX<double>>(effect.parameters.data(),
                                          static_cast<long>(effect.parameters.size()));
  }
  VecX<double> out;
  columns(effect, {}, &out);
  return out;
}

}  // namespace diffnea
