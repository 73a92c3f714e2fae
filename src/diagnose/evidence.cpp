#include "diagnose/evidence.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/batch.hpp>
#include <diffnea/recording/butterworth.hpp>

#include "diagnose/thresholds.hpp"

namespace diffnea {
namespace {

/// Slower than this share of a joint's RMS velocity it rests: what holds it then is not known.
constexpr double kRestShare = 0.01;

/// Of the filter's weight on samples in which a joint rests, or sticks.
constexpr double kMostRest = 0.3, kMostStuck = 0.02;

/// Of a disturbance at the end of a recording.
constexpr double kRemembered = 0.01;
/// Of a recording, that its ends may be: longer, they stay. Of motions that do not repeat, every
/// row counts.
constexpr double kMostEnds = 1.0 / 3.0, kMostEndsOnce = 0.1;

}  // namespace

Evidence::Evidence(const Model& model, const FitLayout& layout, const RecordingSource& source,
                   const PreprocessPlan& plan, double period, const IdentifyOptions& options,
                   Turns at_turns, int first_run, const Evidence* fitted)
    : num_dofs_(layout.num_dofs),
      first_run_(first_run),
      cut_off_(plan.filter_hz),
      runs_(source.runs()),
      filter_(plan.decimator) {
  Stretches collector(first_run);
  for_each_block(source, plan, "reading", 0, options,
                 [&](const Preprocessed& block) { collector.add(block); });
  take_series(collector, plan, period);
  FitLayout held = layout;
  for (FitParameter& s : held.shape) s.fixed = !is_smoothing(s);
  const TorqueRegression measured = regress(model, held, plan, collector, collector.series());
  for (int j = 0; j < num_dofs_; ++j)
    if (!measured.kept()[static_cast<std::size_t>(j)].time.empty()) joints_.push_back(j);
  if (joints_.empty())
    throw DataError(source.sample().front().source +
                    ": diagnose: no joint moves, no stretch of the recording is long enough for "
                    "the filter, or no joint has a torque; record longer than " +
                    format_number(2.0 * plan.min_segment) + " s");
  take_rows(measured, layout, joint_names(model), source.sample().front().source);
  if (averaged_)
    averaged_base_ = stacked_base(regress(model, held, plan, collector, series_), base_.cols());
  take_motion(layout, plan, collector.positions(), at_turns, fitted);
  set_reference(model);
  const MatX<double> turns_of_base = turns(layout);
  for (MatX<double>* base : {&base_, &averaged_base_}) {
    if (base->size() == 0) continue;
    base->conservativeResize(Eigen::NoChange, base->cols() + turns_of_base.cols() + 1);
    base->middleCols(base->cols() - turns_of_base.cols() - 1, turns_of_base.cols()) = turns_of_base;
  }
  // Gridder places held torques half a sample late already.
  if (source.sample().front().info.torque_sampling == TorqueSampling::kHold)
    earliest_instant_ -= 0.5;
  has_instant_ = true;
  set_instant();
}

void Evidence::set_instant() {
  const MatX<double> rate = filtered([](const JointSeries& s) {  // torque of a sample
    const long n = s.total.rows();
    RowMatX<double> out = RowMatX<double>::Zero(n, s.total.cols());
    for (long i = 0; i < n && n > 1; ++i) {
      const long before = std::max(i - 1, 0L), after = std::min(i + 1, n - 1);
      out.row(i) = (s.total.row(after) - s.total.row(before)) / static_cast<double>(after - before);
    }
    return out;
  });
  VecX<double> column = VecX<double>::Zero(rows());
  for (std::size_t k = 0; k < joints_.size(); ++k)
    if (!passive_[k])
      column.segment(static_cast<long>(k) * times(), times()) = rate.col(joints_[k]);
  base_.rightCols(1) = column;
  if (averaged_) averaged_base_.rightCols(1) = column;
}

void Evidence::take_series(Stretches& collector, const PreprocessPlan& plan, double period) {
  // Where a recording begins and ends, its filter still remembers how it was continued beyond.
  // Averaged, that would reach the rows of other periods, too.
  collector.trim(Butterworth(plan.order, plan.filter_hz, 1.0 / plan.dt).memory(kRemembered),
                 period > 0.0 ? kMostEnds : kMostEndsOnce);
  for (std::size_t i = 0; period > 0.0 && i < collector.series().size(); ++i)
    collector.drop_first(i, settling_rows(period, collector.series()[i]));
  series_ = collector.series();
  averaged_ = period > 0.0 && !series_.empty();
  for (JointSeries& s : series_) averaged_ = averaged_ && average_other_periods(period, s);
  if (averaged_) return;
  series_ = collector.series();
}

TorqueRegression Evidence::regress(const Model& model, const FitLayout& layout,
                                   const PreprocessPlan& plan, const Stretches& collector,
                                   const std::vector<JointSeries>& series) const {
  VecX<double> shape(static_cast<long>(layout.shape.size()));
  for (std::size_t s = 0; s < layout.shape.size(); ++s)
    shape[static_cast<long>(s)] = layout.shape[s].prior;
  RegressionOptions all;
  all.keep_bytes = std::numeric_limits<long>::max() / 2;
  all.rest_speed = 0.0;
  all.rest_share = 2.0;
  all.first_run = first_run_;
  TorqueRegression out(model, layout, plan, {layout.prior(), shape}, all);
  for (std::size_t i = 0; i < series.size(); ++i) out.add(collector.rows_of(i, series[i]));
  return out;
}

void Evidence::take_rows(const TorqueRegression& measured, const FitLayout& layout,
                         const std::vector<std::string>& names, const std::string& source) {
  for (std::size_t c = 0; c < layout.linear.size(); ++c)
    if (std::ranges::any_of(layout.shape, [&](const FitParameter& s) {
          return is_smoothing(s) && s.effect == layout.linear[c].effect;
        }))
      dry_columns_.push_back(static_cast<int>(c));
  factors_ = measured.factors();
  const JointRows& first = measured.kept()[static_cast<std::size_t>(joints_[0])];
  time_ = first.time;
  for (const int j : joints_)  // row m of each is one instant
    if (const JointRows& kept = measured.kept()[static_cast<std::size_t>(j)];
        kept.time != first.time || kept.run != first.run)
      throw DataError(source + ": diagnose: the torques of " +
                      names[static_cast<std::size_t>(joints_[0])] + " and " +
                      names[static_cast<std::size_t>(j)] +
                      " are not known at the same instants; expected recordings that all have the "
                      "torques (or `passive`) of the same joints: leave the column out of all of "
                      "them, or diagnose them one by one");
  const long m = times(), linear = static_cast<long>(layout.linear.size());
  torque_.resize(m * static_cast<long>(joints_.size()));
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const JointRows& kept = measured.kept()[static_cast<std::size_t>(joints_[k])];
    torque_.segment(static_cast<long>(k) * m, m) = kept.rows().col(kept.width - 1);
    passive_.push_back(measured.factors()[static_cast<std::size_t>(joints_[k])].inertia.size() > 0);
  }
  base_ = stacked_base(measured, linear + std::ranges::count_if(layout.shape, is_smoothing));
  const VecX<double> of_model = base_.leftCols(linear) * layout.prior();
  for (long k = 0; k < static_cast<long>(joints_.size()); ++k) {
    const double rows = std::sqrt(static_cast<double>(m));
    size_.push_back((passive(k) ? of_model : torque_).segment(k * m, m).norm() / rows);
    scale_.push_back(
        passive(k) ? (base_.block(k * m, 0, m, linear) * layout.prior().asDiagonal()).norm() / rows
                   : size_.back());
  }
}

