#include "diagnose/evidence.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/recording/commands.hpp>
#include <diffnea/recording/refresh.hpp>

#include "diagnose/halves.hpp"
#include "recording/overlap.hpp"

namespace diffnea {
namespace {

/// Rows of the base that are made at once.
constexpr long kChunk = 2048;

/// Tells whether a joint's torque is known: measured, or passive and hence zero.
bool known(const Preprocessed& about, const JointSeries& s, int j) {
  return about.has_tau[j] || (s.rows() > 0 && !std::isnan(s.logged(0, j)));
}

/// Linear parameters: of the links as in `links`, of effects before the fit.
VecX<double> with_inertias_of(const Model& links, const FitLayout& layout) {
  VecX<double> out = layout.prior();
  const Tree<double> tree = make_tree(links);
  for (std::size_t k = 0; k < layout.linear.size(); ++k)
    if (const FitParameter& p = layout.linear[k]; p.dof >= 0)
      out[k] = tree.links[p.dof].inertia.theta()[p.theta];
  return out;
}

}  // namespace

Evidence::Evidence(const Model& model, const Linearisation& about, const FitLayout& layout,
                   const RecordingSource& source, const PreprocessPlan& plan, double period,
                   const IdentifyOptions& options, int first_run, const Evidence* fitted,
                   int base_joints)
    : num_dofs_(layout.num_dofs),
      first_run_(first_run),
      base_joints_(base_joints),
      runs_(source.runs()),
      every_(plan.decimator.factor),
      early_(about.early.size() > 0 ? about.early : VecX<double>::Zero(layout.num_dofs)) {
  Stretches collector(first_run);
  for_each_block(source, plan, "reading", 0, options,
                 [&](const Preprocessed& block) { collector.add(block); });
  take_series(collector, period);
  const std::vector<RowMatX<double>> positions = collector.positions();
  if (series_.empty())
    throw DataError(source.sample().front().source +
                    ": diagnose: " + detail::why_no_rows(source.sample(), every_) +
                    "; record a motion, e.g. one of `diffnea excite`");
  take_halves(collector, plan);
  take_joints(model, collector, fitted);
  if (joints_.empty()) {
    require_torque(describe_joints(model), source.sample());
    throw DataError(
        source.sample().front().source +
        ": diagnose: no joint has a torque (tau_<joint>), and none is declared passive");
  }
  take_standstills(layout, plan, collector, positions, fitted);
  take_filters(about.links, plan, collector);
  FitLayout held = layout;
  for (FitParameter& s : held.shape) s.fixed = !is_smoothing(s);
  take_rows(model, about.links, held, plan, collector);
  if (apart_) seen_base_ = regress(model, held, plan, collector, series_, nullptr);
  take_motion(plan, positions, fitted);
  set_reference(model);
  const MatX<double> turns_of_base = turns(layout);
  for (MatX<double>* base : {&base_, &seen_base_}) {
    if (base->size() == 0) continue;
    base->conservativeResize(Eigen::NoChange, base->cols() + turns_of_base.cols() + 1);
    base->middleCols(base->cols() - turns_of_base.cols() - 1, turns_of_base.cols()) = turns_of_base;
  }
  // Gridder places held torques half a sample late already.
  if (source.sample().front().info.torque_sampling == TorqueSampling::kHold)
    earliest_instant_ -= 0.5, latest_instant_ -= 0.5;
  const std::vector<int> held_rows = refresh_rows(source.sample(), &Recording::tau);
  int slowest = 1;  // a joint that stands still has the same torque for many rows
  for (const int j : joints_) slowest = std::max(slowest, held_rows[j]);
  earliest_instant_ -= 0.5 * (slowest - 1);
  has_instant_ = true;
  set_instant();
}

void Evidence::set_instant() {
  VecX<double> column = VecX<double>::Zero(rows());
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    if (passive_[k]) continue;
    const int j = joints_[k];
    column.segment(k * times(), times()) =
        rows_of(static_cast<long>(k), [j](const JointSeries& s) {  // torque of a sample
          const long n = s.total.rows();
          RowMatX<double> out = RowMatX<double>::Zero(n, 1);
          for (long i = 0; i < n && n > 1; ++i) {
            const long before = std::max(i - 1, 0L), after = std::min(i + 1, n - 1);
            out(i, 0) =
                (s.total(after, j) - s.total(before, j)) / static_cast<double>(after - before);
          }
          return out;
        });
  }
  base_.rightCols(1) = column;
  if (apart_) seen_base_.rightCols(1) = column;
}

void Evidence::take_series(Stretches& collector, double period) {
  collector.drop_shorter(every_);
  for (std::size_t i = 0; period > 0.0 && i < collector.series().size(); ++i)
    collector.drop_first(i, settling_rows(period, collector.series()[i]));
  series_ = collector.series();
  repeats_ = !series_.empty() && std::ranges::all_of(series_, [&](const JointSeries& s) {
    return diffnea::repeats(period, s);
  });
}

