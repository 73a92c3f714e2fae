#pragma once
/// Curves of an error over what may explain it: means in bins, amplitudes of cycles, means around
/// reversals, correlations.

#include <string>
#include <vector>

#include <diffnea/diagnose/evidence_plot.hpp>

namespace diffnea::report {

/// One number a row; NaN where there is none.
using Column = std::vector<double>;

/// Of a bin, to say how sure its mean is.
inline constexpr int kLeastVisits = 3;

/// Rows that follow each other at equal steps: from `begin` to before `end`.
struct EvenRows {
  std::size_t begin, end;
};

Column product(const Column& a, const Column& b);
Column signs(const Column& x);
double mean_square(const Column& x);

/// Between rows; infinite with fewer than two.
double step_of(const Column& time);

/// Central differences inside even rows; NaN at their ends.
Column rate(const Column& time, const Column& x);

/// Time as one axis: a run begins where the one before ends.
Column one_axis(const Column& time);

/// Edges between which equally many of the values lie on one half and equally wide bins on the
/// other: tails are neither empty nor one bin. Empty: the values are too few or all the same.
Column bin_edges(const Column& x);
Column middles(const Column& edges);

/// Means over the rows of each bin. Errors that follow each other are alike: rows of one visit to a
/// bin count as one draw, and the interval is from the spread between visits (Liang & Zeger 1986).
EvidenceCurve binned(const std::string& model, const Column& x, const Column& y,
                     const Column& edges);

/// Amplitude of the error's part a sin(n x) + b cos(n x) over n, each n fitted by itself with a
/// mean (Zechmeister & Kürster 2009): positions are no equal steps.
Column amplitudes(const Column& x, const Column& y, const Column& n);

/// Where a column changes its sign.
struct SignChange {
  std::size_t row;
  double sign;  ///< that it changes to
  EvenRows inside;
};
std::vector<SignChange> sign_changes(const Column& time, const Column& x);

/// The mean error from `reach` rows before the changes to as many after, turned so that the sign
/// becomes positive.
EvidenceCurve mean_around(const std::string& model, const std::vector<SignChange>& changes,
                          const Column& error, long reach);

/// Correlation of the error with x as many rows before it, from −reach to reach; the band is what
/// noise without correlation stays inside in 95 %.
EvidenceCurve lagged_correlation(const std::string& model, const Column& time, const Column& x,
                                 const Column& error, long reach);

}  // namespace diffnea::report