void Evidence::take_motion(const FitLayout& layout, const PreprocessPlan& plan,
                           const std::vector<RowMatX<double>>& positions, Turns at_turns,
                           const Evidence* fitted) {
  VecX<double> speed = VecX<double>::Zero(num_dofs_), acceleration = speed;
  long samples = 0;
  for (const JointSeries& s : series_) {
    speed += s.qd.colwise().squaredNorm().transpose();
    acceleration += s.qdd.colwise().squaredNorm().transpose();
    samples += s.qd.rows();
  }
  speed = (speed / static_cast<double>(samples)).cwiseSqrt();
  acceleration = (acceleration / static_cast<double>(samples)).cwiseSqrt();
  const auto stuck_at = [&](int j, Turns what) {
    std::vector<VecX<double>> q;
    for (const RowMatX<double>& stretch : positions) q.emplace_back(stretch.col(j));
    const double noise = plan.q_noise[static_cast<std::size_t>(j)];
    return stuck_rows(q, standstill(noise, speed[j], acceleration[j], plan), what);
  };
  std::map<int, StuckRows> stuck;
  for (const int j : dry_joints(layout))
    if (static_cast<std::size_t>(j) < plan.q_noise.size())
      stuck[j] = stuck_at(j, !fitted                                    ? at_turns
                             : std::ranges::count(fitted->sticking_, j) ? Turns::kAllLeftOut
                                                                        : Turns::kKept);
  take_states(stuck, speed);
  bool again = false;
  for (std::size_t k = 0; k < joints_.size() && !fitted; ++k) {
    const auto at = stuck.find(joints_[k]);
    if (at == stuck.end() || !at->second.everywhere) continue;
    const auto column = [&](long c) {
      return !base_.col(c).segment(static_cast<long>(k) * times(), times()).isZero(0.0);
    };
    long columns = 0;
    for (long c = 0; c < base_.cols(); ++c) columns += column(c);
    if (rows_between(static_cast<long>(k)) >= kRowsAColumn * columns) continue;
    at->second = stuck_at(at->first, Turns::kKept);
    again = true;
  }
  if (again) take_states(stuck, speed);
  for (const auto& [j, rows] : stuck)
    if (rows.everywhere) sticking_.push_back(j);
  for (const int j : joints_) {
    turns_per_second_.push_back(turn_rate(series_, j, kRestShare * speed[j]));
    late_.push_back(stuck.contains(j) ? plan.dt * stuck[j].late : 0.0);
  }
}

