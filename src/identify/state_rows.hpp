#pragma once
/// States of preprocessed rows in the order of the dynamics, where a base that floats leads, and
/// torques in that of the fit's rows, where the joints do (FitLayout::num_rows). Internal to
/// identify/.

#include <diffnea/recording/preprocess.hpp>

namespace diffnea {

/// q, v and v̇ of all rows, as rnea_batch takes them.
struct RowsOfState {
  explicit RowsOfState(const Preprocessed& b)
      : q(joined(b.base, b.q)),
        v(joined(b.base_twist, b.qd)),
        vd(joined(b.base_acceleration, b.qdd)) {}

  RowMatX<double> q, v, vd;

 private:
  static RowMatX<double> joined(const RowMatX<double>& base, const RowMatX<double>& joints) {
    if (base.size() == 0) return joints;
    RowMatX<double> out(joints.rows(), base.cols() + joints.cols());
    out << base, joints;
    return out;
  }
};

/// Torques of the dynamics, (N, n_v), with the base behind the joints.
inline RowMatX<double> by_row(const RowMatX<double>& tau, const Preprocessed& b) {
  const long n = b.q.cols(), base = tau.cols() - n;
  if (base == 0) return tau;
  RowMatX<double> out(tau.rows(), tau.cols());
  out << tau.rightCols(n), tau.leftCols(base);
  return out;
}

/// Recorded torques, and the wrench on a base that floats behind them.
inline RowMatX<double> recorded_rows(const Preprocessed& b) {
  if (b.base.size() == 0) return b.tau;
  RowMatX<double> out(b.tau.rows(), b.tau.cols() + b.base_wrench.cols());
  out << b.tau, b.base_wrench;
  return out;
}

}  // namespace diffnea
