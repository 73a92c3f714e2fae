/// The filters of an evidence, one for each joint and stretch, and what they make of torques.

#include <algorithm>
#include <cmath>

#include <diffnea/dynamics/mass_matrix.hpp>

#include "core/constants.hpp"
#include "core/statistics.hpp"
#include "diagnose/evidence.hpp"
#include "diagnose/noise.hpp"

namespace diffnea {
namespace {

/// Share of the links' torques that rounding leaves at a joint that nothing drives: its motion
/// tells of its whole run, however long.
constexpr double kRounding = 1e-8;

/// Mean squares of the torques by which noise is told from nothing: as logged, or, of a joint that
/// nothing drives, what its links take one by one, (n).
VecX<double> torque_squares(const Tree<double>& tree, const JointSeries& s,
                            const std::vector<bool>& driven) {
  const long n = s.q.cols();
  VecX<double> out = VecX<double>::Zero(n);
  const VecX<double> still = VecX<double>::Zero(n);
  RneaWorkspace<double, double> ws;
  MassMatrixWorkspace<double, double> mass;
  for (long i = 0; i < s.rows(); ++i) {
    VecX<double> gravity;
    for (long j = 0; j < n; ++j) {
      if (driven[j]) {
        out[j] += s.logged(i, j) * s.logged(i, j);
        continue;
      }
      const VecX<double> q = s.q.row(i).transpose();
      if (gravity.size() == 0) gravity = rnea<double, double>(tree, q, still, still, ws);
      const double inertia = mass_matrix<double, double>(tree, q, mass)(j, j) * s.qdd(i, j);
      out[j] += gravity[j] * gravity[j] + inertia * inertia;
    }
  }
  return out;
}

}  // namespace

std::vector<JointEquation> Evidence::equations_along(const Tree<double>& tree,
                                                     const JointSeries& own,
                                                     const SignalNoise& noise,
                                                     const PreprocessPlan& plan) {
  if (!driven_rows_.closed())
    return joint_equations(tree, own, joints_, noise, plan.filter_hz, every_);
  std::vector<JointEquation> out;
  shown_.emplace_back();
  for (LoopEquation& e : driven_rows_.equations(tree, own, joints_, noise, every_)) {
    out.push_back(std::move(e.equation));
    shown_.back().push_back(std::move(e.shown));
  }
  return out;
}

VecX<double> Evidence::shown(std::size_t stretch, std::size_t k, const RowMatX<double>& positions,
                             const RowMatX<double>& path) const {
  const int j = joints_[k];
  if (!driven_rows_.closed()) return positions.col(j) - path.col(j);
  return (positions - path).cwiseProduct(shown_[stretch][k]).rowwise().sum();
}

void Evidence::take_filters(const Model& links, const PreprocessPlan& plan,
                            const Stretches& collector) {
  const std::vector<JointSeries>& own = collector.series();
  std::vector<bool> driven;
  for (int j = 0; j < num_dofs_; ++j) driven.push_back(collector.about(0).has_tau[j]);
  for (const int j : joints_) passive_.push_back(!driven[j]);
  std::map<int, Tree<double>> trees;
  VecX<double> squares = VecX<double>::Zero(num_dofs_);
  double samples = 0.0;
  for (const JointSeries& s : own) {
    if (!trees.contains(s.run)) trees.emplace(s.run, extend(links, runs_, s.run).tree);
    squares += torque_squares(trees.at(s.run), s, driven);
    samples += static_cast<double>(s.rows());
  }
  SignalNoise noise{VecX<double>(num_dofs_), VecX<double>(num_dofs_),
                    base_joints_ > 0 ? base_joints_ - 3 : -1};
  for (int j = 0; j < num_dofs_; ++j) {
    const double torque = std::max(0.0, plan.tau_noise[j]);  // not a number: there is none
    // Between two new positions there is none.
    const int rows = plan.refresh[j] * (halves_ ? 2 : 1);
    noise.position[j] = std::max(std::sqrt(rows) * plan.q_noise[j], kLeastPosition);
    noise.density[j] =
        plan.dt * (std::pow(torque, 2) + std::pow(driven[j] ? kLeastNoise : kRounding, 2) *
                                             std::max(squares[j] / samples, 1e-300));
  }
  constant_.assign(joints_.size(), MatX<double>(times(), 1));
  std::vector<std::vector<double>> settled(joints_.size());
  long row = 0;
  cut_off_.assign(joints_.size(), plan.filter_hz);
  for (const JointSeries& s : own) {
    std::vector<TorqueFilter> of;
    const std::vector<JointEquation> equations = equations_along(trees.at(s.run), s, noise, plan);
    const RowMatX<double> one = RowMatX<double>::Ones(s.rows(), 1);
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      of.emplace_back(equations[k], s.dt, every_);
      constant_[k].middleRows(row, of.back().rows()) = of.back()(one);
      for (const double of_one : constant_[k].col(0).segment(row, of.back().rows()))
        settled[k].push_back(of_one);
      const JointEquation& e = equations[k];
      const long at = s.rows() / 2;
      cut_off_[k] = std::max(
          cut_off_[k],
          std::pow(e.density[at] / (std::pow(e.inertia[at], 2) * e.variance[at] * s.dt), 0.25) /
              (2.0 * kPi));
    }
    row += of.front().rows();
    filters_.push_back(std::move(of));
  }
  unit_.resize(std::ssize(joints_));
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    unit_[k] = 1.0 / median(settled[k]);
    constant_[k] *= unit_[k];
  }
}

bool Evidence::begins(long instant, long k) const {
  const std::size_t stretch = static_cast<std::size_t>(stretch_[instant]);
  const auto first = std::ranges::lower_bound(stretch_, static_cast<int>(stretch));
  return instant - (first - stretch_.begin()) < filters_[stretch][k].settled();
}

MatX<double> Evidence::rows_of(long k, const std::vector<RowMatX<double>>& stretches) const {
  MatX<double> out(times(), stretches.empty() ? 0 : stretches[0].cols());
  long row = 0;
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    const TorqueFilter& filter = filters_[i][k];
    out.middleRows(row, filter.rows()) = unit_[k] * filter(stretches[i]);
    row += filter.rows();
  }
  return out;
}

MatX<double> Evidence::means_of(long k, const std::vector<RowMatX<double>>& stretches) const {
  MatX<double> out = rows_of(k, stretches);
  const MatX<double>& weight = constant_[k];
  long row = 0;
  for (std::size_t i = 0; i < stretches.size(); ++i)
    for (long m = 0; m < stretches[i].rows() / every_; ++m, ++row)
      // A first row knows nothing yet.
      if (std::abs(weight(row, 0)) > 1e-3)
        out.row(row) /= weight(row, 0);
      else
        out.row(row) = stretches[i].middleRows(m * every_, every_).colwise().mean();
  return out;
}

}  // namespace diffnea
