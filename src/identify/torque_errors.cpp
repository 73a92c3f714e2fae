#include "identify/torque_errors.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include <diffnea/effects/extended_tree.hpp>

#include "core/constants.hpp"
#include "identify/constrained_rows.hpp"
#include "identify/gains.hpp"
#include "identify/state_rows.hpp"

namespace diffnea {
namespace {

std::vector<TorqueSeries> make_series(const TorqueFit& fit, const TorqueRegression& regression,
                                      const TorqueRegression& before) {
  std::vector<TorqueSeries> out;
  for (int j = 0; j < fit.layout.num_rows(); ++j) {
    const JointRows& kept = regression.kept()[j];
    TorqueSeries s;
    s.joint = row_name(fit.model, j);
    s.unit = row_unit(fit.model, j);
    const std::vector<int>& columns = regression.factors()[j].columns;
    const Gains gains(fit.layout);
    const VecX<double> xj = gains.effective(j, fit.x)(columns),
                       nj = gains.effective(j, fit.nominal)(columns);
    const auto rows = kept.rows(), rows_before = before.kept()[j].rows();
    const std::size_t points =
        std::min({kept.time.size(), before.kept()[j].time.size(), kMaxSeriesRows});
    for (std::size_t k = 0; k < points; ++k) {
      const auto row = rows.row(static_cast<long>(k));
      s.time.push_back(kept.time[k]);
      s.velocity.push_back(kept.velocity[k]);
      s.measured.push_back(row[kept.width - 1]);
      s.fitted.push_back(row.head(kept.width - 1).dot(xj));
      s.nominal.push_back(rows_before.row(static_cast<long>(k)).head(kept.width - 1).dot(nj));
    }
    out.push_back(std::move(s));
  }
  return out;
}

/// The rows as the model before the fit has them: another pass where shapes or fixed transforms
/// moved, since columns depend on those, or where they depend on the links' parameters. Null: the
/// rows of the fit serve both.
std::unique_ptr<TorqueRegression> rows_before(const TorqueFit& fit, const RecordingSource& source,
                                              const PreprocessPlan& plan, int first_run,
                                              const IdentifyOptions& options, bool& stopped) {
  VecX<double> prior(fit.shape.size());
  for (long s = 0; s < prior.size(); ++s) prior[s] = fit.layout.shape[s].prior;
  if (prior == fit.shape && !reads_links(fit.layout)) return nullptr;
  RegressionOptions o;
  o.first_run = first_run;
  auto out = std::make_unique<TorqueRegression>(fit.model, fit.layout, plan,
                                                RegressionPoint{fit.nominal, prior}, o);
  stopped |= for_each_block(source, plan, "testing", 2, options, [&](const Preprocessed& b) {
               out->add(b);
             }).interrupted;
  return out;
}

}  // namespace

void set_torque_errors(const TorqueFit& fit, const RecordingSource& train,
                       const RecordingSource* test, const IdentifyOptions& options,
                       IdentifyResult& result) {
  const Gains gains(fit.layout);
  std::unique_ptr<TorqueRegression> held, held_all, held_before;
  bool stopped = false;
  const std::unique_ptr<TorqueRegression> moved =
      rows_before(fit, train, fit.plan, 0, options, stopped);
  const TorqueRegression& train_before = moved ? *moved : fit.rows;
  VecX<double> raw = VecX<double>::Constant(fit.layout.num_rows(), kNaN);
  if (test) {
    const PreprocessPlan& plan = fit.test_plan;
    RegressionOptions after;
    after.first_run = fit.training_runs;
    held = std::make_unique<TorqueRegression>(fit.model, fit.layout, plan,
                                              RegressionPoint{fit.x, fit.shape}, after);
    RegressionOptions with_rest = after;
    with_rest.rest_speed = 0.0;
    with_rest.keep_bytes = 0;
    held_all = std::make_unique<TorqueRegression>(fit.model, fit.layout, plan,
                                                  RegressionPoint{fit.x, fit.shape}, with_rest);
    const Pass p = for_each_block(*test, plan, "testing", 0, options, [&](const Preprocessed& b) {
      held->add(b);
      held_all->add(b);
    });
    result.notes.insert(result.notes.end(), p.notes.begin(), p.notes.end());
    stopped |= p.interrupted;
    struct Run {  // numbered as effects name it, with the bodies that the robot held in it
      ExtendedTree model;
      double start = 0.0;
    };
    std::map<int, Run> runs;
    std::optional<ConstrainedRows> constraints;
    if (!result.model.constraints.empty()) constraints.emplace(result.model);
    VecX<double> sum = VecX<double>::Zero(fit.layout.num_rows());
    long rows = 0;
    const Pass raw_pass =
        for_each_block(*test, plan, "testing", 1, options, [&](const Preprocessed& b) {
          const int number = fit.training_runs + b.run;
          if (!runs.contains(number)) runs[number] = {extend(result.model, {}, number), b.time[0]};
          const VecX<double> time = b.time.array() - runs[number].start;
          const RowsOfState state(b);
          RowMatX<double> error = by_row(inverse_dynamics(runs[number].model, state.q, state.v,
                                                          state.vd, number, &time),
                                         b) -
                                  recorded_rows(b);
          if (constraints) {
            constraints->choose(b, state.q.row(0).transpose());
            for (long k = 0; k < b.rows(); ++k) {
              RowMatX<double> of_row = error.row(k).transpose();
              constraints->eliminate(runs[number].model.tree, state.q.row(k).transpose(), b.time[k],
                                     of_row);
              error.row(k) = of_row.transpose();
            }
          }
          sum += error.colwise().squaredNorm().transpose();
          rows += b.rows();
        });
    stopped |= raw_pass.interrupted;
    if (rows > 0) raw = (sum / static_cast<double>(rows)).cwiseSqrt();
    held_before = rows_before(fit, *test, plan, fit.training_runs, options, stopped);
    result.test_series = make_series(fit, *held, held_before ? *held_before : *held);
  }
  result.train_series = make_series(fit, fit.rows, train_before);
  bool tells = false;  // whether a held-out error is known at all
  for (int j = 0; held && j < fit.layout.num_rows(); ++j)
    tells =
        tells || (fit.rows.factors()[j].factor.rows() > 0 && held->factors()[j].factor.rows() > 0);
  std::string unknown;  // joints of the fit of which the held-out data say nothing
  for (int j = 0; j < fit.layout.num_rows(); ++j) {
    const JointFactor& f = fit.rows.factors()[j];
    if (j >= fit.layout.num_dofs && f.factor.rows() == 0) continue;  // eliminated by constraints
    const VecX<double> x = gains.effective(j, fit.x), first = gains.effective(j, fit.nominal);
    JointError e = blank_error(fit.model, j, true);
    const auto error = [j](const TorqueRegression& rows, const VecX<double>& at) {
      const JointFactor& of = rows.factors()[j];
      return of.factor.rows() > 0 ? of.rmse(at) : kNaN;
    };
    if (f.factor.rows() > 0) {
      e.train = error(fit.rows, x);
      e.nominal_train = error(train_before, first);
      e.torque_rms = error(tells ? *held : fit.rows, VecX<double>::Zero(fit.x.size()));
    }
    if (f.factor.rows() > 0 && held) {
      e.test = error(*held, x);
      e.nominal_test = error(held_before ? *held_before : *held, first);
      e.test_all = error(*held_all, x);
      e.test_raw = raw[j];
      if (std::isnan(e.test)) unknown += (unknown.empty() ? "" : ", ") + e.joint;
    }
    result.errors.push_back(e);
  }
  if (!unknown.empty() && !stopped)
    result.notes.push_back(
        "held-out data say nothing of " + unknown +
        ": there the joint rests, its torque is not recorded, or no stretch without a gap is long "
        "enough; its held-out error is not known");
  if (stopped && !result.summary.interrupted) {
    result.summary.interrupted = true;
    result.summary.termination +=
        "; interrupted while testing, errors are of the rows read until then";
  }
}

}  // namespace diffnea