long Evidence::rows_between(long k) const {
  long out = 0, since = 0;
  for (long i = 0; i < times(); ++i) {
    const bool follows =
        i > 0 && stretch_[static_cast<std::size_t>(i)] == stretch_[static_cast<std::size_t>(i - 1)];
    since = sticks(i, k) ? 0 : follows ? since + 1 : 1;
    out += since > kNoiseOrder && !rests(i, k);
  }
  return out;
}

void Evidence::take_states(const std::map<int, StuckRows>& stuck, const VecX<double>& speed) {
  const long n = num_dofs_, known = static_cast<long>(joints_.size()), m = times();
  stretch_.assign(time_.size(), 0);
  std::vector<RowMatX<double>> states;  // [q | q̇ | q̈ | rests | sticks]
  long row = 0;
  for (std::size_t i = 0; i < series_.size(); ++i) {
    const JointSeries& s = series_[i];
    const long outputs = s.q.rows() < 2 * filter_.half_length() + 1
                             ? 0
                             : (s.q.rows() - 2 * filter_.half_length() - 1) / filter_.factor() + 1;
    for (long k = 0; k < outputs && row < m; ++k)
      stretch_[static_cast<std::size_t>(row++)] = static_cast<int>(i);
    step_ = s.dt * filter_.factor();
    RowMatX<double> state(s.q.rows(), 3 * n + 2 * known);
    state << s.q, s.qd, s.qdd, RowMatX<double>::Zero(s.q.rows(), 2 * known);
    for (long k = 0; k < known; ++k) {
      const int j = joints_[static_cast<std::size_t>(k)];
      state.col(3 * n + k) =
          (s.qd.col(j).array().abs() < kRestShare * speed[j]).cast<double>().matrix();
      if (!stuck.contains(j)) continue;
      const std::vector<bool>& rows = stuck.at(j).rows[i];
      for (std::size_t at = 0; at < rows.size(); ++at)
        state(static_cast<long>(at), 3 * n + known + k) = rows[at];
    }
    states.push_back(std::move(state));
  }
  const MatX<double> decimated = decimate(states);
  if (row != m || decimated.rows() != m)
    throw DataError("diagnose: torques are known at " + std::to_string(m) + " of " +
                    std::to_string(decimated.rows()) +
                    " instants; expected recordings that all have the torques of the same joints: "
                    "leave out those that have none");
  q_ = decimated.leftCols(n);
  qd_ = decimated.middleCols(n, n);
  qdd_ = decimated.middleCols(2 * n, n);
  sticks_ = decimated.rightCols(known).array().abs() > kMostStuck;  // of either sign
  rests_ = decimated.middleCols(3 * n, known).array() > kMostRest || sticks_;
}

MatX<double> Evidence::without_scale(long k, const Eigen::Ref<const MatX<double>>& rows,
                                     const VecX<double>& x0) const {
  MatX<double> out = rows;
  const JointFactor& f = factors_[static_cast<std::size_t>(joints_[static_cast<std::size_t>(k)])];
  if (f.inertia.size() == 0 || !has_passive_beside_torques()) return out;
  const double m = f.inertia.dot(x0(f.columns));
  if (!(m > 0.0)) return out;
  VecX<double> inertia = VecX<double>::Zero(rows.cols());
  inertia(f.columns) = f.inertia;
  const VecX<double> left = rows * x0 - torque_.segment(k * times(), times());
  out.noalias() -= left * (inertia.transpose() / m);
  return out;
}