void Evidence::take_halves(Stretches& collector, const PreprocessPlan& plan) {
  const std::vector<bool>& driven = collector.about(0).has_tau;
  apart_ = std::ranges::find(driven, true) != driven.end();
  if (!apart_) return;
  halves_ = halves_suffice(plan);
  const std::vector<int> alike = joints_alike(plan, collector.positions());
  for (std::size_t i = 0; i < series_.size(); ++i) {
    const RowMatX<double> all = collector.positions()[i];
    const RowMatX<double> seen = halves_ ? half_of(all, plan, false) : all;
    set_path(seen, plan, series_[i]);
    smooth_more(seen, plan, alike, series_[i]);
    if (halves_) collector.set_positions(i, half_of(all, plan, true), plan);
  }
}

void Evidence::take_joints(const Model& model, const Stretches& collector, const Evidence* fitted) {
  has_torque_ = collector.about(0).has_tau;
  const std::vector<std::string> names = joint_names(model);
  if (!model.constraints.empty()) {
    driven_rows_ = DrivenRows(model, collector.rows_of(0, collector.series()[0], 0, 1),
                              fitted ? fitted->driven_rows_.joints() : std::vector<int>{});
    driven_rows_.set_paths(series_);
    joints_ = driven_rows_.joints();
  }
  for (std::size_t i = 0; i < series_.size(); ++i)
    for (int j = 0; j < num_dofs_; ++j) {
      if (driven_rows_.closed() && collector.about(i).has_tau == has_torque_) continue;
      const bool is_known = known(collector.about(i), series_[i], j);
      if (i == 0 && is_known) joints_.push_back(j);
      if (is_known != (std::ranges::find(joints_, j) != joints_.end()))
        throw DataError(collector.about(i).source + ": diagnose: the torque of " + names[j] +
                        " is known in some of the recordings alone; expected recordings that all "
                        "have the torques (or `passive`) of the same joints: leave the column out "
                        "of all of them, or diagnose them one by one");
    }
  std::size_t row = 0;
  for (std::size_t i = 0; i < series_.size(); ++i) {
    const JointSeries& s = series_[i];
    step_ = s.dt * every_;
    for (long m = 0; m < s.rows() / every_; ++m, ++row) {
      stretch_.push_back(static_cast<int>(i));
      time_.push_back(collector.about(i).time[0] + s.dt * (static_cast<double>(m) + 0.5) * every_);
    }
  }
}

MatX<double> Evidence::regress(const Model& model, const FitLayout& layout,
                               const PreprocessPlan& plan, const Stretches& collector,
                               const std::vector<JointSeries>& series, VecX<double>* torque) {
  VecX<double> shape(std::ssize(layout.shape));
  for (std::size_t s = 0; s < layout.shape.size(); ++s) shape[s] = layout.shape[s].prior;
  RegressionOptions all;
  all.keep_bytes = std::numeric_limits<long>::max() / 2;
  all.rest_speed = 0.0;
  all.rest_share = 2.0;
  all.factored = false;
  all.first_run = first_run_;
  if (driven_rows_.closed()) all.leads = driven_rows_.joints();
  PreprocessPlan every_sample = plan;
  every_sample.decimator = {.rate_hz = 1.0 / plan.dt};
  TorqueRegression samples(model, layout, every_sample, {layout.prior(), shape}, all);
  const long p = std::ssize(layout.linear) + std::ranges::count_if(layout.shape, is_smoothing);
  MatX<double> out = MatX<double>::Zero(times() * std::ssize(joints_), p);
  long row = 0;
  for (std::size_t i = 0; i < series.size(); ++i) {
    const long count = series[i].rows(), of_stretch = count / every_;
    std::vector<TorqueFilter::State> states(joints_.size());
    std::vector<RowMatX<double>> waiting(joints_.size());  // for the sample after them
    std::vector<MatX<double>> rows(joints_.size());
    for (long from = 0; from < count; from += kChunk) {
      samples.add(collector.rows_of(i, series[i], from, std::min(kChunk, count - from)));
      for (std::size_t k = 0; k < joints_.size(); ++k) {
        const auto now = samples.kept()[joints_[k]].rows();
        if (from == 0) rows[k].resize(of_stretch, now.cols());
        if (from > 0) filters_[i][k].push(waiting[k], now.row(0).data(), states[k], rows[k]);
        waiting[k] = now;
      }
      samples.forget();
    }
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      filters_[i][k].push(waiting[k], nullptr, states[k], rows[k]);
      rows[k] *= unit_[k];
      const long at = static_cast<long>(k) * times() + row;
      const std::vector<int>& columns = samples.factors()[joints_[k]].columns;
      for (std::size_t c = 0; c < columns.size(); ++c)
        out.col(columns[c]).segment(at, of_stretch) = rows[k].col(c);
      if (torque) torque->segment(at, of_stretch) = rows[k].rightCols(1);
    }
    row += of_stretch;
  }
  retime(model, layout, series, out);
  if (torque) factors_ = samples.factors();
  return out;
}

