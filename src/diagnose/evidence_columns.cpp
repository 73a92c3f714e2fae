/// What effects add in an evidence's rows: their columns and torques, filtered like the measured
/// torque.

#include <algorithm>
#include <complex>
#include <numeric>

#include <diffnea/core/error.hpp>
#include <diffnea/effects/stepping.hpp>

#include "diagnose/evidence.hpp"
#include "diagnose/term.hpp"

namespace diffnea {

MatX<double> Evidence::rows_of(
    long k, const std::function<RowMatX<double>(const JointSeries&)>& columns) const {
  std::vector<RowMatX<double>> stretches;
  for (const JointSeries& s : series_) stretches.push_back(columns(s));
  return rows_of(k, stretches);
}

MatX<double> Evidence::driven(
    long k, const std::vector<int>& joints,
    const std::function<RowMatX<double>(std::size_t, int)>& torques) const {
  std::vector<RowMatX<double>> stretches;
  for (std::size_t i = 0; i < series_.size(); ++i)
    stretches.push_back(
        driven_rows_.at(i, joints_[k], joints, [&](int j) { return torques(i, j); }));
  return rows_of(k, stretches);
}

MatX<double> Evidence::driven(long k, const std::vector<int>& joints,
                              const std::vector<std::vector<RowMatX<double>>>& columns) const {
  return driven(k, joints, [&](std::size_t i, int j) {
    RowMatX<double> out(series_[i].rows(), std::ssize(columns[i]));
    for (long c = 0; c < out.cols(); ++c) out.col(c) = columns[i][c].col(j);
    return out;
  });
}

void Evidence::evaluate(const TriedEffect& effect) {
  const TriedEffect::Own& own = *effect.own;
  const long width = std::ssize(own.parameters);
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
        throw DataError(what + "the column of '" + own.parameters[k].name +
                        "' holds NaN or infinity; expected finite torques at every instant");
  }
  const long m = times();
  MatX<double> all = MatX<double>::Zero(rows(), width);
  for (const long k : reached(effect.joints))
    all.middleRows(k * m, m) =
        driven(k, effect.joints, [&](std::size_t i, int) { return stretches[i]; });
  own_[{own.name, own.where}] = std::move(all);
}

MatX<double> Evidence::columns(const TriedEffect& effect, const std::vector<int>& which,
                               VecX<double>* torque) const {
  const long m = times(), width = std::ssize(which);
  MatX<double> out = MatX<double>::Zero(rows(), width);
  if (torque) *torque = VecX<double>::Zero(rows());
  if (effect.own) {
    if (torque) *torque = torque_of(effect);
    return own_.at({effect.own->name, effect.where})(Eigen::all, which);
  }
  if (which.empty() && !torque) return out;
  if (effect.told >= 0) {
    TriedEffect whole = effect;
    whole.told = -1;
    std::vector<int> own = which;
    std::erase(own, effect.told);
    VecX<double> at;
    const MatX<double> of_own = columns(whole, own, &at);
    const double share = effect.parameters[effect.told];
    for (long w = 0, next = 0; w < width; ++w)
      if (which[w] == effect.told)
        out.col(w) = at;
      else
        out.col(w) = share * of_own.col(next++);
    if (torque) *torque = share * at;
    return out;
  }
  // Torque of one joint reaches few others: their columns need no filter.
  const std::vector<int> from = acts_at_its_joints(effect) ? effect.joints : all_joints();
  const std::vector<long> reached = this->reached(from);
  if (reached.empty()) return out;
  const bool turns =
      effect.info().port == Port::kJointTorque && is_dry(effect) && !early_.isZero(0.0);
  std::vector<std::vector<RowMatX<double>>> of;  // a stretch each; last the torque, if asked for
  for (const JointSeries& own : series_) {
    JointSeries moved;
    const JointSeries& s = turns ? (moved = turned(effect, own)) : own;
    RowMatX<double> at;
    of.push_back(series_columns(effect, reference(s), s, effect.parameters.data(), which,
                                torque ? &at : nullptr));
    if (torque) of.back().push_back(std::move(at));
  }
  for (const long k : reached) {
    const MatX<double> rows = driven(k, from, of);
    out.middleRows(k * m, m) = rows.leftCols(width);
    if (torque) torque->segment(k * m, m) = rows.col(width);
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
  const std::vector<long> reached = this->reached({joint});
  const long m = times();
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
    MatX<double> out(m * std::ssize(reached), 2);
    for (std::size_t r = 0; r < reached.size(); ++r)
      out.middleRows(r * m, m) =
          driven(reached[r], {joint}, [&](std::size_t i, int) { return stretches[i]; });
    visit(k, std::move(out));
  }
}

MatX<double> Evidence::curvature(long k) const {
  const int j = joints_[k];
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
           Eigen::Map<const VecX<double>>(effect.parameters.data(), std::ssize(effect.parameters));
  }
  VecX<double> out;
  columns(effect, {}, &out);
  return out;
}

}  // namespace diffnea