bool Evidence::has_passive_beside_torques() const {
  if (std::ranges::find(passive_, false) == passive_.end()) return false;
  return std::ranges::any_of(factors_, [](const JointFactor& f) { return f.inertia.size() > 0; });
}

MatX<double> Evidence::turns(const FitLayout& layout) const {
  MatX<double> out(rows(), 0);
  for (const FitParameter& shape : layout.shape) {
    if (!is_smoothing(shape)) continue;
    const BoundEffect friction = friction_of(layout, shape);
    std::vector<RowMatX<double>> stretches;
    for (const JointSeries& s : series_) {
      const auto columns = turn_columns(friction, shape.index, reference(s), s);
      stretches.emplace_back(s.rows(), kTurnColumns * num_dofs_);
      for (int c = 0; c < kTurnColumns; ++c)
        stretches.back().middleCols(c * num_dofs_, num_dofs_) =
            columns[static_cast<std::size_t>(c)];
    }
    const MatX<double> d = decimate(stretches);
    out.conservativeResize(Eigen::NoChange, out.cols() + kTurnColumns);
    for (int c = 0; c < kTurnColumns; ++c)
      for (std::size_t k = 0; k < joints_.size(); ++k)
        out.col(out.cols() - kTurnColumns + c).segment(static_cast<long>(k) * times(), times()) =
            d.col(c * num_dofs_ + joints_[k]);
  }
  return out;
}

MatX<double> Evidence::stacked_base(const TorqueRegression& regression, long p) const {
  MatX<double> out = MatX<double>::Zero(rows(), p);
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const std::size_t j = static_cast<std::size_t>(joints_[k]);
    const auto rows = regression.kept()[j].rows();
    const std::vector<int>& columns = regression.factors()[j].columns;
    for (std::size_t c = 0; c < columns.size(); ++c)
      out.col(columns[c]).segment(static_cast<long>(k) * times(), times()) =
          rows.col(static_cast<long>(c));
  }
  return out;
}

MatX<double> Evidence::decimate(const std::vector<RowMatX<double>>& stretches) const {
  std::vector<RowMatX<double>> parts;
  long rows = 0;
  Decimator filter = filter_;
  for (const RowMatX<double>& s : stretches) {
    filter.reset();
    parts.push_back(filter.push(s));
    rows += parts.back().rows();
  }
  MatX<double> out(rows, stretches.empty() ? 0 : stretches[0].cols());
  rows = 0;
  for (const RowMatX<double>& part : parts) {
    if (part.rows() > 0) out.middleRows(rows, part.rows()) = part;
    rows += part.rows();
  }
  return out;
}

double Evidence::set_reference(const Model& fitted) {
  references_.clear();
  VecX<double> change = VecX<double>::Zero(num_dofs_), size = change;
  for (JointSeries& s : series_) {
    const RowMatX<double> before = std::move(s.total);
    const auto [at, is_new] = references_.try_emplace(s.run);
    if (is_new) at->second = extend(fitted, runs_, s.run);
    predict(at->second, s);
    size += s.total.colwise().squaredNorm().transpose();
    change += (before.size() == 0 ? s.total : RowMatX<double>(s.total - before))
                  .colwise()
                  .squaredNorm()
                  .transpose();
  }
  if (has_instant_) set_instant();
  return std::sqrt((change.array() / size.array().max(1e-300)).maxCoeff());
}

void Evidence::set_tilt(const Vec3<double>& more, const VecX<double>& x) {
  const long p = static_cast<long>(kThetaSize) * num_dofs_, m = times();
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
    const MatX<double> d = decimate(stretches);
    for (std::size_t k = 0; k < joints_.size(); ++k)
      now.middleRows(static_cast<long>(k) * m, m) = d.middleCols(joints_[k] * p, p);
  }
  const MatX<double> change = tilted_.size() > 0 ? MatX<double>(now - tilted_) : now;
  base_.leftCols(p) += change;
  if (averaged_) averaged_base_.leftCols(p) += change;
  if (shift_.size() > 0) torque_ -= shift_;
  shift_ = now * x.head(p);
  torque_ += shift_;
  tilted_ = now;
}

}  // namespace diffnea