void Evidence::take_rows(const Model& model, const Model& links, const FitLayout& layout,
                         const PreprocessPlan& plan, const Stretches& collector) {
  for (std::size_t c = 0; c < layout.linear.size(); ++c)
    if (std::ranges::any_of(layout.shape, [&](const FitParameter& s) {
          return is_smoothing(s) && s.effect == layout.linear[c].effect;
        }))
      dry_columns_.push_back(static_cast<int>(c));
  const long m = times(), linear = std::ssize(layout.linear);
  torque_.resize(m * std::ssize(joints_));
  base_ = regress(model, layout, plan, collector, collector.series(), &torque_);
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    long row = k * m;
    for (std::size_t i = 0; i < filters_.size(); ++i) {
      const VecX<double> beside = shown(i, k, collector.positions()[i], collector.series()[i].q);
      torque_.segment(row, filters_[i][k].rows()) += unit_[k] * filters_[i][k].shown(beside);
      row += filters_[i][k].rows();
    }
    JointFactor& f = factors_[joints_[k]];
    RowMatX<double> rows(m, std::ssize(f.columns) + 1);
    for (std::size_t c = 0; c < f.columns.size(); ++c)
      rows.col(c) = base_.col(f.columns[c]).segment(k * m, m);
    rows.rightCols(1) = torque_.segment(k * m, m);
    f.factor.add(rows);
  }
  const VecX<double> x = with_inertias_of(links, layout), taken = base_.leftCols(linear) * x;
  for (long k = 0; k < std::ssize(joints_); ++k) {
    const double rows = std::sqrt(static_cast<double>(m));
    size_.push_back((passive(k) ? taken : torque_).segment(k * m, m).norm() / rows);
    scale_.push_back(passive(k) ? (base_.block(k * m, 0, m, linear) * x.asDiagonal()).norm() / rows
                                : size_.back());
  }
}

MatX<double> Evidence::without_scale(long k, const Eigen::Ref<const MatX<double>>& rows,
                                     const VecX<double>& x0) const {
  MatX<double> out = rows;
  const JointFactor& f = factors_[joints_[k]];
  if (f.inertia.size() == 0 || !has_passive_beside_torques()) return out;
  const double m = f.inertia.dot(x0(f.columns));
  if (!(m > 0.0)) return out;
  VecX<double> inertia = VecX<double>::Zero(rows.cols());
  inertia(f.columns) = f.inertia;
  const VecX<double> left = rows * x0 - torque_.segment(k * times(), times());
  out.noalias() -= left * (inertia.transpose() / m);
  return out;
}

MatX<double> Evidence::without_scale(const MatX<double>& base, const VecX<double>& x0,
                                     const std::vector<int>& columns) const {
  const long m = times();
  MatX<double> out(rows(), std::ssize(columns));
  for (std::size_t k = 0; k < joints_.size(); ++k)
    out.middleRows(k * m, m) = without_scale(k, base.middleRows(k * m, m), x0)(Eigen::all, columns);
  return out;
}

double Evidence::rms(long k, const VecX<double>& rows, const std::vector<bool>& counts) const {
  double squares = 0.0, count = 0.0;
  for (long row = k * times(); row < (k + 1) * times(); ++row)
    if (counts.empty() || counts[row]) squares += rows[row] * rows[row], ++count;
  return std::sqrt(squares / std::max(count, 1.0));
}

long Evidence::index_of(int joint) const {
  const auto at = std::ranges::find(joints_, joint);
  return at == joints_.end() ? -1 : at - joints_.begin();
}

bool Evidence::is_passive(int joint) const {
  if (driven_rows_.closed()) return !has_torque_[joint];
  const long k = index_of(joint);
  return k >= 0 && passive(k);
}

std::vector<long> Evidence::reached(const std::vector<int>& by) const {
  std::vector<long> out;
  for (std::size_t k = 0; k < joints_.size(); ++k)
    if (driven_rows_.reaches(by, joints_[k])) out.push_back(static_cast<long>(k));
  return out;
}

bool Evidence::has_passive_beside_torques() const {
  if (std::ranges::find(passive_, false) == passive_.end()) return false;
  return std::ranges::any_of(factors_, [](const JointFactor& f) { return f.inertia.size() > 0; });
}

std::vector<int> Evidence::all_joints() const {
  std::vector<int> out(num_dofs_);
  std::iota(out.begin(), out.end(), 0);
  return out;
}

