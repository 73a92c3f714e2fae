#pragma once
/// Candidates against what the base leaves: scores, and fits of several effects at once.
/// Everything here works on columns that are whitened and projected (projection.hpp), where effects
/// are independent of the base. Internal to diagnose/.

#include <memory>

#include "diagnose/score_table.hpp"

namespace diffnea {

class Search {
 public:
  /// @param table_bytes  most that ripples' columns may take; beyond, they are made anew whenever
  ///   they are scored, with the same results. By default 50 Hz and six joints fill it in two
  ///   minutes.
  Search(const Evidence& evidence, const std::vector<Candidate>& candidates, const BasePrior& prior,
         const std::vector<bool>& used, double table_bytes = 256e6);

  /// Noise from `period` where the motion repeats, else from what base and terms leave; whitens and
  /// projects anew.
  void refresh(double period, std::vector<Term>& terms);
  /// The candidates' columns, after the evidence's reference has moved; refresh() next.
  void recompute() { table_.recompute(); }

  /// Every candidate beside `terms`, best first; of those that are not wanted nothing but their
  /// index.
  std::vector<Score> scores(const std::vector<Term>& terms, const Wanted& wanted = {}) const;
  /// Where on its candidate's grid a score is: values of its shapes, then of its choices.
  const std::vector<double>& point_of(const Score& score) const { return table_.point_of(score); }
  /// The candidate of a score as a term, where its grid has it.
  Term term_of(const Score& score) const;
  /// Columns of the term at its present parameters.
  void set_columns(Term& term) const;

  /// Linear parameters of all terms together; sets their values. @return what they remove from χ²
  double fit(std::vector<Term>& terms) const;
  double gain_of(const std::vector<Term>& terms) const;
  /// The same at the parameters as they are.
  double gain_at(const std::vector<Term>& terms) const;
  /// BIC of a gain, lower is better, relative to the base alone.
  double bic(double gain, const std::vector<Term>& terms) const;
  int num_parameters(const std::vector<Term>& terms) const;

  /// Covariance of each term's parameters, linear ones first, then shapes (of their logarithm).
  std::vector<MatX<double>> covariances(const std::vector<Term>& terms) const;
  /// How much of a term's projected torque another one can take over together with those that are
  /// there, 0 … 1.
  double replaced_share(const Term& term, const Term& by, const std::vector<Term>& beside) const;

  /// χ² at the joints that `term` reaches which base and `terms` leave because their columns are
  /// not exact: (2 %)² of what `terms` remove, where one of them is dry friction (4 %)²; (1 %)² of
  /// the base's dry friction, more where `term` is like friction and the joint turns often.
  double inexact_at(const Term& term, const std::vector<Term>& terms) const;
  /// χ² that the base leaves at each of joints() because the torque of its dry friction is not
  /// exact: no function of the motion tells it.
  /// @param of_late_turns  what passes for other functions of the velocity is more; where turns are
  ///   kept at which the joint sticks, all of it
  VecX<double> inexact_friction(const std::vector<Term>& terms, bool of_late_turns) const;
  /// That of late turns at the joints of a term, where they stick and their turns are kept: so much
  /// of what the term removes may be none of its.
  double late_turns(const Term& term, const std::vector<Term>& terms) const;

  /// What a fit costs, −2 ln of its likelihood but for a constant: n ln χ², the noise as large as
  /// what is left; where repeats have told the noise and no more is left, χ².
  double cost(double chi2) const;

  const Evidence& evidence() const { return evidence_; }
  const std::vector<Candidate>& candidates() const { return candidates_; }
  const Projection& projection() const { return *projection_; }
  const Whitener& whitener() const { return *whitener_; }
  double residual_sum() const { return projection_->residual().squaredNorm(); }
  long rows() const { return projection_->rows(); }
  bool noise_is_repeatable() const { return repeatable_; }
  /// Joints (of evidence().joints()) whose noise is what the base leaves of too few rows: what the
  /// model lacks there is taken for noise.
  const std::vector<long>& blind() const { return blind_; }
  /// The residual of torque at the base that goes with the terms, (rows()).
  VecX<double> residual(const std::vector<Term>& terms) const;

  /// RMS of the term's torque over that of the measured torque, at the joints it acts on.
  double torque_share(const Term& term) const;

 private:
  /// What the best of a candidate's starts is worth less for being the best of many (Bonferroni).
  double looked_elsewhere(int candidate) const;
  /// What is left beside base and terms at their values, whitened.
  VecX<double> left_by(const std::vector<Term>& terms) const;
  /// Variances where rows are no independent ones but go with the motion, by blocks of time, the
  /// same of every period together (Liang and Zeger 1986, eq. 6).
  /// @param influence  (parameters, rows) of each row of `left` on each parameter
  VecX<double> clustered(const MatX<double>& influence, const VecX<double>& left) const;
  /// The base's dry friction beside `terms`, in units of noise, (rows of the evidence).
  VecX<double> dry_friction(const std::vector<Term>& terms) const;

  const Evidence& evidence_;
  const std::vector<Candidate>& candidates_;
  const BasePrior& prior_;
  std::vector<bool> used_;
  ScoreTable table_;
  std::unique_ptr<Whitener> whitener_;
  std::unique_ptr<Projection> projection_;
  double period_ = 0.0;  ///< [s]
  bool repeatable_ = false;
  std::vector<long> blind_;
};

}  // namespace diffnea
