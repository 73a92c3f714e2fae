#pragma once
/// What a fit by torque is worth: errors of every joint before and after it, on the data of the fit
/// and on held-out data, and the series behind them. Internal to identify/.

#include <diffnea/identify/torque_regression.hpp>

#include "identify/passes.hpp"

namespace diffnea {

/// Where a fit has arrived, and the rows of its last pass.
struct TorqueFit {
  const Model& model;
  const FitLayout& layout;
  const PreprocessPlan& plan;
  const PreprocessPlan& test_plan;  ///< of the held-out recordings, if there are any
  const VecX<double>&nominal, &x;   ///< (p) linear parameters before and after
  const VecX<double>& shape;        ///< (s) after
  const TorqueRegression& rows;     ///< of `train` at x and shape, rows at rest left out
  int training_runs = 0;            ///< recordings in `train`
};

/// Sets errors, train_series and test_series of the result, and adds notes.
/// @param test    may be null
/// @param result  its model is the fitted one already
/// @throws what reading the sources throws
void set_torque_errors(const TorqueFit& fit, const RecordingSource& train,
                       const RecordingSource* test, const IdentifyOptions& options,
                       IdentifyResult& result);

}  // namespace diffnea