JointSeries Evidence::turned(const BoundEffect& friction, const JointSeries& s) const {
  JointSeries out = s;
  for (const int j : friction.joints)
    if (early_[j] != 0.0) out.qd.col(j) = shifted(s.qd.col(j), s.dt, early_[j]);
  return out;
}

void Evidence::retime(const Model& model, const FitLayout& layout,
                      const std::vector<JointSeries>& series, MatX<double>& base) const {
  if (early_.isZero(0.0)) return;
  long width = std::ssize(layout.linear);
  for (const FitParameter& shape : layout.shape) {
    if (!is_smoothing(shape)) continue;
    const BoundEffect friction = friction_of(layout, shape);
    std::vector<int> which = {shape.index};
    std::vector<long> to = {width++};
    for (const int c : dry_columns_)
      if (const FitParameter& p = layout.linear[c]; p.effect == shape.effect)
        which.push_back(p.index), to.push_back(c);
    std::vector<std::vector<RowMatX<double>>> columns;
    for (const JointSeries& of : series) {
      const JointSeries x = turned(friction, of);
      columns.push_back(series_columns(friction, extend(model, runs_, x.run), x,
                                       friction.parameters.data(), which));
    }
    for (const long k : reached(friction.joints)) {
      const MatX<double> rows = driven(k, friction.joints, columns);
      for (std::size_t c = 0; c < to.size(); ++c)
        base.col(to[c]).segment(k * times(), times()) = rows.col(c);
    }
  }
}

MatX<double> Evidence::turns(const FitLayout& layout) const {
  MatX<double> out(rows(), 0);
  for (const FitParameter& shape : layout.shape) {
    if (!is_smoothing(shape)) continue;
    const BoundEffect friction = friction_of(layout, shape);
    out.conservativeResize(Eigen::NoChange, out.cols() + kTurnColumns);
    out.rightCols(kTurnColumns).setZero();
    std::vector<std::vector<RowMatX<double>>> columns;
    for (const JointSeries& of : series_) {
      const JointSeries s = turned(friction, of);
      const auto own = turn_columns(friction, shape.index, reference(s), s);
      columns.emplace_back(own.begin(), own.end());
    }
    for (const long k : reached(friction.joints))
      out.block(k * times(), out.cols() - kTurnColumns, times(), kTurnColumns) =
          driven(k, friction.joints, columns);
  }
  return out;
}

VecX<double> Evidence::set_reference(const Model& fitted) {
  references_.clear();
  VecX<double> change = VecX<double>::Zero(num_dofs_), size = change;
  for (JointSeries& s : series_) {
    const RowMatX<double> before = std::move(s.total);
    const auto [at, is_new] = references_.try_emplace(s.run);
    if (is_new) at->second = extend(fitted, runs_, s.run);
    at->second.loops = driven_rows_.loops();
    predict(at->second, s);
    size += s.total.colwise().squaredNorm().transpose();
    change += (before.size() == 0 ? s.total : RowMatX<double>(s.total - before))
                  .colwise()
                  .squaredNorm()
                  .transpose();
  }
  if (has_instant_) set_instant();
  VecX<double> out = (change.array() / size.array().max(1e-300)).sqrt();
  if (driven_rows_.closed()) out.setConstant(out.maxCoeff());  // they move together
  return out;
}

void Evidence::set_tilt(const Vec3<double>& more, const VecX<double>& x) {
  const long p = kThetaSize * static_cast<long>(reference(series_.front()).tree.links.size()),
             m = times();
  MatX<double> now = MatX<double>::Zero(rows(), p);
  if (dot(more, more) > 0.0) {
    std::vector<RowMatX<double>> stretches;
    for (const JointSeries& s : series_) {
      Tree<double> tree = reference(s).tree;
      tree.gravity = more;
      const RowMatX<double> still = RowMatX<double>::Zero(s.rows(), num_dofs_);
      const RowMatX<double> Y = regressor_batch(tree, s.q, still, still);
      stretches.push_back(Eigen::Map<const RowMatX<double>>(Y.data(), s.rows(), num_dofs_ * p));
    }
    for (std::size_t k = 0; k < joints_.size(); ++k)
      now.middleRows(k * m, m) =
          driven(k, all_joints(), [&](std::size_t i, int j) -> RowMatX<double> {
            return stretches[i].middleCols(j * p, p);
          });
  }
  const MatX<double> change = tilted_.size() > 0 ? MatX<double>(now - tilted_) : now;
  base_.leftCols(p) += change;
  if (apart_) seen_base_.leftCols(p) += change;
  if (shift_.size() > 0) torque_ -= shift_;
  shift_ = now * x.head(p);
  torque_ += shift_;
  tilted_ = now;
}

}  // namespace diffnea
